//! Numbers of robots, teams, places, sites and layers, one in each tick: a condition compares it, and a measure takes it over a run.
//!
//! [`RunQuantity`] is what there is to look at: what comes with another kind of subject is added there.

use std::fmt;

use config::FixedList;
use config::units::Length;
use protocol::messages::Point;
use protocol::pattern::matches;
use protocol::{Event, RobotName, RobotPattern};
use serde::{Deserialize, Serialize};

use crate::combine::{self, By, truth};
use crate::comparison::{TestError, TestTable, ValueTest, in_words, number_of, type_in_words};
use crate::places::{CoveredArea, FieldRegion, components, least_distance_m};
use crate::words::{Word, WordKind};
use crate::{Observation, RobotState, RunSetting};

/// Most names and patterns of a team.
const MAX_PATTERNS: usize = 64;

/// One number of a run in each tick.
#[derive(Debug, Clone, PartialEq)]
pub enum RunQuantity {
    /// A number of each robot, combined to one.
    Each {
        /// The robots.
        team: Team,
        /// How the numbers are combined; `None` for a single robot.
        by: Option<By>,
        /// The number of each.
        of: OfRobot,
    },
    /// Distance between the robots of all pairs, meters.
    Between {
        /// The robots.
        team: Team,
        /// The number of the distances: the least, their mean, or the largest.
        by: By,
    },
    /// Share of the field that was within sensing range of a robot, 0 to 1.
    Covered {
        /// The robots.
        team: Team,
        /// Whether it is of the tick alone, and not of all ticks up to it.
        is_now: bool,
        /// Sensing radius, meters.
        radius_m: f64,
        /// Side of the cells that are counted, meters.
        cell_m: f64,
    },
    /// Number of groups whose robots reach each other over robots that are within range of the next one.
    Components {
        /// The robots.
        team: Team,
        /// Range, meters; `None` for that of the scenario's radios.
        range_m: Option<f64>,
    },
    /// A variable of the state of each site, combined to one number.
    Sites {
        /// The sites.
        sites: Team,
        /// How the numbers are combined; `None` for a single site.
        by: Option<By>,
        /// Name of the variable.
        variable: String,
        /// If it is given: the number of each is whether it passes. Otherwise it is that of the variable; a flag is 1 or 0.
        test: Option<ValueTest>,
    },
    /// The cells of a layer, combined to one number.
    Layer {
        /// Name of the layer.
        name: String,
        /// How the numbers of the cells are combined.
        by: By,
        /// If it is given: the number of each cell is whether it passes.
        test: Option<ValueTest>,
    },
}

/// Whose variable a number is.
#[derive(Debug, Default)]
pub(crate) struct WhoseVariable {
    pub(crate) robot: Option<RobotName>,
    pub(crate) robots: Option<Team>,
    pub(crate) site: Option<RobotName>,
    pub(crate) sites: Option<Team>,
    pub(crate) by: Option<By>,
}

/// A number of a robot.
#[derive(Debug, Clone, PartialEq)]
pub enum OfRobot {
    /// Whether it is in one of these states.
    State(StateNames),
    /// A state variable. A flag is 1 or 0. With a test: whether it passes.
    Variable(String, Option<ValueTest>),
    /// Distance that it has walked, meters.
    Walked,
    /// Distance to a point or a robot, meters.
    DistanceTo(Goal),
    /// Whether it is within a region.
    Inside(FieldRegion),
}

/// To where a distance is.
#[derive(Debug, Clone, PartialEq)]
pub enum Goal {
    /// A point.
    Point(Point),
    /// A robot.
    Robot(RobotName),
}

/// Emotions or behaviors.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StateNames {
    /// Emotions.
    Emotions(Vec<String>),
    /// Behaviors.
    Behaviors(Vec<String>),
}

/// Robots or sites by a name, a pattern of names, or a list of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "a name, a pattern such as \"S*\" or \"S{1..9}\", or a list of them"
)]
pub enum Team {
    /// Those that match.
    One(RobotPattern),
    /// Those that match one of these.
    Several(Vec<RobotPattern>),
}

/// The number that is taken of the values that a quantity has during a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OfValues {
    /// The last one.
    #[default]
    End,
    /// The largest one.
    Max,
    /// The least one.
    Min,
    /// Their mean over time.
    Mean,
    /// Their integral over time, in the unit of the quantity times seconds.
    Area,
}

/// Why a quantity has no value in a tick.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum Undefined {
    /// A robot has not reported.
    #[error("{0} has not reported")]
    NotReported(RobotName),
    /// A robot does not have the variable, or it is a text.
    #[error("{0} has no number `{1}` among its state variables")]
    NoNumber(RobotName, String),
    /// A site does not have the variable, or it is of another type.
    #[error("the site {0} has no such `{1}` in its state")]
    NoSite(String, String),
    /// The run has no such layer.
    #[error("there is no layer {0}")]
    NoLayer(String),
    /// A share is negative.
    #[error("the number of {0} is {1}, and shares are 0 or more")]
    Negative(String, f64),
    /// All shares are 0.
    #[error("there is nothing that could be spread: every robot has 0")]
    NothingToSpread,
    /// There is no robot.
    #[error("the team has no robot")]
    NoRobot,
}

