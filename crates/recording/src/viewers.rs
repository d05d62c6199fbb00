//! Messages that general viewers draw, in the schemas of Foxglove: Foxglove draws all of them, Rerun all but the scenes.
//! The run's own channels have everything that these have.

use protocol::RobotName;
use protocol::messages::{BodyShape, LogRecord};

use crate::content::{Header, PlacedRobot, RecordedTick};
use crate::protobuf::Protobuf;

/// Frame of reference of everything: the origin is the corner of the field, x and y are its edges, in meters.
const FIELD: &str = "field";
/// Height of bodies, as a part of their side: the field is flat, and viewers are not.
const HEIGHT: f64 = 0.5;

/// A kind of message, with the descriptor of its schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ViewerSchema {
    SceneUpdate,
    PointCloud,
    PoseInFrame,
    FrameTransforms,
    Log,
}

impl ViewerSchema {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::SceneUpdate => "foxglove.SceneUpdate",
            Self::PointCloud => "foxglove.PointCloud",
            Self::PoseInFrame => "foxglove.PoseInFrame",
            Self::FrameTransforms => "foxglove.FrameTransforms",
            Self::Log => "foxglove.Log",
        }
    }

    /// A `FileDescriptorSet`.
    pub(crate) fn descriptor(self) -> &'static [u8] {
        match self {
            Self::SceneUpdate => include_bytes!("../descriptors/SceneUpdate.bin"),
            Self::PointCloud => include_bytes!("../descriptors/PointCloud.bin"),
            Self::PoseInFrame => include_bytes!("../descriptors/PoseInFrame.bin"),
            Self::FrameTransforms => include_bytes!("../descriptors/FrameTransforms.bin"),
            Self::Log => include_bytes!("../descriptors/Log.bin"),
        }
    }
}

/// The field with its obstacles and walls, which stay.
pub(crate) fn field(to: &mut Protobuf<'_>, header: &Header) {
    to.message(2, |to| {
        entity(to, 0, "field");
        let mut discs = Vec::new();
        for (index, at) in header.obstacles.iter().enumerate() {
            let shape = header.static_world.obstacle_shapes.get(index);
            match shape.copied().flatten() {
                Some(BodyShape::Disc(radius_m)) => discs.push((BodyShape::Disc(radius_m), *at)),
                other => body(to, header, other, *at, 0.0, FIXED_COLOR),
            }
        }
        // Fields are in the order of their numbers.
        for (shape, at) in discs {
            body(to, header, Some(shape), at, 0.0, FIXED_COLOR);
        }
        to.message(11, |to| outline(to, header));
        for wall in &header.static_world.walls {
            to.message(11, |to| line(to, header, LINE_STRIP, wall, FIXED_COLOR));
        }
    });
}

fn outline(to: &mut Protobuf<'_>, header: &Header) {
    let [width, height] = header.field_m;
    let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
    line(to, header, LINE_LOOP, &corners, [0.5, 0.5, 0.5]);
}

fn line(to: &mut Protobuf<'_>, header: &Header, kind: u64, corners: &[[f64; 2]], rgb: [f64; 3]) {
    to.integer(1, kind)
        .message(2, |to| pose(to, 0.0, 0.0, 0.0, 0.0))
        .double(3, header.body_m / 10.0);
    for [x, y] in corners {
        to.message(5, |to| vector(to, *x, *y, 0.0));
    }
    to.message(6, |to| color(to, rgb));
}

/// A body, as a part of an entity, turned by an angle.
fn body(
    to: &mut Protobuf<'_>,
    header: &Header,
    shape: Option<BodyShape>,
    [x, y]: [f64; 2],
    direction_rad: f64,
    rgb: [f64; 3],
) {
    let height_m = header.body_m * HEIGHT;
    let field = match shape {
        None | Some(BodyShape::Rectangle(_)) => CUBES,
        Some(BodyShape::Disc(_)) => CYLINDERS,
    };
    let [width_m, length_m] = shape.map_or([header.body_m; 2], BodyShape::size_m);
    to.message(field, |to| {
        to.message(1, |to| pose(to, x, y, height_m / 2.0, direction_rad))
            .message(2, |to| vector(to, width_m, length_m, height_m));
        if field == CYLINDERS {
            to.double(3, 1.0).double(4, 1.0);
            to.message(5, |to| color(to, rgb));
        } else {
            to.message(3, |to| color(to, rgb));
        }
    });
}

/// The robots, each with its name, its emotion and its behavior.
pub(crate) fn robots(to: &mut Protobuf<'_>, header: &Header, tick: &RecordedTick, time_ns: u64) {
    for (index, robot) in tick.frame.robots.iter().enumerate() {
        let at = robot.location;
        let direction_rad = direction_rad(tick, robot);
        let color_of = ROBOT_COLORS[index % ROBOT_COLORS.len()];

        to.message(2, |to| {
            entity(to, time_ns, robot.name.as_str());
            let shape = header.static_world.robot_shapes.get(&robot.name).copied();
            // A shape of its own turns with a robot that drives.
            let turn_rad = shape.map_or(direction_rad, |_| robot.heading_rad.unwrap_or(0.0));
            body(to, header, shape, [at.x, at.y], turn_rad, color_of);
            to.message(13, |to| {
                to.message(1, |to| pose(to, at.x, at.y, header.body_m, 0.0))
                    .integer(2, 1)
                    .double(3, header.body_m / 2.0)
                    .message(5, |to| color(to, [1.0, 1.0, 1.0]))
                    .text(6, &label(tick, &robot.name));
            });
        });
    }
}

