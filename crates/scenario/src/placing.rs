//! Places robots at random, and checks that all bodies of a scenario can be placed. The environment numbers its robots; the errors
//! here name them.

use protocol::RobotName;
use protocol::messages::Point;
use world::{Footprint, HallError, Placer, Region, World};

use super::checked::{Obstacle, Scenario, to_wire};

/// A body of a scenario cannot be placed.
#[derive(Debug, Clone)]
pub(super) struct PlacingError {
    reason: PlacingReason,
    /// The robot that cannot be placed.
    robot: Option<RobotName>,
    /// The robot that it overlaps.
    other: Option<RobotName>,
    /// The obstacle that has no free place.
    obstacle: Option<usize>,
}

/// Why a body cannot be placed.
#[derive(Debug, Clone, Copy)]
enum PlacingReason {
    Hall(HallError),
    /// All places of a robot or an obstacle that were drawn in a region overlap another body, or the edge.
    NoFreePlace(Region),
}

/// The part of a scenario that keeps its bodies from being placed.
#[derive(Debug, Clone, Copy)]
pub(super) enum PlacingCause<'a> {
    Tick,
    Field,
    Guests,
    Obstacle(usize),
    Wall(usize),
    Robot(&'a RobotName),
}

/// Places all bodies once.
pub(super) fn check(scenario: &Scenario) -> Result<(), PlacingError> {
    let stream = protocol::random::stream(scenario.seed, "guests");
    match World::with_guests(&scenario.hall(), scenario.guest_walk(), stream) {
        Ok(_) => Ok(()),
        Err(error) => Err(PlacingError::of(error, &scenario.roster())),
    }
}

/// Places what has no given place, each by a stream of its own, after what has one: obstacles in their order, then robots. Of two
/// robots that hinder each other the one with the longer name gives way, and then the later one in the alphabet: so one more robot
/// in bulk moves none.
pub(super) fn place_at_random(scenario: &mut Scenario) -> Result<(), PlacingError> {
    let is_drawn = |obstacle: &Obstacle| obstacle.drawn.is_some();
    let mut drawn_robots = Vec::new();
    let mut given_names = Vec::new();
    for (name, robot) in &scenario.robots {
        match robot.drawn {
            Some(_) => drawn_robots.push(name.clone()),
            None => given_names.push(name.clone()),
        }
    }
    if drawn_robots.is_empty() && !scenario.obstacles.iter().any(is_drawn) {
        return Ok(());
    }
    drawn_robots.sort_by_key(|name| (name.as_str().len(), name.clone()));

    let mut given = Vec::new();
    let mut given_indices = Vec::new();
    for (index, obstacle) in scenario.obstacles.iter().enumerate() {
        if !is_drawn(obstacle) {
            given.push(obstacle);
            given_indices.push(index);
        }
    }
    let robots = scenario.robots.values();
    let hall = scenario.hall_of(&given, robots.filter(|robot| robot.drawn.is_none()));
    let placer = Placer::new(&hall);
    let mut placer = placer
        .map_err(|error| PlacingError::of(error, &given_names).with_obstacles(&given_indices))?;

    for (index, obstacle) in scenario.obstacles.iter_mut().enumerate() {
        let Some(region) = obstacle.drawn else {
            continue;
        };
        // Counted from 1, as people count the tables.
        let name = format!("at/obstacle/{}", index + 1);
        let mut stream = protocol::random::stream(scenario.seed, &name);
        let footprint = obstacle.shape.map(Footprint::from);
        let Some(at) = placer.place(footprint, region, &mut stream) else {
            return Err(PlacingError::no_room(region, None, Some(index)));
        };
        obstacle.at = to_wire(at);
    }

    for name in drawn_robots {
        let mut stream = protocol::random::stream(scenario.seed, &format!("at/{name}"));
        let Some(robot) = scenario.robots.get_mut(&name) else {
            continue;
        };
        let region = robot.drawn.unwrap_or(Region::Field);
        let footprint = Footprint::of_robot(robot.shape, robot.wheels.as_ref(), scenario.body_m);
        let Some(at) = placer.place(footprint, region, &mut stream) else {
            return Err(PlacingError::no_room(region, Some(name), None));
        };
        robot.at = to_wire(at);
    }
    Ok(())
}

