//! Hosts that are network namespaces, and the query whether there can be any here.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Output};

/// Says why a test is not done, where everybody sees it: the test harness hides what a test that passes prints.
pub fn skip(test: &str, reason: &str) {
    let _unseen = writeln!(std::io::stderr(), "\nSKIPPED {test}: {reason}\n");
}

/// Skips for want of a tool: on a machine of the project's own (environment variable `CI`) that is a failure.
pub fn lacks_tool(test: &str, what: &str) {
    assert!(std::env::var_os("CI").is_none(), "{test}: {what}");
    skip(test, what);
}

/// Runs a command of `ip`.
///
/// # Errors
/// What it says.
pub fn ip(args: &[&str]) -> Result<(), String> {
    let output = Command::new("ip")
        .args(args)
        .output()
        .map_err(|error| error.to_string())?;
    said(&output).map_err(|error| format!("ip {}: {error}", args.join(" ")))
}

fn said(output: &Output) -> Result<(), String> {
    let error = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    if output.status.success() {
        Ok(())
    } else {
        Err(error)
    }
}

/// Whether namespaces with cables between them can be made here; if not, says why.
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

    // One that could not be made cannot be removed.
    let _made_or_not = ip(&["netns", "del", &probe]);

    match made {
        Ok(()) => true,
        // A right that is missing is nothing that can be installed.
        Err(error) => {
            skip(
                test,
                &format!("network namespaces are not permitted here (as root?): {error}"),
            );
            false
        }
    }
}

/// The namespaces that a process of `cars net play` has made.
#[must_use]
pub fn namespaces_of(pid: u32) -> Vec<String> {
    let names = std::fs::read_dir("/run/netns")
        .into_iter()
        .flatten()
        .flatten();
    let names = names.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names
        .filter(|name| name.starts_with(&format!("cars-{pid}-")))
        .collect()
}

/// Hosts in a row, each cabled to the next: host `i` is 10.78.i.1 towards the next and 10.78.(i-1).2 towards the one
/// before. None forwards packets: who wants to pass one must speak to a process there.
#[derive(Debug)]
pub struct Row {
    names: Vec<String>,
}

impl Row {
    /// Makes them.
    #[must_use]
    pub fn new(test: &str, hosts: usize) -> Self {
        let name = |i| format!("carstest{}-{test}-{i}", std::process::id());
        let row = Self {
            names: (0..hosts).map(name).collect(),
        };
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
        let (left, right) = (&self.names[a], &self.names[b]);
        let ends = [
            "name", "next", "type", "veth", "peer", "name", "before", "netns", right,
        ];
        ip(&[["-n", left, "link", "add"].as_slice(), &ends].concat()).expect("a cable");

        for (host, end, number) in [(left, "next", 1), (right, "before", 2)] {
            ip(&[
                "-n",
                host,
                "addr",
                "add",
                &format!("10.78.{a}.{number}/24"),
                "dev",
                end,
            ])
            .expect("an address");
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
