//! A robot that shares tasks with others in an auction without an auctioneer: the consensus-based auction algorithm, CBAA (Choi,
//! Brunet and How 2009).
//!
//! Each robot bids for the nearest task for which no higher bid is known, and sends its table of highest bids to the others. Each
//! keeps the higher bid of its own table and a received one, so the tables agree in the end, and a robot that is outbid takes
//! another task. While messages are lost, two robots may go to the same task, until a table arrives or one sees that it is done.
//!
//! CBAA does not know robots that crash: their tasks stay theirs. With a `lease`, which is ours, a robot renews its bid while it has the
//! task, and a task whose bid was not renewed for so long is free again.
//!
//! The robot has no emotion. `sdk/python/examples/bidder.py` is the same in Python, to the last bit.

use rand::Rng as _;
use robot::{Action, BadParameters, Cars, KnownSite, Payload, Point, Robot, SiteAction};
use serde::{Deserialize, Serialize};

/// Kind of the sites that are tasks.
const TASK: &str = "task";
/// Name of the commands with tables.
const TABLE: &str = "table";
/// Bid of a robot that has begun to work: no robot that still has to go bids more.
const BID_AT_WORK: f64 = 1.0;
/// Ticks for which a robot goes to one side after it was blocked \[I\].
const ASIDE_TICKS: u32 = 4;
/// Distance that it goes toward its goal meanwhile, for each meter to the side \[I\].
const FORWARD_M: f64 = 0.3;

/// The parameters of a bidder, as in the scenario.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct BidderParameters {
    /// Speed, m/s.
    speed: f64,
    /// Time that a task takes, seconds.
    work: f64,
    /// When it sends its table.
    sends: Sends,
    /// Time between two tables, if it sends periodically, seconds.
    period: f64,
    /// Time after which a bid that was not renewed no longer counts, seconds; without it a bid counts for ever \[I\].
    lease: Option<f64>,
}

impl Default for BidderParameters {
    fn default() -> Self {
        Self {
            speed: 1.0,
            work: 3.0,
            sends: Sends::Periodically,
            period: 0.5,
            lease: None,
        }
    }
}

/// When a bidder sends its table.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Sends {
    /// Once a period.
    Periodically,
    /// When it has changed.
    OnChange,
    /// Never: each robot does every task of which it has not seen that it is done.
    Never,
}

/// What a robot knows of a task.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
struct TaskEntry {
    /// Highest bid, 0 for none.
    bid: f64,
    /// The robot that has made it.
    by: String,
    /// Whether the task is done.
    done: bool,
    /// When that robot has renewed its bid, simulated seconds; 0 without a lease.
    renewed_s: f64,
}

/// A robot that shares tasks.
#[derive(Debug, Clone, Default)]
pub struct Bidder {
    parameters: BidderParameters,
    tasks: Vec<KnownSite>,
    /// What is known of each task.
    table: Vec<TaskEntry>,
    /// The task that it does, by its index.
    task: Option<usize>,
    /// Time that it has worked on the task, seconds.
    worked_s: f64,
    /// When it has sent its table, and when it sends it next, seconds.
    sent_s: f64,
    sends_s: f64,
    /// Whether its table has changed since it was sent.
    has_changed: bool,
    /// Ticks that are left of going aside.
    aside_ticks: u32,
    /// The side: 1 for left, -1 for right.
    side: f64,
}

impl Robot for Bidder {
    fn init(&mut self, cars: &mut Cars<'_>) -> Result<(), BadParameters> {
        let mut tasks = cars.welcome().known_sites.clone();
        tasks.retain(|site| site.kind == TASK);
        *self = Self {
            parameters: cars.parameters()?,
            table: vec![TaskEntry::default(); tasks.len()],
            tasks,
            ..Self::default()
        };
        Ok(())
    }

    fn tick(&mut self, cars: &mut Cars<'_>) -> Action {
        self.receive(cars);
        self.look(cars);
        self.drop_lost_task(cars);
        self.renew(cars);
        self.bid(cars);
        let action = self.work(cars);
        self.send(cars);

        let task = self.task.map(|task| self.tasks[task].name.as_str());
        action.variable("task", task.unwrap_or_default())
    }

    fn snapshot(&self) -> Option<Box<dyn Robot>> {
        Some(Box::new(self.clone()))
    }

    fn is_quick(&self) -> bool {
        true
    }
}

