//! Ladders, which order emotions by the urgency that leads to them.
//!
//! A ladder maps urgency to emotions. It consists of rungs in ascending order, each with the urgency that enters
//! it, and optionally of two emotions that come from beliefs.

use crate::label::{EmotionLabel, StandardEmotion};
use crate::parameters::{DynamicsParameters, ParameterError, StateSet, ascending, not_negative};
use StandardEmotion::{Angry, Concerned, Confident, Discouraged, Frustrated, Happy, Hopeful};

/// One emotion on a ladder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rung<E> {
    /// The emotion.
    pub emotion: E,
    /// Urgency at which the rung is entered; unused for the lowest rung.
    pub enter: f64,
    /// How long, in seconds, the urgency must exceed `enter` before the rung is entered. With 0, the rung is entered
    /// as soon as the urgency reaches `enter`.
    pub hold_s: f64,
    /// Whether the rung is only entered while another agent is to blame.
    pub needs_blame: bool,
    /// Whether only a positive input leads down from the rung, as far as the input is important.
    pub needs_progress: bool,
}

impl<E> Rung<E> {
    /// A rung that is entered as soon as the urgency reaches `enter`.
    pub fn new(emotion: E, enter: f64) -> Self {
        Self {
            emotion,
            enter,
            hold_s: 0.0,
            needs_blame: false,
            needs_progress: false,
        }
    }
}

/// The two emotions that follow from beliefs rather than from urgency [D: S].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeliefEmotions<E> {
    /// Entered, and kept, while the robot believes that it cannot achieve its goal [D: S].
    pub discouraged: E,
    /// Follows `discouraged` as soon as the robot believes that it can [D: S].
    pub hopeful: E,
    /// The lowest rung from which the belief leads to `discouraged` \[I\].
    pub from: E,
}

/// A set of emotions in ascending order.
#[derive(Debug, Clone, PartialEq)]
pub struct Ladder<E> {
    rungs: Vec<Rung<E>>,
    beliefs: Option<BeliefEmotions<E>>,
}

/// The position of an emotion relative to a ladder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    Rung(usize),
    Discouraged,
    Hopeful,
    Elsewhere,
}

impl<E: EmotionLabel> Ladder<E> {
    /// Builds a ladder from rungs in ascending order. Robots start on the first one.
    ///
    /// # Errors
    ///
    /// Returns an error if there are no rungs, if the thresholds of the second and later rungs do not ascend within
    /// `(0, 1]`, if a hold time is invalid, or if an emotion occurs twice.
    pub fn new(rungs: Vec<Rung<E>>) -> Result<Self, ParameterError> {
        let Some((_, above)) = rungs.split_first() else {
            return Err(ParameterError::NoRungs);
        };

        let thresholds: Vec<f64> = above.iter().map(|rung| rung.enter).collect();
        ascending(&thresholds)?;
        for rung in above {
            not_negative("hold_s", rung.hold_s)?;
        }

        let ladder = Self {
            rungs,
            beliefs: None,
        };
        ladder.check_distinct()?;
        Ok(ladder)
    }

    /// Adds the two emotions that follow from beliefs.
    ///
    /// # Errors
    ///
    /// Returns an error if `from` is not on the ladder, or if an emotion then occurs twice.
    pub fn with_beliefs(mut self, beliefs: BeliefEmotions<E>) -> Result<Self, ParameterError> {
        if self.rungs.iter().all(|rung| rung.emotion != beliefs.from) {
            return Err(ParameterError::NotOnLadder(beliefs.from.name()));
        }

        self.beliefs = Some(beliefs);
        self.check_distinct()?;
        Ok(self)
    }

    /// The rungs, lowest first. There is at least one.
    pub fn rungs(&self) -> &[Rung<E>] {
        &self.rungs
    }

    /// The emotions that follow from beliefs, if this ladder has any.
    pub fn beliefs(&self) -> Option<&BeliefEmotions<E>> {
        self.beliefs.as_ref()
    }

    /// The initial emotion, to which an achieved goal returns.
    pub fn start(&self) -> E {
        self.rungs[0].emotion
    }

    /// Index of the highest rung, at most `limit`, that is reached by urgency alone.
    pub(crate) fn rung_for(&self, urgency: f64, limit: usize) -> usize {
        let above = self.rungs.iter().skip(1);
        let reached = above
            .take_while(|rung| urgency >= rung.enter && rung.hold_s == 0.0 && !rung.needs_blame);

        reached.count().min(limit)
    }

