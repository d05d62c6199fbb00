//! The simulated star: the router, which is in the simulator's process, and a link to each robot's process. A link keeps the
//! order of messages in each direction, holds a limited number of bytes, loses, repeats and delays single messages, and is
//! cut with everything that is on it.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use lockstep::StateQuery;
use protocol::RobotName;

use crate::plan::{Flaw, MS, Micros};
use crate::process::Life;
use crate::world::{Event, World};

/// An encoded message.
pub(crate) type Bytes = Arc<[u8]>;

/// Number of a get, unique in a schedule.
pub(crate) type GetId = u64;

/// What travels on a link.
#[derive(Debug, Clone)]
pub(crate) enum Message {
    // From a process to the router, or through it.
    /// The session declares its subscribers and queryables.
    Declare,
    Token,
    Follow(RobotName),
    Unfollow(RobotName),
    Closed,
    Join(GetId, Bytes),
    Command(Bytes),
    Report(Bytes),
    Waiting(Bytes),
    State(RobotName, Bytes),
    /// The number of the link that asks is added by the router.
    Query {
        asker: Option<usize>,
        of: RobotName,
        query: StateQuery,
    },
    QueryReply {
        asker: usize,
        of: RobotName,
        result: Result<Bytes, String>,
    },
    // From the simulator to a process.
    News(Bytes),
    Clock(Bytes),
    JoinReply(GetId, Bytes),
    SimulatorToken(bool),
    /// Whether there are subscribers to the state of the robot.
    Interest(bool),
}

impl Message {
    /// Bytes on the wire.
    fn size(&self) -> usize {
        let payload = match self {
            Self::Join(_, bytes)
            | Self::Command(bytes)
            | Self::Report(bytes)
            | Self::Waiting(bytes)
            | Self::State(_, bytes)
            | Self::News(bytes)
            | Self::Clock(bytes)
            | Self::JoinReply(_, bytes)
            | Self::QueryReply {
                result: Ok(bytes), ..
            } => bytes.len(),
            _ => 0,
        };

        64 + payload
    }

