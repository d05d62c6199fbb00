//! Links of the kernel: each process runs in a network namespace, and a veth pair connects it to a bridge in another
//! namespace. A link is cut by setting its port of the bridge down, like pulling a cable. The namespaces have no other
//! interfaces.
//!
//! ```text
//!   simulator and launcher   Butler     Leguin
//!       10.77.0.1          10.77.0.2   10.77.0.3     eth0 of each
//!          |                   |           |
//!          p0                  p1          p2        ports of the switch
//! ```

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use launch::child::{self, AtExit};
use launch::{LaunchError, Process, ProcessLink};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::links::{Links, Start, own_path};
use super::shape::{Flow, LinkShape};

/// Prefix of the names of all namespaces; the id of this process follows.
const PREFIX: &str = "cars-";
/// Prefix of the addresses, which exist only in the namespaces.
const NETWORK: &str = "10.77.0";
const PORT: u16 = 7447;
/// Most processes with an address.
const MAX_PROCESSES: usize = 250;
/// Milliseconds between two ARP requests. The kernel's default of one second would be most of the time that a healed link
/// needs.
const ARP_RETRY_MS: u32 = 100;

/// How long the processes of a play that was killed may take to exit before they are killed, too.
const END_PATIENCE: Duration = Duration::from_secs(5);
/// How often to look for them.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

const NO_CONSOLE: &str = "--no-console";

/// The namespaces of a launch: one for the simulator, one for each process, and one for the bridge.
#[derive(Debug)]
pub(super) struct Namespaces {
    prefix: String,
    processes: Vec<String>,
}

impl Namespaces {
    pub(super) fn new(processes: &[Process]) -> Result<Self, LaunchError> {
        if processes.len() > MAX_PROCESSES {
            return Err(LaunchError::refused(format!(
                "more than {MAX_PROCESSES} processes do not fit into one network"
            )));
        }

        let names = processes.iter().map(|process| process.name.clone());

        // Its drop removes what has been made, also if `make` fails.
        let namespaces = Self {
            prefix: format!("{PREFIX}{}-", std::process::id()),
            processes: names.collect(),
        };
        namespaces.make().map_err(|reason| LaunchError::Tool {
            reason,
            help: Some("network namespaces need root and `ip` (Debian: apt install iproute2)"),
        })?;

        Ok(namespaces)
    }

    fn make(&self) -> Result<(), String> {
        let switch = self.switch();
        ip(&format!("netns add {switch}"))?;
        let bridge = "link add name hub type bridge forward_delay 0";
        ip(&format!("-n {switch} {bridge}"))?;
        ip(&format!("-n {switch} link set hub up"))?;

        for index in 0..=self.processes.len() {
            self.connect(&switch, index)?;
        }
        Ok(())
    }

    /// Makes the namespace of a host, and the veth pair to the bridge.
    fn connect(&self, switch: &str, index: usize) -> Result<(), String> {
        let host = self.host(index);
        let port = port(index);
        let address = address(index);
        ip(&format!("netns add {host}"))?;
        ip(&format!("-n {host} link set lo up"))?;

        let pair = format!("type veth peer name eth0 netns {host}");
        ip(&format!("-n {switch} link add {port} {pair}"))?;
        ip(&format!("-n {switch} link set {port} master hub up"))?;

        ip(&format!("-n {host} addr add {address}/24 dev eth0"))?;
        ip(&format!("-n {host} link set eth0 up"))?;
        let arp = format!("name arp_cache dev eth0 retrans {ARP_RETRY_MS}");
        ip(&format!("-n {host} ntable change {arp}"))?;
        Ok(())
    }

    fn switch(&self) -> String {
        format!("{}switch", self.prefix)
    }

    /// The simulator's is 0.
    fn host(&self, index: usize) -> String {
        format!("{}{index}", self.prefix)
    }
}

impl Drop for Namespaces {
    fn drop(&mut self) {
        // The bridge comes last. Removing a namespace removes what is in it, the pairs included.
        let hosts = (0..=self.processes.len()).map(|index| self.host(index));
        for namespace in hosts.chain([self.switch()]) {
            // Removing fails for a namespace that was not made.
            if let Err(error) = ip(&format!("netns del {namespace}")) {
                tracing::debug!("{error}");
            }
        }
    }
}