impl Undefined {
    /// Whether it follows from the values of this tick, and not from what robots do not report.
    pub(crate) fn is_of_values(&self) -> bool {
        matches!(self, Self::Negative(..) | Self::NothingToSpread)
    }
}

/// A number that cannot be taken.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum QuantityError {
    /// Neither one robot nor several, or both.
    #[error(
        "`{0}` is of `robot = NAME`, or of `robots`: a pattern such as \"S*\", or a list of names"
    )]
    Who(&'static str),
    /// Only several robots have such a number.
    #[error("`{0}` is of `robots`: a pattern such as \"S*\", or a list of names")]
    Several(&'static str),
    /// Too few or too many names and patterns.
    #[error("a list of robots or sites has 1 to {MAX_PATTERNS} names and patterns")]
    Patterns,
    /// How the numbers of robots become one is missing, or there is one robot only.
    #[error("`by` belongs to `robots`, and `robots` needs it: {0}")]
    By(&'static str),
    /// The numbers cannot be combined in this way.
    #[error("`{0}` of robots is taken by {1}")]
    WrongBy(&'static str, &'static str),
    /// A number of robots and of sites at once.
    #[error("a variable is of robots or of sites: leave one of them out")]
    RobotOrSite,
    /// One site and several at once.
    #[error(
        "`variable` is of `site = NAME`, or of `sites`: a pattern such as \"T*\", or a list of names"
    )]
    OneOrMoreSites,
    /// How the numbers of sites become one is missing, or there is one site only.
    #[error("`by` belongs to `sites`, and `sites` needs it: {0}")]
    BySites(&'static str),
    /// A key that belongs to another number.
    #[error("`{0}` has no `{1}`")]
    Foreign(&'static str, &'static str),
    /// A key is missing.
    #[error("`{0}` needs {1}")]
    Lacks(&'static str, &'static str),
    /// A length is not more than zero.
    #[error("`{0}` is more than zero")]
    NotPositive(&'static str),
    /// A robot, or a pattern of robots, that the run does not have.
    #[error("no robot of this scenario is called {0}")]
    UnknownRobot(String),
    /// There is no pair.
    #[error("`distance` between robots needs two of them at least")]
    NoPair,
    /// The radios of the scenario reach everywhere.
    #[error("`components` needs a `range`, or a scenario whose `[network.radio]` has one")]
    NoRange,
    /// The field would have too many cells, or none.
    #[error("{0}")]
    Cells(String),
    /// What the cells of a layer are compared with is wrong.
    #[error(transparent)]
    Test(#[from] TestError),
    /// The cells of a layer cannot be combined in this way.
    #[error("the cells of a `layer` become one number by {0}: write it as `by`")]
    ByCells(&'static str),
    /// A layer that the run does not have.
    #[error("no layer of this scenario is called {name}; {known}")]
    UnknownLayer {
        /// The name.
        name: String,
        /// The layers that there are, in words.
        known: String,
    },
    /// A site, or a pattern of sites, that the run does not have.
    #[error("no site of this scenario is called {name}; {known}")]
    UnknownSite {
        /// The name or pattern.
        name: String,
        /// The sites that there are, in words.
        known: String,
    },
    /// A site does not have the variable.
    #[error("the state of the site {site} has no `{variable}`; {known}")]
    UnknownKey {
        /// The site.
        site: String,
        /// The variable.
        variable: String,
        /// The variables that it has, in words.
        known: String,
    },
    /// A variable of a site has another type.
    #[error("`{variable}` of the site {site} is {has}: {wanted}")]
    OtherType {
        /// The site.
        site: String,
        /// The variable.
        variable: String,
        /// Its type, in words.
        has: &'static str,
        /// What it would have to be, or what to do, in words.
        wanted: &'static str,
    },
}

/// What is taken of places.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PlaceKind {
    Walked,
    Distance,
    Inside,
    Covered,
    Components,
    Layer,
}

/// A number of places or of a layer as written.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct PlaceTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    robot: Option<RobotName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    robots: Option<Team>,
    #[serde(skip_serializing_if = "Option::is_none")]
    by: Option<By>,
    #[serde(skip_serializing_if = "Option::is_none")]
    to: Option<GoalTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rectangle: Option<FixedList<Place, 2>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    disc: Option<DiscTable>,
    #[serde(skip_serializing_if = "Option::is_none")]
    radius: Option<Length>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cell: Option<Length>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    now: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    range: Option<Length>,
    /// Of a layer.
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// If it is given: the number of each cell is whether it passes.
    #[serde(skip_serializing_if = "Option::is_none")]
    each: Option<TestTable>,
    /// In measures only: a condition is about each tick.
    #[serde(rename = "as", skip_serializing_if = "Option::is_none")]
    pub(crate) number: Option<OfValues>,
}

type Place = FixedList<Length, 2>;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "a place such as [\"3 m\", \"4 m\"], or the name of a robot"
)]
enum GoalTable {
    Point(Place),
    Robot(RobotName),
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DiscTable {
    center: Place,
    radius: Length,
}

impl PlaceKind {
    pub(crate) const ALL: [Self; 6] = [
        Self::Walked,
        Self::Distance,
        Self::Inside,
        Self::Covered,
        Self::Components,
        Self::Layer,
    ];

