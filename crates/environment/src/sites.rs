//! The sites of a run: their state, and what robots do to it.
//!
//! All actions of a tick are carried out when all of its reports are in: in the order of the robots' names, those of a robot in the
//! order of its report. Each one sees the state that the one before has left, and is carried out wholly or not at all.

use std::collections::{BTreeMap, BTreeSet};
use std::mem::discriminant;

use protocol::messages::{
    KnownSite, MAX_SITE_TEXT_BYTES, MAX_SITES_BYTES, Point, SensedSite, SiteAction, SiteFrame,
    SiteRefusal, SiteResult, StateVariables, Variable, site_bytes,
};
use protocol::{Event, RobotName};
use scenario::{OnConflict, Scenario, SiteSpec};

/// The sites of an epoch.
#[derive(Debug, Clone, Default)]
pub struct Sites {
    sites: BTreeMap<String, Site>,
    /// What all of them take in a frame at most, bytes.
    bytes: usize,
    /// What became of the actions of the last tick, by robot.
    results: BTreeMap<RobotName, Vec<SiteResult>>,
}

#[derive(Debug, Clone)]
struct Site {
    spec: SiteSpec,
    state: StateVariables,
}

/// What a robot does to sites in a tick, and where it stands.
#[derive(Debug, Clone, Copy)]
pub struct SiteOrders<'a> {
    /// Who.
    pub robot: &'a RobotName,
    /// Where it stands, meters.
    pub at: Point,
    /// What it does, in its order.
    pub actions: &'a [SiteAction],
}

/// A variable of a site.
type SiteKey = (String, String);

impl Sites {
    /// The sites of a scenario, as they are at the start.
    #[must_use]
    pub fn new(scenario: &Scenario) -> Self {
        let sites = scenario.sites.iter().map(|(name, spec)| {
            let site = Site {
                spec: spec.clone(),
                state: spec.start(),
            };
            (name.clone(), site)
        });
        let sites: BTreeMap<_, _> = sites.collect();
        Self {
            bytes: sites.iter().map(|(name, site)| site.bytes(name)).sum(),
            sites,
            results: BTreeMap::new(),
        }
    }

    /// Carries out the actions of a tick. Returns what happened, in this order. The order of `orders` does not matter.
    pub fn carry_out(&mut self, orders: &[SiteOrders<'_>]) -> Vec<Event> {
        self.results.clear();
        let mut orders = orders.to_vec();
        orders.sort_by(|one, other| one.robot.cmp(other.robot));

        let contested = self.contested(&orders);
        let mut changed_by: BTreeMap<SiteKey, &RobotName> = BTreeMap::new();
        let mut events = Vec::new();
        for SiteOrders { robot, at, actions } in orders {
            for action in actions {
                let is_contested = action.keys().any(|key| {
                    let key = (action.site.clone(), key.to_owned());
                    let is_taken = changed_by.get(&key).is_some_and(|other| *other != robot);
                    contested.contains(&key) || (is_taken && self.refuses_both(&key.0))
                });
                let judged = match self.judge(at, action) {
                    Ok(_) if is_contested => Err(SiteRefusal::Conflict),
                    judged => judged,
                };

                let refused = judged.as_ref().err().copied();
                match judged {
                    Ok(state) => {
                        for key in action.keys() {
                            changed_by.insert((action.site.clone(), key.to_owned()), robot);
                        }
                        events.extend(self.change(robot, &action.site, state));
                    }
                    Err(because) => events.push(Event::SiteRefused {
                        robot: robot.clone(),
                        site: action.site.clone(),
                        because,
                    }),
                }
                self.results
                    .entry(robot.clone())
                    .or_default()
                    .push(SiteResult {
                        site: action.site.clone(),
                        refused,
                    });
            }
        }
        events
    }

    /// The variables that two robots would change, of sites that refuse both.
    fn contested(&self, orders: &[SiteOrders<'_>]) -> BTreeSet<SiteKey> {
        let mut robots: BTreeMap<SiteKey, BTreeSet<&RobotName>> = BTreeMap::new();
        for SiteOrders { robot, at, actions } in orders {
            for action in *actions {
                // An action that is refused anyway hinders no other one.
                if !self.refuses_both(&action.site) || self.judge(*at, action).is_err() {
                    continue;
                }
                for key in action.keys() {
                    let key = (action.site.clone(), key.to_owned());
                    robots.entry(key).or_default().insert(robot);
                }
            }
        }
        robots.retain(|_, robots| robots.len() > 1);
        robots.into_keys().collect()
    }

    fn refuses_both(&self, site: &str) -> bool {
        let site = self.sites.get(site);
        site.is_some_and(|site| site.spec.on_conflict == OnConflict::Refuse)
    }

    /// The state of a site after an action of a robot that stands at `at`.
    fn judge(&self, at: Point, action: &SiteAction) -> Result<StateVariables, SiteRefusal> {
        let site = self
            .sites
            .get(&action.site)
            .ok_or(SiteRefusal::UnknownSite)?;
        if at.distance_m(site.spec.at) > site.spec.range_m {
            return Err(SiteRefusal::OutOfRange);
        }
        let state = site.after(action)?;

        let bytes = site_bytes(&action.site, &site.spec.kind, &state);
        let others = self.bytes - site.bytes(&action.site);
        match others + bytes <= MAX_SITES_BYTES {
            true => Ok(state),
            false => Err(SiteRefusal::TooLong),
        }
    }

    /// Gives a site a state. Returns an event for each variable that has another value than before.
    fn change(&mut self, robot: &RobotName, name: &str, state: StateVariables) -> Vec<Event> {
        let Some(site) = self.sites.get_mut(name) else {
            return Vec::new();
        };

        self.bytes -= site.bytes(name);
        let before = std::mem::replace(&mut site.state, state);
        self.bytes += site.bytes(name);
        let mut events = Vec::new();
        for ((key, from), (_, to)) in before.iter().zip(&site.state) {
            if from != to {
                events.push(Event::SiteChanged {
                    robot: robot.clone(),
                    site: name.to_owned(),
                    key: key.to_owned(),
                    from: from.clone(),
                    to: to.clone(),
                });
            }
        }
        events
    }

    /// The sites within range of a place, by name, at the places where they are.
    #[must_use]
    pub fn near(&self, at: Point) -> Vec<SensedSite> {
        let mut near = Vec::new();
        for (name, site) in &self.sites {
            if at.distance_m(site.spec.at) <= site.spec.range_m {
                near.push(SensedSite {
                    name: name.clone(),
                    kind: site.spec.kind.clone(),
                    location: site.spec.at,
                    state: site.state.clone(),
                });
            }
        }
        near
    }

    /// The sites that every robot knows of, by name.
    #[must_use]
    pub fn known(&self) -> Vec<KnownSite> {
        let mut known = Vec::new();
        for (name, site) in &self.sites {
            if site.spec.is_known {
                known.push(KnownSite {
                    name: name.clone(),
                    kind: site.spec.kind.clone(),
                    location: site.spec.at,
                });
            }
        }
        known
    }

    /// The greatest distance at which a site is sensed, meters.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        let ranges = self.sites.values().map(|site| site.spec.range_m);
        ranges.fold(0.0, f64::max)
    }

    /// What became of a robot's actions of the last tick, in their order.
    #[must_use]
    pub fn results(&self, robot: &RobotName) -> &[SiteResult] {
        self.results.get(robot).map_or(&[], Vec::as_slice)
    }

    /// The state of a site.
    #[must_use]
    pub fn state(&self, name: &str) -> Option<&StateVariables> {
        Some(&self.sites.get(name)?.state)
    }

    /// The sites, for observers.
    #[must_use]
    pub fn frames(&self) -> Vec<SiteFrame> {
        let sites = self.sites.iter();
        sites
            .map(|(name, site)| SiteFrame {
                name: name.clone(),
                kind: site.spec.kind.clone(),
                location: site.spec.at,
                state: site.state.clone(),
            })
            .collect()
    }

    /// The states that are others than at the start, by site: what a recording has of a tick.
    #[must_use]
    pub fn changed(&self) -> BTreeMap<String, StateVariables> {
        let sites = self.sites.iter();
        let changed = sites.filter(|(_, site)| site.has_changed());
        changed
            .map(|(name, site)| (name.clone(), site.state.clone()))
            .collect()
    }
}

impl Site {
    /// What it takes in a frame at most.
    fn bytes(&self, name: &str) -> usize {
        site_bytes(name, &self.spec.kind, &self.state)
    }

