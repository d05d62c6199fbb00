//! Scenario files with odd values: either an error with file, line and caret, or a run. Never a panic.

use std::convert::Infallible;
use std::path::Path;
use std::sync::Arc;

use config::shipped;
use environment::Simulation;
use lockstep::{Bulletin, Exchange, TickOutcome};
use proptest::prelude::*;
use protocol::Tick;
use protocol::messages::{CommandText, Report, TickUpdate};
use scenario::Scenario;
use scenario::diagnostic::{FileError, Source};

/// Numbers that quantities are written with.
const NUMBERS: [&str; 16] = [
    "0",
    "-0",
    "-1",
    "1",
    "0.5",
    "3",
    "1e-6",
    "1e-7",
    "1e-320",
    "1e6",
    "2e10",
    "1e19",
    "1e308",
    "1e309",
    "NaN",
    "18446744073709551616",
];
/// Units, also unknown ones.
const UNITS: [&str; 9] = ["m", "ft", "m/s", "s", "ms", "h", "deg", "", "furlong"];
/// Values of other kinds.
const VALUES: [&str; 22] = [
    "0",
    "-1",
    "1",
    "0.5",
    "nan",
    "inf",
    "-inf",
    "9223372036854775807",
    "9007199254740992",
    "true",
    "\"\"",
    "\"Butler\"",
    "\"operator\"",
    "\"\\u0000\\u001b[2J\"",
    "[]",
    "[[]]",
    "{}",
    "[\"1 m\", \"1 m\", \"1 m\"]",
    "[\"Butler\", \"Butler\"]",
    "1979-05-27",
    "\"../../../etc/passwd\"",
    "{ min = \"1 s\", mode = \"0 s\", max = \"inf s\" }",
];

/// Robots that never report.
struct Nobody;

impl Exchange<TickUpdate, Arc<Report>, CommandText> for Nobody {
    type Error = Infallible;

    fn exchange(
        &mut self,
        _: Tick,
        _: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, Infallible> {
        Ok(TickOutcome::default())
    }
}

fn scenarios() -> Vec<&'static str> {
    let mut texts: Vec<&str> = shipped::files()
        .filter(|(path, _)| {
            let name = path.strip_prefix("configs/");
            name.is_some_and(|name| !name.contains('/'))
        })
        .map(|(_, text)| text)
        .collect();
    texts.push(EVERYTHING);
    texts
}

/// What the shipped scenarios do not have.
const EVERYTHING: &str = r#"
seed = 1
tick = "0.5 s"
duration = "60 s"
on_late = "continue"
deadline = "2 s"
lose_after = 3
end_when = { site = "T1", variable = "stock", at_most = 0 }
[field]
size = ["15 m", "15 m"]
body = "2 ft"
max_speed = "10 ft/s"
[sensing]
range = "6 ft"
field_of_view = "120 deg"
walls_hide = true
misses = 0.1
noise = "0.1 m"
rays = { count = 36, range = "5 m" }
[guests]
count = 7
speed = { min = "0.2 ft/s", mode = "1 ft/s", max = "2 ft/s" }
duration = { min = "2 s", mode = "5 s", max = "10 s" }
[network]
commands = { loss = 0.1, duplication = 0.1, delay = "1 s", burst = { enter = 0.1, leave = 0.5, loss = 0.9 } }
queries = { loss = 0.1 }
[[network.link]]
from = "Butler"
to = "Leguin"
commands = { delay = { min = "0 s", mode = "1 s", max = "3 s" } }
[[network.partition]]
groups = [["Butler"], ["Leguin"]]
from = "1 s"
until = "5 s"
one_way = true
cuts = ["commands"]
[[network.lose]]
from = "Butler"
to = "Leguin"
number = 1
text = "refill"
[record]
log_name = "cars.log"
sync = "tick"
[[fault]]
robot = "Leguin"
do = "hang"
at = "1 s"
until = "3 s"
[[change]]
at = "2 s"
set = ["network.commands.loss=0.5"]
[[expect]]
name = "they meet"
never = { robot = "Butler", behavior = "NONSENSE" }
[[obstacle]]
at = ["2 ft", "2 ft"]
[[obstacle]]
count = 3
at = { line = { from = ["2 m", "12 m"], to = ["6 m", "12 m"] }, jitter = "0.2 m" }
size = ["0.5 m", "0.2 m"]
[[wall]]
points = [["9 m", "1 m"], ["9 m", "6 m"], ["11 m", "6 m"]]
[[site]]
name = "T{1..3}"
kind = "task"
at = { circle = { center = ["7 m", "4 m"], radius = "1 m" } }
range = "2 m"
known = true
on_conflict = "refuse"
[site.state]
stock = { start = 5, min = 0, max = 9 }
open = true
last = "no one"
[[site]]
name = "U"
count = 2
at = { random = { from = ["1 m", "8 m"], to = ["5 m", "10 m"] } }
[[layer]]
name = "dust"
cell = "1 m"
value = 1.0
min = 0.0
max = 10.0
range = "2 m"
decay = 0.1
diffuse = 0.1
[[layer.peaks]]
count = 2
at = "random"
radius = "3 m"
height = 5.0
[[measure]]
name = "left"
variable = { sites = "T*", by = "sum", name = "stock", as = "end" }
[[robot]]
name = "S{1..3}"
class = "Scout"
at = { cluster = { center = ["5 m", "5 m"], radius = "2 m" } }
radius = "0.2 m"
[[robot]]
name = "D"
count = 2
at = { grid = { from = ["12 m", "9 m"], step = "1 m", columns = 2 } }
size = ["0.4 m", "0.6 m"]
[robot.drive]
max_speed = "1 m/s"
max_turn = "90 deg/s"
max_acceleration = "0.5 m/s2"
max_turn_acceleration = "180 deg/s2"
heading = "45 deg"
[[robot]]
name = "Butler"
at = ["25 ft", "25 ft"]
[[robot]]
name = "Leguin"
at = ["4 ft", "4 ft"]
on_late = "continue"
params = { caution = 0.8 }
"#;

