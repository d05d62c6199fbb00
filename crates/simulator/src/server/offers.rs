//! Asks robots whether they can work with other parameters, before these are set: a wrong one is refused with the robot's reason,
//! and nothing has happened then. What is set is in the record, so a run that is executed again asks nothing.

use std::thread;
use std::time::{Duration, Instant};

use bus::{Bus, Query};
use protocol::keys::Keys;
use protocol::messages::{Control, Intervention, Parameters, ParametersAnswer, ParametersOffer};
use protocol::{RobotName, decode, encode};

use super::event::ServerEvent;
use super::frontend::Frontend;
use super::live::LiveRun;
use super::requests::load;

/// How long robots may take to answer, all together. One that cannot check its parameters has no queryable and costs nothing; one
/// that is stopped finds out when it begins.
const TIMEOUT: Duration = Duration::from_secs(2);

/// Parameters, and the robot that would get them.
type Offer = (RobotName, Parameters);

impl LiveRun {
    /// The parameters that a request would give to robots.
    pub(super) fn offers(&self, control: &Control) -> Vec<Offer> {
        let simulation = &self.epoch.simulation;
        match control {
            Control::Intervene { what } if matches!(what, Intervention::Set { .. }) => {
                simulation.parameters_set_by(what)
            }
            Control::Load { scenario } => load(scenario, simulation.scenario())
                .map_or_else(|_| Vec::new(), |next| next.all_parameters()),
            _ => Vec::new(),
        }
    }

    /// Asks the robots, on a thread of its own: nothing may wait for them here. The request is then handled as [`Event::Offered`].
    pub(super) fn offer(query: Query, control: Control, offers: Vec<Offer>, frontend: &Frontend) {
        let bus = frontend.bus.clone();
        let keys = frontend.keys.clone();
        let inbox = frontend.inbox.clone();

        let asking = thread::Builder::new()
            .name("offers".to_owned())
            .spawn(move || {
                let refusal = ask_all(&bus, &keys, &offers).err();
                inbox.send(ServerEvent::Offered {
                    query,
                    control,
                    refusal,
                });
            });
        // The query has gone with the closure: it ends at once where it was sent, without an answer.
        if let Err(error) = asking {
            tracing::warn!("robots cannot be asked about their parameters: {error}");
        }
    }
}

/// Asks one robot after the other.
///
/// # Errors
/// The first refusal, in words.
fn ask_all(bus: &Bus, keys: &Keys, offers: &[Offer]) -> Result<(), String> {
    // One limit for all robots together: a client waits for this.
    let deadline = Instant::now() + TIMEOUT;
    for (robot, parameters) in offers {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            tracing::warn!("not all robots have been asked about their parameters in time");
            break;
        }

        let key = keys.parameters(robot);
        let offer = ParametersOffer {
            parameters: parameters.clone(),
        };
        match bus.get_within(&key, "", Some(encode(&offer)), left) {
            Ok(Some(reply)) => judge(robot, &key, reply.result)?,
            // It has no check, or is stopped: then it finds out when it begins.
            Ok(None) => {}
            Err(error) => tracing::warn!("{error}"),
        }
    }
    Ok(())
}

fn judge(robot: &RobotName, key: &str, answer: Result<Vec<u8>, String>) -> Result<(), String> {
    let answer = match answer {
        Ok(answer) => decode::<ParametersAnswer>(key, robot.as_str(), &answer),
        Err(reason) => {
            tracing::warn!(%robot, "parameters cannot be checked: {reason}");
            return Ok(());
        }
    };

    match answer {
        Ok(ParametersAnswer::Accepted) => Ok(()),
        Ok(ParametersAnswer::Refused { reason }) => {
            Err(format!("{robot} refuses these parameters: {reason}"))
        }
        Err(error) => {
            tracing::warn!("{error}");
            Ok(())
        }
    }
}
