//! How robots come to take part: the one that is checked, and those that the kit plays.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use lockstep::{Admission, Refused, Stamp};
use nix::sys::signal::Signal;
use protocol::messages::{JoinAnswer, Refusal, TickUpdate};
use protocol::{Epoch, Generation, RobotName, Tick};

use super::{Harness, barrier, patient, start};
use crate::fake_peers::FakePeers;
use crate::patience::{Limit, PATIENCE, START_PATIENCE};
use crate::report::RuleFailure;
use crate::wire::Joining;

/// The instance of robots that the kit plays.
const OWN_INSTANCE: &str = "conformance kit";
/// Tokens that are declared are known within this time.
const ARRIVED: Duration = Duration::from_millis(200);
/// How often it is looked whether a process is stopped.
const SOON: Duration = Duration::from_millis(5);

impl Harness<'_> {
    /// Sets the other robots up and begins the first epoch, so that the robot can be admitted.
    pub fn prepare(&mut self) -> Result<(), RuleFailure> {
        let kit = self.kit;
        let subject = kit.subject();
        self.template = kit.template(&self.run, self.options.roster);
        self.fake_peers = FakePeers::new(
            kit.others(self.options.roster),
            self.options.has_extras,
            self.options.writes_integers,
        );
        self.wire.keep(self.fake_peers.serve(&kit.bus, &self.keys)?);
        self.tokens = self.fake_peers.show(&kit.bus, &self.keys)?;
        self.wire.guard(self.fake_peers.names())?;
        if self.options.is_followed {
            self.wire.follow(&subject)?;
        }

        let others: Vec<RobotName> = self.fake_peers.names().cloned().collect();
        let roster = others.iter().cloned().chain([subject.clone()]);
        self.barrier = barrier(roster);
        for name in &others {
            self.play(name, OWN_INSTANCE);
        }
        // A token that was declared before the welcome is a flaw of its own, and hides nothing else.
        if self.is_present() {
            self.drive(|barrier, out| barrier.token(&subject, true, out));
        }

        self.begin_epoch(1);
        Ok(())
    }

    /// The kit plays this robot: it joins at once.
    fn play(&mut self, name: &RobotName, instance: &str) {
        self.drive(|barrier, out| {
            let admission = barrier.join(name, instance, out);
            assert!(
                admission.is_ok(),
                "the name of a robot that is played is free"
            );
            barrier.token(name, true, out);
        });
    }

    /// `init`: begins an epoch.
    pub fn begin_epoch(&mut self, epoch: Epoch) {
        self.epoch = epoch;
        self.next = 0;
        self.is_gathered = false;
        self.outcome = None;
        self.drive(|barrier, out| barrier.gather(epoch, patient(), out));
    }

    /// A predecessor of the robot's process, played by the kit, takes part up to this tick and is gone.
    pub fn play_predecessor(&mut self, last: Tick) -> Result<(), RuleFailure> {
        let subject = self.kit.subject();
        // Each is a process of its own.
        self.play(&subject, &format!("{OWN_INSTANCE} {last}"));
        let (generation, _) = self.barrier.presence(&subject);
        for tick in self.next..=last {
            self.open(&TickUpdate::default())?;
            let stamp = Stamp {
                epoch: self.epoch,
                tick,
                generation,
            };
            self.drive(|barrier, out| barrier.report(&subject, stamp, 0, usize::MAX, out));
            self.outcome = None;
        }

        // Its name is free then, and the process that joins is the next incarnation.
        self.drive(|barrier, out| barrier.token(&subject, false, out));
        Ok(())
    }

    /// So many incarnations of the robot, played by the kit, have joined and are gone before a tick names one of them.
    pub fn pass_incarnations(&mut self, count: Generation) {
        let subject = self.kit.subject();
        for number in 0..count {
            self.play(&subject, &format!("{OWN_INSTANCE} of {number}"));
            self.drive(|barrier, out| barrier.token(&subject, false, out));
        }
    }

    /// Another process, played by the kit, takes the place of the robot's.
    pub fn play_successor(&mut self) {
        let subject = self.kit.subject();
        self.drive(|barrier, out| barrier.token(&subject, false, out));
        self.play(&subject, OWN_INSTANCE);
    }

    /// The oldest request to join that is queued.
    fn take_join(&mut self) -> Option<Joining> {
        self.joins.pop_front()
    }

    /// The next request to join.
    pub fn next_join(&mut self, patience: Duration) -> Result<Joining, RuleFailure> {
        self.until("a request to join", patience, Self::take_join)
    }

    /// Admits the robot, and waits until its token is declared. From now on its requests are answered as they come.
    pub fn join(&mut self) -> Result<(), RuleFailure> {
        self.prepare()?;
        self.admit_first()
    }

    /// The same where the other robots are set up.
    pub fn admit_first(&mut self) -> Result<(), RuleFailure> {
        let joining = self.next_join(START_PATIENCE)?;
        self.admit(joining);
        self.keeps_requests = false;
        self.until_ready()
    }

    /// Answers a request to join as the barrier decides.
    pub fn admit(&mut self, joining: Joining) {
        self.seen.requests.push(joining.request.clone());
        let request = match &joining.request {
            Ok(request) => request.clone(),
            Err(error) => {
                let explanation = error.clone();
                return self.refuse_join(joining, Refusal::Malformed, &explanation);
            }
        };

        let mut admitted = Err(Refused::Ended);
        self.drive(|barrier, out| admitted = barrier.join(&request.name, &request.instance, out));
        match admitted {
            Ok(admission) => self.welcome(joining, admission),
            Err(Refused::UnknownName) => self.refuse_join(
                joining,
                Refusal::UnknownName,
                "no robot of this run has this name",
            ),
            Err(Refused::NameTaken) => {
                self.refuse_join(joining, Refusal::NameTaken, "another process is this robot");
            }
            Err(Refused::Ended) => {
                self.refuse_join(joining, Refusal::Ended, "the run is over");
            }
        }
    }

    fn welcome(&self, joining: Joining, admission: Admission) {
        let mut welcome = self.template.clone();
        welcome.epoch = admission.epoch;
        welcome.generation = admission.generation;
        welcome.news_flag = admission.news_flag;
        welcome.tick = self.next.saturating_sub(1);
        // Real time decides when a process asks, and where the body stands then.
        if self.asks_early && admission.generation > 1 {
            welcome.tick = welcome.tick.saturating_sub(1);
            welcome.location.x += 0.0625;
        }
        self.answer_join(joining, &JoinAnswer::Welcome(Box::new(welcome)));
    }

    /// Welcomes the robot to an epoch that is over.
    pub fn welcome_to(&mut self, joining: Joining, epoch: Epoch) {
        self.seen.requests.push(joining.request.clone());
        let admission = Admission {
            epoch,
            generation: 1,
            news_flag: self.flag(),
        };
        self.welcome(joining, admission);
    }

    /// Answers a request to join. With it the query ends, for which a robot may wait.
    fn answer_join(&self, joining: Joining, answer: &JoinAnswer) {
        let Joining { query, key, .. } = joining;
        query.reply(&key, self.fake_peers.dress(answer));
    }

    /// Refuses a request to join.
    pub fn refuse_join(&self, joining: Joining, reason: Refusal, explanation: &str) {
        let refused = JoinAnswer::Refused {
            reason,
            explanation: explanation.to_owned(),
        };
        self.answer_join(joining, &refused);
    }

    /// Waits until the robot's token is declared.
    pub fn until_ready(&mut self) -> Result<(), RuleFailure> {
        self.until(
            "its liveliness token after the welcome",
            PATIENCE,
            |harness| harness.is_present().then_some(()),
        )
    }

    /// Stops the robot's process, as a hang does.
    pub fn hang(&mut self) -> Result<(), RuleFailure> {
        self.process.signal(Signal::SIGSTOP);
        // The thread that takes the signal stops the others: until it has a processor, they run on.
        let mut limit = Limit::new(PATIENCE);
        while !self.process.is_stopped() {
            if limit.is_over(&self.process) {
                return Err(RuleFailure::new(
                    "its process is stopped by SIGSTOP",
                    self.process.fate(),
                ));
            }
            self.pass(SOON);
        }
        Ok(())
    }

    /// The robot's process is killed, and its token gone.
    pub fn crash(&mut self) -> Result<(), RuleFailure> {
        self.process.signal(Signal::SIGKILL);
        self.until_gone()
    }

    /// Starts another process of the robot on the same run, and waits until it has joined.
    pub fn restart(&mut self) -> Result<(), RuleFailure> {
        self.process = start(self.kit, &self.run, &self.options)?;
        self.until(
            "its liveliness token after its start",
            START_PATIENCE,
            |harness| harness.is_present().then_some(()),
        )
    }

    /// The generation of the process that was admitted last.
    pub fn generation(&self) -> Generation {
        self.barrier.presence(&self.kit.subject()).0
    }

    /// The tokens of the other robots are gone; their queryables are still there.
    pub fn hide_others(&mut self) {
        self.tokens.clear();
    }

    /// The same. Returns tokens that are declared all the same, but for that of the robot.
    pub fn tokens_of_others(&mut self) -> Result<BTreeSet<String>, RuleFailure> {
        self.hide_others();
        let tokens = Arc::new(Mutex::new(BTreeSet::new()));
        let known = Arc::clone(&tokens);
        let watched = self
            .kit
            .bus
            .liveliness(&self.keys.alive(), move |key, is_present| {
                let mut known = known.lock().unwrap_or_else(PoisonError::into_inner);
                if is_present {
                    known.insert(key.to_owned());
                } else {
                    known.remove(key);
                }
            })?;
        self.pass(ARRIVED);
        drop(watched);

        let mut tokens =
            std::mem::take(&mut *tokens.lock().unwrap_or_else(PoisonError::into_inner));
        tokens.remove(&self.keys.alive_robot(&self.kit.subject()));
        Ok(tokens)
    }

    /// Waits until the robot, whose news ask it to, has joined again.
    pub fn until_rejoined(&mut self, before: Generation) -> Result<(), RuleFailure> {
        self.until_asked_again(before, |harness| {
            (harness.generation() > before && harness.is_present()).then_some(())
        })
    }

    /// The next request to join of the robot, whose news ask it to join again.
    pub fn next_rejoin(&mut self) -> Result<Joining, RuleFailure> {
        self.until_asked_again(self.generation(), Self::take_join)
    }

    /// Puts news that ask this incarnation to join again, until that is found which follows.
    fn until_asked_again<T>(
        &mut self,
        generation: Generation,
        found: impl FnMut(&mut Self) -> Option<T>,
    ) -> Result<T, RuleFailure> {
        let news = TickUpdate {
            rejoin: Some(generation),
            ..self.open_news()
        };
        self.until_put(
            "another request to join when its news have its generation as `rejoin`",
            PATIENCE,
            |harness| harness.put_news(&news),
            found,
        )
    }

    /// Whether the robot takes part from the next tick on, in the middle of an epoch.
    pub fn takes_over(&self) -> bool {
        let (generation, _) = self.barrier.presence(&self.kit.subject());
        let has_answered = self.seen.answers.iter().any(|answer| {
            let report = &answer.reading.report;
            (report.epoch, report.generation) == (self.epoch, generation)
        });

        self.next > 0 && !has_answered
    }
}
