//! The messages of ROS 2 that an export has: their definitions (ros2/rcl_interfaces, ros2/common_interfaces and ros2/geometry2, as of
//! Kilted), which readers get with the file, and how each is written.

use super::cdr::Cdr;

/// Between the definition of a message and those that it uses.
const SEPARATOR: &str =
    "================================================================================";

/// A type of message: its name, its fields, and the types that these use.
struct Definition {
    name: &'static str,
    fields: &'static str,
    uses: &'static [Definition],
}

const fn definition(
    name: &'static str,
    fields: &'static str,
    uses: &'static [Definition],
) -> Definition {
    Definition { name, fields, uses }
}

const TIME: Definition = definition(
    "builtin_interfaces/Time",
    "int32 sec\nuint32 nanosec\n",
    &[],
);
const HEADER: Definition = definition(
    "std_msgs/Header",
    "builtin_interfaces/Time stamp\nstring frame_id\n",
    &[TIME],
);
const POINT: Definition = definition(
    "geometry_msgs/Point",
    "float64 x\nfloat64 y\nfloat64 z\n",
    &[],
);
const VECTOR: Definition = definition(
    "geometry_msgs/Vector3",
    "float64 x\nfloat64 y\nfloat64 z\n",
    &[],
);
const QUATERNION: Definition = definition(
    "geometry_msgs/Quaternion",
    "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    &[],
);
const POSE: Definition = definition(
    "geometry_msgs/Pose",
    "Point position\nQuaternion orientation\n",
    &[POINT, QUATERNION],
);
const POSE_WITH_COVARIANCE: Definition = definition(
    "geometry_msgs/PoseWithCovariance",
    "Pose pose\nfloat64[36] covariance\n",
    &[POSE],
);
const TWIST: Definition = definition(
    "geometry_msgs/Twist",
    "Vector3 linear\nVector3 angular\n",
    &[VECTOR],
);
const TWIST_WITH_COVARIANCE: Definition = definition(
    "geometry_msgs/TwistWithCovariance",
    "Twist twist\nfloat64[36] covariance\n",
    &[TWIST],
);
const TRANSFORM: Definition = definition(
    "geometry_msgs/Transform",
    "Vector3 translation\nQuaternion rotation\n",
    &[VECTOR, QUATERNION],
);
const TRANSFORM_STAMPED: Definition = definition(
    "geometry_msgs/TransformStamped",
    "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
    &[HEADER, TRANSFORM],
);

/// The types of the messages that an export has.
#[derive(Debug, Clone, Copy)]
pub(super) enum MessageType {
    Clock,
    Odometry,
    PoseArray,
    Text,
    Transforms,
}

impl MessageType {
    /// Its name, as in `ros2 topic info`.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Clock => "rosgraph_msgs/msg/Clock",
            Self::Odometry => "nav_msgs/msg/Odometry",
            Self::PoseArray => "geometry_msgs/msg/PoseArray",
            Self::Text => "std_msgs/msg/String",
            Self::Transforms => "tf2_msgs/msg/TFMessage",
        }
    }

    /// Its definition, and after it those of all types that it uses, each once: the encoding `ros2msg` of schemas.
    pub(super) fn schema(self) -> String {
        let (fields, uses): (&str, &[Definition]) = match self {
            Self::Clock => ("builtin_interfaces/Time clock\n", &[TIME]),
            Self::Odometry => (
                "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
                 geometry_msgs/TwistWithCovariance twist\n",
                &[HEADER, POSE_WITH_COVARIANCE, TWIST_WITH_COVARIANCE],
            ),
            Self::PoseArray => ("std_msgs/Header header\nPose[] poses\n", &[HEADER, POSE]),
            Self::Text => ("string data\n", &[]),
            Self::Transforms => (
                "geometry_msgs/TransformStamped[] transforms\n",
                &[TRANSFORM_STAMPED],
            ),
        };

        let mut schema = fields.to_owned();
        let mut written = Vec::new();
        for used in uses {
            used.append(&mut schema, &mut written);
        }
        schema
    }
}

