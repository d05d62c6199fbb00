//! What becomes of a robot whose parameters are wrong: at the beginning, in the middle of an epoch, and before they change.

use std::sync::Arc;

use lockstep::{Begin, Turn};
use protocol::messages::JoinAnswer;
use robot::{
    Action, BadParameters, Cars, CommandText, Parameters, ParametersCheck, PeerNetwork,
    PublicState, Robot, RobotError, RobotName, Runner, Undelivered, Welcome, read_parameters,
};
use serde::Deserialize;
use serde_json::{Value, json};

/// Draws once when it begins, and publishes what it drew and how it was set.
#[derive(Default)]
struct Picky {
    way: String,
    drawn: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Set {
    way: Way,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Way {
    Left,
    Right,
}

impl Robot for Picky {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        self.drawn = protocol::random::unit(cars.random());
        cars.log("begins");
        cars.set_robot_command("A", "hello").unwrap();
        self.way = format!("{:?}", cars.parameters::<Set>()?.way);
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        Action::stay(cars)
            .variable("way", self.way.clone())
            .variable("drawn", self.drawn)
    }

    fn parameters_check(&self) -> Option<ParametersCheck> {
        Some(|parameters| read_parameters::<Set>(parameters).map(drop))
    }
}

struct Nobody;

impl PeerNetwork for Nobody {
    fn state_of(&mut self, _: &RobotName) -> Result<Arc<PublicState>, Undelivered> {
        Err(Undelivered::Lost)
    }
}

fn set(way: Value) -> Parameters {
    Parameters::from([("way".to_owned(), way)])
}

fn welcome(now: Value, earlier: Vec<Value>, later: Vec<Value>) -> Welcome {
    let text = r#"{"answer":"welcome","protocol":2,"run":"r","name":"A","generation":1,"epoch":1,"tick":0,"seed":1,
        "stream":"robot/A","tick_s":0.5,"field_m":[9,9],"body_m":0.6,"sensing_range_m":2,"location":{"x":1,"y":1},
        "roster":["A"],"parameters":{},"news_flag":1}"#;
    let answer = protocol::decode("join", "simulator", text.as_bytes()).unwrap();
    let JoinAnswer::Welcome(welcome) = answer else {
        unreachable!("it is a welcome")
    };

    Welcome {
        parameters: set(now),
        earlier_parameters: earlier.into_iter().map(set).collect(),
        later_parameters: later.into_iter().map(set).collect(),
        ..*welcome
    }
}

/// Begins with a welcome: the way that it goes, what it drew, the lines of its log, and its commands.
fn begin(begin: Begin, welcome: Welcome) -> Result<(Value, Vec<String>, Vec<CommandText>), String> {
    let mut runner = Runner::new(Box::new(Picky::default()), welcome);
    let turn = Turn {
        epoch: 1,
        tick: 7,
        begin,
        news: None,
    };
    let done = runner
        .run(&turn, &mut Nobody)
        .map_err(|error: RobotError| error.to_string())?;
    let commands = done.commands.into_iter().map(|sent| sent.command);
    let variables = json!(done.report.state_variables);
    Ok((variables, done.report.log.clone(), commands.collect()))
}

#[test]
fn parameters_that_are_refused_at_the_beginning_end_the_run() {
    let error = begin(Begin::Init, welcome(json!("up"), vec![], vec![])).unwrap_err();
    assert_eq!(
        error,
        "parameters of A: way: unknown variant `up`, expected `left` or `right`"
    );
}

#[test]
fn a_robot_that_refuses_a_change_keeps_what_it_had_and_says_so() {
    let before = welcome(json!("left"), vec![], vec![]);
    let (expected, _, commands) = begin(Begin::TakeOver, before).unwrap();
    for earlier in [
        vec![json!("left")],
        vec![json!(3), json!("left"), json!("right")],
    ] {
        let wrong = welcome(json!("up"), earlier.clone(), vec![]);
        let (variables, log, sent) = begin(Begin::TakeOver, wrong).unwrap();

        // Nothing of the attempts with what was refused is left, also of the chance that they drew.
        assert_eq!(variables, expected);
        assert_eq!(sent, commands);
        let said =
            "error: refuses its new parameters, and keeps those before; its output has the reason";
        assert_eq!(log, [said, "begins"]);
    }
}

#[test]
fn a_robot_that_refuses_all_that_it_ever_had_ends_the_run() {
    let wrong = welcome(json!("up"), vec![json!("down")], vec![]);
    let error = begin(Begin::TakeOver, wrong).unwrap_err();
    assert!(error.contains("unknown variant `down`"), "{error}");
}

#[test]
fn a_change_that_the_scenario_plans_is_refused_at_the_beginning() {
    let planned = welcome(json!("left"), vec![], vec![json!("right"), json!("up")]);
    let error = begin(Begin::Init, planned.clone()).unwrap_err();
    assert!(
        error.starts_with(
            "parameters of A: as a change of the scenario sets them: way: unknown variant `up`"
        ),
        "{error}"
    );
    begin(Begin::TakeOver, planned).unwrap();
}