    /// Its key in files.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Walked => "walked",
            Self::Distance => "distance",
            Self::Inside => "inside",
            Self::Covered => "covered",
            Self::Components => "components",
            Self::Layer => "layer",
        }
    }

    /// The keys beside `robot`, `robots`, `by` and `as` that its table may have.
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Walked => &[],
            Self::Distance => &["to"],
            Self::Inside => &["rectangle", "disc"],
            Self::Covered => &["radius", "cell", "now"],
            Self::Components => &["range"],
            Self::Layer => &["name", "each"],
        }
    }
}

impl PlaceTable {
    pub(crate) fn check(self, kind: PlaceKind) -> Result<RunQuantity, QuantityError> {
        let key = kind.key();
        for (name, is_given) in [
            ("to", self.to.is_some()),
            ("rectangle", self.rectangle.is_some()),
            ("disc", self.disc.is_some()),
            ("radius", self.radius.is_some()),
            ("cell", self.cell.is_some()),
            ("now", self.now),
            ("range", self.range.is_some()),
            ("name", self.name.is_some()),
            ("each", self.each.is_some()),
        ] {
            if is_given && !kind.keys().contains(&name) {
                return Err(QuantityError::Foreign(key, name));
            }
        }

        match kind {
            PlaceKind::Walked => {
                RunQuantity::each(key, self.robot, self.robots, self.by, OfRobot::Walked)
            }
            PlaceKind::Distance => {
                if let Some(to) = self.to {
                    let of = OfRobot::DistanceTo(to.into());
                    return RunQuantity::each(key, self.robot, self.robots, self.by, of);
                }
                let by = match self.by {
                    Some(by @ (By::Min | By::Mean | By::Max)) => by,
                    _ => {
                        let these =
                            "\"min\", \"mean\" or \"max\" of all pairs, or `to` a point or a robot";
                        return Err(QuantityError::WrongBy(key, these));
                    }
                };
                let team = several(key, self.robot.as_ref(), self.robots)?;
                Ok(RunQuantity::Between { team, by })
            }
            PlaceKind::Inside => {
                let region = match (self.rectangle, self.disc) {
                    (Some(FixedList([one, other])), None) => {
                        FieldRegion::rectangle(point(one), point(other))
                    }
                    (None, Some(disc)) => FieldRegion::Disc {
                        center: point(disc.center),
                        radius_m: positive("radius", Some(disc.radius))?,
                    },
                    _ => return Err(QuantityError::Lacks(key, "a `rectangle` or a `disc`")),
                };
                let of = OfRobot::Inside(region);
                RunQuantity::each(key, self.robot, self.robots, self.by, of)
            }
            PlaceKind::Covered => Ok(RunQuantity::Covered {
                radius_m: positive("radius", self.radius)?,
                cell_m: positive("cell", self.cell)?,
                is_now: self.now,
                team: whole(key, self.robot.as_ref(), self.robots, self.by)?,
            }),
            PlaceKind::Components => Ok(RunQuantity::Components {
                range_m: match self.range {
                    Some(_) => Some(positive("range", self.range)?),
                    None => None,
                },
                team: whole(key, self.robot.as_ref(), self.robots, self.by)?,
            }),
            PlaceKind::Layer => self.check_layer(),
        }
    }

    fn check_layer(self) -> Result<RunQuantity, QuantityError> {
        let key = PlaceKind::Layer.key();
        for (name, is_given) in [
            ("robot", self.robot.is_some()),
            ("robots", self.robots.is_some()),
        ] {
            if is_given {
                return Err(QuantityError::Foreign(key, name));
            }
        }

        let test = match self.each {
            Some(table) => Some(table.check()?.ok_or(TestError::Nothing)?),
            None => None,
        };
        let by = combine::check_cells(self.by, test.is_some()).map_err(QuantityError::ByCells)?;
        let name = self.name;
        let name = name.ok_or(QuantityError::Lacks(key, "the `name` of a layer"))?;
        Ok(RunQuantity::Layer { name, by, test })
    }

