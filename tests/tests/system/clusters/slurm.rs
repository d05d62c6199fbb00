//! A Slurm of one node, of the distribution's programs, in a temporary folder.

use std::fmt::Write;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use nix::sys::signal::Signal;
use system_tests::processes::send;
use system_tests::{Lab, eventually, free_port, within};

use super::{PATIENCE, Trial, UNITS, checked, has_programs};

/// Number of units of a task.
const UNITS_PER_TASK: usize = 3;
/// Bytes of the key of the authentication.
const KEY_BYTES: usize = 128;

/// The daemons of the cluster; they end with the thread that started them.
struct Cluster {
    lab: Lab,
    daemons: Vec<Child>,
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_job_array_gives_the_results_of_this_machine_also_after_an_interruption() {
    let programs = ["munged", "slurmctld", "slurmd", "sbatch", "setpriv"];
    let packages = "slurmctld slurmd slurm-client munge util-linux";
    if !has_programs("Slurm", &programs, packages) {
        return;
    }
    let cluster = Cluster::start();
    let trial = Trial::new();
    let folder = trial.plan("the cluster's");

    // The first array is cancelled when some of its tasks have ended, and the results of those are written all the same.
    let first = cluster.submit(&trial, &folder, &["--limit", "1"]);
    within(PATIENCE, "a second task", || {
        logs(&folder, &first).get(1).cloned()
    });
    cluster.client("scancel", &[&first]);
    cluster.wait_for_all(&folder);
    assert!(folder.join("results.json").exists(), "{}", said(&folder));
    let cancelled = logs(&folder, &first).len();
    assert!(
        cancelled < UNITS.div_ceil(UNITS_PER_TASK),
        "{cancelled} tasks ended"
    );

    let second = cluster.submit(
        &trial,
        &folder,
        &["--partition", "batch", "--time-limit", "1 h"],
    );
    cluster.wait_for_all(&folder);
    let tasks = logs(&folder, &second).len();
    assert_eq!(tasks, UNITS.div_ceil(UNITS_PER_TASK), "{}", said(&folder));
    trial.assert_results(&folder);
}

impl Cluster {
    fn start() -> Self {
        let mut cluster = Self {
            lab: Lab::new(),
            daemons: Vec::new(),
        };
        let node = node();
        let conf = cluster.write_configuration(&node);

        let folder = cluster.lab.out();
        let key = cluster.lab.write("key", &"k".repeat(KEY_BYTES));
        let private = std::os::unix::fs::PermissionsExt::from_mode(0o600);
        std::fs::set_permissions(&key, private).unwrap();
        let mut munged = daemon("munged");
        munged.args(["--foreground", "--force"]);
        for name in ["key-file", "socket", "pid-file", "log-file", "seed-file"] {
            let file = name.trim_end_matches("-file");
            munged.arg(format!("--{name}={}", folder.join(file).display()));
        }
        let socket = folder.join("socket");
        cluster.daemons.push(munged.spawn().unwrap());
        eventually("munge", || socket.exists().then_some(()));

        for name in ["slurmctld", "slurmd"] {
            let mut slurm = daemon(name);
            slurm.arg("-D").env("SLURM_CONF", &conf);
            cluster.daemons.push(slurm.spawn().unwrap());
        }
        within(PATIENCE, "an idle node", || {
            let mut sinfo = Command::new("sinfo");
            sinfo
                .args(["--noheader", "--format=%T"])
                .env("SLURM_CONF", &conf);
            let states = sinfo.output().unwrap();
            (states.stdout == b"idle\n").then_some(())
        });
        cluster
    }

