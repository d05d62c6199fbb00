//! The robot's ticks.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::time::Duration;

use lockstep::{Begin, Sent, Turn};
use protocol::keys::STATE;
use protocol::messages::{
    CommandText, Delivery, MAX_TEXT_BYTES, Point, PublicState, Report, StateVariables, TickUpdate,
    Variable, Velocity, Welcome,
};
use protocol::plain::cut;
use protocol::random::{stream, unit};
use protocol::{Epoch, RobotName, Tick};
use serde_json::Value;

use crate::answering::{Phase, lock};
use crate::host::{Event, Failure, Host};
use crate::walker::Walker;

/// How long the robot computes in its slow tick.
const COMPUTES: Duration = Duration::from_millis(150);
const SLOW_TICK: Tick = 11;
/// A tick after which only a command has woken it.
const LATE_TICK: Tick = 36;
/// What a robot counts on that has little room: commands, and bytes of a text.
const TEN: usize = 10;
const SHORT_TEXT: usize = 100;
/// How often one moves that moves rarely.
const RARELY: f64 = 0.05;
/// So many robots are few.
const FEW: usize = 4;
/// The same for a robot that has more.
const HUNDRED: usize = 100;

/// So many lists and objects within one another are few.
const DEPTH: usize = 32;

/// Whether a command has a payload of which something holds.
fn has_payload(delivery: &Delivery, holds: &dyn Fn(&Value) -> bool) -> bool {
    let payload = delivery.payload.as_ref();
    payload.is_some_and(|payload| holds(payload.value()))
}

/// Whether a list has an integer of 64 bits without a sign.
fn has_large_number(value: &Value) -> bool {
    let values = value.as_array();
    values.is_some_and(|values| values.iter().any(|value| value.is_u64() && !value.is_i64()))
}

/// Whether there are more lists within one another.
fn is_deep(value: &Value, depth: usize) -> bool {
    let Some(values) = value.as_array() else {
        return false;
    };
    depth == 0 || values.iter().any(|value| is_deep(value, depth - 1))
}

/// The results of a tick.
pub(crate) type Outcome = (Vec<Sent<CommandText>>, PublicState, Report);

impl Host {
    pub(crate) fn run_tick(&mut self, turn: Turn<TickUpdate>) -> Result<(), Failure> {
        self.shared.enter(Phase::Computing);
        let starts_over = std::mem::take(&mut self.starts_over);
        if turn.begin != Begin::GoOn || starts_over {
            self.begin();
        }
        self.has_begun = true;

        let stray = self
            .strays
            .iter()
            .find(|stray| stray.epoch < turn.epoch && stray.tick == turn.tick);
        let mut news = turn.news.or(stray.cloned()).unwrap_or_default();
        if self.wrong.is("tick.newest:news") {
            let last = self.last.map_or(0, |(_, tick)| tick);
            let skipped = |stray: &&TickUpdate| {
                stray.epoch == turn.epoch && (last + 1..turn.tick).contains(&stray.tick)
            };
            for stray in self.strays.iter().filter(skipped) {
                news.commands.extend(stray.commands.iter().cloned());
            }
        }

        if turn.begin == Begin::TakeOver && self.wrong.is("return.generation:first-command") {
            news.commands.clear();
        }

        let (commands, state, report) = self.act(turn.epoch, turn.tick, &news)?;
        self.drive(|machine, out| machine.done(commands, state, report, out))?;
        self.shared.enter(Phase::Idle);
        match self.queued.pop_front() {
            Some(clock) => self.on_clock(clock),
            None => Ok(()),
        }
    }

    /// Returns the robot to the state of its last welcome.
    fn begin(&mut self) {
        let Some(welcome) = &self.welcome else { return };

        let mut walker = Walker::new(welcome, &self.wrong);
        if let Some(before) = self.walker.take() {
            let is_mixed = self.has_rejoined && welcome.epoch > 1;
            if self.wrong.is("epoch.init:random")
                || is_mixed && self.wrong.is("return.rejoin:later")
            {
                walker.random = before.random;
            }
            if self.wrong.is("epoch.init:field") {
                walker.height_m = before.height_m;
            }
            let is_further = welcome.generation > 1;
            if self.wrong.is("epoch.init:parameters")
                || is_further && self.wrong.is("return.rejoin:parameters")
            {
                walker.step_m = before.step_m;
            }
            if self.wrong.is("epoch.init:variables") {
                walker.received = before.received;
            }
            if self.wrong.is("epoch.init:count") {
                walker.sent = before.sent;
            }
            if is_further && self.wrong.is("return.rejoin:variables") {
                walker.received = before.received;
            }
            if self.wrong.is("epoch.init:put-off")
                || is_further && self.wrong.is("return.rejoin:put-off")
            {
                walker.put_off = before.put_off;
            }
        }

        self.walker = Some(walker);
    }

