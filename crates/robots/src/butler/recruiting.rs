//! How Butler gets a refiller where he commands none by name: he calls all of them, and assigns one of those who offer.

use robot::{Cars, RobotName, StateVariables};

use super::Butler;
use crate::commands::{HELP, REFILL};
use crate::published::{count, number, text};
use crate::recruitment::recruiter::{RecruitingCounts, RecruitingStep};

impl Butler {
    /// Whether he recruits refillers.
    pub(super) fn recruits(&self) -> bool {
        self.parameters.recruitment.by.is_on()
    }

    /// Whether there is a refiller who is to come: the one whom he has chosen, or else the one whom he commands.
    pub(super) fn has_refiller(&self) -> bool {
        !self.recruits() || self.state.recruiter.chosen().is_some()
    }

    /// Calls for help instead of sending a command, unless a refiller has accepted. Returns whether he does.
    pub(super) fn calls_for_help(&mut self) -> bool {
        let is_calling = self.recruits() && !self.state.recruiter.is_assigned();
        if is_calling {
            self.state.recruiter.request();
        }
        is_calling
    }

    /// Takes what recruiting wants done in this tick.
    pub(super) fn recruit(&mut self, cars: &mut Cars<'_>) {
        let parameters = &self.parameters.recruitment;
        let here = cars.location();
        let step = self
            .state
            .recruiter
            .advance(cars.tick_s(), parameters, |refiller| {
                let location = cars.get_robot_location(refiller).ok()?;
                Some(here.distance_m(location))
            });

        match step {
            None => {}
            Some(RecruitingStep::Call) => {
                for refiller in self.refillers(cars) {
                    self.send(refiller.as_str(), HELP, cars);
                }
            }
            Some(RecruitingStep::Assign { to, is_first }) => {
                if is_first {
                    self.state.engage(&to);
                }
                self.send(&to, REFILL, cars);
            }
            Some(RecruitingStep::GiveUp) => self.state.forget_calls(),
        }
    }

    /// The refillers whom he calls.
    pub(super) fn refillers(&self, cars: &Cars<'_>) -> Vec<RobotName> {
        let patterns = &self.parameters.recruitment.refillers;
        let others = cars
            .welcome()
            .roster
            .iter()
            .filter(|robot| *robot != cars.name());
        let called = others.filter(|robot| {
            patterns.is_empty() || patterns.iter().any(|pattern| pattern.matches(robot))
        });
        called.cloned().collect()
    }

    /// Sends a command, which counts as one of his messages.
    pub(super) fn send(&mut self, to: &str, command: &str, cars: &mut Cars<'_>) {
        // A robot that is not in the roster was already logged as an error.
        if cars.set_robot_command(to, command).is_ok() {
            self.state.messages += 1;
        }
    }

    /// Adds what he publishes of it.
    pub(super) fn publish_recruiting(&self, variables: &mut StateVariables) {
        if !self.recruits() {
            return;
        }

        let recruiter = &self.state.recruiter;
        let RecruitingCounts {
            requests,
            calls,
            arrivals,
            arrival_s,
        } = recruiter.counts();
        // Refillers go by it: only the chosen one exchanges.
        variables.insert("refiller", recruiter.chosen().unwrap_or_default().into());
        variables.insert("requests", requests.into());
        variables.insert("help_calls", calls.into());
        variables.insert("arrivals", arrivals.into());
        variables.insert("arrival_s", arrival_s.into());
    }

    /// Goes on from what an earlier incarnation published of it.
    pub(super) fn resume_recruiting(&mut self, last: &StateVariables) {
        if !self.recruits() {
            return;
        }

        let counts = RecruitingCounts {
            requests: count(last, "requests"),
            calls: count(last, "help_calls"),
            arrivals: count(last, "arrivals"),
            arrival_s: number(last, "arrival_s").unwrap_or_default(),
        };
        let chosen = text(last, "refiller").filter(|name| !name.is_empty());
        if let Some(chosen) = chosen {
            self.state.engage(chosen);
        }
        self.state.recruiter.take_over(counts, chosen);
    }
}
