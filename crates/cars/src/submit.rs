//! `cars experiment submit`: hands the units of an experiment to Slurm, Kubernetes or GNU parallel.

use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::{Args, ValueEnum};
use config::units::Time;
use experiments::Plan;
use experiments::submit::{Kubernetes, Parallel, Slurm, Tasks};
use export::draft::unwritable;
use record::folder::check_no_links;

use crate::errors::{Context, Result, refusal};
use crate::output;

/// Folder of the scripts and of what they print, in that of the experiment.
const SCRIPTS: &str = "slurm";
/// Name of the script that plays units.
const UNITS: &str = "units.sh";
/// Name of the script that writes the results.
const MERGE: &str = "merge.sh";

/// What plays the units, and how.
#[derive(Debug, Args)]
pub(crate) struct EngineArgs {
    /// What plays the units. For Kubernetes and GNU parallel, what they need is printed.
    #[arg(long)]
    engine: Engine,
    /// Print the scripts for Slurm and submit nothing.
    #[arg(long)]
    print: bool,
    /// Number of units that a task plays; without it, so many that there are at most 100 tasks.
    #[arg(long, value_name = "N")]
    units_per_task: Option<NonZero<usize>>,
    /// Number of units that a task plays at the same time, each on a processor.
    #[arg(long, value_name = "N", default_value = "1")]
    processors: NonZero<usize>,
    /// Most tasks at the same time; for GNU parallel, on each host.
    #[arg(long, value_name = "N")]
    limit: Option<NonZero<u64>>,
    /// Longest time of a task (Slurm, Kubernetes).
    #[arg(long, value_name = "TIME", value_parser = time_limit)]
    time_limit: Option<Time>,
    /// Partition of the jobs (Slurm).
    #[arg(long, value_name = "NAME", value_parser = partition)]
    partition: Option<String>,
    /// Hosts, as `ssh` knows them; `:` is this one (GNU parallel).
    #[arg(long, value_name = "HOSTS", value_delimiter = ',')]
    hosts: Vec<String>,
    /// Image with the program, such as that of `docker/Dockerfile` (Kubernetes).
    #[arg(long, required_if_eq("engine", "kubernetes"))]
    image: Option<String>,
    /// Claim of the volume with the folder (Kubernetes).
    #[arg(long, value_name = "NAME", required_if_eq("engine", "kubernetes"))]
    claim: Option<String>,
    /// The folder in the volume; without it, the volume is the folder (Kubernetes).
    #[arg(long, value_name = "PATH")]
    path: Option<String>,
    /// The program `cars` on the machines; without it, this one, and for Kubernetes the one in the image's path.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Engine {
    /// A job array, and a job after it that writes the results.
    Slurm,
    /// The manifest of an indexed Job.
    Kubernetes,
    /// A command line.
    Parallel,
}

fn partition(text: &str) -> Result<String, String> {
    let is_name = text
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || "-_.,".contains(c));
    if text.is_empty() || !is_name {
        return Err(format!("{text:?} is not the name of a partition"));
    }
    Ok(text.to_owned())
}

fn time_limit(text: &str) -> Result<Time, String> {
    let time: Time = text.parse()?;
    if time.0 <= 0.0 {
        return Err("a task needs more time than none".to_owned());
    }
    Ok(time)
}

impl EngineArgs {
    /// Submits the units of an experiment that has been planned in a folder, or prints what an engine needs.
    ///
    /// # Errors
    /// If an option is not one of the engine, or Slurm refuses the jobs.
    pub(crate) fn submit(&self, plan: &Plan, folder: &Path) -> Result<()> {
        self.check()?;
        let folder = std::path::absolute(folder)?;
        let tasks = self.tasks(plan, &folder)?;
        let at_a_time = self.limit.map(NonZero::get);

        match self.engine {
            Engine::Slurm => self.slurm(&tasks, &folder)?,
            Engine::Kubernetes => {
                let kubernetes = Kubernetes {
                    image: self.image.clone().unwrap_or_default(),
                    claim: self.claim.clone().unwrap_or_default(),
                    path: self.path.clone(),
                    limit_s: self.time_limit.map(|limit| limit.0.ceil() as u64),
                    at_a_time,
                };
                terminal::data(format_args!("{}", kubernetes.manifest(&tasks)))?;
            }
            Engine::Parallel => {
                let parallel = Parallel {
                    hosts: self.hosts.clone(),
                    at_a_time,
                };
                terminal::data(format_args!("{}", parallel.commands(&tasks)))?;
            }
        }
        Ok(())
    }