fn label(tick: &RecordedTick, robot: &RobotName) -> String {
    match tick.reports.get(robot) {
        Some(report) => format!(
            "{robot}\n{}\n{}",
            report.emotion_state, report.behavior_state
        ),
        None => format!("{robot}\n(no report)"),
    }
}

/// The guests.
pub(crate) fn guests(to: &mut Protobuf<'_>, guests_mm: &[i64], time_ns: u64) {
    to.message(1, |to| timestamp(to, time_ns))
        .text(2, FIELD)
        .message(3, |to| pose(to, 0.0, 0.0, 0.0, 0.0))
        .fixed32(4, 3 * 4);

    for (name, offset) in [("x", 0), ("y", 4), ("z", 8)] {
        to.message(5, |to| {
            to.text(1, name).fixed32(2, offset).integer(3, FLOAT32);
        });
    }

    to.bytes(6, |bytes| {
        for place in guests_mm.chunks_exact(2) {
            for coordinate in [place[0], place[1], 0] {
                bytes.extend_from_slice(&(coordinate as f32 / 1000.0).to_le_bytes());
            }
        }
    });
}

/// The pose of a robot.
pub(crate) fn robot_pose(
    to: &mut Protobuf<'_>,
    tick: &RecordedTick,
    robot: &PlacedRobot,
    time_ns: u64,
) {
    let at = robot.location;
    to.message(1, |to| timestamp(to, time_ns))
        .text(2, FIELD)
        .message(3, |to| {
            pose(to, at.x, at.y, 0.0, direction_rad(tick, robot));
        });
}

/// The frame of reference of each robot, which has its name.
pub(crate) fn transforms(to: &mut Protobuf<'_>, tick: &RecordedTick, time_ns: u64) {
    for robot in &tick.frame.robots {
        let at = robot.location;
        to.message(1, |to| {
            to.message(1, |to| timestamp(to, time_ns))
                .text(2, FIELD)
                .text(3, robot.name.as_str())
                .message(4, |to| vector(to, at.x, at.y, 0.0))
                .message(5, |to| rotation(to, direction_rad(tick, robot)));
        });
    }
}

/// A line of the log.
pub(crate) fn log(to: &mut Protobuf<'_>, line: &LogRecord, time_ns: u64) {
    to.message(1, |to| timestamp(to, time_ns))
        .integer(2, INFO)
        .text(3, &line.text)
        .text(4, &line.source);
}

/// Fields of a `SceneEntity`.
const CUBES: u64 = 8;
const CYLINDERS: u64 = 10;
const LINE_STRIP: u64 = 0;
const LINE_LOOP: u64 = 1;
const FLOAT32: u64 = 7;
const INFO: u64 = 2;
const FIXED_COLOR: [f64; 3] = [0.4, 0.4, 0.4];
/// Told apart by people with any color vision (Okabe and Ito).
const ROBOT_COLORS: [[f64; 3]; 4] = [
    [0.0, 0.45, 0.7],
    [0.9, 0.6, 0.0],
    [0.0, 0.62, 0.45],
    [0.8, 0.47, 0.65],
];

/// The heading of a robot, or the direction of one that does not drive; that of x for one without a report.
fn direction_rad(tick: &RecordedTick, robot: &PlacedRobot) -> f64 {
    let report = tick.reports.get(&robot.name);
    let reported = report.map_or(0.0, |report| report.direction_rad);
    robot.heading_rad.unwrap_or(reported)
}

/// The beginning of an entity of a scene, which stays until another one with its id replaces it.
fn entity(to: &mut Protobuf<'_>, time_ns: u64, id: &str) {
    to.message(1, |to| timestamp(to, time_ns))
        .text(2, FIELD)
        .text(3, id);
}

fn pose(to: &mut Protobuf<'_>, x: f64, y: f64, z: f64, direction_rad: f64) {
    to.message(1, |to| vector(to, x, y, z))
        .message(2, |to| rotation(to, direction_rad));
}

fn vector(to: &mut Protobuf<'_>, x: f64, y: f64, z: f64) {
    to.double(1, x).double(2, y).double(3, z);
}

/// A rotation about the vertical, as a quaternion.
fn rotation(to: &mut Protobuf<'_>, direction_rad: f64) {
    to.double(3, libm::sin(direction_rad / 2.0))
        .double(4, libm::cos(direction_rad / 2.0));
}

fn color(to: &mut Protobuf<'_>, [r, g, b]: [f64; 3]) {
    to.double(1, r).double(2, g).double(3, b).double(4, 1.0);
}

fn timestamp(to: &mut Protobuf<'_>, time_ns: u64) {
    to.integer(1, time_ns / 1_000_000_000)
        .integer(2, time_ns % 1_000_000_000);
}
