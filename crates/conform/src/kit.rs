//! The kit: a router session of its own, the robot's command, and what was learned of the robot so far.

use std::collections::BTreeMap;
use std::net::TcpListener;
use std::process::Command;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use bus::{Bus, BusError, Role as BusRole};
use protocol::messages::{JoinRequest, Welcome};
use protocol::{PROTOCOL_VERSION, RobotName, RunName};

use crate::report::{Outcome, Report, Verdict};
use crate::rules::{RULES, Rule};
use crate::script::Transcript;
use crate::setting::{Role, Setting};
use crate::{checks, process};

/// Why nothing could be checked.
#[derive(Debug, thiserror::Error)]
pub enum CannotRun {
    /// The kit could not open its own session.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The program did not get so far that there is something to check.
    #[error("{0}")]
    Robot(String),
}

/// A router session, a command, and what was learned.
pub(crate) struct Kit {
    pub(crate) bus: Bus,
    pub(crate) endpoint: String,
    pub(crate) command: Command,
    pub(crate) setting: Setting,
    runs: AtomicUsize,
    learned: OnceLock<Learned>,
    /// The usual ticks, without any disturbance.
    pub(crate) usual: OnceLock<Transcript>,
    /// Whether the same ticks gave the same reports, so that differences mean something.
    pub(crate) is_deterministic: OnceLock<bool>,
}

/// What the first request to join told.
struct Learned {
    request: JoinRequest,
    cast: BTreeMap<RobotName, Role>,
}

/// Attempts to find a free port before giving up.
const ATTEMPTS: usize = 8;
/// Processes of the robot that run at the same time.
const WORKERS: usize = 4;

/// Checks the robot that `command` starts: all rules, or those in `rules`.
///
/// # Errors
/// [`CannotRun`] if the command cannot be started, or the robot never asks to join.
pub fn check(command: &Command, setting: &Setting, rules: &[Rule]) -> Result<Report, CannotRun> {
    let kit = Kit::open(command, setting)?;
    let (mut verdicts, times) = checks::all(&kit, rules, WORKERS)?;
    let is_wanted = |rule: &Rule| rules.is_empty() || rules.contains(rule);
    let unchecked = || Verdict::Skipped {
        reason: "no check of it was run".to_owned(),
    };
    let outcomes = RULES.into_iter().filter(is_wanted).map(|rule| Outcome {
        rule,
        verdict: verdicts.remove(rule.name).unwrap_or_else(unchecked),
    });
    let outcomes = outcomes.collect();
    let sdk = kit
        .learned
        .get()
        .map(|learned| learned.request.sdk.clone())
        .unwrap_or_default();
    Ok(Report {
        name: kit.subject(),
        sdk,
        outcomes,
        answers: times,
    })
}

impl Kit {
    fn open(command: &Command, setting: &Setting) -> Result<Self, CannotRun> {
        let (bus, endpoint) = open_router()?;
        let mut own = process::copy(command);
        // The robot connects to this kit only.
        own.env_remove("CARS_ZENOH_CONFIG");
        let (runs, learned, usual) = (AtomicUsize::new(0), OnceLock::new(), OnceLock::new());
        let (setting, is_deterministic) = (setting.clone(), OnceLock::new());
        Ok(Self {
            bus,
            endpoint,
            command: own,
            setting,
            runs,
            learned,
            usual,
            is_deterministic,
        })
    }

    /// A name for a run that no other has.
    pub(crate) fn next_run(&self) -> RunName {
        let number = self.runs.fetch_add(1, Ordering::Relaxed);
        RunName::new(&format!("conform-{}-{number}", std::process::id()))
            .unwrap_or_else(|error| unreachable!("letters and digits are a name: {error}"))
    }

    /// The first request to join tells who the robot is.
    pub(crate) fn learn(&self, request: &JoinRequest) -> Result<(), CannotRun> {
        let cast = self
            .setting
            .cast_for(&request.name)
            .map_err(CannotRun::Robot)?;
        let learned = Learned {
            request: request.clone(),
            cast,
        };
        self.learned
            .set(learned)
            .unwrap_or_else(|_| unreachable!("a kit learns once"));
        Ok(())
    }

