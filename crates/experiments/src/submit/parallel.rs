//! GNU parallel: one command for a shell.

use super::tasks::Tasks;
use crate::shell;

/// What GNU parallel is asked for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Parallel {
    /// The hosts as `ssh` knows them, `:` being this one; none for this one alone.
    pub hosts: Vec<String>,
    /// Most tasks at the same time on each host; without it, as many as it has processors.
    pub at_a_time: Option<u64>,
}

impl Parallel {
    /// The lines for a shell: one that plays all units, and one that writes the results.
    #[must_use]
    pub fn commands(&self, tasks: &Tasks) -> String {
        let mut command = "parallel".to_owned();
        if !self.hosts.is_empty() {
            command += &format!(" --sshlogin {}", shell::word(&self.hosts.join(",")));
        }
        if let Some(at_a_time) = self.at_a_time {
            command += &format!(" --jobs {at_a_time}");
        }
        // A shell on the host reads the command once more.
        command += &format!(" {} :::", shell::word(&tasks.unit_command("{}")));
        for task in 0..tasks.count() {
            let first = task * tasks.units_per_task;
            let last = tasks.units.min(first + tasks.units_per_task) - 1;
            command += &format!(" {first}..={last}");
        }

        let merge = tasks.merge_command();
        format!("{command}\n{merge}\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_range_is_a_task() {
        let parallel = Parallel {
            hosts: vec![":".to_owned(), "user@two".to_owned()],
            at_a_time: Some(3),
        };
        let expected = r"parallel --sshlogin :,user@two --jobs 3 'cars experiment unit '\''/shared/two arms'\'' {} --jobs 2' ::: 0..=3 4..=7 8..=9
cars experiment merge '/shared/two arms'
";
        assert_eq!(parallel.commands(&Tasks::example()), expected);
    }
}
