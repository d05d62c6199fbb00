//! The waiter's side: a call for help, until a refiller has been assigned and has come.

use robot::RobotPattern;
use serde::{Deserialize, Serialize};

use super::Recruitment;
use crate::bounds::positive;
use crate::chance::Chance;
use crate::commands::{ACCEPT, OFFER};

/// How the waiter recruits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RecruiterParameters {
    /// Whether he recruits, and how he chooses. Default off \[I\].
    pub by: Recruitment,
    /// The refillers whom he calls: names and patterns of names. Default every other robot \[I\].
    pub refillers: Vec<RobotPattern>,
    /// Time after which a call or an assignment without an answer is repeated, s. Default 2 \[I\].
    pub help_s: f64,
    /// How often he assigns a refiller who does not accept before he calls again. Default 5 \[I\].
    pub assign_tries: u32,
    /// Time after the assignment after which a refiller who has not come is given up, s. Default 120 \[I\].
    pub patience_s: f64,
}

impl Default for RecruiterParameters {
    fn default() -> Self {
        Self {
            by: Recruitment::Off,
            refillers: Vec::new(),
            help_s: 2.0,
            assign_tries: 5,
            patience_s: 120.0,
        }
    }
}

impl RecruiterParameters {
    /// Checks the values.
    ///
    /// # Errors
    /// The first value that is wrong.
    pub fn check(&self) -> Result<(), String> {
        positive("recruitment.help_s", self.help_s)?;
        positive("recruitment.patience_s", self.patience_s)?;
        if self.assign_tries == 0 {
            return Err("recruitment.assign_tries must be at least 1".to_owned());
        }
        Ok(())
    }
}

/// What the waiter has to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RecruitingStep {
    /// Send "help" to every refiller.
    Call,
    /// Send "refill" to this one. The first time she is chosen.
    Assign {
        /// Her name.
        to: String,
        /// Whether she has just been chosen.
        is_first: bool,
    },
    /// Forget this refiller, who has not come.
    GiveUp,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum RecruitingPhase {
    Idle,
    /// He calls; the time since the last call is `None` before the first one.
    Calling {
        since_s: Option<f64>,
    },
    /// He has chosen a refiller, who has not accepted.
    Assigning {
        to: String,
        tries: u32,
        since_s: f64,
    },
    /// She has accepted.
    Assigned {
        to: String,
        since_s: f64,
    },
}

/// How far a request for help is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recruiter {
    phase: RecruitingPhase,
    /// The time since the request that has not been served, s.
    open_s: Option<f64>,
    /// Who has offered in this tick.
    offers: Vec<String>,
    chance: Chance,
    counts: RecruitingCounts,
}

/// What has happened so far.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecruitingCounts {
    /// Requests: needs for which he has called.
    pub requests: u32,
    /// Calls: a "help" to every refiller is one.
    pub calls: u32,
    /// Requests whose refiller has come.
    pub arrivals: u32,
    /// Time from these requests to the arrivals, in total, s.
    pub arrival_s: f64,
}

impl Recruiter {
    /// A waiter who does not call, with the chance by which he chooses at random.
    #[must_use]
    pub fn new(chance: Chance) -> Self {
        Self {
            phase: RecruitingPhase::Idle,
            open_s: None,
            offers: Vec::new(),
            chance,
            counts: RecruitingCounts::default(),
        }
    }

    /// Draws from another stream from now on.
    pub fn reseed(&mut self, chance: Chance) {
        self.chance = chance;
    }

    /// What has happened so far.
    #[must_use]
    pub fn counts(&self) -> RecruitingCounts {
        self.counts
    }

    /// Goes on from what an earlier incarnation has counted, and from the refiller whom it had chosen.
    pub fn take_over(&mut self, counts: RecruitingCounts, chosen: Option<&str>) {
        self.counts = counts;
        if let Some(to) = chosen {
            self.phase = RecruitingPhase::Assigned {
                to: to.to_owned(),
                since_s: 0.0,
            };
        }
    }

    /// The refiller whom he has chosen.
    #[must_use]
    pub fn chosen(&self) -> Option<&str> {
        match &self.phase {
            RecruitingPhase::Assigning { to, .. } | RecruitingPhase::Assigned { to, .. } => {
                Some(to)
            }
            RecruitingPhase::Idle | RecruitingPhase::Calling { .. } => None,
        }
    }

    /// Whether the refiller whom he has chosen has accepted.
    #[must_use]
    pub fn is_assigned(&self) -> bool {
        matches!(self.phase, RecruitingPhase::Assigned { .. })
    }