    fn learned(&self) -> &Learned {
        self.learned
            .get()
            .unwrap_or_else(|| unreachable!("the robot is known from its first request on"))
    }

    /// The instance that its first process claimed.
    pub(crate) fn first_instance(&self) -> &str {
        &self.learned().request.instance
    }

    /// The robot that is checked.
    pub(crate) fn subject(&self) -> RobotName {
        self.learned().request.name.clone()
    }

    /// The robots that the kit plays.
    pub(crate) fn others(&self) -> BTreeMap<RobotName, Role> {
        let learned = self.learned();
        let is_other = |(name, _): &(&RobotName, &Role)| **name != learned.request.name;
        learned
            .cast
            .iter()
            .filter(is_other)
            .map(|(name, role)| (name.clone(), role.clone()))
            .collect()
    }

    /// The sender of the robot's commands: the first of the others, or the operator.
    pub(crate) fn sender(&self) -> RobotName {
        self.others()
            .into_keys()
            .next()
            .unwrap_or_else(RobotName::operator)
    }

    /// Pairs of different commands: first those that the robot understands, as far as is known, then others. A robot that
    /// shows nothing of the one may show something of the other.
    pub(crate) fn pairs(&self) -> Vec<[String; 2]> {
        let role = self.learned().cast.get(&self.subject());
        let hears = role.map(|role| role.hears.clone()).unwrap_or_default();
        let unknown = ["hello".to_owned(), "goodbye".to_owned()];
        let pair = |texts: &[String]| {
            let one = texts.first()?;
            let other = texts.iter().find(|text| *text != one).cloned();
            Some([one.clone(), other.unwrap_or_else(|| format!("{one} again"))])
        };
        [&hears[..], &self.setting.commands, &unknown]
            .into_iter()
            .filter_map(pair)
            .collect()
    }

    /// The first of these pairs.
    pub(crate) fn texts(&self) -> [String; 2] {
        self.pairs().into_iter().next().unwrap_or_default()
    }

    /// Whether its news list the bodies around it.
    pub(crate) fn wants_bodies(&self) -> bool {
        self.learned().request.bodies
    }

    /// What the robot is welcomed with at tick 0.
    pub(crate) fn template(&self, run: &RunName) -> Welcome {
        let setting = &self.setting;
        let learned = self.learned.get();
        let name = learned.map_or_else(RobotName::operator, |learned| learned.request.name.clone());
        let cast = learned
            .map(|learned| learned.cast.clone())
            .unwrap_or_default();
        let role = cast.get(&name).cloned().unwrap_or_default();

        Welcome {
            protocol: PROTOCOL_VERSION,
            run: run.clone(),
            generation: 1,
            epoch: 1,
            tick: 0,
            seed: setting.seed,
            stream: format!("robot/{name}"),
            name,
            tick_s: setting.tick_s,
            field_m: setting.field_m,
            body_m: setting.body_m,
            sensing_range_m: setting.sensing_range_m,
            location: role.location,
            roster: cast.into_keys().collect(),
            parameters: role.parameters,
            news_flag: 0,
            last_state: None,
            state_before: None,
        }
    }
}

/// A router on a free port of this machine. Somebody else may take the port first: then another one is tried.
fn open_router() -> Result<(Bus, String), CannotRun> {
    let mut attempt = 0;
    loop {
        let port = TcpListener::bind("127.0.0.1:0")
            .and_then(|listener| listener.local_addr())
            .map_err(|error| CannotRun::Robot(format!("no free port on this machine: {error}")))?
            .port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        match Bus::open(
            &BusRole::Router {
                listen: endpoint.clone(),
                trusts_network: false,
            },
            None,
        ) {
            Ok(bus) => return Ok((bus, endpoint)),
            Err(error) if attempt == ATTEMPTS => return Err(error.into()),
            Err(_) => attempt += 1,
        }
    }
}
