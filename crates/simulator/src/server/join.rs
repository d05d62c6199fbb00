//! Joining: a request becomes a welcome or a refusal.

use bus::Query;
use lockstep::Refused;
use protocol::keys::Keys;
use protocol::messages::{JoinAnswer, JoinRequest, Refusal};
use protocol::{PROTOCOL_VERSION, RobotName, RunName, decode, encode};

use super::frontend::Frontend;
use super::live::LiveRun;

/// Why a robot may not take part, for programs and for people.
type NotAdmitted = (Refusal, String);

impl LiveRun {
    pub(super) fn on_join(&mut self, query: &Query, frontend: &Frontend) {
        let answer = match self.judge_join(query, &frontend.run) {
            Ok(answer) => answer,
            Err((reason, explanation)) => {
                tracing::info!("refused a robot: {explanation}");
                JoinAnswer::Refused {
                    reason,
                    explanation,
                }
            }
        };

        // Before anything that the barrier wants put because of it: one session's messages arrive in their order, and a reply has the
        // priority of its get. So news and clock that are put again arrive behind the welcome.
        query.reply(query.key(), encode(&answer));
    }

    fn judge_join(&mut self, query: &Query, run: &RunName) -> Result<JoinAnswer, NotAdmitted> {
        let request: JoinRequest = decode(query.key(), "a robot", &query.body())
            .map_err(|error| (Refusal::Malformed, error.to_string()))?;
        // What the request itself shows to be wrong is refused before the barrier is asked.
        check_request(query, &request, run)?;

        let name = &request.name;
        let admission = self
            .barrier
            .join(name, &request.instance, &mut self.outputs);
        // It asks again soon, and takes the place when it is free: the clock may wait for it a little.
        if admission == Err(Refused::NameTaken) {
            self.departed.refused(name);
        }
        let admission = admission.map_err(|refused| self.explain(refused, name, run))?;
        self.orders.joined(name);
        if request.bodies {
            self.with_bodies.insert(name.clone());
        } else {
            self.with_bodies.remove(name);
        }
        if request.ranges {
            self.with_ranges.insert(name.clone());
        } else {
            self.with_ranges.remove(name);
        }
        let simulation = &mut self.epoch.simulation;
        simulation.list_bodies(name, request.bodies);
        simulation.list_ranges(name, request.ranges);

        // A predecessor may have answered the open tick: then its successor begins after that answer.
        let open = self.barrier.open_report(name).map(AsRef::as_ref);
        let welcome = simulation.welcome(run, name, admission.generation, open);
        match welcome {
            Some(welcome) => Ok(JoinAnswer::Welcome(Box::new(welcome))),
            None => Err(self.explain(Refused::UnknownName, name, run)),
        }
    }

    fn explain(&self, refused: Refused, name: &RobotName, run: &RunName) -> NotAdmitted {
        match refused {
            Refused::Ended => (Refusal::Ended, format!("run {run} is over")),
            Refused::NameTaken => (
                Refusal::NameTaken,
                format!("another living process is {name} already"),
            ),
            Refused::UnknownName => {
                let roster: Vec<&str> = self.barrier.roster().map(RobotName::as_str).collect();
                let explanation = format!(
                    "no robot of this run is called {name}; its robots are {}",
                    roster.join(", ")
                );
                (Refusal::UnknownName, explanation)
            }
        }
    }
}

/// Checks what does not depend on the other robots.
fn check_request(query: &Query, request: &JoinRequest, run: &RunName) -> Result<(), NotAdmitted> {
    let name = &request.name;

    // Access control sees keys and not messages: both must name the same robot.
    let asker = Keys::joins_as(query.key());
    if let Some(asker) = asker.filter(|asker| *asker != name.as_str()) {
        let explanation = format!("{asker} cannot join as {name}");
        return Err((Refusal::Malformed, explanation));
    }
    if request.protocol != PROTOCOL_VERSION {
        let explanation = format!(
            "{name} speaks version {} of the protocol, this simulator version {PROTOCOL_VERSION}: update the older one",
            request.protocol
        );
        return Err((Refusal::OtherProtocol, explanation));
    }
    if request.run != *run {
        let explanation = format!("{name} means run {}, this is run {run}", request.run);
        return Err((Refusal::OtherRun, explanation));
    }

    Ok(())
}