    pub(crate) fn place(&self, emotion: E) -> Place {
        if let Some(index) = self.rungs.iter().position(|rung| rung.emotion == emotion) {
            return Place::Rung(index);
        }

        match &self.beliefs {
            Some(beliefs) if beliefs.discouraged == emotion => Place::Discouraged,
            Some(beliefs) if beliefs.hopeful == emotion => Place::Hopeful,
            _ => Place::Elsewhere,
        }
    }

    /// Index of the lowest rung from which a belief leads to discouragement; `None` without such beliefs.
    pub(crate) fn discouraging_rung(&self) -> Option<usize> {
        let from = self.beliefs.as_ref()?.from;
        self.rungs.iter().position(|rung| rung.emotion == from)
    }

    fn check_distinct(&self) -> Result<(), ParameterError> {
        let mut emotions: Vec<E> = self.rungs.iter().map(|rung| rung.emotion).collect();
        if let Some(beliefs) = &self.beliefs {
            emotions.extend([beliefs.discouraged, beliefs.hopeful]);
        }

        for (index, emotion) in emotions.iter().enumerate() {
            if emotions[..index].contains(emotion) {
                return Err(ParameterError::Repeated(emotion.name()));
            }
        }

        Ok(())
    }
}

impl Ladder<StandardEmotion> {
    /// The ladder of the documented robots, with the state set that the parameters select.
    ///
    /// `murphy4` follows the order of the paper's Table 2 [D: S]. `akr4` has no CONFIDENT, and ANGRY follows
    /// FRUSTRATED after the urgency has been extreme for a long time and another agent is to blame. The paper shows
    /// that state but not how it is entered \[I\]. Only a positive input leads down from FRUSTRATED [D: S].
    ///
    /// # Errors
    ///
    /// Returns an error if the parameters are invalid.
    pub fn standard(parameters: &DynamicsParameters) -> Result<Self, ParameterError> {
        parameters.check()?;

        let happy = Rung::new(Happy, 0.0);
        let confident = Rung::new(Confident, parameters.th_confident);
        let concerned = Rung::new(Concerned, parameters.th_concerned);
        let frustrated = Rung {
            needs_progress: true,
            ..Rung::new(Frustrated, parameters.th_frustrated)
        };
        let angry = Rung {
            emotion: Angry,
            enter: parameters.th_angry,
            hold_s: parameters.anger_s,
            needs_blame: true,
            needs_progress: false,
        };

        let rungs = match parameters.state_set {
            StateSet::Murphy4 => vec![happy, confident, concerned, frustrated],
            StateSet::Akr4 => vec![happy, concerned, frustrated, angry],
        };

        let beliefs = BeliefEmotions {
            discouraged: Discouraged,
            hopeful: Hopeful,
            from: Frustrated,
        };

        Self::new(rungs)?.with_beliefs(beliefs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_documented_sets_start_happy() {
        for (state_set, emotions) in [
            (StateSet::Murphy4, [Happy, Confident, Concerned, Frustrated]),
            (StateSet::Akr4, [Happy, Concerned, Frustrated, Angry]),
        ] {
            let parameters = DynamicsParameters {
                state_set,
                ..Default::default()
            };
            let ladder = Ladder::standard(&parameters).unwrap();
            let climbed: Vec<StandardEmotion> =
                ladder.rungs().iter().map(|rung| rung.emotion).collect();

            assert_eq!(climbed, emotions);
            assert_eq!(ladder.start(), Happy);
        }
    }

    #[test]
    fn an_ambiguous_ladder_is_rejected() {
        let empty: Vec<Rung<StandardEmotion>> = vec![];
        assert_eq!(Ladder::new(empty), Err(ParameterError::NoRungs));

        let repeated = vec![
            Rung::new(Happy, 0.0),
            Rung::new(Concerned, 0.5),
            Rung::new(Happy, 0.6),
        ];
        assert_eq!(
            Ladder::new(repeated),
            Err(ParameterError::Repeated("HAPPY"))
        );

        let level = vec![
            Rung::new(Happy, 0.0),
            Rung::new(Concerned, 0.5),
            Rung::new(Angry, 0.5),
        ];
        assert!(matches!(
            Ladder::new(level),
            Err(ParameterError::NotAscending { .. })
        ));
    }

    #[test]
    fn beliefs_must_start_from_a_rung() {
        let beliefs = BeliefEmotions {
            discouraged: Discouraged,
            hopeful: Hopeful,
            from: Angry,
        };
        let ladder = Ladder::new(vec![Rung::new(Happy, 0.0)]).unwrap();

        assert_eq!(
            ladder.with_beliefs(beliefs),
            Err(ParameterError::NotOnLadder("ANGRY"))
        );
    }
}