    /// The table of a number of places or of a layer; `None` for another one.
    pub(crate) fn of(quantity: &RunQuantity) -> Option<(PlaceKind, Self)> {
        let mut table = Self::default();
        let kind = match quantity {
            RunQuantity::Each { team, by, of } => {
                match (by, team) {
                    (None, Team::One(name)) => table.robot = RobotName::new(name.as_str()).ok(),
                    _ => table.robots = Some(team.clone()),
                }
                table.by = *by;
                match of {
                    OfRobot::State(_) | OfRobot::Variable(..) => return None,
                    OfRobot::Walked => PlaceKind::Walked,
                    OfRobot::DistanceTo(to) => {
                        table.to = Some(to.into());
                        PlaceKind::Distance
                    }
                    OfRobot::Inside(FieldRegion::Rectangle { least, most }) => {
                        table.rectangle = Some(FixedList([lengths(*least), lengths(*most)]));
                        PlaceKind::Inside
                    }
                    OfRobot::Inside(FieldRegion::Disc { center, radius_m }) => {
                        table.disc = Some(DiscTable {
                            center: lengths(*center),
                            radius: Length(*radius_m),
                        });
                        PlaceKind::Inside
                    }
                }
            }
            RunQuantity::Between { team, by } => {
                table.robots = Some(team.clone());
                table.by = Some(*by);
                PlaceKind::Distance
            }
            RunQuantity::Covered {
                team,
                radius_m,
                cell_m,
                is_now,
            } => {
                table.robots = Some(team.clone());
                table.now = *is_now;
                table.radius = Some(Length(*radius_m));
                table.cell = Some(Length(*cell_m));
                PlaceKind::Covered
            }
            RunQuantity::Components { team, range_m } => {
                table.robots = Some(team.clone());
                table.range = range_m.map(Length);
                PlaceKind::Components
            }
            RunQuantity::Sites { .. } => return None,
            RunQuantity::Layer { name, by, test } => {
                table.name = Some(name.clone());
                table.by = Some(*by);
                table.each = test.as_ref().map(|test| TestTable::of(Some(test)));
                PlaceKind::Layer
            }
        };
        Some((kind, table))
    }
}

/// The robots of a number that only several have together, without `by`.
fn whole(
    key: &'static str,
    robot: Option<&RobotName>,
    robots: Option<Team>,
    by: Option<By>,
) -> Result<Team, QuantityError> {
    if by.is_some() {
        return Err(QuantityError::Foreign(key, "by"));
    }
    several(key, robot, robots)
}

fn several(
    key: &'static str,
    robot: Option<&RobotName>,
    robots: Option<Team>,
) -> Result<Team, QuantityError> {
    match (robot, robots) {
        (None, Some(team)) => team.check(),
        _ => Err(QuantityError::Several(key)),
    }
}

fn positive(key: &'static str, length: Option<Length>) -> Result<f64, QuantityError> {
    match length {
        Some(length) if length.0 > 0.0 => Ok(length.0),
        _ => Err(QuantityError::NotPositive(key)),
    }
}

fn point(FixedList([x, y]): Place) -> Point {
    Point::new(x.0, y.0)
}

fn lengths(at: Point) -> Place {
    FixedList([Length(at.x), Length(at.y)])
}

impl From<GoalTable> for Goal {
    fn from(table: GoalTable) -> Self {
        match table {
            GoalTable::Point(place) => Self::Point(point(place)),
            GoalTable::Robot(robot) => Self::Robot(robot),
        }
    }
}

impl From<&Goal> for GoalTable {
    fn from(goal: &Goal) -> Self {
        match goal {
            Goal::Point(at) => Self::Point(lengths(*at)),
            Goal::Robot(robot) => Self::Robot(robot.clone()),
        }
    }
}

impl Team {
    /// One robot.
    #[must_use]
    pub fn one(robot: RobotName) -> Self {
        Self::One(robot.into())
    }

    fn check(self) -> Result<Self, QuantityError> {
        match (1..=MAX_PATTERNS).contains(&self.patterns().len()) {
            true => Ok(self),
            false => Err(QuantityError::Patterns),
        }
    }

    /// Its names and patterns.
    #[must_use]
    pub fn patterns(&self) -> &[RobotPattern] {
        match self {
            Self::One(pattern) => std::slice::from_ref(pattern),
            Self::Several(patterns) => patterns,
        }
    }

    /// Those of the roster that belong to it, in the order of their names.
    #[must_use]
    pub fn of(&self, roster: &[RobotName]) -> Vec<RobotName> {
        let patterns = self.patterns();
        let matches = |robot: &&RobotName| patterns.iter().any(|pattern| pattern.matches(robot));
        let mut robots: Vec<RobotName> = roster.iter().filter(matches).cloned().collect();
        robots.sort();
        robots
    }

    /// The sites of a run that belong to it, in the order of their names.
    fn of_sites(&self, setting: &RunSetting) -> Vec<String> {
        let is_in = |site: &&String| {
            let mut patterns = self.patterns().iter();
            patterns.any(|pattern| matches(pattern.as_str(), site))
        };
        setting.sites.keys().filter(is_in).cloned().collect()
    }
}

impl fmt::Display for Team {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (place, pattern) in self.patterns().iter().enumerate() {
            let comma = if place > 0 { ", " } else { "" };
            write!(f, "{comma}{pattern}")?;
        }
        Ok(())
    }
}

impl StateNames {
    /// The names.
    #[must_use]
    pub fn names(&self) -> &[String] {
        match self {
            Self::Emotions(names) | Self::Behaviors(names) => names,
        }
    }

