//! One robot's process: its side of the lock-step, and the robot that it runs.

use std::collections::BTreeMap;
use std::sync::Arc;

use lockstep::{Begin, Participant, ParticipantOutput, StateQuery, Timeouts, Turn};
use protocol::messages::{CommandText, JoinRequest, PublicState, TickUpdate, Welcome};
use protocol::{PROTOCOL_VERSION, RobotName, RunName};
use robot::{PeerNetwork, Robot, Runner, TickResult, Undelivered};

pub(super) type Machine = Participant<TickUpdate, Arc<PublicState>, CommandText, Vec<u8>>;
pub(super) type MachineAction =
    ParticipantOutput<TickUpdate, Arc<PublicState>, CommandText, Vec<u8>>;

/// No timer ever fires.
const PATIENCE: Timeouts = Timeouts {
    join: std::time::Duration::MAX,
    gone: std::time::Duration::MAX,
};

pub(super) struct Process {
    pub(super) participant: Machine,
    pub(super) request: JoinRequest,
    /// The robot, until its first welcome.
    robot: Option<Box<dyn Robot>>,
    runner: Option<Runner>,
    /// The newest welcome, until the tick that follows.
    pub(super) welcome: Option<Welcome>,
}

/// The other robots' processes, as a robot queries them in a tick.
pub(super) struct Others<'a> {
    pub(super) processes: &'a BTreeMap<RobotName, Process>,
    pub(super) query: StateQuery,
}

impl PeerNetwork for Others<'_> {
    fn state_of(&mut self, target: &RobotName) -> Result<Arc<PublicState>, Undelivered> {
        let other = self.processes.get(target).ok_or(Undelivered::Lost)?;

        other
            .participant
            .query(self.query)
            .map_err(|_| Undelivered::Lost)
    }
}

impl Process {
    /// A process that begins to join. `instance` is a text that no other process of the run has.
    pub(super) fn new(
        run: &RunName,
        name: &RobotName,
        instance: &str,
        robot: Box<dyn Robot>,
        actions: &mut Vec<MachineAction>,
    ) -> Self {
        let request = JoinRequest {
            protocol: PROTOCOL_VERSION,
            run: run.clone(),
            name: name.clone(),
            instance: instance.to_owned(),
            bodies: robot.senses_bodies(),
            ranges: false,
            sdk: concat!("rust/", env!("CARGO_PKG_VERSION")).to_owned(),
        };

        Self {
            participant: Participant::new(PATIENCE, actions),
            request,
            robot: Some(robot),
            runner: None,
            welcome: None,
        }
    }

    /// Runs the robot for a tick.
    pub(super) fn run(&mut self, turn: &Turn<TickUpdate>, others: &mut Others<'_>) -> TickResult {
        if turn.begin != Begin::GoOn {
            self.take_runner();
        }
        let runner = self
            .runner
            .as_mut()
            .expect("a robot runs after its welcome");

        runner
            .run(turn, others)
            .unwrap_or_else(|error| panic!("{error}"))
    }

    fn take_runner(&mut self) {
        let welcome = self.welcome.take().expect("it has been admitted");
        match self.robot.take() {
            Some(robot) => self.runner = Some(Runner::new(robot, welcome)),
            None => self
                .runner
                .as_mut()
                .expect("a robot is seated once")
                .start_over(welcome),
        }
    }
}
