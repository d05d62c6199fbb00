//! What arrives: clocks, news, answers to its requests to join.

use std::time::Duration;

use lockstep::{Admission, IncarnationNotice, Leave};
use protocol::messages::{Clock, End, JoinAnswer, JoinRequest, Refusal, TickUpdate, Welcome};
use protocol::{Epoch, PROTOCOL_VERSION, encode};

use crate::answering::Phase;
use crate::host::{Failure, Host};
use crate::walker::Walker;

/// After so many epochs it ends, if it is to.
const MAX_EPOCHS: Epoch = 10;
/// After so many requests without an answer it ends, if it is to.
const MAX_UNANSWERED: usize = 3;
/// The same for one that has more patience: it asks every 0.1 s.
const PATIENT: usize = 250;
/// The same for requests that are refused.
const MAX_REFUSALS: usize = 10;
/// Delay of a declaration that is made too late.
const LATE: Duration = Duration::from_millis(1500);

impl Host {
    pub(crate) fn on_clock(&mut self, mut clock: Clock) -> Result<(), Failure> {
        let own = self.welcome.as_ref().map_or(0, |welcome| welcome.epoch);
        let generation = self
            .welcome
            .as_ref()
            .map_or(0, |welcome| welcome.generation);
        let flag = self.welcome.as_ref().map_or(0, |welcome| welcome.news_flag);
        (clock.epoch, clock.tick) = self.wrong.kept_of(clock.epoch, clock.tick);
        let is_later = clock.epoch > own && own > 0;
        let is_of_other_epoch = clock.epoch != own && self.wrong.is("end.clock:epoch");
        if self.ignores(clock.end) || clock.end.is_some() && is_of_other_epoch {
            return Ok(());
        }
        let is_waiting = self.shared.is_in(Phase::AwaitingNews);
        let is_queued = is_waiting
            && self.has_begun
            && clock.tick > self.last_clock.tick
            && clock.end.is_none();
        if is_queued && self.wrong.is("tick.newest") {
            return Ok(());
        }
        let is_asking = self.shared.is_in(Phase::Asking);
        let is_newer = is_asking && clock.tick > self.last_clock.tick && clock.end.is_none();
        if is_newer && self.wrong.is("tick.newest:asking") {
            return Ok(());
        }
        if is_queued && self.wrong.is("tick.newest:every") {
            self.queued.push_back(clock);
            return Ok(());
        }
        if self.is_unserved {
            self.is_unserved = false;
            self.serve()?;
        }

        let is_unnamed = generation > 1 && !self.has_begun;
        let begins = is_later && clock.end.is_none();
        if begins && is_unnamed && self.wrong.is("epoch.init:unnamed") {
            return Ok(());
        }
        let is_repeated =
            clock.tick == self.last_clock.tick && clock.epoch == self.last_clock.epoch;
        if is_repeated && self.wrong.is("end.clock:repeated") {
            clock.end = None;
        }
        if begins && is_asking && self.wrong.is("epoch.init:asking")
            || begins && is_waiting && self.wrong.is("epoch.init:waiting")
            || begins && clock.epoch > own + 1 && self.wrong.is("epoch.late:next")
        {
            return Ok(());
        }
        let is_first = clock.tick == 0 && clock.end.is_none();
        if self.wrong.is("epoch.init") && is_later && is_first
            || self.wrong.is("epoch.late") && is_later && clock.tick > 0
        {
            return Ok(());
        }
        if let Some((epoch, tick)) = self.last {
            let is_late_tick = clock.epoch == epoch && clock.tick < tick;
            let is_awake = self.walker.as_ref().is_some_and(|walker| !walker.is_asleep);
            if self.wrong.is("clock.late") && is_late_tick
                || self.wrong.is("clock.late:awake") && is_late_tick && is_awake
                || self.wrong.is("clock.late:quiet") && is_late_tick && clock.news & flag == 0
                || self.wrong.is("clock.late:epoch") && clock.epoch < epoch
            {
                let (_, _, report) = self.act(clock.epoch, clock.tick, &TickUpdate::default())?;
                let key = self.keys.report(&self.name);
                self.bus.put(&key, encode(&report))?;
                return Ok(());
            }
        }
        if self.wrong.is("news.wait") {
            clock.news = 0;
        }
        if self.wrong.is("news.wait:equal") && clock.news != flag {
            clock.news &= !flag;
        }
        if self.wrong.is("news.wait:always") && clock.news != 0 {
            clock.news |= flag;
        }
        let is_early = clock.tick > 0
            && clock.epoch == own
            && self.last.is_none_or(|(epoch, _)| epoch < clock.epoch)
            && self.wrong.is("return.generation")
            && own == 1;
        let is_early =
            is_early || is_unnamed && clock.tick == 0 && self.wrong.is("return.generation:zero");
        if is_early {
            self.drive(|machine, out| {
                let naming = IncarnationNotice {
                    joined: Some(generation),
                    rejoin: None,
                };
                machine.news(clock.epoch, clock.tick, naming, TickUpdate::default(), out);
            })?;
        }

        let is_new = (clock.epoch, clock.tick) > (self.last_clock.epoch, self.last_clock.tick);
        if is_new {
            self.last_clock = clock;
        }
        self.repetitions = if is_new { 0 } else { self.repetitions + 1 };
        if self.repetitions > 1 && self.wrong.is("clock.duplicate:twice") {
            return Ok(());
        }
        if !is_new && clock.panels && self.wrong.is("clock.duplicate:panels") {
            return Ok(());
        }
        if !is_new && self.shared.is_in(Phase::AwaitingNews) && self.wrong.is("news.wait:repeated")
        {
            return self.on_news(TickUpdate {
                epoch: clock.epoch,
                tick: clock.tick,
                ..TickUpdate::default()
            });
        }
        if is_new && clock.news & flag != 0 && self.shared.is_in(Phase::Idle) {
            self.shared.enter(Phase::AwaitingNews);
        }
        self.drive(|machine, out| machine.clock(clock, out))
    }

