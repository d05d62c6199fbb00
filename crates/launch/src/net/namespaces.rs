//! Links that are the kernel's own: each process in a network namespace, all of them cabled to a switch in one more, and a
//! link is cut by taking the switch's port down, which is what pulling the cable does. Nothing outside can reach them.
//!
//! ```text
//!   simulator and launcher   Butler     Leguin
//!       10.77.0.1          10.77.0.2   10.77.0.3     eth0 of each
//!          |                   |           |
//!          p0                  p1          p2        ports of the switch
//! ```

use std::path::Path;
use std::process::{Command, Stdio};

use miette::{IntoDiagnostic, WrapErr, miette};

use super::links::{Links, Start};
use super::shape::{Flow, Shape};
use crate::file::Process;
use crate::link::Link;

/// First part of the names of all namespaces made here; the id of the process that made them follows.
const PREFIX: &str = "cars-";
/// Network of the hosts. It exists in the namespaces only.
const NETWORK: &str = "10.77.0";
const PORT: u16 = 7447;
/// Most processes that find an address.
const MAX_PROCESSES: usize = 250;
/// Milliseconds between two queries of a host for another one's hardware address. The kernel's second would be most of
/// the time that a healed link takes to be used again.
const ASK_FOR_ADDRESS_AGAIN_MS: &str = "100";

const NO_CONSOLE: &str = "--no-console";

/// Namespaces of a launch: the simulator's, one for each process, and the switch.
#[derive(Debug)]
pub(super) struct Namespaces {
    prefix: String,
    processes: Vec<String>,
}

impl Namespaces {
    pub(super) fn new(processes: &[Process]) -> miette::Result<Self> {
        if processes.len() > MAX_PROCESSES {
            return Err(miette!(
                "more than {MAX_PROCESSES} processes do not fit into one network"
            ));
        }

        remove_abandoned();
        let processes = processes
            .iter()
            .map(|process| process.name.clone())
            .collect();

        // From here on whatever was made is removed, also if the rest cannot be made.
        let namespaces = Self {
            prefix: format!("{PREFIX}{}-", std::process::id()),
            processes,
        };
        namespaces.make().map_err(|error| {
            miette!(
                help = "network namespaces need root and `ip` (Debian: apt install iproute2)",
                "{error}"
            )
        })?;

        Ok(namespaces)
    }

    fn make(&self) -> Result<(), String> {
        let switch = self.switch();
        ip(&["netns", "add", &switch])?;
        ip(&[
            "-n",
            &switch,
            "link",
            "add",
            "name",
            "hub",
            "type",
            "bridge",
            "forward_delay",
            "0",
        ])?;

        ip(&["-n", &switch, "link", "set", "hub", "up"])?;

        (0..=self.processes.len()).try_for_each(|index| self.cable(&switch, index))
    }

    /// A host, and its cable to the switch.
    fn cable(&self, switch: &str, index: usize) -> Result<(), String> {
        let (host, port) = (self.host(index), port(index));
        ip(&["netns", "add", &host])?;
        ip(&["-n", &host, "link", "set", "lo", "up"])?;
        ip(&[
            "-n", switch, "link", "add", &port, "type", "veth", "peer", "name", "eth0", "netns",
            &host,
        ])?;
        ip(&["-n", switch, "link", "set", &port, "master", "hub", "up"])?;
        ip(&[
            "-n",
            &host,
            "addr",
            "add",
            &format!("{}/24", address(index)),
            "dev",
            "eth0",
        ])?;

        ip(&["-n", &host, "link", "set", "eth0", "up"])?;
        let retrans = ["retrans", ASK_FOR_ADDRESS_AGAIN_MS];

        ip(&[
            ["-n", &host, "ntable", "change"].as_slice(),
            &["name", "arp_cache", "dev", "eth0"],
            &retrans,
        ]
        .concat())
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
        let hosts = (0..=self.processes.len()).map(|index| self.host(index));
        for namespace in hosts.chain([self.switch()]) {
            // One that was never made cannot be removed.
            if let Err(error) = ip(&["netns", "del", &namespace]) {
                tracing::debug!("{error}");
            }
        }
    }
}

impl Links for Namespaces {
    fn command(&self, start: &Start) -> miette::Result<Command> {
        let endpoint = format!("tcp/{}:{PORT}", address(0));
        let link = |(index, process): (usize, &String)| Link {
            process: process.clone(),
            endpoint: endpoint.clone(),
            namespace: Some(self.host(index + 1)),
        };
        let links: Vec<Link> = self.processes.iter().enumerate().map(link).collect();
        let own = std::env::current_exe()
            .into_diagnostic()
            .wrap_err("where this program is")?;
        let mut command = Command::new("ip");
        command
            .args(["netns", "exec", &self.host(0)])
            .arg(own)
            .args(start.args(&links));

        // Nobody else is in this network.
        command
            .arg(format!("--listen={endpoint}"))
            .arg("--insecure");

        if !start.more.iter().any(|arg| arg == NO_CONSOLE) {
            // A browser would not reach it there.
            command.arg(NO_CONSOLE);
        }

        Ok(command)
    }

    fn set(&mut self, process: &str, shape: Shape) -> miette::Result<()> {
        let index = self.processes.iter().position(|name| name == process);
        let index = index.ok_or_else(|| miette!("no link of {process}"))?;
        let state = if shape.flow == Flow::Open {
            "up"
        } else {
            "down"
        };
        ip(&["-n", &self.switch(), "link", "set", &port(index + 1), state])
            .map_err(|error| miette!("{error}"))
    }
}

fn port(index: usize) -> String {
    format!("p{index}")
}

fn address(index: usize) -> String {
    format!("{NETWORK}.{}", index + 1)
}

/// Namespaces whose maker was killed before it could remove them.
fn remove_abandoned() {
    let listed = Command::new("ip")
        .args(["netns", "list"])
        .output()
        .map(|output| output.stdout);
    let listed = String::from_utf8_lossy(&listed.unwrap_or_default()).into_owned();
    let maker = |name: &str| {
        name.strip_prefix(PREFIX)?
            .split_once('-')?
            .0
            .parse::<u32>()
            .ok()
    };

    for name in listed
        .lines()
        .filter_map(|line| line.split_whitespace().next())
    {
        let is_abandoned =
            maker(name).is_some_and(|pid| !Path::new(&format!("/proc/{pid}")).exists());
        if is_abandoned && let Err(error) = ip(&["netns", "del", name]) {
            tracing::warn!("{error}");
        }
    }
}

fn ip(args: &[&str]) -> Result<(), String> {
    let said = format!("ip {}", args.join(" "));
    let output = Command::new("ip").args(args).stdin(Stdio::null()).output();
    let output = output.map_err(|error| format!("{said}: {error}"))?;
    if output.status.success() {
        return Ok(());
    }

    Err(format!(
        "{said}: {}",
        String::from_utf8_lossy(&output.stderr).trim()
    ))
}
