//! A robot's reports and commands, read leniently: a wrong number is noted by its own rule and hides nothing else.

use protocol::messages::{Command, Report};
use protocol::{Malformed, decode};
use serde_json::Value;

/// A report as far as it can be read.
#[derive(Debug, Clone)]
pub struct Reading {
    /// The report; numbers that are not finite are left out or zero.
    pub report: Report,
    /// Fields whose numbers are not finite.
    pub not_numbers: Vec<String>,
    /// Integers that are written with a fraction.
    pub not_integers: Vec<String>,
}

/// The integers of a report and of a command.
const INTEGERS: [&str; 5] = ["epoch", "tick", "generation", "number", "commands"];

/// Reads a report.
pub fn read(key: &str, robot: &str, bytes: &[u8]) -> Result<Reading, Malformed> {
    match decode(key, robot, bytes) {
        Ok(report) => Ok(Reading {
            report,
            not_numbers: Vec::new(),
            not_integers: Vec::new(),
        }),
        Err(malformed) => repair(key, robot, bytes).ok_or(malformed),
    }
}

/// Reads a command, and the integers in it that are written with a fraction.
pub fn read_command(
    key: &str,
    robot: &str,
    bytes: &[u8],
) -> Result<(Command, Vec<String>), Malformed> {
    let malformed = match decode(key, robot, bytes) {
        Ok(command) => return Ok((command, Vec::new())),
        Err(malformed) => malformed,
    };

    let Ok(mut value) = serde_json::from_slice(bytes) else {
        return Err(malformed);
    };
    let not_integers = repair_integers(&mut value);
    decode(key, robot, value.to_string().as_bytes()).map(|command| (command, not_integers))
}

/// Reads a report whose only flaws are its numbers: languages write what is not finite as `NaN`, `Infinity` or `null`,
/// and integers as 5.0.
fn repair(key: &str, robot: &str, bytes: &[u8]) -> Option<Reading> {
    let mut text = String::from_utf8(bytes.to_vec()).ok()?;
    for written in ["-Infinity", "Infinity", "NaN"] {
        text = text
            .replace(&format!(":{written}"), ":null")
            .replace(&format!(": {written}"), ":null");
    }
    let mut value: Value = serde_json::from_str(&text).ok()?;
    let not_integers = repair_integers(&mut value);

    let mut not_numbers = Vec::new();
    for path in ["/proposal/x", "/proposal/y", "/speed_mps", "/direction_rad"] {
        if let Some(number) = value.pointer_mut(path).filter(|number| number.is_null()) {
            not_numbers.push(path.trim_start_matches('/').replace('/', "."));
            *number = 0.0.into();
        }
    }
    if let Some(Value::Object(variables)) = value.get_mut("state_variables") {
        variables.retain(|name, variable| {
            let is_number = !variable.is_null();
            if !is_number {
                not_numbers.push(format!("state_variables.{name}"));
            }
            is_number
        });
    }

    let report = decode(key, robot, value.to_string().as_bytes()).ok()?;
    Some(Reading {
        report,
        not_numbers,
        not_integers,
    })
}

/// Turns whole numbers that are written with a fraction into integers. Returns their fields.
fn repair_integers(value: &mut Value) -> Vec<String> {
    let mut repaired = Vec::new();
    for name in INTEGERS {
        let Some(field) = value.get_mut(name).filter(|field| field.is_f64()) else {
            continue;
        };
        let number = field.as_f64().unwrap_or_default();
        if number.fract() == 0.0 && number >= 0.0 {
            *field = (number as u64).into();
            repaired.push(name.to_owned());
        }
    }

    repaired
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Reading, Malformed> {
        super::read("key", "A", text.as_bytes())
    }

    fn report(speed: &str, variable: &str) -> String {
        format!(
            "{{\"epoch\":1,\"tick\":3,\"generation\":1,\"proposal\":{{\"x\":1.0,\"y\":2.0}},\"speed_mps\":{speed},\
             \"direction_rad\": 0,\"emotion_state\":\"\",\"behavior_state\":\"\",\"state_variables\":{{\"a\":{variable}}}}}"
        )
    }

    #[test]
    fn numbers_that_are_not_finite_are_named() {
        assert!(read(&report("0.5", "1")).unwrap().not_numbers.is_empty());

        for written in ["null", "NaN", " Infinity", "-Infinity"] {
            assert_eq!(
                read(&report(written, "1")).unwrap().not_numbers,
                ["speed_mps"],
                "{written}"
            );
        }

        assert_eq!(
            read(&report("1", "NaN")).unwrap().not_numbers,
            ["state_variables.a"]
        );
        assert!(read(&report("\"fast\"", "1")).is_err());
    }

    #[test]
    fn integers_with_a_fraction_are_named() {
        let text = report("1", "1").replace("\"tick\":3", "\"tick\":3.0");
        let reading = read(&text).unwrap();
        assert_eq!(reading.not_integers, ["tick"]);
        assert_eq!(reading.report.tick, 3);

        let text = text.replace("3.0", "3.5");
        assert!(read(&text).is_err());
    }

    #[test]
    fn what_is_not_a_report_is_malformed() {
        assert!(read("{}").is_err());
    }
}
