//! Names of runs and robots: short, plain, safe inside a key expression and a file name.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Longest name, in bytes.
pub const MAX_NAME_LEN: usize = 64;

/// Sender of commands that come from outside the roster (a shell, a button on the console).
pub const OPERATOR: &str = "operator";

/// Names that no run can have: other entries of the folder of runs have them.
const RESERVED_RUNS: [(&str, &str); 2] = [
    (
        LATEST,
        "the link to the latest run has it; choose another name",
    ),
    (
        EXPERIMENTS,
        "the folder of the experiments has it; choose another name",
    ),
];

/// The symbolic link to the latest run, beside the folders of runs.
pub const LATEST: &str = "latest";

/// The folder of experiments, beside the folders of runs.
pub const EXPERIMENTS: &str = "experiments";

/// A name that cannot be used, and why.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name:?} is not a usable name: {reason}")]
pub struct BadName {
    name: String,
    reason: &'static str,
}

impl BadName {
    /// The same of another text.
    pub(crate) fn of(self, text: &str) -> Self {
        let name = text.chars().take(MAX_NAME_LEN).collect();
        Self { name, ..self }
    }
}

fn checked(name: &str) -> Result<String, BadName> {
    let refuse = |reason| {
        Err(BadName {
            name: name.chars().take(MAX_NAME_LEN).collect(),
            reason,
        })
    };

    if name.is_empty() {
        return refuse("it is empty");
    }
    if name.len() > MAX_NAME_LEN {
        return refuse("it is longer than 64 characters");
    }
    if !name
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-' || c == '.')
        || name.starts_with('.')
    {
        return refuse(
            "only letters, digits, '_', '-' and '.' may stand in it, and no leading '.'",
        );
    }
    // Names are arguments of programs, also of programs that others write.
    if name.starts_with('-') {
        return refuse("it begins with '-', as an option of a command does");
    }

    Ok(name.to_owned())
}

/// Checks the name of a new run, or of one that is asked for.
fn checked_run(name: &str) -> Result<String, BadName> {
    for (reserved, reason) in RESERVED_RUNS {
        // Some file systems ignore case.
        if name.eq_ignore_ascii_case(reserved) {
            return Err(BadName {
                name: name.to_owned(),
                reason,
            });
        }
    }
    checked(name)
}

macro_rules! name_type {
    ($(#[$doc:meta])* $type:ident, $check:path) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[cfg_attr(test, derive(schemars::JsonSchema))]
        #[serde(try_from = "String", into = "String")]
        #[cfg_attr(test, schemars(with = "String"))]
        pub struct $type(std::sync::Arc<str>);

        impl $type {
            /// Checks a name: 1 to 64 letters, digits, `_`, `-` or `.`, not beginning with `.` or `-`, and not reserved.
            ///
            /// # Errors
            /// [`BadName`] says what is wrong with it.
            pub fn new(name: &str) -> Result<Self, BadName> {
                $check(name).map(|name| Self(name.into()))
            }

            /// The name as text.
            #[must_use]
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        // Of messages and records, which may be those of a version that reserved fewer names.
        impl TryFrom<String> for $type {
            type Error = BadName;
            fn try_from(name: String) -> Result<Self, BadName> {
                checked(&name).map(|name| Self(name.into()))
            }
        }

        impl From<$type> for String {
            fn from(name: $type) -> Self {
                name.0.as_ref().to_owned()
            }
        }

        impl std::str::FromStr for $type {
            type Err = BadName;
            fn from_str(name: &str) -> Result<Self, BadName> {
                Self::new(name)
            }
        }

        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.pad(&self.0)
            }
        }

        impl std::borrow::Borrow<str> for $type {
            fn borrow(&self) -> &str {
                &self.0
            }
        }
    };
}

name_type! {
    /// Name of a robot of the roster; robots are addressed by it (seed, "Inter-Robot Communication").
    RobotName, checked
}
name_type! {
    /// Name of a run; several runs can share a network.
    RunName, checked_run
}

impl RunName {
    /// The name of a run whose name is not known.
    #[must_use]
    pub fn unknown() -> Self {
        Self("run".into())
    }

    /// The name with a number behind it, as in `hall-2`. A long name is cut, so that it stays one.
    #[must_use]
    pub fn numbered(&self, number: u64) -> Self {
        self.with_suffix(&format!("-{number}"))
    }

    /// The name with a suffix of characters that names have. A long name is cut, so that it stays one.
    #[must_use]
    pub fn with_suffix(&self, suffix: &str) -> Self {
        let kept = MAX_NAME_LEN.saturating_sub(suffix.len());
        let name: String = self.as_str().chars().take(kept).collect();
        Self(format!("{name}{suffix}").into())
    }
}

impl RobotName {
    /// The sender of commands from outside the roster; no robot may have this name.
    #[must_use]
    pub fn operator() -> Self {
        Self(OPERATOR.into())
    }

    /// Whether this is the reserved sender from outside the roster.
    #[must_use]
    pub fn is_operator(&self) -> bool {
        self.as_str() == OPERATOR
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_run_has_the_name_of_another_entry_of_the_folder_of_runs() {
        for reserved in ["latest", "Latest", "experiments"] {
            let refused = RunName::new(reserved).unwrap_err().to_string();
            assert!(refused.contains("choose another name"), "{refused}");
            assert!(reserved.parse::<RunName>().is_err());
            assert!(RobotName::new(reserved).is_ok());
            // A record of an earlier version can be read.
            assert!(RunName::try_from(reserved.to_owned()).is_ok());
        }
        assert!(RunName::new("latest-2").is_ok());
    }

    #[test]
    fn a_long_name_with_a_number_is_a_name() {
        let long = RunName::new(&"x".repeat(64)).unwrap().numbered(12);
        assert_eq!(RunName::new(long.as_str()).unwrap(), long);
        assert!(long.as_str().ends_with("x-12"));
        assert_eq!(RunName::new("hall").unwrap().numbered(2).as_str(), "hall-2");
    }

    #[test]
    fn names_that_would_break_a_key_or_a_path_are_refused() {
        for bad in ["", "a/b", "*", "a b", "..", "\u{e9}", &"x".repeat(65)] {
            assert!(RobotName::new(bad).is_err(), "{bad:?} was accepted");
        }
        for bad in ["-", "--help", "-Butler", "--"] {
            let refused = RobotName::new(bad).unwrap_err().to_string();
            assert!(refused.contains("begins with '-'"), "{refused}");
            assert!(RunName::new(bad).is_err(), "{bad:?} was accepted");
        }
        for good in ["Butler", "a-", "_-", "r-2_d.2", &"x".repeat(64)] {
            assert_eq!(RobotName::new(good).unwrap().as_str(), good);
        }
    }
}