    fn has_changed(&self) -> bool {
        let mut now = self.state.iter();
        now.any(|(key, value)| {
            let at_start = self.spec.state.get(key);
            at_start.is_none_or(|variable| variable.start != *value)
        })
    }

    /// The state after an action.
    fn after(&self, action: &SiteAction) -> Result<StateVariables, SiteRefusal> {
        let mut state = self.state.clone();
        for (key, value) in action.set.iter().chain(&action.only_if) {
            let current = state.get(key).ok_or(SiteRefusal::UnknownKey)?;
            if discriminant(current) != discriminant(value) {
                return Err(SiteRefusal::OtherType);
            }
            let text = value.as_str().unwrap_or_default();
            if text.len() > MAX_SITE_TEXT_BYTES {
                return Err(SiteRefusal::TooLong);
            }
        }
        for key in action.add.keys() {
            let current = state.get(key).ok_or(SiteRefusal::UnknownKey)?;
            current.as_f64().ok_or(SiteRefusal::OtherType)?;
        }

        let mut conditions = action.only_if.iter();
        if !conditions.all(|(key, value)| self.state.get(key) == Some(value)) {
            return Err(SiteRefusal::Condition);
        }

        // What is set is set before something is added to it.
        for (key, value) in &action.set {
            state.insert(key, value.clone());
        }
        for (key, number) in &action.add {
            let before = state.get(key).and_then(Variable::as_f64);
            let sum = before.unwrap_or_default() + number;
            state.insert(key, Variable::Number(sum));
        }
        for key in action.keys() {
            let number = state.get(key).and_then(Variable::as_f64);
            if number.is_some_and(|number| !self.allows(key, number)) {
                return Err(SiteRefusal::Bound);
            }
            // Also where it is minus zero: no event tells the one from the other.
            if number == Some(0.0) {
                state.insert(key, Variable::Number(0.0));
            }
        }
        Ok(state)
    }

    fn allows(&self, key: &str, number: f64) -> bool {
        let Some(variable) = self.spec.state.get(key) else {
            return false;
        };
        number.is_finite()
            && variable.min.is_none_or(|min| number >= min)
            && variable.max.is_none_or(|max| number <= max)
    }
}