/// Places the sites whose places are random, each by a stream of its own, where a body is inside the field and on no obstacle.
/// Sites are not solid: they hinder neither each other nor robots.
///
/// # Errors
/// The name of a site that has no place, and why.
pub(super) fn place_sites_at_random(scenario: &mut Scenario) -> Result<(), (String, String)> {
    let mut drawn = Vec::new();
    for (name, site) in &scenario.sites {
        drawn.extend(site.drawn.map(|region| (name.clone(), region)));
    }

    let places = free_places(scenario, drawn, "site")?;
    for (name, at) in places {
        if let Some(site) = scenario.sites.get_mut(&name) {
            site.at = at;
        }
    }
    Ok(())
}

/// Places the peaks of layers whose places are random, as sites: those of a layer are called as it and a number from 1, `dust/1`.
///
/// # Errors
/// The name of a layer with a peak that has no place, and why.
pub(super) fn place_peaks_at_random(scenario: &mut Scenario) -> Result<(), (String, String)> {
    let layers: Vec<String> = scenario.layers.keys().cloned().collect();
    for layer in layers {
        let mut drawn = Vec::new();
        for (index, peak) in scenario.layers[&layer].peaks.iter().enumerate() {
            let name = format!("{layer}/{}", index + 1);
            drawn.extend(peak.drawn.map(|region| (name, region)));
        }

        let places = free_places(scenario, drawn, "peak");
        let places = places.map_err(|(_, reason)| (layer.clone(), reason))?;
        let spec = scenario.layers.get_mut(&layer);
        let peaks = spec.into_iter().flat_map(|spec| &mut spec.peaks);
        let drawn = peaks.filter(|peak| peak.drawn.is_some());
        for (peak, (_, at)) in drawn.zip(places) {
            peak.at = at;
        }
    }
    Ok(())
}

/// Places where a body is inside the field and on no obstacle, by name, in regions, each by the stream of its name.
fn free_places(
    scenario: &Scenario,
    drawn: Vec<(String, Region)>,
    what: &str,
) -> Result<Vec<(String, Point)>, (String, String)> {
    if drawn.is_empty() {
        return Ok(Vec::new());
    }

    let mut hall = scenario.hall();
    hall.robots.clear();
    let placer = Placer::new(&hall);
    let mut places = Vec::new();
    for (name, region) in drawn {
        let refuse = |reason: String| (name.clone(), reason);
        let placer = placer.as_ref();
        let placer = placer.map_err(|error| refuse(error.to_string()))?;
        let mut stream = protocol::random::stream(scenario.seed, &format!("at/{name}"));
        let at = placer.find(None, region, &mut stream);
        let at = at.ok_or_else(|| refuse(no_free_place(&format!("{what} {name}"), region)))?;
        places.push((name, to_wire(at)));
    }
    Ok(places)
}

/// Why something has no place in a region, in words.
fn no_free_place(whose: &str, region: Region) -> String {
    let why = match region {
        Region::Field => "the field is too full",
        Region::Rectangle(..) | Region::Disc { .. } => {
            "the region of its place is too small, too full, or off the field"
        }
    };
    let tries = Placer::TRIES;
    format!("there is no free place for {whose} in {tries} draws: {why}")
}

impl PlacingError {
    /// An error of a hall with these robots.
    fn of(error: HallError, robots: &[RobotName]) -> Self {
        let name = |index: usize| robots.get(index).cloned();

        let mut robot = None;
        let mut other = None;
        match error {
            HallError::RobotOffField { index, .. }
            | HallError::RobotOnObstacle { index, .. }
            | HallError::RobotOnWall { index, .. } => {
                robot = name(index);
            }
            HallError::RobotOnRobot {
                index,
                other: other_index,
                ..
            } => {
                robot = name(index);
                other = name(other_index);
            }
            _ => {}
        }

        Self {
            reason: PlacingReason::Hall(error),
            robot,
            other,
            obstacle: None,
        }
    }

