//! How Leguin answers a waiter who calls for help instead of commanding her by name.

use robot::{Cars, RobotName, StateVariables};

use super::Leguin;
use super::tables::LeguinBehavior;
use crate::chance::Chance;
use crate::commands::{ACCEPT, HELP, OFFER, REFILL};
use crate::published::number;
use crate::recruitment::Recruitment;
use crate::recruitment::shame::Shame;

impl Leguin {
    /// Answers a command that belongs to recruiting. Returns whether nothing else is to be done about it.
    pub(super) fn answer(&mut self, cars: &mut Cars<'_>, from: &RobotName, command: &str) -> bool {
        if !self.parameters.recruitment.by.is_on() || from.as_str() != self.parameters.waiter {
            return false;
        }

        match (command, self.behavior()) {
            (HELP, LeguinBehavior::Wait) if self.state.pending.is_none() => {
                if self.offers(cars) {
                    self.reply(cars, OFFER);
                }
                true
            }
            (HELP, _) => true,
            // She is on this errand, or begins it when she is home.
            (REFILL, LeguinBehavior::Wait | LeguinBehavior::Refill | LeguinBehavior::GoHome) => {
                self.state.shame.relieve();
                self.reply(cars, ACCEPT);
                false
            }
            _ => false,
        }
    }

    /// Whether she offers at a call for help, being idle.
    fn offers(&mut self, cars: &Cars<'_>) -> bool {
        let parameters = &self.parameters.recruitment;
        if parameters.by != Recruitment::Affective {
            return true;
        }

        // A waiter of whom nothing is known may be anywhere on the field.
        let [width_m, height_m] = cars.welcome().field_m;
        let farthest_m = (width_m * width_m + height_m * height_m).sqrt();
        let waiter = self.state.waiter.location();
        let distance_m = waiter.map_or(farthest_m, |waiter| cars.location().distance_m(waiter));
        self.state.shame.hear(distance_m, parameters)
    }

    fn reply(&self, cars: &mut Cars<'_>, answer: &str) {
        // He is in the roster: he has sent a command.
        let _sent = cars.set_robot_command(&self.parameters.waiter, answer);
    }

    /// Draws the shame with which she begins.
    pub(super) fn begin_helping(&mut self, cars: &mut Cars<'_>) {
        let parameters = &self.parameters.recruitment;
        if parameters.by == Recruitment::Affective {
            let share = Chance::split(cars.random()).uniform();
            self.state.shame = Shame::new(share * parameters.shame_start_max);
        }
    }

    /// Adds what she publishes of it.
    pub(super) fn publish_shame(&self, variables: &mut StateVariables) {
        if self.parameters.recruitment.by == Recruitment::Affective {
            variables.insert("shame", self.state.shame.value().into());
        }
    }

    /// Goes on from what an earlier incarnation published of it.
    pub(super) fn resume_shame(&mut self, last: &StateVariables) {
        if let Some(shame) = number(last, "shame") {
            self.state.shame = Shame::new(shame);
        }
    }
}
