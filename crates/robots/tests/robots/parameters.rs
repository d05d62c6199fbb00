//! The shipped files say what the code does, and what makes no sense is refused.

use std::path::{Path, PathBuf};

use super::stage::{FT_M, Role, Stage, feet};
use robot::{Robot, Tone, Widget};
use robots::{Butler, Leguin};
use serde::{Serialize, de::DeserializeOwned};

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs")
}

fn read(file: &str) -> toml::Table {
    toml::from_str(&std::fs::read_to_string(configs().join(file)).unwrap()).unwrap()
}

/// A file's value as the scenario loader hands it to a robot: quantities as SI numbers.
fn in_si(value: &toml::Value) -> serde_json::Value {
    match value {
        toml::Value::String(text) => {
            let quantity = text.split_once(' ').and_then(|(number, unit)| {
                let factor = match unit {
                    "ft" | "ft/s" => FT_M,
                    "s" => 1.0,
                    "h" => 3600.0,
                    _ => return None,
                };
                Some(number.parse::<f64>().ok()? * factor)
            });
            quantity.map_or_else(|| text.clone().into(), Into::into)
        }
        toml::Value::Array(values) => values.iter().map(in_si).collect(),
        toml::Value::Table(table) => table
            .iter()
            .map(|(key, value)| (key.clone(), in_si(value)))
            .collect(),
        other => serde_json::to_value(other).unwrap(),
    }
}

/// Names of all parameters, with those of tables.
fn names(value: &serde_json::Value, prefix: &str) -> Vec<String> {
    let Some(map) = value.as_object() else {
        return vec![prefix.to_owned()];
    };
    map.iter()
        .flat_map(|(key, value)| names(value, &format!("{prefix}.{key}")))
        .collect()
}

fn check_file<P: Default + PartialEq + std::fmt::Debug + Serialize + DeserializeOwned>(file: &str) {
    let shipped = in_si(&toml::Value::Table(read(file)));
    let defaults = serde_json::to_value(P::default()).unwrap();
    let (mut shipped_names, mut default_names) = (names(&shipped, ""), names(&defaults, ""));
    shipped_names.sort();
    default_names.sort();
    assert_eq!(shipped_names, default_names, "{file} names every parameter");
    assert_eq!(
        serde_json::from_value::<P>(shipped).unwrap(),
        P::default(),
        "{file} and the code differ"
    );
}

#[test]
fn the_shipped_files_hold_every_parameter_and_the_defaults_of_the_code() {
    check_file::<robots::butler::ButlerParameters>("robots/butler.toml");
    check_file::<robots::leguin::LeguinParameters>("robots/leguin.toml");
}

#[test]
fn every_line_of_the_shipped_files_says_where_it_comes_from() {
    for file in ["robots/butler.toml", "robots/leguin.toml"] {
        let text = std::fs::read_to_string(configs().join(file)).unwrap();
        for line in text.lines().filter(|line| line.contains(" = ")) {
            assert!(
                line.contains("[D]") || line.contains("[I]"),
                "{file}: {line}"
            );
        }
    }
}

#[test]
fn the_shipped_scenarios_name_robots_that_exist_and_parameters_that_they_know() {
    for file in ["hors_doeuvres.toml", "three_robots.toml", "museum.toml"] {
        for robot in read(file)["robot"].as_array().unwrap() {
            let name = robot["name"].as_str().unwrap();
            assert!(robots::make(name).is_some(), "{file}: {name}");
            let mut parameters = read(robot["params_from"].as_str().unwrap());
            parameters.extend(
                robot
                    .get("params")
                    .and_then(|own| own.as_table())
                    .cloned()
                    .unwrap_or_default(),
            );
            let parameters = in_si(&toml::Value::Table(parameters));
            let refused = match name {
                "Butler" => Butler::new(serde_json::from_value(parameters).unwrap()).err(),
                _ => Leguin::new(serde_json::from_value(parameters).unwrap()).err(),
            };
            assert_eq!(refused, None, "{file}: {name}");
        }
    }
}

#[test]
fn classes_can_be_made_and_others_cannot() {
    assert!(
        robots::CLASSES
            .iter()
            .all(|class| robots::make(class).is_some())
    );
    assert!(robots::make("Cherry").is_none());
}