    /// Whether it ignores the end of the run.
    fn ignores(&self, end: Option<End>) -> bool {
        match end {
            None => false,
            Some(End::Finished) if self.wrong.is("end.clock:finished") => true,
            Some(End::Stopped) if self.wrong.is("end.clock:stopped") => true,
            Some(End::Aborted) if self.wrong.is("end.clock:aborted") => true,
            Some(_) => {
                self.wrong.is("end.clock:unnamed") && self.welcome.is_some() && !self.has_begun
                    || self.wrong.is("end.clock:news") && self.shared.is_in(Phase::AwaitingNews)
                    || self.wrong.is("end.clock:answer") && self.shared.is_in(Phase::Asking)
            }
        }
    }

    pub(crate) fn on_news(&mut self, mut news: TickUpdate) -> Result<(), Failure> {
        let generation = self
            .welcome
            .as_ref()
            .map_or(0, |welcome| welcome.generation);
        for named in [&mut news.joined, &mut news.rejoin] {
            *named = named.map(|of| self.wrong.generation_kept_of(of));
        }
        if self.wrong.is("return.replaced") && news.joined.is_some_and(|joined| joined > generation)
        {
            news.joined = None;
        }
        let is_later = news.joined.is_some_and(|joined| joined > generation);
        if is_later && !self.has_begun && self.wrong.is("return.replaced:unnamed") {
            news.joined = None;
        }
        let is_seated = self.last.is_some() && (news.epoch, generation) == (1, 1);
        if is_seated && news.joined == Some(1) {
            if self.wrong.is("return.own-joined") {
                self.leave = Some(Leave::Replaced);
            }
            self.starts_over |= self.wrong.is("return.own-joined:over");
        }
        let is_lower = news.joined.is_some_and(|joined| joined < generation);
        if is_lower && self.has_begun && self.wrong.is("return.own-joined:lower") {
            self.leave = Some(Leave::Replaced);
        }
        let is_other = news.joined.is_some_and(|joined| joined != generation);
        let takes_it = is_lower && self.wrong.is("return.generation:lower")
            || is_other && self.wrong.is("return.generation:any");
        let takes_it =
            takes_it || news.correction.is_some() && self.wrong.is("return.generation:placed");
        if takes_it && !self.has_begun && generation > 1 {
            news.joined = Some(generation);
        }
        if self.wrong.is("return.rejoin")
            || self.wrong.is("return.rejoin:once") && news.rejoin.is_some_and(|of| of > 1)
        {
            news.rejoin = None;
        }
        if news.rejoin.is_some() && self.wrong.is("return.generation:rejoin") {
            news.rejoin = Some(generation);
        }

        let (mut epoch, mut tick) = self.wrong.kept_of(news.epoch, news.tick);
        if self.wrong.is("news.wait:epoch") && news.rejoin == Some(generation) {
            epoch = self.last_clock.epoch;
        }
        if self.wrong.is("news.wait:any") && self.shared.is_in(Phase::AwaitingNews) {
            epoch = self.last_clock.epoch;
            tick = self.last_clock.tick;
        }

        let own = self.welcome.as_ref().map_or(0, |welcome| welcome.epoch);
        if epoch < own && self.wrong.is("clock.late:joined") {
            (epoch, news.rejoin) = (own, None);
        }

        if self.wrong.is("epoch.init:received") || self.wrong.is("tick.newest:news") {
            self.strays.push(news.clone());
        }
        let naming = IncarnationNotice::from(&news);
        self.drive(|machine, out| machine.news(epoch, tick, naming, news, out))
    }

