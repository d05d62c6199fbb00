//! Affective Knowledge Representation (AKR): the building blocks of robots with emotions.
//!
//! Emotion-based control is easy to describe but hard to reproduce. Emotions, progress measures, thresholds and
//! effects on behavior are usually scattered throughout a robot's code. This crate provides them as separate parts
//! that can each be used alone. All of them are pure: they use no clock, randomness or I/O, and do not depend on any
//! simulator or robot. The same inputs give the same emotions on every machine.
//!
//! | Task | Item |
//! | --- | --- |
//! | Describe a personality, appraise a situation | [`akr`] |
//! | Describe the tree of personality, affect, moods and emotions, and explain an emotion in words | [`Schemata`], [`CausalChain`] |
//! | Follow an emotion from its beginning to its end, appraise it | [`Episode`], [`Prediction`], [`RecentShare`] |
//! | Describe an emotion with all its components, publish it | [`AffectFrame`] |
//! | Measure progress | [`progress`] |
//! | Change a feeling over time with progress, events and beliefs | [`Dynamics`], [`Ladder`] |
//! | Generate emotion from progress (ESG) | [`EmotionGenerator`] and its implementations |
//! | Generate behavior from progress and emotion (BSG) | [`behavior`] |
//! | Let emotion affect motor output, active behaviors and deliberation | [`levels`] |
//!
//! # Sources
//!
//! Much of the original work was not readable, so each item states its source: **\[D: code\]** marks what is
//! documented, and **\[I\]** what is inferred or chosen here. Every chosen number is a parameter.
//!
//! | Code | Source |
//! | --- | --- |
//! | S | Lisetti, Glinos, Murphy, Tardif: AKR for Cooperative Affective Robots, AAAI FS-02-03, 2002 |
//! | T | Murphy, Lisetti, Tardif, Irish, Gage: IEEE Trans. Robotics and Automation 18(5), 2002 (abstract) |
//! | F2 | Lisetti, Nasoz: FLAIRS 2002 (part of the taxonomy figure) |
//! | D1, D2 | Lisetti, Gmytrasiewicz: AAAI FS-00-04 and SS-00-02 (first pages) |
//! | N | Guzzi et al.: artificial emotions for multi-robot systems, GECCO 2018 (code) |
//! | W | W3C: vocabularies for EmotionML |
//!
//! # A robot with custom emotions
//!
//! This example is a museum guide that waits for visitors and becomes bored. It defines its own set of emotions and a
//! schema for one of them; the rest comes from this crate. See `docs/new-robot.md` for a complete robot that runs as a
//! process of a simulation.
//!
//! ```
//! use affect::akr::{Agency, Appraisal, Valence};
//! use affect::behavior::{BehaviorGenerator, Row, Then::{Go, Stay}};
//! use affect::{Caution, Circumstances, Dynamics, DynamicGenerator, DynamicsParameters};
//! use affect::{EmotionGenerator, EmotionLabel, Episode, Feeling, Ladder, ProgressEvent, Rung, Schemata, Stimulus};
//!
//! #[derive(Debug, Clone, Copy, PartialEq, Eq)]
//! enum Mind { Content, Restless, Bored }
//!
//! impl EmotionLabel for Mind {
//!     fn name(self) -> &'static str {
//!         match self {
//!             Mind::Content => "CONTENT",
//!             Mind::Restless => "RESTLESS",
//!             Mind::Bored => "BORED",
//!         }
//!     }
//!     fn valence(self) -> Valence {
//!         if self == Mind::Content { Valence::Positive } else { Valence::Negative }
//!     }
//! }
//!
//! #[derive(Debug, Clone, Copy, PartialEq)]
//! enum Task { Wait, Stroll }
//! #[derive(Debug, Clone, Copy, PartialEq)]
//! enum Act { Sigh, Greet }
//!
//! /// Progress measures: the time without visitors and the time that the guide can bear.
//! struct Measures { alone_s: f64, bearable_s: f64, visitor_came: bool }
//! struct Context { feeling: Feeling<Mind>, visitor_came: bool, has_sighed: bool }
//!
//! const ANY: &[Task] = &[Task::Wait, Task::Stroll];
//! const TABLE: &[Row<Task, Context, Act>] = &[
//!     Row { from: ANY, when: |c| c.visitor_came, act: &[Act::Greet], then: Go(Task::Wait) },
//!     Row { from: &[Task::Wait], when: feels_restless, act: &[Act::Sigh], then: Stay },
//!     Row { from: &[Task::Wait], when: feels_bored, act: &[], then: Go(Task::Stroll) },
//! ];
//! fn feels_restless(c: &Context) -> bool {
//!     c.feeling.emotion == Mind::Restless && !c.has_sighed
//! }
//! fn feels_bored(c: &Context) -> bool {
//!     c.feeling.emotion == Mind::Bored
//! }
//!
//! const SCHEMA: &str = r#"
//!     [BORED]
//!     parent = "negative emotion"
//!     facial_expression = "sad"
//!     action_tendency = "change-current-strategy"
//!     causal_chain = [
//!         "goal: I want {g}",
//!         "belief: {a} did not come",
//!         "effect: because of this I want to be somewhere else",
//!     ]
//! "#;
//!
//! fn appraise(measures: &Measures, task: &Task) -> Stimulus {
//!     let need = if *task == Task::Wait { measures.alone_s / measures.bearable_s } else { 0.0 };
//!     Stimulus::need(need).with_event(measures.visitor_came.then_some(ProgressEvent::GoalAchieved))
//! }
//!
//! let rungs = vec![
//!     Rung::new(Mind::Content, 0.0),
//!     Rung::new(Mind::Restless, 0.3),
//!     Rung::new(Mind::Bored, 0.7),
//! ];
//! let dynamics = Dynamics::new(Ladder::new(rungs)?, &DynamicsParameters::default(), Caution::default())?;
//! let mut esg = DynamicGenerator::new(dynamics, appraise);
//! let mut bsg = BehaviorGenerator::new(TABLE, Task::Wait);
//!
//! let mut measures = Measures { alone_s: 0.0, bearable_s: 10.0, visitor_came: false };
//! let mut acts = Vec::new();
//! while *bsg.current() == Task::Wait {
//!     // One tick: update the state variables, then the emotion, then the behavior.
//!     measures.alone_s += 0.5;
//!     bsg.advance(0.5);
//!
//!     let feeling = esg.update(&measures, bsg.current(), 0.5);
//!
//!     let has_sighed = acts.contains(&Act::Sigh);
//!     let context = Context { feeling, visitor_came: measures.visitor_came, has_sighed };
//!     acts.extend(bsg.update(&context).actions);
//! }
//! assert_eq!(esg.feeling().emotion, Mind::Bored);
//! assert_eq!(acts, [Act::Sigh]);
//!
//! let feeling = esg.feeling();
//! let alone = (measures.alone_s / measures.bearable_s).min(1.0);
//! let appraisal = Appraisal::new(1.0 - 2.0 * alone, 0.0, 1.0);
//! let circumstances = Circumstances {
//!     other: Some("the group"),
//!     goal: Some("to show the exhibits"),
//!     ..Default::default()
//! };
//!
//! let schemata = Schemata::from_toml(SCHEMA)?;
//! let name = feeling.emotion.name();
//! let mut episode = Episode::default();
//! episode.update(name, 0.5, |_| {
//!     schemata.cause(name, Agency::Other("the group".to_owned()), "the wait", &circumstances)
//! });
//! let bored = schemata.frame(name, feeling.urgency, appraisal).ok_or("no schema")?.during(&episode);
//! assert!(bored.valence() < -0.7);
//! assert_eq!(
//!     episode.cause().spoken(),
//!     "I want to show the exhibits; the group did not come; because of this I want to be somewhere else."
//! );
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod affect;
pub mod akr;
pub mod behavior;
mod causal;
mod dynamics;
mod episode;
pub mod frame;
mod generator;
mod label;
mod ladder;
pub mod levels;
mod mood;
mod parameters;
pub mod progress;
mod scalar;
mod schema;

pub use causal::{CausalChain, Circumstances, Clause, ClauseError, ClauseKind};
pub use dynamics::{Belief, Dynamics, EmotionState, Progress, ProgressEvent, StepInput, Stimulus};
pub use episode::{Episode, EpisodeCause, Prediction, RecentShare};
pub use frame::AffectFrame;
pub use generator::{DynamicGenerator, EmotionGenerator};
pub use label::{EmotionLabel, Feeling, StandardEmotion};
pub use ladder::{BeliefEmotions, Ladder, Rung};
pub use mood::MoodParameters;
pub use parameters::{DynamicsParameters, ParameterError, StateSet};
pub use scalar::{Caution, Intensity, IntensityLabel, OutOfRange, Urgency};
pub use schema::{Components, Node, Schema, SchemaError, Schemata};
