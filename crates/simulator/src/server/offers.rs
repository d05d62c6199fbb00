//! Asks robots whether they can work with other parameters, before these are set: a wrong one is refused with the robot's reason,
//! and nothing has happened then. What is set is in the record, so a run that is executed again asks nothing.

use std::thread;
use std::time::{Duration, Instant};

use bus::{Bus, Query};
use protocol::keys::Keys;
use protocol::messages::{Control, Intervention, Parameters, ParametersAnswer, ParametersOffer};
use protocol::{RobotName, decode, encode};

use super::control::load;
use super::process::{Event, Server};
use crate::simulation::Simulation;

/// How long robots may take to answer, all together. One that cannot check its parameters has no queryable and costs nothing; one
/// that is stopped finds out when it begins.
const PATIENCE: Duration = Duration::from_secs(2);

/// Parameters, and the robot that would get them.
type Offer = (RobotName, Parameters);

impl Server {
    /// The parameters that a request would give to robots.
    pub(super) fn offers(control: &Control, simulation: &Simulation) -> Vec<Offer> {
        match control {
            Control::Intervene { what } if matches!(what, Intervention::Set { .. }) => {
                simulation.parameters_set_by(what)
            }
            Control::Load { scenario } => load(scenario, simulation.scenario())
                .map_or_else(|_| Vec::new(), |next| next.all_parameters()),
            _ => Vec::new(),
        }
    }

    /// Asks the robots, on a thread of its own: nothing may wait for them here. The request comes back as [`Event::Offered`].
    pub(super) fn offer(&self, query: Query, control: Control, offers: Vec<Offer>) {
        let bus = self.bus.clone();
        let keys = self.keys.clone();
        let send = self.sender();
        let asking = thread::Builder::new()
            .name("offers".to_owned())
            .spawn(move || {
                let refusal = ask_all(&bus, &keys, &offers).err();
                send(Event::Offered {
                    query,
                    control: Box::new(control),
                    refusal,
                });
            });
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
    let deadline = Instant::now() + PATIENCE;
    for (robot, parameters) in offers {
        let patience = deadline.saturating_duration_since(Instant::now());
        if patience.is_zero() {
            tracing::warn!("not all robots have been asked about their parameters in time");
            break;
        }

        let key = keys.parameters(robot);
        let offer = ParametersOffer {
            parameters: parameters.clone(),
        };
        match bus.get_within(&key, "", Some(encode(&offer)), patience) {
            Ok(Some(reply)) => judge(robot, &key, reply.result)?,
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