impl Links for Namespaces {
    fn command(&self, start: &Start) -> Result<Command, LaunchError> {
        let endpoint = format!("tcp/{}:{PORT}", address(0));
        let mut links = Vec::new();
        for (index, process) in self.processes.iter().enumerate() {
            links.push(ProcessLink {
                process: process.clone(),
                endpoint: endpoint.clone(),
                namespace: Some(self.host(index + 1)),
            });
        }

        let mut command = child::command(AtExit::Terminate, "ip");
        command
            .args(["netns", "exec", &self.host(0)])
            .arg(own_path()?)
            .args(start.args(&links))
            .arg(format!("--listen={endpoint}"))
            // Only this launch is in the network.
            .arg("--insecure");
        if !start.more.iter().any(|arg| arg == NO_CONSOLE) {
            // A browser could not reach the console in the namespace.
            command.arg(NO_CONSOLE);
        }

        Ok(command)
    }

    fn set(&mut self, process: &str, shape: LinkShape) -> Result<(), LaunchError> {
        let index = self.processes.iter().position(|name| name == process);
        let index = index.ok_or_else(|| LaunchError::refused(format!("no link of {process}")))?;
        let switch = self.switch();
        let port = port(index + 1);
        let state = match shape.flow {
            Flow::Open => "up",
            Flow::Cut | Flow::Closed => "down",
        };

        ip(&format!("-n {switch} link set {port} {state}"))
            .map(drop)
            .map_err(|reason| LaunchError::Tool { reason, help: None })
    }
}

fn port(index: usize) -> String {
    format!("p{index}")
}

fn address(index: usize) -> String {
    format!("{NETWORK}.{}", index + 1)
}

/// Removes the namespaces of processes that were killed, and ends the processes in them. `report` receives a line for each
/// namespace.
pub(super) fn remove_abandoned(report: &mut dyn FnMut(String)) {
    let mut abandoned = namespaces();
    abandoned.retain(|name| is_abandoned(name));

    end_processes(&abandoned);
    for name in abandoned {
        report(match ip(&format!("netns del {name}")) {
            Ok(_) => format!("removed the network namespace {name} of a play that was killed"),
            Err(error) if namespaces().contains(&name) => {
                format!("the network namespace {name} of a play that was killed: {error}")
            }
            // Another play that starts now has removed it.
            Err(_) => continue,
        });
    }
}

/// The network namespaces of this machine that have names. Without `ip` there are none.
fn namespaces() -> Vec<String> {
    let listed = ip("netns list").unwrap_or_default();
    let names = listed
        .lines()
        .filter_map(|line| line.split_whitespace().next());
    names.map(str::to_owned).collect()
}

/// Whether the process that has made a namespace does not exist any more. Namespaces of other programs are not ours to judge.
fn is_abandoned(name: &str) -> bool {
    maker(name).is_some_and(|pid| !Path::new(&format!("/proc/{pid}")).exists())
}

/// Waits for the exit of all processes in these namespaces, which have received SIGTERM when their play was killed, and
/// kills those that stay.
fn end_processes(namespaces: &[String]) {
    let begun = Instant::now();
    loop {
        let mut left = Vec::new();
        for name in namespaces {
            left.extend(processes_in(name));
        }
        if left.is_empty() {
            return;
        }

        if begun.elapsed() > END_PATIENCE {
            for process in left {
                let _exited_already = kill(process, Signal::SIGKILL);
            }
            return;
        }
        std::thread::sleep(LOOK_AGAIN);
    }
}

/// The processes in a namespace.
fn processes_in(namespace: &str) -> Vec<Pid> {
    let listed = ip(&format!("netns pids {namespace}")).unwrap_or_default();
    let pids = listed.lines().filter_map(|line| line.trim().parse().ok());
    pids.map(Pid::from_raw).collect()
}

/// The id of the process that has made a namespace; `None` for namespaces of other programs.
fn maker(name: &str) -> Option<u32> {
    let (pid, _) = name.strip_prefix(PREFIX)?.split_once('-')?;
    pid.parse().ok()
}

/// Runs `ip` with these arguments, separated by spaces; returns its output.
fn ip(args: &str) -> Result<String, String> {
    let output = Command::new("ip")
        .args(args.split(' '))
        .stdin(Stdio::null())
        .output()
        .map_err(|error| format!("ip {args}: {error}"))?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }

    let error = String::from_utf8_lossy(&output.stderr);
    Err(format!("ip {args}: {}", error.trim()))
}