    /// The robot's tick.
    pub(crate) fn act(
        &mut self,
        epoch: Epoch,
        tick: Tick,
        news: &TickUpdate,
    ) -> Result<Outcome, Failure> {
        let wrong = self.wrong.clone();
        let welcome = self.welcome.clone().ok_or("no welcome")?;
        let mut walker = self.walker.take().ok_or("no walker")?;
        walker.at = match news.correction {
            Some(correction) if !wrong.is("tick.correction") => correction.location,
            _ => walker.proposal,
        };

        let mut deliveries = news.commands.clone();
        deliveries.append(&mut self.intercepted);
        if wrong.is("command.order") {
            deliveries.reverse();
        }
        if wrong.is("command.order:sorts") {
            deliveries.sort_by(|one, other| one.command.cmp(&other.command));
        }
        if wrong.is("command.order:senders") {
            deliveries.sort_by(|one, other| other.from.cmp(&one.from));
        }
        if wrong.is("command.order:letters") {
            deliveries.sort_by_key(|delivery| delivery.from.as_str().to_lowercase());
        }
        if wrong.is("command.order:interleaved") {
            // The first of each sender, then the second of each.
            let mut counts = BTreeMap::new();
            deliveries.sort_by_cached_key(|delivery| {
                let count = counts.entry(delivery.from.clone()).or_insert(0);
                *count += 1;
                *count
            });
        }
        if wrong.is("command.order:exchanged") && deliveries.len() > 2 {
            let last = deliveries.len() - 1;
            deliveries.swap(1, last);
        }
        if wrong.is("command.order:many") && deliveries.len() > HUNDRED {
            // Of many only those that are like the first.
            deliveries.dedup_by(|next, one| next.command != one.command);
        }
        if let [one, other, again] = &deliveries[..]
            && wrong.is("command.order:again")
            && one.command == again.command
            && one.command != other.command
        {
            deliveries.pop();
        }
        let has_skipped = self
            .last
            .is_some_and(|last| last.0 == epoch && last.1 + 1 < tick);
        if wrong.is("tick.newest:deaf") && has_skipped {
            deliveries.clear();
        }
        if wrong.is("return.generation:deaf") && news.joined.is_some() {
            deliveries.clear();
        }
        if wrong.is("command.twice:blocked") && news.correction.is_some_and(|at| at.blocked) {
            deliveries.clear();
        }
        if wrong.is("command.twice:adjacent") {
            let before = std::mem::take(&mut self.before);
            self.before.clone_from(&deliveries);
            deliveries.retain(|delivery| !before.contains(delivery));
        }
        if wrong.is("command.twice:ten") {
            deliveries.truncate(TEN);
        }
        if wrong.is("command.twice:hundred") {
            deliveries.truncate(HUNDRED);
        }
        if wrong.is("command.payload:ascii") {
            deliveries.retain(|delivery| delivery.command.is_ascii());
        }
        if wrong.is("command.payload:long") {
            deliveries.retain(|delivery| delivery.command.len() <= SHORT_TEXT);
        }
        if wrong.is("command.twice:senders") {
            deliveries.dedup_by(|next, one| next.command == one.command && next.from != one.from);
        }
        if wrong.is("command.payload:numbers") {
            deliveries.retain(|delivery| !has_payload(delivery, &has_large_number));
        }
        if wrong.is("command.payload:deep") {
            deliveries.retain(|delivery| !has_payload(delivery, &|value| is_deep(value, DEPTH)));
        }
        if wrong.is("command.twice") {
            deliveries.dedup();
        }
        if wrong.is("operator.commands") {
            deliveries.retain(|delivery| delivery.from != RobotName::operator());
        }

        let mut commands = Vec::new();
        let mut log = Vec::new();
        for delivery in deliveries {
            if delivery.payload.is_some() && wrong.is("command.payload") {
                return Err("a payload".into());
            }
            walker.received += 1;
            if has_payload(&delivery, &|value| value["blocked"] == true)
                && wrong.is("command.payload:fields")
            {
                walker.received += 1;
            }
            walker.last.clone_from(&delivery.command);
            match delivery.command.as_str() {
                "rest" => walker.is_asleep = true,
                "fly" => walker.is_asleep = false,
                _ => {}
            }
            log.push(format!(
                "received {:?} from {}",
                delivery.command, delivery.from
            ));
            let answers_operator = wrong.is("operator.commands:answers");
            if welcome.roster.contains(&delivery.from) || answers_operator {
                walker.sent += 1;
                let mut answer = format!("{} received: {}", walker.sent, delivery.command);
                cut(&mut answer, MAX_TEXT_BYTES);
                commands.push(Sent {
                    to: delivery.from.into(),
                    command: CommandText::named(answer),
                });
            }
        }

        if wrong.is("command.sent:ten") {
            commands.truncate(TEN);
        }
        if wrong.is("epoch.init:put-off") || wrong.is("return.rejoin:put-off") {
            commands = std::mem::replace(&mut walker.put_off, commands);
        }

        let mut reseeds = &welcome.reseeds[..];
        if epoch > 1 && wrong.is("epoch.init:reseeds")
            || self.has_rejoined && wrong.is("return.rejoin:reseeds")
        {
            reseeds = &[];
        }
        if wrong.is("determinism.seed:reseeds-first") {
            reseeds = welcome.reseeds.get(..1).unwrap_or_default();
        }
        let due = reseeds.partition_point(|reseed| reseed.tick <= tick);
        let skips = wrong.is("determinism.seed:reseeds-skipped");
        if let Some(reseed) = reseeds[walker.reseeded..due].last()
            && !wrong.is("determinism.seed:reseeds")
            && !(skips && reseed.tick < tick)
        {
            walker.reseeded = due;
            let name = if wrong.is("determinism.seed:reseeds-stream") {
                welcome.name.as_str()
            } else {
                &welcome.stream
            };
            walker.random = stream(reseed.seed, name);
        }
        let seen = self.ask_another(tick, epoch, news, &welcome, !walker.is_asleep)?;
        if tick == SLOW_TICK {
            std::thread::sleep(COMPUTES);
        }
        let step_x_m = (unit(&mut walker.random) - 0.5) * walker.step_m;
        let step_y_m = (unit(&mut walker.random) - 0.5) * walker.step_m;
        walker.proposal = Point::new(walker.at.x + step_x_m, walker.at.y + step_y_m);
        let mut angle = unit(&mut walker.random) * 3.0;
        if wrong.is("determinism.seed:rarely") && unit(&mut walker.random) > RARELY {
            walker.proposal = walker.at;
            angle = 0.0;
        }
        let is_awake = tick > LATE_TICK && !walker.is_asleep;
        let turns = wrong.is("number.angles") || wrong.is("number.angles:awake") && is_awake;
        let turn = if turns { 7.0 } else { 0.0 };

        let mut state_variables: StateVariables = [
            ("received".to_owned(), Variable::from(walker.received)),
            ("last".to_owned(), Variable::from(walker.last.clone())),
            ("height_m".to_owned(), Variable::from(walker.height_m)),
        ]
        .into();
        if self.shared.is_watched.load(Ordering::SeqCst) {
            state_variables.insert("watched", Variable::from(1_u32));
        }
        if let Some(seen) = seen {
            state_variables.insert("seen_x_m", Variable::from(seen.x));
        }

        let state = PublicState {
            epoch,
            tick,
            location: if wrong.is("tick.initial") && tick == 0 {
                Point::default()
            } else {
                walker.at
            },
            speed_mps: 0.1,
            direction_rad: if wrong.is("number.angles:half") && tick == SLOW_TICK {
                // Half a turn as it is rounded, on the wrong side.
                f64::from(-3_141_593) / 1e6
            } else {
                ((angle + turn) * 1e6).round() / 1e6
            },
            state_variables,
            emotion_state: "CALM".to_owned(),
            behavior_state: "WALK".to_owned(),
        };

        let report = self.report(&welcome, &walker, &state, &commands, log);
        self.walker = Some(walker);
        Ok((commands, state, report))
    }