    /// Checks that every option is one of the engine.
    fn check(&self) -> Result<()> {
        let is_of_job = self.engine != Engine::Parallel;
        for (option, is_given, is_of_engine) in [
            ("--print", self.print, self.engine == Engine::Slurm),
            ("--time-limit", self.time_limit.is_some(), is_of_job),
            (
                "--partition",
                self.partition.is_some(),
                self.engine == Engine::Slurm,
            ),
            (
                "--hosts",
                !self.hosts.is_empty(),
                self.engine == Engine::Parallel,
            ),
            (
                "--image",
                self.image.is_some(),
                self.engine == Engine::Kubernetes,
            ),
            (
                "--claim",
                self.claim.is_some(),
                self.engine == Engine::Kubernetes,
            ),
            (
                "--path",
                self.path.is_some(),
                self.engine == Engine::Kubernetes,
            ),
        ] {
            if is_given && !is_of_engine {
                let engine = self.engine.to_possible_value();
                let engine = engine.as_ref().map_or("", |value| value.get_name());
                return Err(refusal!("{option} has no meaning with --engine {engine}"));
            }
        }

        Ok(())
    }

    fn tasks(&self, plan: &Plan, folder: &Path) -> Result<Tasks> {
        let program = match (&self.program, self.engine) {
            (Some(program), _) => program.clone(),
            (None, Engine::Kubernetes) => PathBuf::from("cars"),
            (None, _) => std::env::current_exe()?,
        };
        let per_task = self.units_per_task.map(NonZero::get);

        Ok(Tasks {
            name: plan.name().to_owned(),
            program: text(&program)?,
            folder: text(folder)?,
            units: plan.units(),
            units_per_task: per_task.unwrap_or_else(|| Tasks::units_per_task(plan.units())),
            processors: self.processors.get(),
        })
    }

    /// Submits the jobs, or prints their scripts.
    fn slurm(&self, tasks: &Tasks, folder: &Path) -> Result<()> {
        let slurm = Slurm {
            partition: self.partition.clone(),
            limit_min: self.time_limit.map(|limit| (limit.0 / 60.0).ceil() as u64),
            at_a_time: self.limit.map(NonZero::get),
        };
        let units = slurm.units(tasks);
        let merge = slurm.merge(tasks);
        if self.print {
            terminal::data(format_args!("# {UNITS}\n{units}\n# {MERGE}\n{merge}"))?;
            return Ok(());
        }

        let scripts = folder.join(SCRIPTS);
        check_no_links(&scripts)?;
        std::fs::create_dir_all(&scripts).map_err(|error| unwritable(&scripts, &error))?;
        for (name, script) in [(UNITS, units), (MERGE, merge)] {
            output::write(Some(&scripts.join(name)), &script)?;
        }
        let units = sbatch(&scripts, &[UNITS])?;
        // Also if a task failed: the others have results.
        let after = format!("--dependency=afterany:{units}");
        let merge = sbatch(&scripts, &[&after, MERGE])
            .context(format!("the units are submitted as job {units}"))?;

        let count = tasks.count();
        terminal::print_line(format_args!(
            "job {units} plays the units in {count} tasks, and job {merge} writes the results afterwards; what they print is in {}",
            scripts.display()
        ))?;
        Ok(())
    }
}

/// Submits a script of a folder and returns the number of its job.
fn sbatch(folder: &Path, args: &[&str]) -> Result<String> {
    let output = Command::new("sbatch")
        .current_dir(folder)
        .arg("--parsable")
        .args(args)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| {
            refusal!(
                help = "submit on a machine that has Slurm, or print the scripts with --print",
                "`sbatch` cannot be started: {error}"
            )
        })?;
    if !output.status.success() {
        let reason = String::from_utf8_lossy(&output.stderr);
        return Err(refusal!("`sbatch` refuses the job: {}", reason.trim()));
    }

    // The number, and where there are several clusters, `;` and the name of the cluster.
    let printed = String::from_utf8_lossy(&output.stdout);
    let number = printed.trim().split(';').next().unwrap_or_default();
    Ok(number.to_owned())
}

/// A path as a text of a script.
fn text(path: &Path) -> Result<String> {
    let text = path.to_str();
    let text = text.ok_or_else(|| refusal!("{}: this path is not UTF-8", path.display()))?;
    Ok(text.to_owned())
}
