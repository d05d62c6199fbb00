//! Slurm: a job array, and a job that waits for it.

use super::tasks::Tasks;

/// What Slurm is asked for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Slurm {
    /// Partition of the jobs; without it, that of the cluster.
    pub partition: Option<String>,
    /// Longest time of a task, minutes; without it, that of the partition.
    pub limit_min: Option<u64>,
    /// Most tasks at the same time.
    pub at_a_time: Option<u64>,
}

impl Slurm {
    /// The script of the job array that plays the units. What it prints is in the folder that it is submitted from, in one
    /// file for each task.
    #[must_use]
    pub fn units(&self, tasks: &Tasks) -> String {
        let last = tasks.count() - 1;
        let mut array = format!("0-{last}");
        if let Some(at_a_time) = self.at_a_time {
            array += &format!("%{at_a_time}");
        }

        let head = self.head(tasks, "%A_%a.txt");
        let processors = tasks.processors;
        let script = tasks.script("SLURM_ARRAY_TASK_ID");
        format!(
            "{head}#SBATCH --array={array}\n\
             #SBATCH --cpus-per-task={processors}\n\
             set -eu\n\
             {script}"
        )
    }

    /// The script of the job that writes the results afterwards, also if a task failed.
    #[must_use]
    pub fn merge(&self, tasks: &Tasks) -> String {
        let head = self.head(tasks, "%j.txt");
        let command = tasks.merge_command();
        format!("{head}exec {command}\n")
    }

    fn head(&self, tasks: &Tasks, output: &str) -> String {
        let name = tasks.job_name();
        let mut head = format!(
            "#!/bin/sh\n\
             #SBATCH --job-name={name}\n\
             #SBATCH --output={output}\n"
        );

        if let Some(partition) = &self.partition {
            head += &format!("#SBATCH --partition={partition}\n");
        }
        if let Some(limit_min) = self.limit_min {
            head += &format!("#SBATCH --time={limit_min}\n");
        }

        head
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_task_plays_its_range_of_units() {
        let slurm = Slurm {
            partition: Some("short".to_owned()),
            limit_min: Some(30),
            at_a_time: Some(2),
        };
        let expected = r#"#!/bin/sh
#SBATCH --job-name=cars-two-arms
#SBATCH --output=%A_%a.txt
#SBATCH --partition=short
#SBATCH --time=30
#SBATCH --array=0-2%2
#SBATCH --cpus-per-task=2
set -eu
first=$((SLURM_ARRAY_TASK_ID * 4))
last=$((first + 4 - 1))
exec cars experiment unit '/shared/two arms' "$first..=$last" --jobs 2
"#;
        assert_eq!(slurm.units(&Tasks::example()), expected);
    }

    #[test]
    fn the_cluster_decides_what_is_not_given() {
        let expected = "#!/bin/sh
#SBATCH --job-name=cars-two-arms
#SBATCH --output=%j.txt
exec cars experiment merge '/shared/two arms'
";
        assert_eq!(Slurm::default().merge(&Tasks::example()), expected);
        assert!(
            Slurm::default()
                .units(&Tasks::example())
                .contains("--array=0-2\n")
        );
    }
}
