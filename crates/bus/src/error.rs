//! Errors of the bus.

use std::io::{Error, ErrorKind};

/// A failure of the bus itself.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// No session could be opened.
    #[error("cannot {doing} {endpoint}: {reason}")]
    Open {
        /// What was tried.
        doing: &'static str,
        /// The address tried.
        endpoint: String,
        /// The reason, from the middleware.
        reason: String,
    },
    /// An endpoint cannot be used, for this reason.
    #[error("{0}")]
    BadEndpoint(String),
    /// The access control of a configuration file is that of other runs.
    #[error(
        "the certificates in {file} are for run {admitted}, and this is run {run}: say --run {admitted}, or make others by \
         `cars secure init` with --run {run}, or without --run for any run"
    )]
    OtherRun {
        /// The configuration file.
        file: String,
        /// The run.
        run: String,
        /// The runs that it admits.
        admitted: String,
    },
    /// The file with a private key can be changed by others.
    #[error("{0}")]
    Unprotected(String),
    /// The system starts no further threads.
    #[error(
        "no thread can be started for the network: {0}; the limits of processes and threads (`ulimit -u`, pids.max of the \
         control group) are reached"
    )]
    NoThreads(std::io::Error),
    /// A simulator would be open to a network.
    #[error(
        "{0} can be reached from other machines, and every process that reaches it may control the run and pose as any robot; \
         either secure the run (`cars secure init` says how) and listen at tls/…, or say --insecure if you trust \
         every process that can reach it"
    )]
    Exposed(String),
    /// A client would connect to a secured run without a certificate.
    #[error(
        "{0} wants a certificate: name a file zenoh.json5 that `cars secure init` made, by --zenoh-config or \
         CARS_ZENOH_CONFIG"
    )]
    NoCertificate(String),
    /// A configuration with access control does not fit a listener without certificates.
    #[error(
        "{0} is not encrypted, so no client can present a certificate there: a secured run listens at tls/…"
    )]
    Unencrypted(String),
    /// A session that was open cannot do what was asked.
    #[error("bus: cannot {doing} {key}: {reason}")]
    Use {
        /// What was tried.
        doing: &'static str,
        /// The key concerned.
        key: String,
        /// The reason, from the middleware.
        reason: String,
    },
}

impl BusError {
    /// Whether nothing could listen at the address, because another socket of this machine has it.
    #[must_use]
    pub fn is_address_taken(&self) -> bool {
        let Self::Open { reason, .. } = self else {
            return false;
        };
        os_errors(reason).any(|kind| kind == ErrorKind::AddrInUse)
    }
}

/// The errors of the operating system that a text of the middleware names, which has its reasons as texts only.
fn os_errors(text: &str) -> impl Iterator<Item = ErrorKind> {
    let after = text.split("(os error ").skip(1);
    let numbers = after.filter_map(|rest| rest.split_once(')')?.0.parse().ok());
    numbers.map(|number| Error::from_raw_os_error(number).kind())
}
