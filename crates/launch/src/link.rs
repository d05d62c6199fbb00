//! How a process reaches the simulator, where that is not directly.

use std::path::PathBuf;
use std::str::FromStr;

use config::FileError;

use super::plan::{Part, Planned};

/// The way of one process to the simulator: `PROCESS=ENDPOINT[@NAMESPACE]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Link {
    /// Name of the process in the launch file.
    pub process: String,
    /// Where it connects, for example `tcp/127.0.0.1:7500`.
    pub endpoint: String,
    /// The network namespace that it lives in, as `ip netns` knows it.
    pub namespace: Option<String>,
}

/// A text is not a link.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is not of the form PROCESS=ENDPOINT[@NAMESPACE]")]
pub struct LinkError(String);

impl FromStr for Link {
    type Err = LinkError;

    fn from_str(text: &str) -> Result<Self, LinkError> {
        let bad = || LinkError(text.to_owned());
        let (process, rest) = text.split_once('=').ok_or_else(bad)?;
        let (endpoint, namespace) = rest
            .split_once('@')
            .map_or((rest, None), |(endpoint, name)| (endpoint, Some(name)));
        if process.is_empty() || endpoint.is_empty() || namespace.is_some_and(str::is_empty) {
            return Err(bad());
        }

        let namespace = namespace.map(str::to_owned);

        Ok(Self {
            process: process.to_owned(),
            endpoint: endpoint.to_owned(),
            namespace,
        })
    }
}

impl std::fmt::Display for Link {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.process, self.endpoint)?;
        self.namespace
            .iter()
            .try_for_each(|namespace| write!(f, "@{namespace}"))
    }
}

impl Link {
    /// Makes the process take this way.
    pub(super) fn lay(&self, planned: &mut [Planned]) -> Result<(), FileError> {
        let is_meant = |planned: &&mut Planned| {
            planned.part != Part::Simulator && planned.name == self.process
        };
        let Some(found) = planned.iter_mut().find(is_meant) else {
            let text = format!(
                "--link {self}: the launch file has no process {}",
                self.process
            );
            return Err(
                FileError::new(text).with_help("a link is that of a process of the launch file")
            );
        };

        let command = &mut found.command;
        command
            .env
            .insert("CARS_CONNECT".to_owned(), self.endpoint.clone());

        if let Some(namespace) = &self.namespace {
            let program = std::mem::replace(&mut command.program, PathBuf::from("ip"));
            let within = ["netns", "exec", namespace].map(str::to_owned);
            command.args.splice(
                0..0,
                within.into_iter().chain([program.display().to_string()]),
            );
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
            assert_eq!(text.parse::<Link>().unwrap().to_string(), text);
        }
        for text in ["Leguin", "=tcp/1:1", "Leguin=", "Leguin=tcp/1:1@"] {
            assert!(text.parse::<Link>().is_err(), "{text:?}");
        }
    }
}