impl Bidder {
    /// Takes over what is news in the tables of others.
    fn receive(&mut self, cars: &Cars<'_>) {
        for command in cars.commands() {
            let Some(payload) = command.payload.as_ref().filter(|_| command.text == TABLE) else {
                continue;
            };
            // An operator may send anything.
            let Ok(received) = payload.read::<Vec<TaskEntry>>() else {
                continue;
            };
            for (own, mut received) in self.table.iter_mut().zip(received) {
                received.expire(self.parameters.lease, cars.time_s());
                self.has_changed |= own.merge(received);
            }
        }
    }

    /// Renews the bid for its task, and drops those of others that they have not renewed.
    fn renew(&mut self, cars: &Cars<'_>) {
        if self.parameters.lease.is_none() {
            return;
        }
        for (index, entry) in self.table.iter_mut().enumerate() {
            if self.task == Some(index) {
                entry.renewed_s = cars.time_s();
            }
            entry.expire(self.parameters.lease, cars.time_s());
        }
    }

    /// Sees which tasks within range are done.
    fn look(&mut self, cars: &Cars<'_>) {
        for (entry, task) in self.table.iter_mut().zip(&self.tasks) {
            let mut seen = cars.sites().iter().filter(|site| site.name == task.name);
            let is_done = seen.any(|site| site.state.get("done") == Some(&true.into()));
            if is_done && !entry.done {
                entry.done = true;
                self.has_changed = true;
            }
        }
    }

    /// Gives up its task if that is done, or another robot bids more for it.
    fn drop_lost_task(&mut self, cars: &Cars<'_>) {
        let Some(task) = self.task else {
            return;
        };
        let entry = &self.table[task];
        if entry.done || entry.by != cars.name().as_str() {
            self.task = None;
            self.worked_s = 0.0;
        }
    }

    /// Bids for the nearest task that it can get, if it has none: the nearer, the more.
    fn bid(&mut self, cars: &Cars<'_>) {
        if self.task.is_some() {
            return;
        }

        let mut best: Option<(usize, f64)> = None;
        for (task, (entry, site)) in self.table.iter().zip(&self.tasks).enumerate() {
            let bid = 1.0 / (1.0 + cars.location().distance_m(site.location));
            if !entry.done && bid > entry.bid && best.is_none_or(|(_, other)| bid > other) {
                best = Some((task, bid));
            }
        }
        if let Some((task, bid)) = best {
            self.task = Some(task);
            self.has_changed = true;
            let entry = &mut self.table[task];
            entry.bid = bid;
            entry.by = cars.name().to_string();
            entry.renewed_s = self.parameters.lease.map_or(0.0, |_| cars.time_s());
        }
    }

    /// Goes to its task and does it.
    fn work(&mut self, cars: &mut Cars<'_>) -> Action {
        let Some(task) = self.task else {
            return Action::stay(cars).behavior("IDLE");
        };
        let KnownSite { name, location, .. } = self.tasks[task].clone();
        let is_there = cars.sites().iter().any(|site| site.name == name);
        if !is_there {
            return self.go(cars, location).behavior("GO");
        }

        if self.worked_s == 0.0 {
            self.table[task].bid = BID_AT_WORK;
            self.has_changed = true;
        }
        self.worked_s += cars.tick_s();
        let action = Action::stay(cars).behavior("WORK");
        if self.worked_s < self.parameters.work {
            return action;
        }
        action.on_site(SiteAction::set(name, "done", true).only_if("done", false))
    }

    /// A step toward a goal; after it was blocked, for some ticks around what is in the way.
    fn go(&mut self, cars: &mut Cars<'_>, goal: Point) -> Action {
        if cars.was_blocked() && self.aside_ticks == 0 {
            self.aside_ticks = ASIDE_TICKS;
            let is_left = cars.random().next_u64() >> 63 == 0;
            self.side = if is_left { 1.0 } else { -1.0 };
        }
        let here = cars.location();
        let distance_m = here.distance_m(goal);
        if self.aside_ticks == 0 || distance_m == 0.0 {
            return Action::go(cars, goal, self.parameters.speed);
        }

        self.aside_ticks -= 1;
        let x = (goal.x - here.x) / distance_m;
        let y = (goal.y - here.y) / distance_m;
        let aside = Point::new(
            here.x - self.side * y + FORWARD_M * x,
            here.y + self.side * x + FORWARD_M * y,
        );
        Action::go(cars, aside, self.parameters.speed)
    }

