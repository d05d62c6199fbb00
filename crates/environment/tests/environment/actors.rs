//! Robots that act in ticks of their choice.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::sync::Arc;

use environment::Simulation;
use lockstep::{Bulletin, Exchange, IncarnationNotice, TickOutcome};
use protocol::RobotName;
use protocol::messages::{CommandText, Point, Report, TickUpdate};

use crate::common::report;

/// Robots that stay and do this in these ticks, and the news they got.
pub(crate) struct Actors<A> {
    places: BTreeMap<RobotName, Point>,
    pub(crate) actions: BTreeMap<(u64, RobotName), Vec<A>>,
    pub(crate) news: Vec<BTreeMap<RobotName, TickUpdate>>,
    /// Puts the actions of a tick into a report.
    put: fn(&mut Report, Vec<A>),
}

impl<A> Actors<A> {
    /// The robots of a simulation, where they stand.
    pub(crate) fn of(simulation: &Simulation, put: fn(&mut Report, Vec<A>)) -> Self {
        let places = simulation.names().iter().map(|name| {
            let at = simulation.location(name).unwrap();
            (name.clone(), at)
        });
        Self {
            places: places.collect(),
            actions: BTreeMap::new(),
            news: Vec::new(),
            put,
        }
    }
}

impl<A: Clone> Exchange<TickUpdate, Arc<Report>, CommandText> for Actors<A> {
    type Error = Infallible;

    fn exchange(
        &mut self,
        tick: u64,
        bulletin: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, Infallible> {
        let mut news = BTreeMap::new();
        for name in bulletin.robots() {
            let update = bulletin.compose(&name, IncarnationNotice::default());
            news.insert(name, update);
        }
        self.news.push(news);

        let mut outcome = TickOutcome::default();
        for (name, place) in &self.places {
            let mut report = report(tick, *place);
            let actions = self.actions.get(&(tick, name.clone()));
            (self.put)(&mut report, actions.cloned().unwrap_or_default());
            let answer = (Arc::new(report), Vec::new());
            outcome.reports.insert(name.clone(), answer);
        }
        Ok(outcome)
    }
}
