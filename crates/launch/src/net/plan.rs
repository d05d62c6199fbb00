//! The plan of faults: which link, when, for how long, what. Times are of the wall clock, from the moment when the clock
//! of the run first ran.
//!
//! A plan is a file, or what a scenario's own partitions come to on real links.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::Duration;

use config::units::Time;
use config::{FileError, Source};
use protocol::{RobotName, Tick};
use serde::Deserialize;
use simulator::Scenario;
use simulator::scenario::network::Partition;
use toml::Spanned;

use super::shape::{Flow, Shape, duration};

/// Faults, checked.
#[derive(Debug, Clone)]
pub struct Plan {
    faults: Vec<Fault>,
}

/// One fault of one link.
#[derive(Debug, Clone, PartialEq)]
struct Fault {
    robot: RobotName,
    begin: Duration,
    end: Duration,
    shape: Shape,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlan {
    #[serde(rename = "link_fault")]
    faults: Vec<RawFault>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFault {
    robot: Spanned<RobotName>,
    at: Spanned<Time>,
    r#for: Spanned<Time>,
    r#do: Spanned<RawShape>,
}

/// As people write it.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "a fault is \"cut\", \"close\", { delay = \"50 ms\", jitter = \"10 ms\" } or { bandwidth_bps = 64000 }"
)]
enum RawShape {
    Word(Word),
    Slow(Slow),
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Word {
    Cut,
    Close,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Slow {
    delay: Option<Time>,
    jitter: Option<Time>,
    bandwidth_bps: Option<u64>,
}

impl Plan {
    /// Reads a plan for links of these robots.
    ///
    /// # Errors
    /// [`FileError`] with line and caret, also about a robot that has no link.
    pub fn load(path: &Path, robots: &BTreeSet<RobotName>) -> Result<Self, FileError> {
        Self::parse(&Source::read(path)?, robots)
    }

    /// The partitions of a scenario as cuts of real links, at `speed` simulated seconds a second. Every link leads to the
    /// simulator, so whoever is cut off from the others there is cut off from it, too: the largest group, the first of
    /// equals, keeps its links, and all other groups lose theirs.
    ///
    /// # Errors
    /// There is no partition, or one that real links cannot be: in one direction, or of one kind of message.
    pub(super) fn of_partitions(scenario: &Scenario, speed: f64) -> Result<Self, FileError> {
        let partitions = &scenario.network.partitions;
        if partitions.is_empty() {
            return Err(
                FileError::new("the scenario has no partition that could be played")
                    .with_help("name a plan of faults by --plan; docs/links.md says how one looks"),
            );
        }

        let wall = |tick: Tick| Duration::try_from_secs_f64(tick as f64 * scenario.tick_s / speed);
        let mut faults = Vec::new();
        for partition in partitions {
            if partition.one_way || !(partition.commands && partition.queries) {
                return Err(FileError::new(
                    "a real link is cut in both directions and for all messages",
                )
                .with_help(
                    "a partition in one direction, or of one kind of message, is simulated only",
                ));
            }
            let begin = wall(partition.from);
            let end = partition.until.map_or(Ok(NEVER), wall);
            let (Ok(begin), Ok(end)) = (begin, end) else {
                return Err(FileError::new("at this speed a partition never comes"));
            };
            let shape = Shape {
                flow: Flow::Cut,
                ..Shape::default()
            };
            let cut = |robot: &RobotName| Fault {
                robot: robot.clone(),
                begin,
                end,
                shape,
            };
            faults.extend(cut_off(partition).map(cut));
        }

        Ok(Self { faults })
    }

    fn parse(source: &Source, robots: &BTreeSet<RobotName>) -> Result<Self, FileError> {
        let raw: RawPlan = source.parse()?;
        let faults = raw
            .faults
            .into_iter()
            .map(|fault| check(source, fault, robots));
        Ok(Self {
            faults: faults.collect::<Result<_, _>>()?,
        })
    }

    /// Those whose links it touches.
    pub(super) fn robots(&self) -> BTreeSet<&RobotName> {
        self.faults.iter().map(|fault| &fault.robot).collect()
    }

    /// Moments at which something begins or ends, in order.
    pub(super) fn changes(&self) -> BTreeSet<Duration> {
        self.faults
            .iter()
            .flat_map(|fault| [fault.begin, fault.end])
            .collect()
    }

    /// What the link of a robot is like at a moment.
    pub(super) fn shape(&self, robot: &RobotName, at: Duration) -> Shape {
        let active =
            |fault: &&Fault| fault.robot == *robot && (fault.begin..fault.end).contains(&at);
        self.faults
            .iter()
            .filter(active)
            .map(|fault| fault.shape)
            .fold(Shape::default(), Shape::and)
    }

    /// Refuses what can only be played through a proxy.
    pub(super) fn check_cuts_only(&self, via: &str) -> Result<(), FileError> {
        match self.faults.iter().find(|fault| !fault.shape.is_plain_cut()) {
            None => Ok(()),
            Some(Fault { robot, shape, .. }) => {
                let text =
                    format!("the link of {robot} is to be \"{shape}\": {via} can only be cut");
                Err(FileError::new(text).with_help("play this plan with --via proxy"))
            }
        }
    }

    /// Plays it from `begun` on: calls `apply` for every link that changes, with the time since `begun`, until all is
    /// done or `is_over`.
    ///
    /// # Errors
    /// The first error of `apply`.
    pub fn play<E>(
        &self,
        begun: std::time::Instant,
        mut apply: impl FnMut(&RobotName, Shape, Duration) -> Result<(), E>,
        mut is_over: impl FnMut() -> bool,
    ) -> Result<(), E> {
        let mut now: BTreeMap<&RobotName, Shape> = BTreeMap::new();
        for at in self.changes() {
            while let Some(left) = at
                .checked_sub(begun.elapsed())
                .filter(|left| !left.is_zero())
            {
                if is_over() {
                    return Ok(());
                }
                std::thread::sleep(left.min(LOOK_AGAIN));
            }
            for robot in self.robots() {
                let shape = self.shape(robot, at);
                if now.insert(robot, shape).unwrap_or_default() != shape {
                    apply(robot, shape, begun.elapsed())?;
                }
            }
        }

        Ok(())
    }
}

/// While a plan waits for its next moment it looks this often whether the run is over.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// The end of what lasts until the run is over.
const NEVER: Duration = Duration::from_secs(u32::MAX as u64);

/// Robots that a partition leaves without a link to the simulator.
fn cut_off(partition: &Partition) -> impl Iterator<Item = &RobotName> {
    // Of equals `max_by_key` gives the last, so they are looked at from the end.
    let largest = partition
        .groups
        .iter()
        .enumerate()
        .rev()
        .max_by_key(|(_, group)| group.len());
    let kept = largest.map(|(index, _)| index);
    let others = partition
        .groups
        .iter()
        .enumerate()
        .filter(move |(index, _)| Some(*index) != kept);

    others.flat_map(|(_, group)| group)
}

fn check(source: &Source, raw: RawFault, robots: &BTreeSet<RobotName>) -> Result<Fault, FileError> {
    let refuse = |span, reason: &str| FileError::at(source, Some(span), reason);
    let time = |time: &Spanned<Time>| {
        duration(*time.get_ref()).map_err(|reason| refuse(time.span(), &reason))
    };
    let robot = raw.robot.get_ref().clone();
    if !robots.contains(&robot) {
        let names: Vec<&str> = robots.iter().map(RobotName::as_str).collect();
        return Err(refuse(
            raw.robot.span(),
            &format!("there is no link of a robot {robot}"),
        )
        .with_help(format!("there are links of {}", names.join(", "))));
    }

    let (begin, length) = (time(&raw.at)?, time(&raw.r#for)?);
    if length.is_zero() {
        return Err(refuse(raw.r#for.span(), "a fault lasts for more than zero"));
    }

    let end = begin
        .checked_add(length)
        .ok_or_else(|| refuse(raw.r#for.span(), "this never ends"))?;
    let span = raw.r#do.span();
    let shape = shape(raw.r#do.into_inner()).map_err(|reason| refuse(span, &reason))?;

    Ok(Fault {
        robot,
        begin,
        end,
        shape,
    })
}

fn shape(raw: RawShape) -> Result<Shape, String> {
    let slow = match raw {
        RawShape::Word(Word::Cut) => {
            return Ok(Shape {
                flow: Flow::Cut,
                ..Shape::default()
            });
        }
        RawShape::Word(Word::Close) => {
            return Ok(Shape {
                flow: Flow::Closed,
                ..Shape::default()
            });
        }
        RawShape::Slow(slow) => slow,
    };
    let time = |time: Option<Time>| time.map_or(Ok(Duration::ZERO), duration);
    let shape = Shape {
        delay: time(slow.delay)?,
        jitter: time(slow.jitter)?,
        bandwidth_bps: slow.bandwidth_bps,
        ..Shape::default()
    };

    if slow.bandwidth_bps == Some(0) {
        return Err("a bandwidth is above zero; to let nothing through, write \"cut\"".to_owned());
    }

    if shape == Shape::default() {
        return Err("this fault does nothing".to_owned());
    }

    Ok(shape)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Plan, FileError> {
        let robots = ["Butler", "Leguin"].map(|name| RobotName::new(name).unwrap());
        let source = Source {
            name: "plan.toml".to_owned(),
            text: text.to_owned(),
        };
        Plan::parse(&source, &robots.into_iter().collect())
    }

    fn fault(robot: &str, at: &str, length: &str, what: &str) -> String {
        format!(
            "[[link_fault]]\nrobot = \"{robot}\"\nat = \"{at}\"\nfor = \"{length}\"\ndo = {what}\n"
        )
    }

    #[test]
    fn a_plan_says_what_each_link_is_like_at_each_moment() {
        let text = fault("Leguin", "5 s", "5 s", "\"cut\"")
            + &fault(
                "Leguin",
                "8 s",
                "4 s",
                "{ delay = \"50 ms\", jitter = \"10 ms\" }",
            )
            + &fault("Butler", "1 s", "1 s", "{ bandwidth_bps = 64000 }");
        let plan = parse(&text).unwrap();
        let shown = |robot: &str, s: u64| {
            plan.shape(&RobotName::new(robot).unwrap(), Duration::from_secs(s))
                .to_string()
        };
        let times: Vec<u64> = plan.changes().iter().map(Duration::as_secs).collect();
        assert_eq!(times, [1, 2, 5, 8, 10, 12]);

        let leguin: Vec<String> = times.iter().map(|s| shown("Leguin", *s)).collect();
        let slow = "delay 50ms, jitter 10ms";
        assert_eq!(
            leguin,
            [
                "whole",
                "whole",
                "cut",
                &format!("cut, {slow}"),
                slow,
                "whole"
            ]
        );

        assert_eq!(
            (shown("Butler", 1), shown("Butler", 2)),
            ("bandwidth 64000 bit/s".into(), "whole".into())
        );
        assert!(plan.check_cuts_only("a namespace's link").is_err());
    }

    #[test]
    fn the_shipped_plan_can_be_played() {
        let file =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/links/cut_leguin.toml");
        let plan = Plan::load(&file, &BTreeSet::from([RobotName::new("Leguin").unwrap()])).unwrap();
        assert_eq!(plan.changes().len(), 4);
    }

    fn scenario(network: &str) -> Scenario {
        let robots: String = ["A", "B", "C"]
            .iter()
            .enumerate()
            .map(|(i, name)| {
                format!(
                    "[[robot]]\nname = \"{name}\"\nat = [\"{} m\", \"2 m\"]\n",
                    2 + 2 * i
                )
            })
            .collect();
        let text = format!("seed = 5\ntick = \"0.5 s\"\n{network}\n{robots}");

        Scenario::parse(
            &Source {
                name: "scenario.toml".to_owned(),
                text,
            },
            Path::new("."),
        )
        .unwrap()
    }

    #[test]
    fn a_simulated_partition_is_a_cut_of_links_at_the_same_simulated_time() {
        let partition = |more: &str| {
            let head =
                "[[network.partition]]\ngroups = [[\"A\"], [\"C\", \"B\"]]\nfrom = \"60 s\"\n";
            scenario(&format!("{head}{more}\n"))
        };
        let plan = Plan::of_partitions(&partition("until = \"100 s\""), 20.0).unwrap();
        let cut = |s: u64| {
            plan.shape(&RobotName::new("A").unwrap(), Duration::from_secs(s))
                .to_string()
        };
        assert_eq!(
            [cut(2), cut(3), cut(4), cut(5)],
            ["whole", "cut", "cut", "whole"]
        );
        assert_eq!(plan.robots().len(), 1, "the larger group keeps its links");

        let endless = Plan::of_partitions(&partition(""), 20.0).unwrap();
        assert!(endless.changes().contains(&NEVER));

        for refused in ["one_way = true", "cuts = [\"queries\"]"] {
            assert!(
                Plan::of_partitions(&partition(refused), 20.0).is_err(),
                "{refused}"
            );
        }

        assert!(Plan::of_partitions(&scenario(""), 20.0).is_err());
    }

    #[test]
    fn what_is_wrong_is_shown_where_it_stands() {
        for (text, reason) in [
            (
                fault("Vonda", "5 s", "5 s", "\"cut\""),
                "no link of a robot Vonda",
            ),
            (fault("Leguin", "-5 s", "5 s", "\"cut\""), "zero or more"),
            (fault("Leguin", "5 s", "0 s", "\"cut\""), "more than zero"),
            (
                fault("Leguin", "5 s", "5 s", "\"kut\""),
                "a fault is \"cut\"",
            ),
            (
                fault("Leguin", "5 s", "5 s", "{ dealy = \"5 ms\" }"),
                "a fault is \"cut\"",
            ),
            (
                fault("Leguin", "5 s", "5 s", "{ delay = \"0 ms\" }"),
                "does nothing",
            ),
            (
                fault("Leguin", "5 s", "5 s", "{ bandwidth_bps = 0 }"),
                "above zero",
            ),
            ("[[link_falt]]".to_owned(), "unknown field"),
        ] {
            let error = parse(&text).unwrap_err().in_words();
            assert!(error.contains(reason), "{error:?} does not say {reason:?}");
        }
    }

    #[test]
    fn a_plan_is_played_in_order_and_ends_when_the_run_does() {
        let text = fault("Leguin", "0.01 s", "0.02 s", "\"cut\"")
            + &fault("Butler", "0.02 s", "9 min", "\"cut\"");
        let (plan, mut seen) = (parse(&text).unwrap(), Vec::new());
        let begun = std::time::Instant::now();
        let played: Result<(), ()> = plan.play(
            begun,
            |robot, shape, _| {
                seen.push(format!("{robot} {shape}"));
                Ok(())
            },
            || begun.elapsed() > Duration::from_millis(200),
        );

        assert_eq!(
            (played, seen),
            (
                Ok(()),
                ["Leguin cut", "Butler cut", "Leguin whole"]
                    .map(str::to_owned)
                    .to_vec()
            )
        );
    }
}