    /// Sends its table to all others, when it is time.
    fn send(&mut self, cars: &mut Cars<'_>) {
        let is_due = match self.parameters.sends {
            Sends::Periodically => cars.time_s() >= self.sends_s,
            Sends::OnChange => self.has_changed || self.must_renew(cars.time_s()),
            Sends::Never => false,
        };
        if is_due {
            self.sent_s = cars.time_s();
            self.sends_s = cars.time_s() + self.parameters.period;
            self.has_changed = false;
            // Numbers and texts always are JSON.
            let table = Payload::of(&self.table).unwrap_or_default();
            cars.broadcast(TABLE, table);
        }
    }

    /// Whether half of the lease of its task is over since it was renewed for the others.
    fn must_renew(&self, now_s: f64) -> bool {
        let lease = self.parameters.lease.filter(|_| self.task.is_some());
        lease.is_some_and(|lease_s| now_s - self.sent_s >= 0.5 * lease_s)
    }
}

impl TaskEntry {
    /// Takes over what is news in another robot's entry for the same task: of two bids the higher one, of equal ones that of the
    /// robot that comes first by name. Returns whether there was any, other than that a bid was renewed.
    fn merge(&mut self, received: Self) -> bool {
        let is_done = received.done && !self.done;
        self.done |= received.done;
        let is_higher = received.bid > self.bid;
        if is_higher || (received.bid == self.bid && received.by < self.by) {
            self.bid = received.bid;
            self.by = received.by;
            self.renewed_s = received.renewed_s;
            return true;
        }
        if received.bid == self.bid && received.by == self.by {
            self.renewed_s = self.renewed_s.max(received.renewed_s);
        }
        is_done
    }

    /// Drops a bid that was not renewed for longer than the lease.
    fn expire(&mut self, lease_s: Option<f64>, now_s: f64) {
        if lease_s.is_some_and(|lease_s| now_s - self.renewed_s > lease_s) {
            self.bid = 0.0;
            self.by.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(bid: f64, by: &str, done: bool) -> TaskEntry {
        TaskEntry {
            bid,
            by: by.to_owned(),
            done,
            renewed_s: 0.0,
        }
    }

    #[test]
    fn a_bid_that_is_not_renewed_expires_and_does_not_come_back() {
        let of_c = TaskEntry {
            renewed_s: 4.0,
            ..entry(0.9, "C", false)
        };
        let mut own = TaskEntry::default();
        for (now_s, lease_s, by) in [
            (9.0, Some(5.0), "C"),
            (9.5, Some(5.0), ""),
            (9.5, None, "C"),
        ] {
            let mut received = of_c.clone();
            received.expire(lease_s, now_s);
            own = TaskEntry::default();
            own.merge(received);
            assert_eq!(own.by, by, "{now_s} {lease_s:?}");
        }

        let renewed = TaskEntry {
            renewed_s: 8.0,
            ..of_c.clone()
        };
        assert!(!own.merge(renewed), "a renewal is no news");
        own.expire(Some(5.0), 13.0);
        assert_eq!((own.by.as_str(), own.renewed_s), ("C", 8.0));
        assert!(!own.merge(of_c), "an older one neither");
        assert_eq!(own.renewed_s, 8.0);
    }

    #[test]
    fn the_higher_bid_counts_and_of_equal_ones_the_first_name() {
        for (received, merged, is_news) in [
            (entry(0.6, "C", false), entry(0.6, "C", false), true),
            (entry(0.5, "A", false), entry(0.5, "A", false), true),
            (entry(0.5, "C", false), entry(0.5, "B", false), false),
            (entry(0.4, "A", true), entry(0.5, "B", true), true),
        ] {
            let mut own = entry(0.5, "B", false);
            assert_eq!(own.merge(received), is_news);
            assert_eq!(own, merged);
        }
    }

    #[test]
    fn tables_agree_whatever_the_order_in_which_they_arrive() {
        let tables = [
            entry(0.5, "B", false),
            entry(0.5, "A", true),
            entry(0.7, "C", false),
        ];
        for order in [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [1, 2, 0],
            [2, 0, 1],
            [2, 1, 0],
        ] {
            let mut own = TaskEntry::default();
            for index in order {
                own.merge(tables[index].clone());
            }
            assert_eq!(own, entry(0.7, "C", true));
        }
    }
}
