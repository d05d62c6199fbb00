//! What happens in one launch, drawn from its seed alone.

use std::time::Duration;

use protocol::messages::OnLate;
use protocol::random::{Stream, stream, unit};

/// Faults of one launch.
const FAULTS: usize = 8;
/// Numbers of robots.
const ROBOTS: [usize; 4] = [2, 5, 9, 16];
/// Kills of one robot in one launch: fewer than make the launcher give up a program as broken.
const MAX_KILLS: usize = 4;

/// One thing that goes wrong. Robots are given by index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fault {
    /// The process of a robot is killed, and restarted by the launcher.
    Kill(usize),
    /// The process of a robot is stopped for this long.
    Stop(usize, Duration),
    /// The link of a robot is cut for this long, while further faults happen.
    Cut(usize, Duration),
    /// The simulator can open no further file and accept no further connection for this long.
    Starve(Duration),
    /// A rogue client floods the run, while further faults happen.
    Flood(Flood),
}

/// What a rogue client floods the run with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Flood {
    /// Messages that cannot be decoded.
    Rubbish,
    /// Messages of the run that were put before.
    Stale,
    /// Well-formed messages that no participant puts.
    Forged,
    /// Connections that send nothing.
    Silent,
}

impl Fault {
    /// Its kind, as the test counts it.
    pub(super) fn kind(self) -> &'static str {
        match self {
            Self::Kill(_) => "kill",
            Self::Stop(..) => "stop",
            Self::Cut(..) => "cut",
            Self::Starve(_) => "no file descriptors",
            Self::Flood(Flood::Rubbish) => "flood of rubbish",
            Self::Flood(Flood::Stale) => "flood of stale messages",
            Self::Flood(Flood::Forged) => "flood of forged messages",
            Self::Flood(Flood::Silent) => "flood of silent connections",
        }
    }
}

/// One launch and its faults.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub(super) seed: u64,
    pub(super) robots: usize,
    pub(super) on_late: OnLate,
    pub(super) is_secured: bool,
    pub(super) faults: Vec<Fault>,
}

impl Plan {
    /// The plan of this seed.
    pub(super) fn draw(seed: u64) -> Self {
        let mut chance = stream(seed, "nemesis");
        let robots = ROBOTS[below(&mut chance, ROBOTS.len())];
        let waits = below(&mut chance, 2) == 0;
        let is_secured = below(&mut chance, 2) == 0;

        let mut kills = vec![0; robots];
        let mut faults = Vec::new();
        while faults.len() < FAULTS {
            let fault = draw_fault(&mut chance, robots);
            if let Fault::Kill(robot) = fault {
                // A further incarnation draws other numbers, so its run is another one than without the kill.
                if waits || kills[robot] == MAX_KILLS {
                    continue;
                }
                kills[robot] += 1;
            }
            faults.push(fault);
        }

        Self {
            seed,
            robots,
            on_late: if waits {
                OnLate::Wait
            } else {
                OnLate::Continue
            },
            is_secured,
            faults,
        }
    }

    /// Whether the clock waits for late robots.
    pub(super) fn waits(&self) -> bool {
        self.on_late == OnLate::Wait
    }

    /// Whether the run is secured, as the test counts it.
    pub(super) fn security(&self) -> &'static str {
        if self.is_secured { "secured" } else { "plain" }
    }
}

fn draw_fault(chance: &mut Stream, robots: usize) -> Fault {
    let robot = below(chance, robots);

    match below(chance, 5) {
        0 => Fault::Kill(robot),
        1 => Fault::Stop(robot, milliseconds(chance, 500, 500)),
        // Shorter and longer than the lease of a link.
        2 => Fault::Cut(robot, milliseconds(chance, 500, 4000)),
        3 => Fault::Starve(milliseconds(chance, 500, 2000)),
        _ => Fault::Flood(match below(chance, 4) {
            0 => Flood::Rubbish,
            1 => Flood::Stale,
            2 => Flood::Forged,
            _ => Flood::Silent,
        }),
    }
}

/// A number from 0 to `n - 1`.
pub(super) fn below(chance: &mut Stream, n: usize) -> usize {
    (unit(chance) * n as f64) as usize
}

/// A time of at least `least` milliseconds and less than `range` more.
pub(super) fn milliseconds(chance: &mut Stream, least: u64, range: usize) -> Duration {
    Duration::from_millis(least + below(chance, range) as u64)
}
