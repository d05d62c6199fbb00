//! The components of emotions in whole runs: over ten seeds of a shipped scenario each takes several values, and has the
//! direction that its name says in the situation that names it. Single situations are in `crates/robots/tests/robots/components.rs`.

use std::collections::{BTreeMap, BTreeSet};

use protocol::messages::{StateVariables, Variable};

use crate::paper::{Change, HALL, watch_seeds};

pub(super) const CROWD: &str = "configs/crowded_hall.toml";
pub(super) const PANTRY: &str = "configs/pantry.toml";
pub(super) const PARTITION: &str = "configs/partition.toml";

/// What a robot shows in a tick.
struct Tick {
    time_s: f64,
    tick_s: f64,
    emotion: String,
    behavior: String,
    /// Behavior of the other robot.
    peer: String,
    variables: StateVariables,
}

impl Tick {
    fn of(change: &Change<'_>, robot: &str) -> Self {
        let hall = change.hall;
        let peer = if robot == "Butler" {
            "Leguin"
        } else {
            "Butler"
        };

        Self {
            time_s: hall.time_s(),
            tick_s: hall.simulation.scenario().tick_s,
            emotion: hall.emotion(robot),
            behavior: hall.behavior(robot),
            peer: hall.behavior(peer),
            variables: hall.variables(robot).clone(),
        }
    }

    fn number(&self, variable: &str) -> f64 {
        let number = self.variables.get(variable).and_then(Variable::as_f64);
        number.unwrap_or_else(|| panic!("no number {variable}"))
    }

    fn text(&self, variable: &str) -> &str {
        let text = self.variables.get(variable).and_then(Variable::as_str);
        text.unwrap_or_else(|| panic!("no text {variable}"))
    }

    fn is(&self, emotion: &str) -> bool {
        self.emotion == emotion
    }

    /// Whether the robot does this while the other one does that.
    fn does(&self, behavior: &str, peer: &str) -> bool {
        self.behavior == behavior && self.peer == peer
    }

    fn begins_an_episode(&self) -> bool {
        self.number("duration_s") == 0.0
    }
}

type Case = fn(&Tick) -> bool;

/// A component is lower in each case than in the next one, on average.
struct Direction {
    component: &'static str,
    file: &'static str,
    robot: &'static str,
    /// From the case with the lowest value to that with the highest.
    cases: &'static [(&'static str, Case)],
}

const UNPLEASANT_FIRST: &[(&str, Case)] = &[
    ("FRUSTRATED", |tick| tick.is("FRUSTRATED")),
    ("CONCERNED", |tick| tick.is("CONCERNED")),
    ("CONFIDENT", |tick| tick.is("CONFIDENT")),
    ("HAPPY", |tick| tick.is("HAPPY")),
];
/// The last one is HAPPY: at the table her controllability says nothing.
const UNPLEASANT_ON_HER_WAY_FIRST: &[(&str, Case)] = &[
    ("FRUSTRATED", |tick| tick.is("FRUSTRATED")),
    ("CONCERNED on her way", |tick| {
        tick.is("CONCERNED") && tick.behavior == "REFILL"
    }),
    ("CONFIDENT", |tick| tick.is("CONFIDENT")),
    ("HAPPY", |tick| tick.is("HAPPY")),
];
const PLEASANT_FIRST: &[(&str, Case)] = &[
    ("HAPPY", |tick| tick.is("HAPPY")),
    ("CONFIDENT", |tick| tick.is("CONFIDENT")),
    ("CONCERNED", |tick| tick.is("CONCERNED")),
    ("FRUSTRATED", |tick| tick.is("FRUSTRATED")),
];
const STRONGER_WHERE_MORE_SERIOUS: &[(&str, Case)] = &[
    ("CONCERNED", |tick| tick.is("CONCERNED")),
    ("FRUSTRATED", |tick| tick.is("FRUSTRATED")),
];
const WEAKER_WHERE_LESS_SURE: &[(&str, Case)] = &[
    ("CONFIDENT", |tick| tick.is("CONFIDENT")),
    ("HAPPY", |tick| tick.is("HAPPY")),
];
/// When links are cut in the scenario, but for the time in which an answer is fresh (`query_stale_s`).
const CUT: &[(&str, Case)] = &[
    ("the links are cut", |tick| {
        (125.0..240.0).contains(&tick.time_s)
    }),
    ("before that", |tick| tick.time_s < 120.0),
];
const DESPAIRING: &[(&str, Case)] = &[
    ("DISCOURAGED", |tick| tick.is("DISCOURAGED")),
    ("HOPEFUL", |tick| tick.is("HOPEFUL")),
];
const LET_DOWN: &[(&str, Case)] = &[
    ("FRUSTRATED", |tick| tick.is("FRUSTRATED")),
    ("CONFIDENT", |tick| tick.is("CONFIDENT")),
];

const fn direction(
    component: &'static str,
    file: &'static str,
    robot: &'static str,
    cases: &'static [(&'static str, Case)],
) -> Direction {
    Direction {
        component,
        file,
        robot,
        cases,
    }
}