/// Before they change, parameters are refused as at the beginning.
#[test]
fn the_check_refuses_what_a_robot_would_refuse() {
    let parameters = |text: &str| serde_json::from_str::<robot::Parameters>(text).unwrap();
    let robots: [Box<dyn robot::Robot>; 2] =
        [Box::new(Butler::default()), Box::new(Leguin::default())];
    for robot in robots {
        let check = robot.parameters_check().unwrap();
        assert_eq!(check(&parameters(r#"{"policy": "rules"}"#)), Ok(()));
        for (text, named) in [
            (
                r#"{"policy": "nonsense"}"#,
                "policy: unknown variant `nonsense`",
            ),
            (r#"{"polcy": "rules"}"#, "unknown field `polcy`"),
            (r#"{"caution": "much"}"#, "caution: "),
            (r#"{"exchange_radius_m": -1.0}"#, "exchange_radius_m"),
        ] {
            let reason = check(&parameters(text)).unwrap_err();
            assert!(reason.contains(named), "{text}: {reason}");
        }
    }
}

#[test]
fn senseless_parameters_are_refused_with_their_name() {
    let refusal = |text: &str| {
        let parameters = toml::from_str(text).map_err(|error| error.to_string())?;
        Butler::new(parameters).map(|_| ())
    };
    assert_eq!(refusal(""), Ok(()));
    for (text, named) in [
        ("treat_mean_s = 0.0", "treat_mean_s"),
        ("v_serve_mps = -1.0", "v_serve_mps"),
        ("treat_capacity = 0", "treat_capacity"),
        ("caution = 2.0", "caution"),
        ("consume_in = [\"DANCE\"]", "DANCE"),
        ("cuation = 0.5", "cuation"),
        ("affect = \"maybe\"", "maybe"),
        ("schematic = \"of\"", "`of`"),
        ("schematics = \"off\"", "schematics"),
        // He has no motor output that his emotion could modify.
        ("sensory_motor = \"off\"", "sensory_motor"),
        ("exchange_s = nan", "exchange_s"),
        ("[dynamics]\nth_confident = 0.9", "0.9"),
        ("[rate]\nwindow_s = 0.0", "window_s"),
    ] {
        let reason = refusal(text).unwrap_err();
        assert!(reason.contains(named), "{text}: {reason}");
    }
    let leguin = |text: &str| {
        let parameters = toml::from_str(text).map_err(|error| error.to_string())?;
        Leguin::new(parameters).map(|_| ())
    };
    assert!(leguin("hurry_mult = -1.0").is_err());
    assert_eq!(
        leguin("sensory_motor = \"off\"\nschematic = \"off\""),
        Ok(())
    );
    assert!(
        leguin("sensory_motor = \"no\"")
            .unwrap_err()
            .contains("`no`")
    );
    assert!(
        leguin("schematic = true")
            .unwrap_err()
            .contains("schematic")
    );
    assert!(
        leguin("sensorymotor = \"off\"")
            .unwrap_err()
            .contains("sensorymotor")
    );
    assert!(
        leguin("await_patience_s = 0.0")
            .unwrap_err()
            .contains("await_patience_s")
    );
}

#[test]
fn panels_show_face_feeling_and_account_and_differ() {
    let mut butler = Butler::default();
    let kinds = |robot: &dyn Robot| -> Vec<String> {
        let panel = serde_json::to_value(robot.panel()).unwrap();
        let widgets = panel["widgets"].as_array().unwrap();
        widgets
            .iter()
            .map(|widget| widget["widget"].as_str().unwrap().to_owned())
            .collect()
    };
    for kind in ["face", "badge", "bar", "text", "sparkline", "table"] {
        assert!(kinds(&butler).contains(&kind.to_owned()), "{kind}");
    }
    let leguin = Leguin::default();
    assert_ne!(kinds(&butler), kinds(&leguin));
    assert!(kinds(&leguin).contains(&"button".to_owned()));
    let is_happy = |widget: &Widget| matches!(widget, Widget::Badge { text, tone: Tone::Good, .. } if text == "HAPPY");
    assert!(leguin.panel().widgets.iter().any(is_happy));

    butler = Butler::new(toml::from_str("affect = \"off\"").unwrap()).unwrap();
    assert!(
        butler
            .panel()
            .widgets
            .iter()
            .any(|widget| matches!(widget, Widget::Badge { text, .. } if text == "NEUTRAL"))
    );
}

#[test]
fn jokes_are_rare_and_come_from_the_happy() {
    let (mut jokes, mut seconds) = (0, 0.0);
    for seed in 0..8 {
        let mut stage = Stage::pair(seed, "", "");
        for _ in 0..1200 {
            let joker_was_happy = |stage: &Stage, name: &str| stage.emotion(name) == "HAPPY";
            stage.step();
            for robot in ["Butler", "Leguin"] {
                for line in &stage.report(robot).log {
                    assert!(
                        line.starts_with("jokes: ") && joker_was_happy(&stage, robot),
                        "{line}"
                    );
                    jokes += 1;
                }
            }
            seconds += 0.5;
        }
    }
    assert!(
        (seconds / 200.0..seconds / 20.0).contains(&f64::from(jokes)),
        "{jokes} jokes in {seconds} s"
    );
}

#[test]
fn a_misspelled_refiller_is_complained_about() {
    let mut stage = Stage::new(
        1,
        vec![Role::new(
            "Butler",
            "Butler",
            feet(25.0, 25.0),
            "refiller = \"Legiun\"",
        )],
    );
    stage.begin();
    assert!(stage.report("Butler").log[0].contains("Legiun"));
    stage.step_until(60.0, |_| false);
    assert!(stage.sent.is_empty());
}