/// One change of a text: the line, by any number, and what its value becomes.
#[derive(Debug, Clone)]
enum Change {
    Value(String),
    Element(String),
    Remove,
    Twice,
}

fn value() -> impl Strategy<Value = String> {
    let quantity = (
        prop::sample::select(&NUMBERS[..]),
        prop::sample::select(&UNITS[..]),
    )
        .prop_map(|(number, unit)| format!("\"{number} {unit}\""));
    prop_oneof![
        2 => quantity,
        1 => prop::sample::select(&VALUES[..]).prop_map(str::to_owned),
    ]
}

fn change() -> impl Strategy<Value = Change> {
    prop_oneof![
        4 => value().prop_map(Change::Value),
        4 => value().prop_map(Change::Element),
        1 => Just(Change::Remove),
        1 => Just(Change::Twice),
    ]
}

/// The text with a line changed.
fn changed(text: &str, at: usize, change: &Change) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let with_values: Vec<usize> = (0..lines.len())
        .filter(|index| !lines[*index].starts_with('#') && !lines[*index].trim().is_empty())
        .collect();
    let at = with_values[at % with_values.len()];
    let line = lines[at].clone();
    let key = line.split('=').next().unwrap();
    match change {
        Change::Value(value) => lines[at] = format!("{key}= {value}"),
        // The first text in the line, which may be within a list or a table.
        Change::Element(value) => {
            let parts: Vec<&str> = line.splitn(3, '"').collect();
            if let [before, _, after] = parts[..] {
                lines[at] = format!("{before}{value}{after}");
            }
        }
        Change::Remove => drop(lines.remove(at)),
        Change::Twice => lines.insert(at, line),
    }
    lines.join("\n")
}

/// Whether people are shown the file, a line and a caret.
fn check_shown(error: &FileError) {
    let shown = config::render_plain(error, None, 200);
    assert!(
        shown.contains("[odd.toml") && shown.contains('╰'),
        "{shown}"
    );
}

fn play(text: &str) {
    let source = Source {
        name: "odd.toml".to_owned(),
        text: text.to_owned(),
    };
    let scenario = match Scenario::parse(&source, &shipped::path(shipped::SCENARIOS)) {
        Ok(scenario) => scenario,
        Err(error) => return check_shown(&error),
    };

    // What is recorded can be read again.
    let written = scenario.to_toml().unwrap();
    let again = Source {
        name: "again.toml".to_owned(),
        text: written.clone(),
    };
    match Scenario::parse(&again, Path::new(".")) {
        Ok(again) => assert_eq!(again.to_toml().unwrap(), written),
        Err(error) => panic!("{error:?}\n{written}"),
    }

    let mut simulation = Simulation::new(scenario, 1).unwrap();
    simulation.init(&mut Nobody).unwrap();
    for _ in 0..simulation.scenario().ticks.min(12) {
        simulation.step(&mut Nobody).unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn an_odd_value_is_an_error_at_its_line_or_a_run(
        which in prop::option::of(any::<prop::sample::Index>()),
        changes in prop::collection::vec((any::<usize>(), change()), 1..4),
    ) {
        let shipped = which.map(|which| *which.get(&scenarios()));
        let mut text = shipped.unwrap_or(EVERYTHING).to_owned();
        for (at, change) in &changes {
            text = changed(&text, *at, change);
        }
        play(&text);
    }
}

#[test]
fn the_scenarios_themselves_are_right() {
    for text in scenarios() {
        let source = Source {
            name: "odd.toml".to_owned(),
            text: text.to_owned(),
        };
        let scenario = Scenario::parse(&source, &shipped::path(shipped::SCENARIOS));
        assert!(scenario.is_ok(), "{scenario:?}");
        play(text);
    }
}