    pub(crate) fn ask_to_join(&mut self) -> Result<(), Failure> {
        let is_again = self.welcome.is_some();
        let mut instance = self.bus.id();
        if self.wrong.is("join.request:instance") {
            instance = "me".to_owned();
        }
        if is_again && self.wrong.is("epoch.init:instance") {
            instance.push_str(" again");
        }
        let epoch = self.welcome.as_ref().map_or(0, |welcome| welcome.epoch);
        if epoch >= MAX_EPOCHS && self.wrong.is("epoch.init:few") {
            self.leave = Some(Leave::Stopped);
            return Ok(());
        }
        let request = JoinRequest {
            protocol: if self.wrong.is("join.request") {
                99
            } else {
                PROTOCOL_VERSION
            },
            run: self.run.clone(),
            name: self.name.clone(),
            instance,
            bodies: false,
            ranges: is_again && self.wrong.is("epoch.init:ranges"),
            sdk: "wrong robot".to_owned(),
        };
        let is_later = self.last_clock.epoch > epoch;
        let renews_token = self.wrong.is("epoch.init:token")
            || self.wrong.is("epoch.late:token") && is_later && self.last_clock.tick > 0
            || self.wrong.is("return.rejoin:token") && !is_later;
        if is_again && renews_token {
            self.token = None;
            self.declare_token()?;
        }

        let key = self.keys.join_as(&self.name);
        let reply = self.bus.get(&key, "", Some(encode(&request)))?;
        let bytes = reply.and_then(|reply| reply.result.ok());
        match bytes.and_then(|bytes| self.wrong.read(&key, &bytes)) {
            None => {
                self.unanswered += usize::from(is_again);
                let has_patience = self.unanswered < MAX_UNANSWERED
                    || self.unanswered < PATIENT && self.wrong.is("return.rejoin:impatient");
                if !has_patience
                    && (self.wrong.is("return.rejoin:three")
                        || self.wrong.is("return.rejoin:impatient"))
                {
                    self.leave = Some(Leave::Stopped);
                }
                self.drive(lockstep::Participant::unanswered)
            }
            Some(JoinAnswer::Refused { .. })
                if is_again && self.wrong.is("return.replaced:taken") =>
            {
                self.drive(lockstep::Participant::unanswered)
            }
            Some(JoinAnswer::Refused {
                reason: Refusal::Ended,
                ..
            }) if self.wrong.is("join.refused:ended") => {
                self.drive(lockstep::Participant::unanswered)
            }
            Some(JoinAnswer::Refused {
                reason,
                explanation,
            }) => {
                self.explanation = explanation;
                self.refusals += 1;
                if self.refusals >= MAX_REFUSALS && self.wrong.is("join.refused:ten") {
                    self.leave = Some(Leave::Refused(reason));
                }
                if reason == Refusal::NameTaken && self.wrong.is("join.refused:impatient") {
                    self.leave = Some(Leave::Refused(reason));
                }
                self.drive(|machine, out| machine.refused(reason, out))
            }
            Some(JoinAnswer::Welcome(welcome)) => self.on_welcome(*welcome),
        }
    }