const DIRECTIONS: &[Direction] = &[
    direction("valence", HALL, "Butler", UNPLEASANT_FIRST),
    direction("valence", CROWD, "Leguin", UNPLEASANT_FIRST),
    direction("urgency", HALL, "Butler", PLEASANT_FIRST),
    direction("urgency", CROWD, "Leguin", PLEASANT_FIRST),
    direction("intensity", HALL, "Butler", STRONGER_WHERE_MORE_SERIOUS),
    direction("intensity", CROWD, "Leguin", STRONGER_WHERE_MORE_SERIOUS),
    direction("intensity", HALL, "Butler", WEAKER_WHERE_LESS_SURE),
    direction("intensity", HALL, "Leguin", WEAKER_WHERE_LESS_SURE),
    direction("goal_congruence", HALL, "Butler", UNPLEASANT_FIRST),
    direction(
        "goal_congruence",
        CROWD,
        "Leguin",
        UNPLEASANT_ON_HER_WAY_FIRST,
    ),
    direction("controllability", HALL, "Butler", UNPLEASANT_FIRST),
    direction(
        "controllability",
        CROWD,
        "Leguin",
        UNPLEASANT_ON_HER_WAY_FIRST.split_at(3).0,
    ),
    direction("controllability", PANTRY, "Butler", DESPAIRING),
    direction("controllability", PANTRY, "Leguin", DESPAIRING),
    direction("goal_congruence", PANTRY, "Leguin", DESPAIRING),
    direction("certainty", PARTITION, "Butler", CUT),
    direction("certainty", PARTITION, "Leguin", CUT),
    direction(
        "novelty",
        HALL,
        "Butler",
        &[
            ("steady service", |tick| {
                tick.is("HAPPY") && tick.does("SERVE", "WAIT")
            }),
            ("the exchange after a delay", |tick| {
                tick.behavior == "EXCHANGE" && (tick.is("CONCERNED") || tick.is("FRUSTRATED"))
            }),
        ],
    ),
    direction(
        "novelty",
        HALL,
        "Leguin",
        &[
            ("a long rest", |tick| {
                tick.behavior == "WAIT" && tick.number("duration_s") > 10.0
            }),
            ("told to hurry", |tick| {
                tick.text("agency") == "Butler" && tick.number("duration_s") <= 1.0
            }),
        ],
    ),
    direction(
        "modifiability",
        HALL,
        "Butler",
        &[
            ("she has not been called", |tick| {
                tick.is("HAPPY") && tick.does("SERVE", "WAIT")
            }),
            ("she comes", |tick| tick.peer == "REFILL"),
        ],
    ),
    direction(
        "modifiability",
        CROWD,
        "Leguin",
        &[
            ("he serves, and her way is free", |tick| {
                tick.does("REFILL", "SERVE") && tick.number("controllability") > 0.9
            }),
            ("he serves, and a crowd is in her way", |tick| {
                tick.does("REFILL", "SERVE") && tick.number("controllability") < 0.5
            }),
            ("he comes to meet her", |tick| {
                tick.does("REFILL", "INTERCEPT")
            }),
        ],
    ),
    direction("external_norms", HALL, "Butler", LET_DOWN),
    direction("external_norms", CROWD, "Leguin", LET_DOWN),
    direction("internal_standards", HALL, "Butler", LET_DOWN),
    direction("internal_standards", CROWD, "Leguin", LET_DOWN),
];

/// Components that take several values in the hall of the paper; certainty does where links are cut.
const VARYING: [&str; 17] = [
    "mood",
    "facial_expression",
    "valence",
    "intensity",
    "urgency",
    "action_tendency",
    "duration_s",
    "focality",
    "agency",
    "goal_congruence",
    "novelty",
    "controllability",
    "modifiability",
    "external_norms",
    "internal_standards",
    "certainty",
    "causal_chain",
];

/// Constant by design: `duration` is of the level of the taxonomy, minutes for every emotion, and `caution` is a trait.
fn assert_constants(tick: &Tick) {
    assert_eq!(tick.text("duration"), "minutes");
    assert_eq!(tick.number("caution"), 0.5);
}

/// The components that an emotion decides, by its name.
fn assert_of_the_emotion(tick: &Tick) {
    let (sign, face, tendency) = match tick.emotion.as_str() {
        "HAPPY" => (1.0, "happy", "free-activate"),
        "CONFIDENT" => (1.0, "neutral", "continue-normal-activity"),
        "CONCERNED" => (-1.0, "fearful", "monitor-progress-closely"),
        "FRUSTRATED" => (-1.0, "angry", "change-current-strategy"),
        "DISCOURAGED" => (-1.0, "sad", "disengage"),
        "HOPEFUL" => (1.0, "happy", "approach"),
        other => panic!("{other} is in no shipped scenario"),
    };
    assert_eq!(tick.number("valence"), sign * tick.number("intensity"));
    assert_eq!(tick.text("facial_expression"), face);
    assert_eq!(tick.text("action_tendency"), tendency);
}