    /// The names as words of these robots.
    pub(crate) fn words(&self, team: &Team) -> Vec<Word> {
        let kind = match self {
            Self::Emotions(_) => WordKind::Emotion,
            Self::Behaviors(_) => WordKind::Behavior,
        };
        let robots: Vec<String> = team.patterns().iter().map(ToString::to_string).collect();
        let mut words = Vec::new();
        for word in self.names() {
            words.push(Word {
                kind,
                robots: robots.clone(),
                word: word.clone(),
            });
        }
        words
    }

    pub(crate) fn hold(&self, state: RobotState<'_>) -> bool {
        match self {
            Self::Emotions(names) => names.iter().any(|name| name == state.emotion_state),
            Self::Behaviors(names) => names.iter().any(|name| name == state.behavior_state),
        }
    }
}

impl RunQuantity {
    /// A number of one robot, or of several combined; `key` names it in errors.
    pub(crate) fn each(
        key: &'static str,
        robot: Option<RobotName>,
        robots: Option<Team>,
        by: Option<By>,
        of: OfRobot,
    ) -> Result<Self, QuantityError> {
        let (ways, is_way) = of.ways();
        let team = match (robot, robots, by) {
            (Some(robot), None, None) => Team::one(robot),
            (None, Some(team), Some(by)) if is_way(by) => team.check()?,
            (None, Some(_), Some(_)) => return Err(QuantityError::WrongBy(key, ways)),
            (Some(_), None, Some(_)) | (None, Some(_), None) => {
                return Err(QuantityError::By(ways));
            }
            _ => return Err(QuantityError::Who(key)),
        };
        Ok(Self::Each { team, by, of })
    }

    /// A variable of one robot or site, or of several combined. With a test, whether each passes it.
    pub(crate) fn variable(
        whose: WhoseVariable,
        variable: String,
        test: Option<ValueTest>,
    ) -> Result<Self, QuantityError> {
        const KEY: &str = "variable";
        if whose.site.is_none() && whose.sites.is_none() {
            let of = OfRobot::Variable(variable, test);
            return Self::each(KEY, whose.robot, whose.robots, whose.by, of);
        }

        if whose.robot.is_some() || whose.robots.is_some() {
            return Err(QuantityError::RobotOrSite);
        }
        let (ways, is_way) = ways_of_variables(test.is_some());
        let sites = match (whose.site, whose.sites, whose.by) {
            (Some(site), None, None) => Team::one(site),
            (None, Some(sites), Some(by)) if is_way(by) => sites.check()?,
            (None, Some(_), Some(_)) => return Err(QuantityError::WrongBy(KEY, ways)),
            (Some(_), None, Some(_)) | (None, Some(_), None) => {
                return Err(QuantityError::BySites(ways));
            }
            _ => return Err(QuantityError::OneOrMoreSites),
        };
        Ok(Self::Sites {
            sites,
            by: whose.by,
            variable,
            test,
        })
    }

    /// Whether its only values are 0 and 1, which stand for false and true.
    pub(crate) fn is_truth(&self) -> bool {
        match self {
            Self::Each {
                by: Some(By::All | By::Any),
                ..
            }
            | Self::Sites {
                by: Some(By::All | By::Any),
                ..
            }
            | Self::Layer {
                by: By::All | By::Any,
                ..
            }
            | Self::Sites {
                by: None,
                test: Some(_),
                ..
            } => true,
            Self::Each { by: None, of, .. } => matches!(
                of,
                OfRobot::State(_) | OfRobot::Inside(_) | OfRobot::Variable(_, Some(_))
            ),
            _ => false,
        }
    }

    /// Whether its words say what a variable is compared with, and of one robot or site only.
    pub(crate) fn is_statement(&self) -> bool {
        matches!(
            self,
            Self::Sites {
                by: None,
                test: Some(_),
                ..
            } | Self::Each {
                by: None,
                of: OfRobot::Variable(_, Some(_)),
                ..
            }
        )
    }

    /// Whether it is about sites, whose states follow from the events of a run.
    pub(crate) fn is_of_sites(&self) -> bool {
        matches!(self, Self::Sites { .. })
    }

    /// The robots of a run, in the order of their names. One that is named is there whatever the roster is.
    pub(crate) fn robots(&self, setting: &RunSetting) -> Vec<RobotName> {
        if let Self::Each {
            team: Team::One(name),
            by: None,
            ..
        } = self
        {
            return RobotName::new(name.as_str()).into_iter().collect();
        }
        let team = self.team();
        team.map(|team| team.of(&setting.roster))
            .unwrap_or_default()
    }

    /// The robots; `None` for a number of sites or a layer.
    fn team(&self) -> Option<&Team> {
        match self {
            Self::Each { team, .. }
            | Self::Between { team, .. }
            | Self::Covered { team, .. }
            | Self::Components { team, .. } => Some(team),
            Self::Sites { .. } | Self::Layer { .. } => None,
        }
    }

