//! The units of an experiment, divided into tasks for other machines.

use crate::shell;

/// How many tasks an experiment is divided into, unless that is chosen: enough for the machines of a group, and few enough
/// that starting them takes no time that counts.
const TASKS: usize = 100;

/// The units of an experiment, divided into tasks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tasks {
    /// Name of the experiment.
    pub name: String,
    /// The program `cars`, as the machines find it.
    pub program: String,
    /// Folder of the experiment, as the machines see it.
    pub folder: String,
    /// Number of units.
    pub units: usize,
    /// Number of units that a task plays.
    pub units_per_task: usize,
    /// Number of units that a task plays at the same time, each on a processor.
    pub processors: usize,
}

impl Tasks {
    /// How many units a task plays, unless that is chosen.
    #[must_use]
    pub fn units_per_task(units: usize) -> usize {
        units.div_ceil(TASKS).max(1)
    }

    /// Number of tasks.
    #[must_use]
    pub fn count(&self) -> usize {
        self.units.div_ceil(self.units_per_task)
    }

    /// The command for a shell that plays a range of units, which is written as the shell reads it.
    pub(super) fn unit_command(&self, range: &str) -> String {
        let program = shell::word(&self.program);
        let folder = shell::word(&self.folder);
        let jobs = self.processors;
        format!("{program} experiment unit {folder} {range} --jobs {jobs}")
    }

    /// The lines for a shell that play the units of the task whose number a variable has.
    pub(super) fn script(&self, variable: &str) -> String {
        let count = self.units_per_task;
        let command = self.unit_command("\"$first..=$last\"");
        format!(
            "first=$(({variable} * {count}))\n\
             last=$((first + {count} - 1))\n\
             exec {command}\n"
        )
    }

    /// The command for a shell that writes the results of the units that have been played.
    pub(super) fn merge_command(&self) -> String {
        let program = shell::word(&self.program);
        let folder = shell::word(&self.folder);
        format!("{program} experiment merge {folder}")
    }

    /// The name of the experiment as a name of jobs: lower-case letters, digits and `-`, 1 to 63 of them, with neither begin nor
    /// end `-` (RFC 1123, which Kubernetes asks for).
    pub(super) fn job_name(&self) -> String {
        let name = self.name.to_lowercase();
        let name: String = name
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
            .take(50)
            .collect();
        let name = format!("cars-{name}");
        name.trim_end_matches('-').to_owned()
    }
}

#[cfg(test)]
impl Tasks {
    /// Ten units of an experiment, four in a task.
    pub(super) fn example() -> Self {
        Self {
            name: "Two arms".to_owned(),
            program: "cars".to_owned(),
            folder: "/shared/two arms".to_owned(),
            units: 10,
            units_per_task: 4,
            processors: 2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tasks_have_all_units() {
        assert_eq!(Tasks::example().count(), 3);
        for (units, expected) in [(1, 1), (100, 1), (101, 2), (2000, 20), (2001, 21)] {
            assert_eq!(Tasks::units_per_task(units), expected, "{units}");
        }
    }

    #[test]
    fn names_of_jobs_are_names_of_hosts() {
        let long = "x".repeat(80);
        for (name, expected) in [
            ("deadlock", "cars-deadlock"),
            ("Two arms_", "cars-two-arms"),
            ("é", "cars"),
            ("", "cars"),
        ] {
            let named = Tasks {
                name: name.to_owned(),
                ..Tasks::example()
            };
            assert_eq!(named.job_name(), expected);
        }
        let named = Tasks {
            name: long,
            ..Tasks::example()
        };
        assert!(named.job_name().len() <= 63);
    }
}