    /// An error of a region that has no room.
    fn no_room(region: Region, robot: Option<RobotName>, obstacle: Option<usize>) -> Self {
        Self {
            reason: PlacingReason::NoFreePlace(region),
            robot,
            other: None,
            obstacle,
        }
    }

    /// The same error of a hall whose obstacles have these numbers in the scenario.
    fn with_obstacles(mut self, indices: &[usize]) -> Self {
        if let PlacingReason::Hall(
            HallError::ObstacleOffField { index, .. }
            | HallError::ObstacleSize { index, .. }
            | HallError::RobotOnObstacle {
                obstacle: index, ..
            },
        ) = &mut self.reason
        {
            *index = indices.get(*index).copied().unwrap_or(*index);
        }
        self
    }

    /// The part of the scenario that has to change.
    pub(super) fn cause(&self) -> PlacingCause<'_> {
        if let Some(robot) = &self.robot {
            return PlacingCause::Robot(robot);
        }

        if let Some(obstacle) = self.obstacle {
            return PlacingCause::Obstacle(obstacle);
        }

        let PlacingReason::Hall(error) = self.reason else {
            return PlacingCause::Field;
        };
        match error {
            HallError::ObstacleOffField { index, .. } | HallError::ObstacleSize { index, .. } => {
                PlacingCause::Obstacle(index)
            }
            HallError::WallOffField { index, .. } | HallError::WallTooShort { index, .. } => {
                PlacingCause::Wall(index)
            }
            HallError::NoRoom { .. }
            | HallError::NoCrowd { .. }
            | HallError::TooManyBodies { .. } => PlacingCause::Guests,
            HallError::OutOfRange { name: "tick_s", .. } => PlacingCause::Tick,
            _ => PlacingCause::Field,
        }
    }

    /// The field of a set-up with the error.
    pub(super) fn field(&self) -> String {
        match self.cause() {
            PlacingCause::Robot(robot) => format!("robots.{robot}"),
            PlacingCause::Obstacle(_) => "obstacles".to_owned(),
            PlacingCause::Guests => "guests".to_owned(),
            PlacingCause::Tick | PlacingCause::Field | PlacingCause::Wall(_) => {
                "field_m".to_owned()
            }
        }
    }
}

impl std::fmt::Display for PlacingError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (&self.reason, &self.robot, &self.other) {
            (PlacingReason::Hall(HallError::RobotOnRobot { at, .. }), Some(robot), Some(other)) => {
                write!(f, "robot {robot} at {at} m overlaps robot {other}")
            }
            (
                PlacingReason::Hall(HallError::RobotOnObstacle { at, obstacle, .. }),
                Some(robot),
                _,
            ) => {
                let number = obstacle + 1;
                write!(f, "robot {robot} at {at} m overlaps obstacle {number}")
            }
            (PlacingReason::Hall(HallError::RobotOffField { at, .. }), Some(robot), _) => {
                write!(
                    f,
                    "robot {robot} at {at} m does not lie wholly inside the field"
                )
            }
            (PlacingReason::Hall(HallError::RobotOnWall { at, wall, .. }), Some(robot), _) => {
                write!(f, "robot {robot} at {at} m stands on wall {}", wall + 1)
            }
            (PlacingReason::NoFreePlace(region), ..) => {
                let whose = match (&self.robot, self.obstacle) {
                    (Some(robot), _) => format!("robot {robot}"),
                    (None, index) => format!("obstacle {}", index.unwrap_or(0) + 1),
                };
                f.write_str(&no_free_place(&whose, *region))
            }
            (PlacingReason::Hall(error), ..) => error.fmt(f),
        }
    }
}
