//! The kit: a router session of its own, the robot's command, and what was learned of the robot so far.

use std::collections::BTreeMap;
use std::net::TcpListener;
use std::ops::Deref;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use bus::{Bus, BusError, Declared, Role as BusRole};
use protocol::messages::{JoinRequest, Point, SensedLayer, SensedRow, Welcome};
use protocol::{PROTOCOL_VERSION, RobotName, RunName};

use crate::process;
use crate::report::KitPart;
use crate::setting::{CheckSetting, RosterRobot};
use crate::stdio::StdioReports;
use crate::transcript::Transcript;

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

/// The robots of which a run's roster consists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KitRoster {
    /// Those of the setting.
    Usual,
    /// Those and as many more as make two others than the robot.
    InRun,
    /// Those and so many more that the robot has the highest flag, with names of all kinds.
    Crowd,
    /// The robot only.
    Alone,
}

/// A router session, a command, and what was learned, for the checks of one part.
pub struct Kit {
    shared: Arc<SharedKit>,
    part: KitPart,
}

/// What all parts share.
pub struct SharedKit {
    /// The router session.
    pub bus: Bus,
    /// A queryable in a session of its own, which replies at once.
    _control: Declared,
    /// Where the robot connects.
    pub endpoint: String,
    /// What starts the robot.
    pub command: Command,
    /// What the robot finds.
    pub setting: CheckSetting,
    runs: AtomicUsize,
    /// What `cars exec` has reported of the robot's processes.
    pub stdio: StdioReports,
    learned: OnceLock<Learned>,
    usual: OnceLock<Transcript>,
    usual_rejoined: OnceLock<Transcript>,
    /// Whether the same ticks gave the same reports, so that differences mean something.
    pub is_deterministic: OnceLock<bool>,
}

/// What the first request to join contained.
struct Learned {
    request: JoinRequest,
    fake_peers: BTreeMap<RobotName, RosterRobot>,
    /// The same for the part in a run: at least two others.
    in_run: BTreeMap<RobotName, RosterRobot>,
}

/// Attempts to find a free port before giving up.
const ATTEMPTS: usize = 8;
/// How long the kit's second session tries to reach the first one.
const OWN_PATIENCE: Duration = Duration::from_secs(20);

impl Kit {
    /// Opens the kit's sessions. Nothing is started yet.
    pub fn open(command: &Command, setting: &CheckSetting) -> Result<Self, CannotRun> {
        let (bus, endpoint) = open_router()?;
        let mut own = process::copy(command);
        // The robot connects to this kit only.
        own.env_remove("CARS_ZENOH_CONFIG");

        let shared = SharedKit {
            _control: declare_control(&endpoint)?,
            bus,
            endpoint,
            command: own,
            setting: setting.clone(),
            runs: AtomicUsize::new(0),
            stdio: StdioReports::default(),
            learned: OnceLock::new(),
            usual: OnceLock::new(),
            usual_rejoined: OnceLock::new(),
            is_deterministic: OnceLock::new(),
        };
        Ok(Self {
            shared: Arc::new(shared),
            part: KitPart::Alone,
        })
    }

    /// The same kit, for the checks of a part.
    pub fn of_part(&self, part: KitPart) -> Self {
        Self {
            shared: Arc::clone(&self.shared),
            part,
        }
    }

    /// The part whose checks it is for.
    pub fn part(&self) -> KitPart {
        self.part
    }

    /// The usual ticks, as the robot goes through them in this part without any disturbance; set when the part begins.
    pub fn usual(&self) -> &OnceLock<Transcript> {
        match self.part {
            KitPart::Rejoined => &self.shared.usual_rejoined,
            KitPart::Alone | KitPart::LaterEpoch | KitPart::InRun => &self.shared.usual,
        }
    }
}

impl Deref for Kit {
    type Target = SharedKit;

    fn deref(&self) -> &SharedKit {
        &self.shared
    }
}

impl SharedKit {
    /// The key of the kit's own queryable: a query there takes as long as this machine makes any query take.
    pub fn control_key(&self) -> String {
        control_key()
    }

    /// A name for a run that no other has.
    pub fn next_run(&self) -> RunName {
        let number = self.runs.fetch_add(1, Ordering::Relaxed);
        RunName::new(&format!("conform-{}-{number}", std::process::id()))
            .unwrap_or_else(|error| unreachable!("letters and digits are a name: {error}"))
    }