    fn report(
        &self,
        welcome: &Welcome,
        walker: &Walker,
        state: &PublicState,
        commands: &[Sent<CommandText>],
        log: Vec<String>,
    ) -> Report {
        let wrong = &self.wrong;
        let generation = if wrong.is("tick.answer:generation") {
            7
        } else if wrong.is("return.generation:number") {
            1
        } else {
            welcome.generation
        };
        let mut stated = u32::try_from(commands.len()).unwrap_or(u32::MAX);
        if wrong.is("command.sent") {
            stated = 0;
        }
        if wrong.is("command.sent:count") && stated > 0 {
            stated += 1;
        }
        let mut state_variables = state.state_variables.clone();
        if wrong.is("number.finite") {
            state_variables.insert("ratio", Variable::Number(f64::NAN));
        }

        Report {
            epoch: state.epoch,
            tick: state.tick,
            generation,
            proposal: walker.proposal,
            speed_mps: state.speed_mps,
            direction_rad: state.direction_rad,
            emotion_state: state.emotion_state.clone(),
            behavior_state: state.behavior_state.clone(),
            state_variables,
            commands: stated,
            log,
            site_actions: Vec::new(),
            layer_actions: Vec::new(),
            velocity: wrong.is("tick.velocity").then(Velocity::default),
        }
    }

