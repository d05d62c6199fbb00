//! A robot's reports, read with patience: what is wrong with a number is noted by its own rule and hides nothing else.

use protocol::messages::Report;
use protocol::{Malformed, decode};
use serde_json::Value;

/// A report as far as it can be read.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    /// The report; numbers that are none are left out or zero.
    pub(crate) report: Report,
    /// Numbers that are none.
    pub(crate) not_numbers: Vec<String>,
}

/// Reads a report.
pub(crate) fn read(key: &str, robot: &str, bytes: &[u8]) -> Result<Reading, Malformed> {
    match decode(key, robot, bytes) {
        Ok(report) => Ok(Reading {
            report,
            not_numbers: Vec::new(),
        }),
        Err(malformed) => repair(key, robot, bytes).ok_or(malformed),
    }
}

/// Reads a report whose only flaw are numbers that are none: languages write them as `NaN`, `Infinity` or `null`.
fn repair(key: &str, robot: &str, bytes: &[u8]) -> Option<Reading> {
    let mut text = String::from_utf8(bytes.to_vec()).ok()?;
    for written in ["-Infinity", "Infinity", "NaN"] {
        text = text
            .replace(&format!(":{written}"), ":null")
            .replace(&format!(": {written}"), ":null");
    }
    let mut value: Value = serde_json::from_str(&text).ok()?;
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
    (!not_numbers.is_empty()).then_some(Reading {
        report,
        not_numbers,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(speed: &str, variable: &str) -> String {
        format!(
            "{{\"epoch\":1,\"tick\":3,\"generation\":1,\"proposal\":{{\"x\":1.0,\"y\":2.0}},\"speed_mps\":{speed},\
             \"direction_rad\": 0,\"emotion_state\":\"\",\"behavior_state\":\"\",\"state_variables\":{{\"a\":{variable}}}}}"
        )
    }

    #[test]
    fn numbers_that_are_none_are_named() {
        let read = |text: &str| read("key", "A", text.as_bytes());
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
        assert!(read("{}").is_err());
    }
}