    /// He needs help: calls, unless he does already or has somebody who comes.
    pub fn request(&mut self) {
        if self.phase != RecruitingPhase::Idle {
            return;
        }
        self.phase = RecruitingPhase::Calling { since_s: None };
        if self.open_s.is_none() {
            self.open_s = Some(0.0);
            self.counts.requests += 1;
        }
    }

    /// Takes a command of another robot. Returns whether it is an answer to a call.
    pub fn hear(&mut self, from: &str, command: &str) -> bool {
        match (command, &self.phase) {
            (OFFER, RecruitingPhase::Calling { .. }) => self.offers.push(from.to_owned()),
            (ACCEPT, RecruitingPhase::Assigning { to, .. }) if to == from => {
                self.phase = RecruitingPhase::Assigned {
                    to: from.to_owned(),
                    since_s: 0.0,
                };
            }
            (OFFER | ACCEPT, _) => {}
            _ => return false,
        }
        true
    }

    /// The next step after a tick. `distance_m` gives the distance of a refiller, m, if it is known: of offers without one, any is
    /// farther than those with one.
    pub fn advance(
        &mut self,
        tick_s: f64,
        parameters: &RecruiterParameters,
        distance_m: impl FnMut(&str) -> Option<f64>,
    ) -> Option<RecruitingStep> {
        if let Some(open_s) = &mut self.open_s {
            *open_s += tick_s;
        }

        let offers = std::mem::take(&mut self.offers);
        match &mut self.phase {
            RecruitingPhase::Idle => None,
            RecruitingPhase::Calling { since_s } => {
                if let Some(to) = choose(offers, parameters.by, &mut self.chance, distance_m) {
                    self.phase = RecruitingPhase::Assigning {
                        to: to.clone(),
                        tries: 1,
                        since_s: 0.0,
                    };
                    return Some(RecruitingStep::Assign { to, is_first: true });
                }
                let waited_s = since_s.map(|since_s| since_s + tick_s);
                if waited_s.is_some_and(|waited_s| waited_s < parameters.help_s) {
                    *since_s = waited_s;
                    return None;
                }
                *since_s = Some(0.0);
                self.counts.calls += 1;
                Some(RecruitingStep::Call)
            }
            RecruitingPhase::Assigning { to, tries, since_s } => {
                *since_s += tick_s;
                if *since_s < parameters.help_s {
                    return None;
                }
                if *tries == parameters.assign_tries {
                    self.phase = RecruitingPhase::Calling { since_s: None };
                    return Some(RecruitingStep::GiveUp);
                }
                *tries += 1;
                *since_s = 0.0;
                Some(RecruitingStep::Assign {
                    to: to.clone(),
                    is_first: false,
                })
            }
            RecruitingPhase::Assigned { since_s, .. } => {
                *since_s += tick_s;
                if self.open_s.is_none() || *since_s < parameters.patience_s {
                    return None;
                }
                self.phase = RecruitingPhase::Calling { since_s: None };
                Some(RecruitingStep::GiveUp)
            }
        }
    }

    /// The refiller has come.
    pub fn arrive(&mut self) {
        if let Some(open_s) = self.open_s.take() {
            self.counts.arrivals += 1;
            self.counts.arrival_s += open_s;
        }
    }

    /// The refiller has served him, or has turned back: he has nobody.
    pub fn release(&mut self) {
        self.phase = RecruitingPhase::Idle;
    }
}