    /// Queries the location of another robot in some ticks.
    fn ask_another(
        &mut self,
        tick: Tick,
        epoch: Epoch,
        news: &TickUpdate,
        welcome: &Welcome,
        is_awake: bool,
    ) -> Result<Option<Point>, Failure> {
        let mut others = welcome.roster.iter().filter(|name| **name != self.name);
        let takes_first = self.wrong.is("query.asking:first");
        let takes_some = self.wrong.is("query.asking:some");
        let other = if takes_first || takes_some {
            others.next_back()
        } else {
            others.next()
        };
        let mut other = other.cloned();
        if welcome.roster.len() > FEW && self.wrong.is("determinism.seed:hash") {
            // In the order of a hash table, which another process has in another way.
            let mut order = stream(u64::from(std::process::id()), &tick.to_string());
            let at = (unit(&mut order) * FEW as f64) as usize;
            let mut others = welcome.roster.iter().filter(|name| **name != self.name);
            other = others.nth(at).cloned();
        }
        let Some(other) = other else {
            return Ok(None);
        };
        let is_present = self.present.contains(other.as_str());
        if !is_present && self.wrong.is("query.again:tokens") {
            return Ok(None);
        }
        if tick == 0 && self.wrong.is("query.asking:zero") {
            self.query(other, tick, epoch)?;
            return Ok(None);
        }
        if news.in_range.is_none() && self.wrong.is("query.asking:listed") {
            return Ok(None);
        }
        let mut is_unreachable = !news.can_query(&other);
        if takes_first && news.in_range.is_none() {
            is_unreachable = news.unreachable.first() == Some(&other);
        }
        if takes_some
            && news
                .in_range
                .as_ref()
                .is_some_and(|names| !names.is_empty())
        {
            is_unreachable = false;
        }
        // The participant does not know of a tick that is run a second time.
        let is_running = self.shared.is_in(Phase::Computing);
        if tick == 0 || !tick.is_multiple_of(2) || !is_running {
            return Ok(None);
        }
        if is_unreachable {
            let follows = self.wrong.is("query.asking:followed")
                || is_awake && self.wrong.is("query.asking:followed-awake");
            if follows {
                if !std::mem::replace(&mut self.is_following, true) {
                    self.follow(&other)?;
                }
                return Ok(self.newest.as_ref().map(|state| state.location));
            }
            let is_cut = news.unreachable.contains(&other);
            let wrong = if is_cut {
                "query.asking:unreachable"
            } else {
                "query.asking:range"
            };
            let asks_awake = is_awake && is_cut && self.wrong.is("query.asking:awake");
            if self.wrong.is(wrong) || asks_awake {
                self.query(other, tick, epoch)?;
            }
            return Ok(None);
        }

        self.shared.enter(Phase::Asking);
        let found = self.await_state(&other);
        self.shared.enter(Phase::Computing);
        Ok(found?.map(|state| state.location))
    }

    fn await_state(&mut self, of: &RobotName) -> Result<Option<PublicState>, Failure> {
        let at = (of.clone(), self.last_clock.tick);
        if self.wrong.is("epoch.init:cache")
            && let Some(state) = self.cache.get(&at)
        {
            return Ok(Some(state.clone()));
        }
        if self.wrong.is("query.reply:newest") {
            if !std::mem::replace(&mut self.is_following, true) {
                self.follow(of)?;
            }
            if self.newest.is_some() {
                return Ok(self.newest.clone());
            }
        }
        loop {
            let mut actions = Vec::new();
            let found = lock(&self.shared.machine).ask(of, &mut actions);
            self.perform(actions)?;
            if let Some(state) = found {
                self.cache.insert(at, state.clone());
                return Ok(Some(state));
            }

            let is_interrupted = lock(&self.shared.machine).is_interrupted();
            let has_given_up = std::mem::take(&mut self.has_given_up);
            if is_interrupted || has_given_up || self.leave.is_some() {
                return Ok(None);
            }
            self.pump()?;
        }
    }

    pub(crate) fn query(&self, of: RobotName, tick: Tick, epoch: Epoch) -> Result<(), Failure> {
        let parameters = if self.wrong.is("query.asking") {
            String::new()
        } else if self.wrong.is("query.asking:epoch") {
            format!("tick={tick}")
        } else {
            format!("tick={tick};epoch={epoch}")
        };

        let queue = self.queue.clone();
        let key = self.keys.query(&of, STATE);
        self.bus.get_then(&key, &parameters, move |reply| {
            let _ = queue.send(Event::Reply(of, reply));
        })?;
        Ok(())
    }
}
