//! Indirect links of processes to the simulator: through a proxy, or from within a network namespace.

use std::path::PathBuf;
use std::str::FromStr;

use config::FileError;

use super::plan::{Part, Planned};

/// The link of one process to the simulator: `PROCESS=ENDPOINT[@NAMESPACE]`.
#[derive(Debug, Clone, PartialEq)]
pub struct ProcessLink {
    /// Name of the process in the launch file.
    pub process: String,
    /// Endpoint to which it connects, for example `tcp/127.0.0.1:7500`.
    pub endpoint: String,
    /// Network namespace in which it runs, by its name for `ip netns`.
    pub namespace: Option<String>,
}

/// A text is not a link.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not of the form PROCESS=ENDPOINT[@NAMESPACE]")]
pub struct LinkError(String);

impl FromStr for ProcessLink {
    type Err = LinkError;

    fn from_str(text: &str) -> Result<Self, LinkError> {
        let (process, rest) = text
            .split_once('=')
            .ok_or_else(|| LinkError(text.to_owned()))?;
        let (endpoint, namespace) = match rest.split_once('@') {
            Some((endpoint, namespace)) => (endpoint, Some(namespace)),
            None => (rest, None),
        };

        if process.is_empty() || endpoint.is_empty() || namespace.is_some_and(str::is_empty) {
            return Err(LinkError(text.to_owned()));
        }
        Ok(Self {
            process: process.to_owned(),
            endpoint: endpoint.to_owned(),
            namespace: namespace.map(str::to_owned),
        })
    }
}

impl std::fmt::Display for ProcessLink {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.process, self.endpoint)?;
        match &self.namespace {
            Some(namespace) => write!(f, "@{namespace}"),
            None => Ok(()),
        }
    }
}

impl ProcessLink {
    /// Changes the command line of the process so that it uses this link.
    pub(super) fn apply(&self, planned: &mut [Planned]) -> Result<(), FileError> {
        let name = &self.process;
        let mut processes = planned.iter_mut();
        let found = processes
            .find(|planned| planned.part != Part::Simulator && planned.name == *name)
            .ok_or_else(|| {
                let text = format!("--link {self}: the launch file has no process {name}");
                FileError::new(text).with_help("a link names a process of the launch file")
            })?;

        let command = &mut found.command;
        let endpoint = self.endpoint.clone();
        command.env.insert("CARS_CONNECT".to_owned(), endpoint);

        if let Some(namespace) = &self.namespace {
            let program = std::mem::replace(&mut command.program, PathBuf::from("ip"));
            let program = program.display().to_string();
            let prefix = ["netns", "exec", namespace, &program].map(str::to_owned);
            command.args.splice(0..0, prefix);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_read_as_it_is_written() {
        for text in [
            "Leguin=tcp/127.0.0.1:7500",
            "Leguin=tcp/10.77.0.1:7447@cars-1-l0",
        ] {
            assert_eq!(text.parse::<ProcessLink>().unwrap().to_string(), text);
        }
        for text in ["Leguin", "=tcp/1:1", "Leguin=", "Leguin=tcp/1:1@"] {
            assert!(text.parse::<ProcessLink>().is_err(), "{text:?}");
        }
    }
}