    /// Whether it may be lost alone: declarations are reliable as long as the session lasts.
    fn is_droppable(&self) -> bool {
        !matches!(
            self,
            Self::Declare
                | Self::Token
                | Self::Follow(_)
                | Self::Unfollow(_)
                | Self::Closed
                | Self::SimulatorToken(_)
                | Self::Interest(_)
        )
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Way {
    /// To the router.
    Up,
    /// To the process.
    Down,
}

#[derive(Debug, Default)]
struct Direction {
    /// On the link, in order.
    queued: VecDeque<Message>,
    queued_bytes: usize,
    /// In the sender, because the link is full.
    waiting: VecDeque<Message>,
    /// Whether the arrival of the first one is scheduled.
    is_moving: bool,
}

/// A link between the router and a process.
#[derive(Debug)]
pub(crate) struct Link {
    pub(crate) robot: RobotName,
    /// Counts breaks: what is scheduled for an earlier session is void.
    pub(crate) session: u64,
    /// Whether bytes pass.
    is_whole: bool,
    /// Whether the process, or the router, takes the session to be open.
    is_open_below: bool,
    is_open_above: bool,
    is_declared: bool,
    has_token: bool,
    follows: BTreeSet<RobotName>,
    /// Whether the session is opened again when the process runs again.
    heals_on_resume: bool,
    up: Direction,
    down: Direction,
}

impl Link {
    pub(crate) fn new(robot: RobotName) -> Self {
        Self {
            robot,
            session: 0,
            is_whole: false,
            is_open_below: false,
            is_open_above: false,
            is_declared: false,
            has_token: false,
            follows: BTreeSet::new(),
            heals_on_resume: false,
            up: Direction::default(),
            down: Direction::default(),
        }
    }

    fn way(&mut self, way: Way) -> &mut Direction {
        match way {
            Way::Up => &mut self.up,
            Way::Down => &mut self.down,
        }
    }

    /// Whether the process can send.
    pub(crate) fn is_open_below(&self) -> bool {
        self.is_open_below
    }

    fn break_off(&mut self) {
        self.session += 1;
        self.is_whole = false;
        self.up = Direction::default();
        self.down = Direction::default();
    }
}

impl World {
    /// Puts a message on a link.
    pub(crate) fn send(&mut self, link: usize, way: Way, message: Message) {
        let is_open = match way {
            Way::Up => self.links[link].is_open_below,
            Way::Down => self.links[link].is_open_above,
        };
        if !is_open || !self.links[link].is_whole {
            return;
        }

        let mut copies = 1;
        if message.is_droppable() && self.is_noisy() {
            if self.chance.happens(self.plan.links.loss) {
                self.counts.losses += 1;
                self.disturb(0);
                return;
            }
            if self.chance.happens(self.plan.links.cuts) {
                let lasts = self.chance.magnitude(100, self.plan.links.longest_cut);
                self.cut(link, lasts);
                return;
            }
            if self.chance.happens(self.plan.links.duplicates) {
                self.counts.duplicates += 1;
                self.disturb(0);
                copies = 2;
            }
        }
        let waiting = &mut self.links[link].way(way).waiting;
        for _ in 1..copies {
            waiting.push_back(message.clone());
        }
        waiting.push_back(message);
        self.fill(link, way);
    }

    /// Moves what fits from the sender to the link.
    fn fill(&mut self, link: usize, way: Way) {
        if way == Way::Up && self.processes[link].life == Life::Hung {
            return;
        }
        let room = self.plan.links.room;
        let takes_any_alone = self.plan.flaw != Flaw::QueueWithoutRoom;
        let direction = self.links[link].way(way);
        while let Some(next) = direction.waiting.front() {
            let size = next.size();
            let is_alone = direction.queued.is_empty() && takes_any_alone;
            if direction.queued_bytes + size > room && !is_alone {
                self.counts.held_back += 1;
                break;
            }
            direction.queued_bytes += size;
            direction.queued.extend(direction.waiting.pop_front());
        }

        self.set_moving(link, way);
    }

    fn set_moving(&mut self, link: usize, way: Way) {
        let direction = self.links[link].way(way);
        let Some(first) = direction.queued.front() else {
            return;
        };
        if direction.is_moving {
            return;
        }
        direction.is_moving = true;
        let takes = first.size() as u64 * MS / self.plan.links.bytes_per_ms;

        let mut after = takes + self.chance.below(self.plan.links.latency + 1);
        if self.is_noisy() && self.chance.happens(self.plan.links.naps) {
            let nap = self.chance.magnitude(100, self.plan.links.longest_nap);
            self.counts.naps += 1;
            self.disturb(nap);
            after += nap;
        }
        let session = self.links[link].session;
        self.schedule(after, Event::Arrive { link, way, session });
    }

    /// The first message of a direction arrives.
    pub(crate) fn arrive(&mut self, link: usize, way: Way, session: u64) {
        if self.links[link].session != session {
            return;
        }
        let is_hung = self.processes[link].life == Life::Hung;
        let direction = self.links[link].way(way);
        direction.is_moving = false;
        if way == Way::Down && is_hung {
            return; // It is taken when the process runs again.
        }
        let Some(message) = direction.queued.pop_front() else {
            return;
        };
        direction.queued_bytes -= message.size();

        self.fill(link, way);
        match way {
            Way::Up => self.route(link, message),
            Way::Down => self.receive(link, message),
        }
    }

    /// The router does with a message what it is for.
    fn route(&mut self, link: usize, message: Message) {
        let robot = self.links[link].robot.clone();
        if self.simulator.is_closed {
            return;
        }

        match message {
            Message::Declare => {
                self.links[link].is_declared = true;
                let is_followed = self
                    .links
                    .iter()
                    .any(|other| other.follows.contains(&robot));
                if is_followed {
                    self.send(link, Way::Down, Message::Interest(true));
                }
            }
            Message::Token => {
                let is_first = !self.has_token(&robot);
                self.links[link].has_token = true;
                if is_first {
                    self.on_token(&robot, true);
                }
            }
            Message::Follow(of) => {
                let is_first = !self.links.iter().any(|other| other.follows.contains(&of));
                self.links[link].follows.insert(of.clone());
                if is_first {
                    self.put_interest(&of, true);
                }
            }
            Message::Unfollow(of) => self.unfollow(link, &of),
            Message::Closed => {
                self.links[link].break_off();
                self.links[link].is_open_below = false;
                self.close_above(link);
            }
            Message::Join(get, bytes) => {
                if let Some(answer) = self.on_join(&bytes) {
                    self.send(link, Way::Down, Message::JoinReply(get, answer));
                }
            }
            Message::Command(bytes) => self.on_command(&robot, &bytes),
            Message::Report(bytes) => self.on_report(&robot, &bytes),
            Message::Waiting(bytes) => self.on_waiting(&robot, &bytes),
            Message::State(of, bytes) => self.put_state(&of, &bytes),
            Message::Query { of, query, .. } => {
                for other in self.links_where(|other| other.is_declared && other.robot == of) {
                    let asker = Some(link);
                    let of = of.clone();
                    self.send(other, Way::Down, Message::Query { asker, of, query });
                }
            }
            Message::QueryReply { asker, .. } => self.send(asker, Way::Down, message),
            Message::News(_)
            | Message::Clock(_)
            | Message::JoinReply(..)
            | Message::SimulatorToken(_)
            | Message::Interest(_) => unreachable!("these come from the simulator"),
        }
    }

    fn links_where(&self, is_meant: impl Fn(&Link) -> bool) -> Vec<usize> {
        let mut found = Vec::new();
        for (index, link) in self.links.iter().enumerate() {
            if is_meant(link) {
                found.push(index);
            }
        }

        found
    }

    /// Puts something to every session that subscribes to the clock, or to the news of one robot.
    pub(crate) fn put_down(&mut self, to: Option<&RobotName>, message: &Message) {
        for link in
            self.links_where(|link| link.is_declared && to.is_none_or(|to| link.robot == *to))
        {
            self.send(link, Way::Down, message.clone());
        }
    }

    /// Puts a robot's state to the sessions that follow it.
    pub(crate) fn put_state(&mut self, of: &RobotName, bytes: &Bytes) {
        for link in self.links_where(|link| link.follows.contains(of)) {
            self.send(link, Way::Down, Message::State(of.clone(), bytes.clone()));
        }
    }

    fn put_interest(&mut self, of: &RobotName, is_followed: bool) {
        self.put_down(Some(of), &Message::Interest(is_followed));
    }

    fn unfollow(&mut self, link: usize, of: &RobotName) {
        let was_followed = self.links[link].follows.remove(of);
        if was_followed && !self.links.iter().any(|other| other.follows.contains(of)) {
            self.put_interest(of, false);
        }
    }

    /// Tokens of one name are one to the simulator.
    fn has_token(&self, robot: &RobotName) -> bool {
        self.links
            .iter()
            .any(|link| link.has_token && link.robot == *robot)
    }

    /// Cuts a link for so long. Each side notices at some time of its own.
    pub(crate) fn cut(&mut self, link: usize, lasts: Micros) {
        if !self.links[link].is_whole {
            return;
        }
        self.counts.cuts += 1;
        self.disturb(lasts);
        self.links[link].break_off();

        let session = self.links[link].session;
        let above = self.chance.below(lasts + 1);
        let below = self.chance.below(lasts + 1);
        self.schedule(above, Event::NoticeAbove { link, session });
        self.schedule(below, Event::NoticeBelow { link, session });
        self.schedule(lasts, Event::Heal { link, session });
    }

    /// The router takes the session to be closed.
    pub(crate) fn close_above(&mut self, link: usize) {
        if !std::mem::take(&mut self.links[link].is_open_above) {
            return;
        }
        self.links[link].is_declared = false;
        for of in self.links[link].follows.clone() {
            self.unfollow(link, &of);
        }
        if std::mem::take(&mut self.links[link].has_token) {
            let robot = self.links[link].robot.clone();
            if !self.has_token(&robot) && !self.simulator.is_closed {
                self.on_token(&robot, false);
            }
        }
    }

    /// The process takes the session to be closed.
    pub(crate) fn close_below(&mut self, link: usize) {
        if self.processes[link].life == Life::Hung || !self.links[link].is_open_below {
            return;
        }
        self.links[link].is_open_below = false;
        self.on_disconnected(link);
    }

    /// Opens the session, for the first time or again.
    pub(crate) fn open_session(&mut self, link: usize, session: u64) {
        if self.links[link].session != session {
            return;
        }
        self.close_above(link);
        self.close_below(link);
        match self.processes[link].life {
            Life::Hung => {
                self.links[link].heals_on_resume = true;
                return;
            }
            Life::Dead | Life::Left(_) => return,
            Life::Alive => {}
        }
        if self.simulator.is_closed {
            return;
        }

        self.links[link].is_whole = true;
        self.links[link].is_open_above = true;
        self.links[link].is_open_below = true;
        self.send(link, Way::Down, Message::SimulatorToken(true));
        self.send(link, Way::Up, Message::Declare);
        for of in self.processes[link].followed.clone() {
            self.send(link, Way::Up, Message::Follow(of));
        }
        if self.processes[link].has_token {
            self.send(link, Way::Up, Message::Token);
        }
    }

    /// The process sends nothing any more. What is on the link may still arrive.
    pub(crate) fn die(&mut self, link: usize, is_abrupt: bool) {
        if !self.links[link].is_whole {
            return; // The router notices, or has noticed.
        }
        let direction = self.links[link].way(Way::Up);
        direction.waiting.clear();
        if !is_abrupt {
            direction.waiting.push_back(Message::Closed);
            self.fill(link, Way::Up);
            return;
        }

        self.links[link].break_off();
        let session = self.links[link].session;
        let after = self.chance.below(self.plan.lease + 1);
        self.disturb(after);
        self.schedule(after, Event::NoticeAbove { link, session });
    }

    /// A process that leaves closes its session after everything that it has put.
    pub(crate) fn leave_star(&mut self, link: usize) {
        self.send(link, Way::Up, Message::Closed);
    }

    /// No sign of life for so long that the router closes the session.
    pub(crate) fn expire(&mut self, link: usize, session: u64) {
        let is_of_now = self.links[link].session == session && self.links[link].is_whole;
        if !is_of_now || self.processes[link].life != Life::Hung {
            return;
        }
        self.links[link].break_off();
        self.links[link].heals_on_resume = true;
        self.close_above(link);
    }

    /// The process runs again.
    pub(crate) fn resume_link(&mut self, link: usize) {
        if !self.links[link].is_whole {
            self.close_below(link);
        }
        if std::mem::take(&mut self.links[link].heals_on_resume) {
            let session = self.links[link].session;
            let after = self.chance.below(100 * MS);
            self.disturb(after);
            self.schedule(after, Event::Heal { link, session });
        }
        self.fill(link, Way::Up);
        self.set_moving(link, Way::Down);
    }
}
