//! The subjects of the benchmark, and the floor that each is compared with.

/// Number of robots in the crowd of Butlers and Leguins.
pub(crate) const CROWD: usize = 64;
/// Number of processes of the raw TCP barrier.
const TCP_PROCESSES: usize = 2;

/// A barrier that is measured in ticks per second.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Subject {
    /// One write and one read over TCP for each process and tick.
    Tcp { processes: usize },
    /// One put in each direction over zenoh for each client and tick.
    Star { clients: usize, content: Content },
    /// The lock-step with idle robots, a process each.
    Lockstep { robots: usize },
    /// Butlers and Leguins in pairs, a process each.
    Crowd { robots: usize },
    /// The hall of the paper.
    Hall { robots: usize, place: HallPlace },
}

/// What a star exchanges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Content {
    /// Bytes that are not looked at.
    Bytes,
    /// Clocks and reports of the protocol.
    Messages,
}

impl std::fmt::Display for Content {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Bytes => "bytes",
            Self::Messages => "messages",
        })
    }
}

/// Where the robots of the hall run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum HallPlace {
    Processes,
    OneProcess,
}

impl std::fmt::Display for Subject {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Tcp { processes } => write!(f, "raw TCP barrier, {processes} processes"),
            Self::Star {
                clients,
                content: Content::Bytes,
            } => write!(f, "zenoh star, {clients} clients"),
            Self::Star {
                clients,
                content: Content::Messages,
            } => write!(f, "zenoh star with messages, {clients} clients"),
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
    /// The bare zenoh star with as many processes: no lock-step over zenoh is faster on the same machine. The hall in one
    /// process has no floor, because nothing crosses a process boundary.
    pub(crate) fn floor(self) -> Option<Self> {
        match self {
            Self::Lockstep { robots }
            | Self::Crowd { robots }
            | Self::Hall {
                robots,
                place: HallPlace::Processes,
            } => Some(Self::star(robots, Content::Bytes)),
            Self::Star {
                clients,
                content: Content::Messages,
            } => Some(Self::star(clients, Content::Bytes)),
            Self::Tcp { .. } | Self::Star { .. } | Self::Hall { .. } => None,
        }
    }

    /// The zenoh star that encodes and decodes as many messages of the protocol, for the bare lock-step: what is missing to it is
    /// what the simulator and the robots do.
    pub(crate) fn message_floor(self) -> Option<Self> {
        match self {
            Self::Lockstep { robots } => Some(Self::star(robots, Content::Messages)),
            Self::Tcp { .. } | Self::Star { .. } | Self::Crowd { .. } | Self::Hall { .. } => None,
        }
    }

    fn star(clients: usize, content: Content) -> Self {
        Self::Star { clients, content }
    }

    /// The raw TCP barrier, for subjects with two processes.
    pub(crate) fn second_floor(self) -> Option<Self> {
        let has_two = match self {
            Self::Star { clients, .. } => clients == TCP_PROCESSES,
            Self::Tcp { .. } => false,
            Self::Lockstep { .. } | Self::Crowd { .. } | Self::Hall { .. } => {
                let star = self.floor();
                star.is_some_and(|star| star.second_floor().is_some())
            }
        };

        has_two.then_some(Self::Tcp {
            processes: TCP_PROCESSES,
        })
    }

    /// Whether the programs of the project run in it, so that builds can be compared.
    pub(crate) fn runs_the_project(self) -> bool {
        !matches!(self, Self::Tcp { .. } | Self::Star { .. })
    }
}