impl Definition {
    fn append(&self, schema: &mut String, written: &mut Vec<&'static str>) {
        if written.contains(&self.name) {
            return;
        }

        written.push(self.name);
        schema.push_str(SEPARATOR);
        schema.push_str("\nMSG: ");
        schema.push_str(self.name);
        schema.push('\n');
        schema.push_str(self.fields);
        for used in self.uses {
            used.append(schema, written);
        }
    }
}

/// A place and a direction in the plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlanePose {
    /// Meters.
    pub(super) at_m: [f64; 2],
    /// Radians counter-clockwise from +x.
    pub(super) heading_rad: f64,
}

/// A velocity in the plane, in the frame of what moves: x is ahead, y to the left.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PlaneVelocity {
    /// Meters per second.
    pub(super) linear_mps: [f64; 2],
    /// Radians per second, counter-clockwise.
    pub(super) angular_radps: f64,
}

/// What the messages of one tick have in common.
#[derive(Debug, Clone, Copy)]
pub(super) struct MessageStamp<'a> {
    /// Simulated time, nanoseconds.
    pub(super) time_ns: u64,
    /// The frame that places are in.
    pub(super) frame: &'a str,
}

impl MessageStamp<'_> {
    pub(super) fn clock(self, bytes: &mut Vec<u8>) {
        self.time(&mut Cdr::begin(bytes));
    }

    pub(super) fn odometry(
        self,
        child: &str,
        pose: PlanePose,
        velocity: PlaneVelocity,
        bytes: &mut Vec<u8>,
    ) {
        let mut cdr = Cdr::begin(bytes);
        self.header(&mut cdr);
        cdr.text(child);
        pose.write(&mut cdr);
        // The simulator knows them exactly.
        cdr.f64s(&[0.0; 36]);
        let [ahead, left] = velocity.linear_mps;
        cdr.f64s(&[ahead, left, 0.0, 0.0, 0.0, velocity.angular_radps]);
        cdr.f64s(&[0.0; 36]);
    }

    pub(super) fn poses(self, places_m: &[[f64; 2]], bytes: &mut Vec<u8>) {
        let mut cdr = Cdr::begin(bytes);
        self.header(&mut cdr);
        cdr.u32(places_m.len() as u32);
        for at_m in places_m {
            let pose = PlanePose {
                at_m: *at_m,
                heading_rad: 0.0,
            };
            pose.write(&mut cdr);
        }
    }

    pub(super) fn transforms(self, children: &[(&str, PlanePose)], bytes: &mut Vec<u8>) {
        let mut cdr = Cdr::begin(bytes);
        cdr.u32(children.len() as u32);
        for (child, pose) in children {
            self.header(&mut cdr);
            cdr.text(child);
            // A translation and a rotation are, in bytes, what a position and an orientation are.
            pose.write(&mut cdr);
        }
    }

    fn header(self, cdr: &mut Cdr<'_>) {
        self.time(cdr);
        cdr.text(self.frame);
    }

    fn time(self, cdr: &mut Cdr<'_>) {
        const NS_PER_S: u64 = 1_000_000_000;
        cdr.i32(i32::try_from(self.time_ns / NS_PER_S).unwrap_or(i32::MAX));
        cdr.u32((self.time_ns % NS_PER_S) as u32);
    }
}

impl PlanePose {
    fn write(self, cdr: &mut Cdr<'_>) {
        let [x, y] = self.at_m;
        cdr.f64s(&[x, y, 0.0]);
        let half_rad = self.heading_rad / 2.0;
        cdr.f64s(&[0.0, 0.0, libm::sin(half_rad), libm::cos(half_rad)]);
    }
}

/// A `std_msgs/String`.
pub(super) fn text(text: &str, bytes: &mut Vec<u8>) {
    Cdr::begin(bytes).text(text);
}