    /// Its names and patterns of robots.
    pub(crate) fn patterns(&self) -> &[RobotPattern] {
        self.team().map_or(&[], Team::patterns)
    }

    /// The state variables that it needs: patterns of robots, and the name.
    pub(crate) fn variables(&self) -> Vec<(&str, &str)> {
        let Self::Each {
            of: OfRobot::Variable(name, _),
            team,
            ..
        } = self
        else {
            return Vec::new();
        };
        let patterns = team.patterns().iter();
        patterns
            .map(|pattern| (pattern.as_str(), name.as_str()))
            .collect()
    }

    /// The words that robots choose and that it names.
    pub(crate) fn words(&self) -> Vec<Word> {
        match self {
            Self::Each {
                of: OfRobot::State(states),
                team,
                ..
            } => states.words(team),
            _ => Vec::new(),
        }
    }

    /// Checks that a run of a scenario can have it.
    ///
    /// # Errors
    /// [`QuantityError`].
    pub fn check(&self, setting: &RunSetting) -> Result<(), QuantityError> {
        for pattern in self.patterns() {
            if !setting.roster.iter().any(|robot| pattern.matches(robot)) {
                return Err(QuantityError::UnknownRobot(pattern.to_string()));
            }
        }
        match self {
            Self::Between { team, .. } if team.of(&setting.roster).len() < 2 => {
                Err(QuantityError::NoPair)
            }
            Self::Covered { cell_m, .. } => {
                CoveredArea::check(setting.field_m, *cell_m).map_err(QuantityError::Cells)
            }
            Self::Components { range_m, .. } if range_m.or(setting.radio_range_m).is_none() => {
                Err(QuantityError::NoRange)
            }
            Self::Each {
                of: OfRobot::DistanceTo(Goal::Robot(robot)),
                ..
            } if !setting.roster.contains(robot) => {
                Err(QuantityError::UnknownRobot(robot.to_string()))
            }
            Self::Sites {
                sites,
                variable,
                test,
                ..
            } => check_sites(sites, variable, test.as_ref(), setting),
            Self::Layer { name, .. } if !setting.layers.contains(name) => {
                Err(QuantityError::UnknownLayer {
                    name: name.clone(),
                    known: in_words("it has", setting.layers.iter().map(String::as_str)),
                })
            }
            _ => Ok(()),
        }
    }
}

/// Checks that a run has sites, and each of them a variable of the type that is wanted: the types of a scenario never change.
fn check_sites(
    sites: &Team,
    variable: &str,
    test: Option<&ValueTest>,
    setting: &RunSetting,
) -> Result<(), QuantityError> {
    for pattern in sites.patterns() {
        if !setting.has_site(pattern.as_str()) {
            return Err(QuantityError::UnknownSite {
                name: pattern.to_string(),
                known: setting.sites_in_words(),
            });
        }
    }

    for site in sites.of_sites(setting) {
        let state = &setting.sites[&site];
        let Some(value) = state.get(variable) else {
            return Err(QuantityError::UnknownKey {
                site,
                variable: variable.to_owned(),
                known: in_words("it has", state.iter().map(|(name, _)| name)),
            });
        };
        let wanted = match test {
            Some(test) => test.mismatch(value),
            None if number_of(value).is_none() => Some("compare it by `is`, which names a text"),
            None => None,
        };
        if let Some(wanted) = wanted {
            return Err(QuantityError::OtherType {
                site,
                variable: variable.to_owned(),
                has: type_in_words(value),
                wanted,
            });
        }
    }
    Ok(())
}

/// How truths are combined.
const TRUTHS: &str = "\"all\", \"any\", \"count\" or \"mean\"";

impl OfRobot {
    /// How it is combined over robots, in words and as a rule.
    fn ways(&self) -> (&'static str, fn(By) -> bool) {
        match self {
            Self::State(_) | Self::Inside(_) => ways_of_variables(true),
            Self::Walked | Self::DistanceTo(_) => (
                "\"sum\", \"mean\", \"max\", \"min\", \"spread\" or \"jain\"",
                |by| !matches!(by, By::All | By::Any | By::Count),
            ),
            Self::Variable(_, test) => ways_of_variables(test.is_some()),
        }
    }
}

/// How variables are combined, in words and as a rule; `are_tested`: whether each is true or false.
fn ways_of_variables(are_tested: bool) -> (&'static str, fn(By) -> bool) {
    match are_tested {
        true => (TRUTHS, |by| {
            matches!(by, By::All | By::Any | By::Count | By::Mean)
        }),
        false => (
            "\"sum\", \"mean\", \"max\", \"min\", \"spread\", \"jain\", \"all\", \"any\" or \"count\"",
            |_| true,
        ),
    }
}