/// Who is responsible and what it is about, where the paper or the words of the emotion say so.
fn assert_cause(tick: &Tick, robot: &str) {
    let (agency, focality) = (tick.text("agency"), tick.text("focality"));
    let chain = tick.text("causal_chain");
    let has = |clause: &str| assert!(chain.contains(clause), "{}: {chain}", tick.emotion);

    match (robot, tick.emotion.as_str()) {
        (_, "HAPPY") => {
            assert_eq!(agency, "self");
            has("achieved goal: ");
        }
        ("Butler", "FRUSTRATED") => {
            assert_eq!(agency, "Leguin");
            assert_eq!(focality, "event: the delay");
            has("belief: Leguin is not here");
        }
        ("Leguin", "FRUSTRATED") if agency == "the crowd" => {
            assert_eq!(focality, "event: the blocked way");
            has("belief: I cannot do this now");
            has("belief: Butler is not here");
        }
        ("Leguin", "FRUSTRATED") => {
            assert_eq!((agency, focality), ("Butler", "event: the wait"));
        }
        (_, "DISCOURAGED") => {
            assert_eq!(agency, "self");
            has("lost goal: ");
            has("belief: I think I cannot do this");
        }
        (_, "HOPEFUL") => has("belief: I think I can do this"),
        _ => {
            assert!(focality.starts_with("event: "));
            has("goal: I want ");
        }
    }

    if robot == "Butler" && tick.begins_an_episode() && focality == "event: the exchange" {
        assert_eq!(tick.behavior, "GO_BACK", "the exchange is over");
    }
}

/// An episode begins with its emotion, and lasts tick by tick.
fn assert_duration(before: &Tick, now: &Tick) {
    let expected_s = if now.emotion == before.emotion {
        before.number("duration_s") + now.tick_s
    } else {
        0.0
    };
    assert_eq!(now.number("duration_s"), expected_s);
}

/// What is kept of the ticks of a run, or of several.
#[derive(Default)]
struct Notes {
    /// The last tick of each robot.
    before: BTreeMap<&'static str, Tick>,
    /// Two values of each component of a robot, where it takes them.
    values: BTreeMap<(&'static str, &'static str), BTreeSet<String>>,
    /// Sum and number of the values in each case, by the place of its direction and its own.
    sums: BTreeMap<(usize, usize), (f64, u32)>,
}

impl Notes {
    fn add_tick(&mut self, file: &str, robot: &'static str, now: Tick) {
        assert_constants(&now);
        assert_of_the_emotion(&now);
        assert_cause(&now, robot);
        if let Some(before) = self.before.get(robot) {
            assert_duration(before, &now);
        }

        for component in VARYING {
            let values = self.values.entry((robot, component)).or_default();
            if values.len() < 2 {
                values.insert(now.variables[component].to_string());
            }
        }
        for (place, direction) in DIRECTIONS.iter().enumerate() {
            if (direction.file, direction.robot) != (file, robot) {
                continue;
            }
            for (index, (_, case)) in direction.cases.iter().enumerate() {
                if case(&now) {
                    let (sum, count) = self.sums.entry((place, index)).or_default();
                    *sum += now.number(direction.component);
                    *count += 1;
                }
            }
        }
        self.before.insert(robot, now);
    }

    fn add_run(&mut self, run: Self) {
        for (component, values) in run.values {
            self.values.entry(component).or_default().extend(values);
        }
        for (case, (sum, count)) in run.sums {
            let total = self.sums.entry(case).or_default();
            total.0 += sum;
            total.1 += count;
        }
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn every_component_varies_in_its_direction() {
    let mut all = Notes::default();
    for file in [HALL, CROWD, PARTITION, PANTRY] {
        let mut notes = Notes::default();
        let runs = watch_seeds(64, file, &[], |run: &mut Notes, change| {
            for robot in ["Butler", "Leguin"] {
                run.add_tick(file, robot, Tick::of(change, robot));
            }
        });
        for run in runs {
            notes.add_run(run);
        }

        for ((robot, component), values) in &notes.values {
            let is_expected = match *component {
                "certainty" => file == PARTITION,
                _ => file == HALL,
            };
            assert!(
                values.len() > 1 || !is_expected,
                "{file}, {robot}: {component} never varies"
            );
        }
        all.add_run(notes);
    }

    for (place, direction) in DIRECTIONS.iter().enumerate() {
        let mut means = Vec::new();
        for (index, (name, _)) in direction.cases.iter().enumerate() {
            let (sum, count) = all.sums.get(&(place, index)).copied().unwrap_or_default();
            assert!(count > 0, "{}: {name} never occurs", direction.file);
            means.push((*name, sum / f64::from(count)));
        }

        let what = format!("{}, {}", direction.robot, direction.component);
        println!("{what}, {}: {means:.2?}", direction.file);
        assert!(
            means.is_sorted_by(|lower, higher| lower.1 < higher.1),
            "{what}: {means:?}"
        );
    }
}