    /// Writes the configuration, which is small: processes are found by their parents, and no limits are enforced.
    fn write_configuration(&self, node: &str) -> std::path::PathBuf {
        let folder = self.lab.out();
        let name = node.split(' ').next().unwrap();
        let user = Command::new("id").arg("-un").output().unwrap();
        let user = checked(&user, "id -un");
        let user = user.trim();

        let mut text = String::new();
        for (key, value) in [
            ("ClusterName", "test"),
            ("SlurmctldHost", &format!("{name}(127.0.0.1)")),
            ("SlurmUser", user),
            ("SlurmdUser", user),
            ("SlurmctldPort", &free_port().to_string()),
            ("SlurmdPort", &free_port().to_string()),
            ("AuthType", "auth/munge"),
            ("CredType", "cred/munge"),
            ("ProctrackType", "proctrack/linuxproc"),
            ("TaskPlugin", "task/none"),
            ("JobAcctGatherType", "jobacct_gather/none"),
            ("SelectType", "select/cons_tres"),
            ("SelectTypeParameters", "CR_Core"),
            ("MpiDefault", "none"),
            ("ReturnToService", "2"),
            (
                "NodeName",
                &format!("{node} NodeAddr=127.0.0.1 State=UNKNOWN"),
            ),
            ("PartitionName", "batch Nodes=ALL Default=YES State=UP"),
        ] {
            writeln!(text, "{key}={value}").unwrap();
        }
        for (key, file) in [
            ("AuthInfo=socket", "socket"),
            ("StateSaveLocation", "state"),
            ("SlurmdSpoolDir", "spool"),
            ("SlurmctldPidFile", "slurmctld.pid"),
            ("SlurmdPidFile", "slurmd.pid"),
            ("SlurmctldLogFile", "slurmctld.log"),
            ("SlurmdLogFile", "slurmd.log"),
        ] {
            writeln!(text, "{key}={}", folder.join(file).display()).unwrap();
        }
        for name in ["state", "spool"] {
            std::fs::create_dir(folder.join(name)).unwrap();
        }
        self.lab.write("slurm.conf", &text)
    }

    /// Submits the units of a folder; returns the number of the job array.
    fn submit(&self, trial: &Trial, folder: &Path, options: &[&str]) -> String {
        let per_task = UNITS_PER_TASK.to_string();
        let mut args = vec!["submit", "--engine", "slurm", "--units-per-task", &per_task];
        args.extend(options);
        let mut cars = trial.command(&args, folder);
        let output = cars.env("SLURM_CONF", self.lab.out().join("slurm.conf"));
        let text = checked(&output.output().unwrap(), "submit");

        let number = text.split(' ').nth(1).unwrap();
        assert!(number.parse::<u32>().is_ok(), "{text}");
        number.to_owned()
    }

    /// Runs one of Slurm's programs, which must succeed.
    fn client(&self, program: &str, args: &[&str]) -> String {
        let mut client = Command::new(program);
        client
            .args(args)
            .env("SLURM_CONF", self.lab.out().join("slurm.conf"));
        checked(&client.output().unwrap(), program)
    }

    /// Waits until no job is left.
    fn wait_for_all(&self, folder: &Path) {
        let mut left = String::new();
        let is_done = system_tests::is_within(PATIENCE, || {
            left = self.client("squeue", &["--noheader"]);
            left.is_empty()
        });
        assert!(is_done, "these jobs do not end:\n{left}\n{}", said(folder));
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        for daemon in self.daemons.iter_mut().rev() {
            send(daemon.id(), Signal::SIGTERM);
            let _ended = daemon.wait();
        }
    }
}

/// A daemon that ends with this thread.
fn daemon(name: &str) -> Command {
    let mut command = Command::new("setpriv");
    command
        .args(["--pdeathsig", "TERM", name])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    command
}

/// This machine as a node: its name and what it has, as Slurm writes that.
fn node() -> String {
    let output = Command::new("slurmd").arg("-C").output().unwrap();
    let text = checked(&output, "slurmd -C");
    let line = text.lines().next().unwrap();
    line.strip_prefix("NodeName=").unwrap().to_owned()
}

/// What the tasks of a job array printed, in files.
fn logs(folder: &Path, job: &str) -> Vec<std::path::PathBuf> {
    let mut logs = Vec::new();
    for entry in std::fs::read_dir(folder.join("slurm")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.starts_with(&format!("{job}_")) {
            logs.push(path);
        }
    }
    logs
}

/// What all jobs of a folder printed, for people.
fn said(folder: &Path) -> String {
    let mut text = String::new();
    for entry in std::fs::read_dir(folder.join("slurm")).unwrap() {
        let path = entry.unwrap().path();
        let printed = std::fs::read_to_string(&path).unwrap();
        writeln!(text, "{}:\n{printed}", path.display()).unwrap();
    }
    text
}