/// The refiller of the best offer, if there is one. Of two at the same distance the first one of the news.
fn choose(
    mut offers: Vec<String>,
    by: Recruitment,
    chance: &mut Chance,
    mut distance_m: impl FnMut(&str) -> Option<f64>,
) -> Option<String> {
    if offers.is_empty() {
        return None;
    }
    if by == Recruitment::Random {
        let index = chance.one_of(offers.len());
        return Some(offers.swap_remove(index));
    }

    let mut best: Option<(f64, String)> = None;
    for offer in offers {
        let price_m = distance_m(&offer).unwrap_or(f64::INFINITY);
        if best.as_ref().is_none_or(|(least_m, _)| price_m < *least_m) {
            best = Some((price_m, offer));
        }
    }
    best.map(|(_, offer)| offer)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_S: f64 = 0.5;

    fn recruiter() -> Recruiter {
        Recruiter::new(Chance::new(1))
    }

    fn parameters(by: Recruitment) -> RecruiterParameters {
        RecruiterParameters {
            by,
            ..RecruiterParameters::default()
        }
    }

    /// What he does in so many ticks in which he hears nothing.
    fn steps(recruiter: &mut Recruiter, ticks: usize) -> Vec<RecruitingStep> {
        let parameters = parameters(Recruitment::Greedy);
        let mut steps = Vec::new();
        for _ in 0..ticks {
            steps.extend(recruiter.advance(TICK_S, &parameters, |_| None));
        }
        steps
    }

    fn assign(to: &str, is_first: bool) -> RecruitingStep {
        RecruitingStep::Assign {
            to: to.to_owned(),
            is_first,
        }
    }

    #[test]
    fn a_call_is_repeated_until_there_is_an_offer() {
        let mut recruiter = recruiter();
        assert!(steps(&mut recruiter, 10).is_empty(), "he needs nobody");
        recruiter.request();
        // At once, and then every 2 s: 4 ticks.
        assert_eq!(steps(&mut recruiter, 9), vec![RecruitingStep::Call; 3]);
        recruiter.request();
        assert_eq!(recruiter.counts().requests, 1);
        assert!(recruiter.hear("S1", OFFER));
        assert_eq!(steps(&mut recruiter, 1), [assign("S1", true)]);
        assert_eq!(recruiter.chosen(), Some("S1"));

        assert_eq!(steps(&mut recruiter, 8), vec![assign("S1", false); 2]);
        assert!(recruiter.hear("S2", ACCEPT));
        assert!(!recruiter.is_assigned(), "it is not hers");
        assert!(recruiter.hear("S1", ACCEPT));
        assert!(recruiter.is_assigned());
        assert!(steps(&mut recruiter, 100).is_empty());

        recruiter.arrive();
        recruiter.release();
        let counts = recruiter.counts();
        assert_eq!((counts.calls, counts.arrivals), (3, 1));
        assert_eq!(counts.arrival_s, 118.0 * TICK_S);
        assert!(!recruiter.hear("S1", "joke"));
    }

    #[test]
    fn the_nearest_offer_is_taken() {
        let distance_m = |name: &str| match name {
            "S1" => Some(9.0),
            "S2" => Some(4.0),
            "S3" => Some(4.0),
            _ => None,
        };
        let taken = |by: Recruitment, offers: &[&str]| {
            let mut recruiter = recruiter();
            recruiter.request();
            recruiter.advance(TICK_S, &parameters(by), distance_m);
            for offer in offers {
                recruiter.hear(offer, OFFER);
            }
            recruiter.advance(TICK_S, &parameters(by), distance_m);
            recruiter.chosen().map(str::to_owned)
        };

        for by in [Recruitment::Greedy, Recruitment::Affective] {
            assert_eq!(taken(by, &["S9", "S1", "S2", "S3"]).as_deref(), Some("S2"));
            assert_eq!(taken(by, &["S9"]).as_deref(), Some("S9"));
        }
        assert_eq!(taken(Recruitment::Greedy, &[]), None);
    }

    #[test]
    fn at_random_every_offer_is_taken_alike() {
        let parameters = parameters(Recruitment::Random);
        let mut recruiter = recruiter();
        let mut taken = [0; 4];
        for _ in 0..4000 {
            recruiter.request();
            recruiter.advance(TICK_S, &parameters, |_| None);
            for name in ["0", "1", "2", "3"] {
                recruiter.hear(name, OFFER);
            }
            recruiter.advance(TICK_S, &parameters, |_| None);
            let chosen: usize = recruiter.chosen().unwrap().parse().unwrap();
            taken[chosen] += 1;
            recruiter.release();
        }
        // Four standard deviations of a binomial count: 4 sqrt(4000 * 1/4 * 3/4) = 110.
        assert!(
            taken.iter().all(|n: &i32| n.abs_diff(1000) < 110),
            "{taken:?}"
        );
    }

    #[test]
    fn a_refiller_who_does_not_accept_or_does_not_come_is_given_up() {
        let mut recruiter = recruiter();
        recruiter.request();
        steps(&mut recruiter, 1);
        recruiter.hear("S1", OFFER);
        let assigned = steps(&mut recruiter, 17);
        assert_eq!(assigned.len(), 5);
        let after = steps(&mut recruiter, 5);
        assert_eq!(after, [RecruitingStep::GiveUp, RecruitingStep::Call]);
        assert_eq!(recruiter.chosen(), None);

        recruiter.hear("S2", OFFER);
        steps(&mut recruiter, 1);
        recruiter.hear("S2", ACCEPT);
        assert!(steps(&mut recruiter, 239).is_empty());
        assert_eq!(
            steps(&mut recruiter, 2),
            [RecruitingStep::GiveUp, RecruitingStep::Call]
        );
        assert_eq!(recruiter.counts().requests, 1, "it is the same request");
    }
}