    pub(crate) fn on_welcome(&mut self, mut welcome: Welcome) -> Result<(), Failure> {
        if self.wrong.is("epoch.init:welcome") && self.last_clock.epoch > welcome.epoch {
            welcome.epoch = self.last_clock.epoch;
        }
        if self.wrong.is("determinism.seed:32-bits") {
            welcome.seed &= u64::from(u32::MAX);
        }
        if let Some(before) = &self.welcome
            && self.wrong.is("epoch.init:location")
            && before.epoch < welcome.epoch
        {
            welcome.location = before.location;
        }
        welcome.generation = self.wrong.generation_kept_of(welcome.generation);
        let admission = Admission::from(&welcome);
        let before = self.welcome.as_ref().map(Admission::from);
        let is_other = self.last_clock.epoch > 0 && self.last_clock.epoch != admission.epoch;
        if is_other && self.wrong.is("epoch.init:exactly") {
            return self.drive(lockstep::Participant::unanswered);
        }
        self.starts_over |= before == Some(admission) && self.wrong.is("epoch.init:restarts");
        if before.is_some_and(|before| before != admission) {
            self.has_rejoined |= before.is_some_and(|before| before.epoch == admission.epoch);
            self.has_begun = false;
            self.queued.clear();
            // The news that it waited for are those of a tick that it forgets.
            if self.shared.is_in(Phase::AwaitingNews) {
                self.shared.enter(Phase::Idle);
            }
        }

        let mut states = welcome.states_before();
        if self.wrong.is("return.generation:state") {
            states.clear();
        }

        let is_early = self.wrong.is("epoch.late:early") && welcome.epoch > 1 && welcome.tick > 0;
        self.welcome = Some(welcome);
        self.drive(|machine, out| machine.admitted(admission, states, out))?;
        if is_early {
            let clock = self.last_clock;
            let naming = IncarnationNotice {
                joined: Some(admission.generation),
                rejoin: None,
            };
            self.drive(|machine, out| {
                machine.news(clock.epoch, clock.tick, naming, TickUpdate::default(), out);
                machine.clock(clock, out);
            })?;
        }
        Ok(())
    }

    pub(crate) fn on_declare_token(&mut self) -> Result<(), Failure> {
        self.declare_token()?;

        if self.wrong.is("join.ready-last") {
            std::thread::sleep(LATE);
            self.listen_to_clocks()?;
        }
        if self.wrong.is("join.ready-last:news") {
            std::thread::sleep(LATE);
            self.listen_to_news()?;
        }

        if self.wrong.is("tick.answer:unasked") {
            let welcome = self.welcome.clone().ok_or("no welcome")?;
            self.walker = Some(Walker::new(&welcome, &self.wrong));
            let (_, _, report) = self.act(welcome.epoch, 0, &TickUpdate::default())?;
            self.bus
                .put(&self.keys.report(&self.name), encode(&report))?;
        }
        Ok(())
    }
}
