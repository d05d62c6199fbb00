//! Sizes and lengths that all measurements share.

use std::path::Path;

use scenario::Scenario;

/// Size of the clock in the star and in the TCP barrier, bytes; about as long as a real one.
pub(crate) const CLOCK_BYTES: usize = 64;
/// Size of the report in the star and in the TCP barrier, bytes; about as long as a real one.
pub(crate) const REPORT_BYTES: usize = 300;
/// Fewest ticks of one measurement: a shorter one would measure start and end of the processes as well.
const MIN_TICKS: u64 = 300;

/// The hall, the length of a measurement, and a folder for its files.
pub(crate) struct Workload<'a> {
    /// Scenario file of the hall.
    pub(crate) hall_file: &'a Path,
    /// The same scenario, as this build reads it.
    pub(crate) hall: Scenario,
    /// Ticks of a measurement with two processes.
    pub(crate) ticks: u64,
    /// Whether runs are secured with certificates.
    pub(crate) is_secured: bool,
    /// Folder for scenarios and runs, removed after the last measurement.
    pub(crate) scratch: &'a Path,
}

impl Workload<'_> {
    /// Ticks of a measurement with this number of processes. The product is constant, so all measurements take about as
    /// long.
    pub(crate) fn ticks_with(&self, processes: usize) -> u64 {
        (2 * self.ticks / processes as u64).max(MIN_TICKS)
    }
}
