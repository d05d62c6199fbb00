//! The states of the sites of a run, as they follow from its events.

use std::collections::BTreeMap;

use protocol::Event;
use protocol::messages::StateVariables;

use crate::RunSetting;

/// The states of the sites of a run that is read again. The simulator has them itself.
#[derive(Debug, Clone)]
pub struct SiteStates(BTreeMap<String, StateVariables>);

impl SiteStates {
    /// The states before the first tick.
    #[must_use]
    pub fn new(setting: &RunSetting) -> Self {
        Self(setting.sites.clone())
    }

    /// Takes the events of a tick into account.
    pub fn note(&mut self, events: &[Event]) {
        for event in events {
            if let Event::SiteChanged { site, key, to, .. } = event
                && let Some(state) = self.0.get_mut(site)
            {
                state.insert(key, to.clone());
            }
        }
    }

    /// The state of a site.
    #[must_use]
    pub fn of(&self, site: &str) -> Option<&StateVariables> {
        self.0.get(site)
    }
}