    /// The first request to join names the robot.
    pub fn learn(&self, request: &JoinRequest) -> Result<(), CannotRun> {
        let fake_peers = self
            .setting
            .cast_for(&request.name)
            .map_err(CannotRun::Robot)?;
        let learned = Learned {
            request: request.clone(),
            in_run: self.setting.with_others(&fake_peers),
            fake_peers,
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
    pub fn first_instance(&self) -> &str {
        &self.learned().request.instance
    }

    /// The robot that is checked.
    pub fn subject(&self) -> RobotName {
        self.learned().request.name.clone()
    }

    /// What the robot is written with, as it states.
    pub fn sdk(&self) -> String {
        self.learned().request.sdk.clone()
    }

    fn robots(&self, learned: &Learned, roster: KitRoster) -> BTreeMap<RobotName, RosterRobot> {
        let name = &learned.request.name;
        match roster {
            KitRoster::Crowd => self.setting.with_crowd(&learned.fake_peers, name),
            KitRoster::Alone => {
                let mut robots = learned.fake_peers.clone();
                robots.retain(|robot, _| robot == name);
                robots
            }
            KitRoster::Usual => learned.fake_peers.clone(),
            KitRoster::InRun => learned.in_run.clone(),
        }
    }

    /// The robots that the kit plays.
    pub fn others(&self, roster: KitRoster) -> BTreeMap<RobotName, RosterRobot> {
        let learned = self.learned();
        let mut others = self.robots(learned, roster);
        others.remove(&learned.request.name);
        others
    }

    /// The sender of the robot's commands: the first of the others, or the operator.
    pub fn sender(&self) -> RobotName {
        self.others(KitRoster::Usual)
            .into_keys()
            .next()
            .unwrap_or_else(RobotName::operator)
    }

    /// Pairs of different commands: first those that the robot understands, as far as is known, then others. A robot that
    /// shows nothing of the one may show something of the other.
    pub fn pairs(&self) -> Vec<[String; 2]> {
        let role = self.learned().fake_peers.get(&self.subject());
        let own = role
            .map(|role| role.understands.clone())
            .unwrap_or_default();
        let unknown = ["hello".to_owned(), "goodbye".to_owned()];

        [&own[..], &self.setting.commands, &unknown]
            .into_iter()
            .filter_map(pair)
            .collect()
    }

    /// The first of these pairs.
    pub fn texts(&self) -> [String; 2] {
        self.pairs().into_iter().next().unwrap_or_default()
    }

    /// Whether its news list the bodies around it.
    pub fn wants_bodies(&self) -> bool {
        self.learned().request.bodies
    }

    /// Its heading at the start, if it drives.
    pub fn heading_rad(&self) -> f64 {
        let Some(learned) = self.learned.get() else {
            return 0.0;
        };
        let own = learned.fake_peers.get(&learned.request.name);
        own.map_or(0.0, |role| role.heading_rad)
    }

    /// The distances along its rays, if it asks for them and there are any: nothing is within their range.
    pub fn ranges_m(&self) -> Vec<f64> {
        match self.setting.rays {
            Some(rays) if self.learned().request.ranges => vec![rays.range_m; rays.count as usize],
            _ => Vec::new(),
        }
    }

    /// What it senses of layers where it stands.
    pub fn layers_at(&self, place: Point) -> Vec<SensedLayer> {
        let mut sensed = Vec::new();
        for layer in &self.setting.layers {
            sensed.push(SensedLayer {
                name: layer.name.clone(),
                cell_m: layer.cell_m,
                rows: vec![SensedRow {
                    row: (place.y / layer.cell_m) as u32,
                    column: (place.x / layer.cell_m) as u32,
                    values: vec![layer.value],
                }],
            });
        }
        sensed
    }

    /// What the robot is welcomed with at tick 0.
    pub fn template(&self, run: &RunName, roster: KitRoster) -> Welcome {
        let learned = self.learned.get();
        let name = learned.map_or_else(RobotName::operator, |learned| learned.request.name.clone());
        let fake_peers = learned
            .map(|learned| self.robots(learned, roster))
            .unwrap_or_default();
        let role = fake_peers.get(&name).cloned().unwrap_or_default();
        let setting = &self.setting;

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
            rays: setting.rays,
            drive: role.drive,
            location: role.location,
            roster: fake_peers.into_keys().collect(),
            known_sites: setting.known_sites.clone(),
            parameters: role.parameters,
            earlier_parameters: Vec::new(),
            reseeds: Vec::new(),
            later_parameters: Vec::new(),
            news_flag: 0,
            last_state: None,
            state_before: None,
        }
    }
}

/// The first two different texts of a list; where there is one only, a second one is made of it.
fn pair(texts: &[String]) -> Option<[String; 2]> {
    let one = texts.first()?;
    let other = texts.iter().find(|text| *text != one).cloned();
    Some([one.clone(), other.unwrap_or_else(|| format!("{one} again"))])
}

/// A router on a free port of this machine. Another program may take the port first: then another one is tried.
fn open_router() -> Result<(Bus, String), CannotRun> {
    let mut attempt = 0;
    loop {
        let port = TcpListener::bind("127.0.0.1:0")
            .and_then(|listener| listener.local_addr())
            .map_err(|error| CannotRun::Robot(format!("no free port on this machine: {error}")))?
            .port();
        let endpoint = format!("tcp/127.0.0.1:{port}");
        let role = BusRole::Router {
            listen: endpoint.clone(),
            trusts_network: false,
        };

        match Bus::open_patient(&role) {
            Ok(bus) => return Ok((bus, endpoint)),
            Err(error) if attempt == ATTEMPTS => return Err(error.into()),
            Err(_) => attempt += 1,
        }
    }
}

fn control_key() -> String {
    format!("conform/{}/control", std::process::id())
}

/// Declares a queryable that replies at once, in a session that is a client as the robot's.
fn declare_control(endpoint: &str) -> Result<Declared, BusError> {
    let role = BusRole::Client {
        connect: endpoint.to_owned(),
        patience: OWN_PATIENCE,
    };
    let bus = Bus::open_patient(&role)?;

    bus.clone().queryable(&control_key(), move |query| {
        query.reply(query.key(), b"{}".to_vec());
        // The session stays open as long as this declaration.
        let _session = &bus;
    })
}