impl fmt::Display for RunQuantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Each { team, by, of } => {
                match of {
                    OfRobot::State(StateNames::Emotions(names)) => {
                        write!(f, "emotion {} of {team}", names.join(" or "))
                    }
                    OfRobot::State(StateNames::Behaviors(names)) => {
                        write!(f, "behavior {} of {team}", names.join(" or "))
                    }
                    OfRobot::Variable(name, None) => write!(f, "`{name}` of {team}"),
                    OfRobot::Variable(name, Some(test)) => {
                        write!(f, "`{name}` of {team} {test}")
                    }
                    OfRobot::Walked => write!(f, "the distance walked by {team}"),
                    OfRobot::DistanceTo(Goal::Point(to)) => {
                        write!(f, "the distance of {team} to {} m, {} m", to.x, to.y)
                    }
                    OfRobot::DistanceTo(Goal::Robot(to)) => {
                        write!(f, "the distance of {team} to {to}")
                    }
                    OfRobot::Inside(_) => write!(f, "{team} within the region"),
                }?;
                match by {
                    Some(by) => write!(f, " ({by})"),
                    None => Ok(()),
                }
            }
            Self::Between { team, by } => write!(f, "the distance between {team} ({by})"),
            Self::Covered { team, .. } => write!(f, "the share of the field covered by {team}"),
            Self::Components { team, range_m } => {
                write!(f, "the number of components of {team} within ")?;
                match range_m {
                    Some(range_m) => write!(f, "{range_m} m"),
                    None => f.write_str("the range of radios"),
                }
            }
            Self::Sites {
                sites,
                by,
                variable,
                test,
            } => {
                let noun = if by.is_some() { "sites" } else { "site" };
                write!(f, "`{variable}` of the {noun} {sites}")?;
                if let Some(test) = test {
                    write!(f, " {test}")?;
                }
                match by {
                    Some(by) => write!(f, " ({by})"),
                    None => Ok(()),
                }
            }
            Self::Layer { name, by, test } => {
                write!(f, "the cells of the layer {name}")?;
                if let Some(test) = test {
                    write!(f, " {test}")?;
                }
                write!(f, " ({by})")
            }
        }
    }
}

/// A quantity while a run is observed.
#[derive(Debug, Clone)]
pub(crate) struct QuantityGauge {
    quantity: RunQuantity,
    /// The robots, in the order of their names.
    robots: Vec<RobotName>,
    walked: Vec<Walk>,
    coverage: Option<CoveredArea>,
    /// The sites, in the order of their names.
    sites: Vec<String>,
    /// The number of the sites, until one of them changes.
    of_sites: Option<f64>,
}

/// How far a robot has walked.
#[derive(Debug, Clone, Copy, Default)]
struct Walk {
    at: Option<Point>,
    walked_m: f64,
}

impl QuantityGauge {
    pub(crate) fn new(quantity: &RunQuantity, setting: &RunSetting) -> Self {
        let robots = quantity.robots(setting);
        let coverage = match quantity {
            RunQuantity::Covered {
                radius_m, cell_m, ..
            } => Some(CoveredArea::new(setting.field_m, *cell_m, *radius_m)),
            _ => None,
        };
        let sites = match quantity {
            RunQuantity::Sites { sites, .. } => sites.of_sites(setting),
            _ => Vec::new(),
        };
        let mut quantity = quantity.clone();
        if let RunQuantity::Components { range_m, .. } = &mut quantity {
            *range_m = range_m.or(setting.radio_range_m);
        }
        Self {
            quantity,
            sites,
            of_sites: None,
            walked: vec![Walk::default(); robots.len()],
            coverage,
            robots,
        }
    }

    /// The value in a tick. Each tick is given once and in its order; the end of the run gives the last one again.
    pub(crate) fn value(&mut self, seen: &Observation<'_>) -> Result<f64, Undefined> {
        match &self.quantity {
            RunQuantity::Each { by, of, .. } => {
                let mut values = Vec::with_capacity(self.robots.len());
                for (robot, walk) in self.robots.iter().zip(&mut self.walked) {
                    values.push(of.value(robot, walk, seen)?);
                }
                match by {
                    Some(by) => combined(*by, &values, &self.robots),
                    None => values.first().copied().ok_or(Undefined::NoRobot),
                }
            }
            RunQuantity::Between { by, .. } => {
                let places = places(&self.robots, seen)?;
                match by {
                    By::Min => least_distance_m(&places).ok_or(Undefined::NoRobot),
                    _ => between(&places, *by).ok_or(Undefined::NoRobot),
                }
            }
            RunQuantity::Covered { is_now, .. } => {
                let Some(coverage) = &mut self.coverage else {
                    return Err(Undefined::NoRobot);
                };
                if *is_now {
                    coverage.clear();
                }
                for (robot, walk) in self.robots.iter().zip(&mut self.walked) {
                    let state = (seen.state)(robot);
                    let Some(at) = state.map(|state| state.location) else {
                        continue;
                    };
                    // One that stands still covers nothing more.
                    if *is_now || walk.at != Some(at) {
                        coverage.cover(at);
                        walk.at = Some(at);
                    }
                }
                Ok(coverage.share())
            }
            RunQuantity::Components { range_m, .. } => {
                let range_m = range_m.ok_or(Undefined::NoRobot)?;
                Ok(components(&places(&self.robots, seen)?, range_m) as f64)
            }
            RunQuantity::Sites {
                by, variable, test, ..
            } => {
                let mut events = seen.events.iter();
                let has_changed = events.any(|event| matches!(event, Event::SiteChanged { .. }));
                if let Some(value) = self.of_sites.filter(|_| !has_changed) {
                    return Ok(value);
                }

                let mut values = Vec::with_capacity(self.sites.len());
                for site in &self.sites {
                    values.push(value_of_site(site, variable, test.as_ref(), seen)?);
                }
                let value = match by {
                    Some(by) => combined(*by, &values, &self.sites)?,
                    None => values.first().copied().ok_or(Undefined::NoRobot)?,
                };
                self.of_sites = Some(value);
                Ok(value)
            }
            RunQuantity::Layer { name, by, test } => {
                let cells = (seen.layer)(name);
                let value =
                    cells.and_then(|cells| combine::combine_cells(cells, *by, test.as_ref()));
                value.ok_or_else(|| Undefined::NoLayer(name.clone()))
            }
        }
    }
}

