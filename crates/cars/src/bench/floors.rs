//! What is measured, and what each is compared with.

use super::programs::Programs;
use super::{Bench, lockstep, star, tcp};

/// Number of robots in the crowd of Butlers and Leguins.
pub(super) const CROWD: usize = 64;
/// Number of processes of the raw TCP barrier.
const TCP_PROCESSES: usize = 2;

/// Something with a barrier, measured in ticks per second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Subject {
    /// A barrier with nothing in it but TCP.
    Tcp { processes: usize },
    /// A barrier with nothing in it but zenoh.
    Star { clients: usize },
    /// The lock-step with robots that only answer, a process each.
    Lockstep { robots: usize },
    /// Butlers and Leguins in pairs, a process each.
    Crowd { robots: usize },
    /// The hall of the paper.
    Hall { robots: usize, place: HallPlace },
}

/// Where the robots of the hall run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum HallPlace {
    Processes,
    OneProcess,
}

impl std::fmt::Display for Subject {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Tcp { processes } => write!(f, "raw TCP barrier, {processes} processes"),
            Self::Star { clients } => write!(f, "zenoh star, {clients} clients"),
            Self::Lockstep { robots } => write!(f, "bare lock-step, {robots} robots"),
            Self::Crowd { robots } => write!(f, "Butlers and Leguins, {robots} robots"),
            Self::Hall { place, .. } => match place {
                HallPlace::Processes => f.write_str("the hall, as processes"),
                HallPlace::OneProcess => f.write_str("the hall, in one process"),
            },
        }
    }
}

impl Subject {
    /// What the same machine does at most, with as many processes. The hall in one process has no floor: nothing
    /// crosses a process boundary.
    pub(super) fn floor(self) -> Option<Self> {
        match self {
            Self::Lockstep { robots }
            | Self::Crowd { robots }
            | Self::Hall {
                robots,
                place: HallPlace::Processes,
            } => Some(Self::Star { clients: robots }),
            Self::Tcp { .. } | Self::Star { .. } | Self::Hall { .. } => None,
        }
    }

    /// What TCP does at most, for subjects with two robots.
    pub(super) fn second_floor(self) -> Option<Self> {
        let has_two = match self {
            Self::Star { clients } => clients == TCP_PROCESSES,
            Self::Tcp { .. } => false,
            _ => self
                .floor()
                .is_some_and(|star| star.second_floor().is_some()),
        };

        has_two.then_some(Self::Tcp {
            processes: TCP_PROCESSES,
        })
    }

    /// Whether it is measured with the project's programs, and so with each build.
    pub(super) fn is_of_the_project(self) -> bool {
        !matches!(self, Self::Tcp { .. } | Self::Star { .. })
    }

    /// Ticks per second, with these programs.
    pub(super) fn measure(self, bench: &Bench<'_>, programs: &Programs) -> miette::Result<f64> {
        match self {
            Self::Tcp { processes } => tcp::measure(processes, bench.ticks_with(processes)),
            Self::Star { clients } => star::measure(clients, bench.ticks_with(clients)),
            Self::Lockstep { robots } => lockstep::bare(bench, programs, robots),
            Self::Crowd { robots } => lockstep::crowd(bench, programs, robots),
            Self::Hall { place, .. } => match place {
                HallPlace::Processes => lockstep::hall(bench, programs),
                HallPlace::OneProcess => lockstep::hall_in_one_process(bench, programs),
            },
        }
    }
}
