//! Set-up of a program's log.

use tracing_subscriber::EnvFilter;

/// The filter of programs that show warnings, but not those of the middleware.
pub const WARNINGS: &str = "warn,zenoh=error";

/// Writes the log of this process to its standard error. `RUST_LOG` replaces `filter`; `shows_targets` is whether each line
/// names the module that it comes from. To be called once.
pub fn init(filter: &str, shows_targets: bool) {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| filter.into());

    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(shows_targets)
        .init();
}
