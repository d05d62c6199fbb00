//! Hosts in network namespaces, and whether this machine permits them.

use std::path::Path;
use std::process::Command;

use crate::tools::{lacks_tool, skip};

/// Runs a command of `ip`.
///
/// # Errors
/// The error output of the command.
pub fn ip(args: &[&str]) -> Result<(), String> {
    let output = Command::new("ip")
        .args(args)
        .output()
        .map_err(|error| error.to_string())?;
    if output.status.success() {
        return Ok(());
    }

    let error = String::from_utf8_lossy(&output.stderr);
    Err(format!("ip {}: {}", args.join(" "), error.trim()))
}

/// Whether namespaces with veth pairs can be made here. If not, the test is reported as skipped.
#[must_use]
pub fn has_namespaces(test: &str) -> bool {
    if Command::new("ip").arg("-V").output().is_err() {
        lacks_tool(test, "there is no `ip` here (Debian: apt install iproute2)");
        return false;
    }

    let probe = format!("carsprobe{}-{test}", std::process::id());
    let cable = [
        "-n", &probe, "link", "add", "name", "a", "type", "veth", "peer", "name", "b",
    ];
    let made = ip(&["netns", "add", &probe]).and_then(|()| ip(&cable));
    let _was_not_made = ip(&["netns", "del", &probe]);

    // A missing privilege is not a missing tool, so it is not a failure.
    if let Err(error) = made {
        let reason = format!("network namespaces are not permitted here (as root?): {error}");
        skip(test, &reason);
        return false;
    }
    true
}

/// The namespaces that a process of `cars net play` has made.
#[must_use]
pub fn namespaces_of(pid: u32) -> Vec<String> {
    let prefix = format!("cars-{pid}-");
    let entries = std::fs::read_dir("/run/netns").into_iter().flatten();
    let names = entries.flatten().map(|entry| entry.file_name());
    let names = names.map(|name| name.to_string_lossy().into_owned());
    names.filter(|name| name.starts_with(&prefix)).collect()
}

/// Hosts in a row, each connected to the next: host `i` is 10.78.i.1 towards the next and 10.78.(i-1).2 towards the one
/// before. The hosts do not forward packets, so only a process on a host can forward messages.
#[derive(Debug)]
pub struct Row {
    names: Vec<String>,
}

impl Row {
    /// Makes them.
    #[must_use]
    pub fn new(test: &str, hosts: usize) -> Self {
        let mut names = Vec::new();
        for host in 0..hosts {
            names.push(format!("carstest{}-{test}-{host}", std::process::id()));
        }
        let row = Self { names };
        for (i, host) in row.names.iter().enumerate() {
            ip(&["netns", "add", host]).expect("a namespace");
            ip(&["-n", host, "link", "set", "lo", "up"]).expect("loopback");
            if let Some(before) = i.checked_sub(1) {
                row.cable(before, i);
            }
        }

        row
    }

    fn cable(&self, a: usize, b: usize) {
        let left = &self.names[a];
        let right = &self.names[b];
        let ends = [
            "name", "next", "type", "veth", "peer", "name", "before", "netns", right,
        ];
        ip(&[["-n", left, "link", "add"].as_slice(), &ends].concat()).expect("a cable");

        for (host, end, number) in [(left, "next", 1), (right, "before", 2)] {
            let address = format!("10.78.{a}.{number}/24");
            ip(&["-n", host, "addr", "add", &address, "dev", end]).expect("an address");
            ip(&["-n", host, "link", "set", end, "up"]).expect("the cable is plugged in");
        }
    }

    /// A program on a host.
    #[must_use]
    pub fn on(&self, host: usize, program: &Path) -> Command {
        let mut command = Command::new("ip");
        command
            .args(["netns", "exec", &self.names[host]])
            .arg(program);
        command
    }
}

impl Drop for Row {
    fn drop(&mut self) {
        for name in &self.names {
            if let Err(error) = ip(&["netns", "del", name]) {
                skip("removing namespaces", &error);
            }
        }
    }
}