fn value_of_site(
    site: &str,
    variable: &str,
    test: Option<&ValueTest>,
    seen: &Observation<'_>,
) -> Result<f64, Undefined> {
    let value = (seen.site)(site).and_then(|state| state.get(variable));
    let number = value.and_then(|value| match test {
        Some(test) => test.holds(value).map(truth),
        None => number_of(value),
    });
    number.ok_or_else(|| Undefined::NoSite(site.to_owned(), variable.to_owned()))
}

fn places(robots: &[RobotName], seen: &Observation<'_>) -> Result<Vec<Point>, Undefined> {
    let mut places = Vec::with_capacity(robots.len());
    for robot in robots {
        let state = (seen.state)(robot).ok_or_else(|| Undefined::NotReported(robot.clone()))?;
        places.push(state.location);
    }
    Ok(places)
}

/// The mean or the largest distance of all pairs; `None` without a pair.
fn between(places: &[Point], by: By) -> Option<f64> {
    let mut sum_m = 0.0;
    let mut max_m = 0.0_f64;
    let mut pairs = 0_u64;
    for (index, one) in places.iter().enumerate() {
        for other in &places[index + 1..] {
            let distance_m = one.distance_m(*other);
            sum_m += distance_m;
            max_m = max_m.max(distance_m);
            pairs += 1;
        }
    }

    let number_m = if by == By::Max {
        max_m
    } else {
        sum_m / pairs as f64
    };
    (pairs > 0).then_some(number_m)
}

impl OfRobot {
    fn value(
        &self,
        robot: &RobotName,
        walk: &mut Walk,
        seen: &Observation<'_>,
    ) -> Result<f64, Undefined> {
        let state = (seen.state)(robot);
        if let Self::Walked = self {
            if let Some(state) = state {
                let before = walk.at.replace(state.location);
                walk.walked_m += before.map_or(0.0, |before| before.distance_m(state.location));
            }
            return Ok(walk.walked_m);
        }
        if let (Self::Variable(name, test), Some(state)) = (self, state) {
            let value = state.state_variables.get(name);
            let value = value.and_then(|value| match test {
                Some(test) => test.holds(value).map(truth),
                None => number_of(value),
            });
            return value.ok_or_else(|| Undefined::NoNumber(robot.clone(), name.clone()));
        }

        let state = state.ok_or_else(|| match self {
            Self::Variable(name, _) => Undefined::NoNumber(robot.clone(), name.clone()),
            _ => Undefined::NotReported(robot.clone()),
        })?;
        Ok(match self {
            Self::State(names) => truth(names.hold(state)),
            Self::Inside(region) => truth(region.contains(state.location)),
            Self::DistanceTo(Goal::Point(to)) => state.location.distance_m(*to),
            Self::DistanceTo(Goal::Robot(to)) => {
                let goal = (seen.state)(to).ok_or_else(|| Undefined::NotReported(to.clone()))?;
                state.location.distance_m(goal.location)
            }
            Self::Walked | Self::Variable(..) => walk.walked_m,
        })
    }
}

/// A state variable as a number; a flag is 1 or 0.
pub(crate) fn number(state: RobotState<'_>, variable: &str) -> Option<f64> {
    number_of(state.state_variables.get(variable)?)
}

/// The number of the numbers of robots or sites, which are in the order of their names.
fn combined(by: By, values: &[f64], names: &[impl fmt::Display]) -> Result<f64, Undefined> {
    if by == By::Jain {
        let mut named = values.iter().zip(names);
        if let Some((value, name)) = named.find(|(value, _)| **value < 0.0) {
            return Err(Undefined::Negative(name.to_string(), *value));
        }
        if !values.is_empty() && values.iter().all(|value| value * value == 0.0) {
            return Err(Undefined::NothingToSpread);
        }
    }
    by.combine(values.iter().copied()).ok_or(Undefined::NoRobot)
}
