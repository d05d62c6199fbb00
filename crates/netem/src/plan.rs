//! The plan of faults: link, begin, duration and shape. Times are wall clock, from the first tick of the run.
//!
//! A plan is a file, or is made from the partitions of a scenario.

use config::units::Time;
use config::{FileError, Source};
use protocol::{RobotName, Tick};
use scenario::Scenario;
use scenario::network::Partition;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::{Duration, Instant};
use toml::Spanned;

use super::shape::{Flow, LinkShape, duration};

/// A plan of faults that has been checked.
#[derive(Debug, Clone)]
pub struct FaultPlan {
    faults: Vec<LinkFault>,
}

/// One fault of the link of one robot.
#[derive(Debug, Clone, PartialEq)]
struct LinkFault {
    robot: RobotName,
    begin: Duration,
    end: Duration,
    shape: LinkShape,
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

/// A shape as written in the file.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "a fault is \"cut\", \"close\", { delay = \"50 ms\", jitter = \"10 ms\" } or { bandwidth_bps = 64000 }"
)]
enum RawShape {
    Word(PlanWord),
    Slow(Slow),
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum PlanWord {
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

impl FaultPlan {
    /// Reads a plan for the links of these robots.
    ///
    /// # Errors
    /// [`FileError`] with line and caret, also for a robot without a link.
    pub fn load(path: &Path, robots: &BTreeSet<RobotName>) -> Result<Self, FileError> {
        Self::parse(&Source::read(path)?, robots)
    }

    /// Reads a plan for the links of any robots; returns the number of its faults.
    ///
    /// # Errors
    /// [`FileError`] with line and caret.
    pub fn check(path: &Path) -> Result<usize, FileError> {
        Ok(Self::parse_any(&Source::read(path)?)?.faults.len())
    }

    /// Reads what a plan for the links of any robots does with the link of this one.
    ///
    /// # Errors
    /// [`FileError`] with line and caret, or if the plan leaves the link alone.
    pub fn load_of(path: &Path, robot: &RobotName) -> Result<Self, FileError> {
        Self::parse_any(&Source::read(path)?)?.of(robot)
    }

    fn of(mut self, robot: &RobotName) -> Result<Self, FileError> {
        let robots: Vec<&str> = self.robots().into_iter().map(RobotName::as_str).collect();
        let robots = robots.join(", ");
        self.faults.retain(|fault| fault.robot == *robot);

        if self.faults.is_empty() {
            return Err(FileError::new(format!(
                "the plan has no fault of the link of {robot}, but of {robots}"
            )));
        }
        Ok(self)
    }

    fn parse_any(source: &Source) -> Result<Self, FileError> {
        let raw: RawPlan = source.parse()?;
        let named = raw.faults.iter().map(|fault| fault.robot.get_ref().clone());
        Self::parse(source, &named.collect())
    }

    /// The partitions of a scenario as cuts of real links, at `speed` simulated seconds per second. Every link leads to the
    /// simulator, so a robot that is cut off from the others is cut off from the simulator, too. The largest group keeps
    /// its links (the first one of equals), and all other groups lose theirs.
    ///
    /// # Errors
    /// If there is no partition, or one that a real link cannot have: in one direction, or of one kind of message.
    pub(super) fn of_partitions(scenario: &Scenario, speed: f64) -> Result<Self, FileError> {
        let partitions = &scenario.network.partitions;
        if partitions.is_empty() {
            let error = FileError::new("the scenario has no partition to play");
            let help = "name a plan of faults by --plan; its format is in docs/links.md";
            return Err(error.with_help(help));
        }

        let mut faults = Vec::new();
        for partition in partitions {
            check_partition(partition)?;
            let begin = wall_time(scenario, partition.from, speed)?;
            let end = match partition.until {
                Some(until) => wall_time(scenario, until, speed)?,
                None => NEVER,
            };
            for robot in cut_off(partition) {
                faults.push(LinkFault {
                    robot: robot.clone(),
                    begin,
                    end,
                    shape: LinkShape::of_flow(Flow::Cut),
                });
            }
        }
        Ok(Self { faults })
    }

    fn parse(source: &Source, robots: &BTreeSet<RobotName>) -> Result<Self, FileError> {
        let raw: RawPlan = source.parse()?;
        let mut faults = Vec::new();
        for fault in raw.faults {
            faults.push(check(source, fault, robots)?);
        }
        Ok(Self { faults })
    }

    /// Robots with faults of their links.
    pub(super) fn robots(&self) -> BTreeSet<&RobotName> {
        self.faults.iter().map(|fault| &fault.robot).collect()
    }

    /// Times at which a fault begins or ends, in order.
    pub(super) fn changes(&self) -> BTreeSet<Duration> {
        let faults = self.faults.iter();
        faults.flat_map(|fault| [fault.begin, fault.end]).collect()
    }

    /// The shape of a robot's link at a time: all current faults together.
    pub(super) fn shape(&self, robot: &RobotName, at: Duration) -> LinkShape {
        let mut shape = LinkShape::default();
        for fault in &self.faults {
            if fault.robot == *robot && (fault.begin..fault.end).contains(&at) {
                shape = shape.and(fault.shape);
            }
        }
        shape
    }

    /// Refuses a plan with faults that only a proxy can play.
    pub(super) fn check_cuts_only(&self, via: &str) -> Result<(), FileError> {
        for LinkFault { robot, shape, .. } in &self.faults {
            if !shape.is_plain_cut() {
                let text = format!(
                    "the link of {robot} is \"{shape}\" in the plan: {via} can only be cut"
                );
                return Err(FileError::new(text).with_help("play this plan with --via proxy"));
            }
        }
        Ok(())
    }

    /// Plays the plan, the times of which begin at `begun`. Calls `apply` for every change of a link with the time since
    /// `begun`, until the last change or until `is_over`.
    ///
    /// # Errors
    /// The first error of `apply`.
    pub fn play<E>(
        &self,
        begun: Instant,
        mut apply: impl FnMut(&RobotName, LinkShape, Duration) -> Result<(), E>,
        mut is_over: impl FnMut() -> bool,
    ) -> Result<(), E> {
        let mut now: BTreeMap<&RobotName, LinkShape> = BTreeMap::new();
        for at in self.changes() {
            while begun.elapsed() < at {
                if is_over() {
                    return Ok(());
                }
                // In short steps, so that the end of the launch is noticed during a long wait.
                let left = at.saturating_sub(begun.elapsed());
                std::thread::sleep(left.min(LOOK_AGAIN));
            }

            for robot in self.robots() {
                let shape = self.shape(robot, at);
                // All faults of a moment are one shape: a link is changed only if that differs.
                if now.insert(robot, shape).unwrap_or_default() != shape {
                    apply(robot, shape, begun.elapsed())?;
                }
            }
        }

        Ok(())
    }
}

/// How often the end of the run is checked while a plan waits for its next change.
const LOOK_AGAIN: Duration = Duration::from_millis(50);

/// The end of a fault without one.
const NEVER: Duration = Duration::from_secs(u32::MAX as u64);

/// Refuses a partition that a real link cannot have.
fn check_partition(partition: &Partition) -> Result<(), FileError> {
    if !partition.one_way && partition.commands && partition.queries {
        return Ok(());
    }

    let error = FileError::new("a real link is cut in both directions and for all messages");
    let help = "a partition in one direction, or of one kind of message, can only be simulated";
    Err(error.with_help(help))
}

/// The wall-clock time of a tick at `speed` simulated seconds per second.
fn wall_time(scenario: &Scenario, tick: Tick, speed: f64) -> Result<Duration, FileError> {
    Duration::try_from_secs_f64(tick as f64 * scenario.tick_s / speed)
        .map_err(|_| FileError::new("at this speed a partition never comes"))
}

/// Robots that a partition leaves without a link to the simulator: those of all groups but the largest.
fn cut_off(partition: &Partition) -> Vec<&RobotName> {
    let groups = || partition.groups.iter().enumerate();
    // `max_by_key` returns the last of equals, so the groups are reversed.
    let largest = groups().rev().max_by_key(|(_, group)| group.len());
    let kept = largest.map(|(index, _)| index);

    let others = groups().filter(|(index, _)| Some(*index) != kept);
    others.flat_map(|(_, group)| group).collect()
}

fn check(
    source: &Source,
    raw: RawFault,
    robots: &BTreeSet<RobotName>,
) -> Result<LinkFault, FileError> {
    let robot = raw.robot.get_ref();
    if !robots.contains(robot) {
        let names: Vec<&str> = robots.iter().map(RobotName::as_str).collect();
        let text = format!("there is no link of a robot {robot}");
        return Err(FileError::at(source, Some(raw.robot.span()), &text)
            .with_help(format!("there are links of {}", names.join(", "))));
    }

    let begin = time(source, &raw.at)?;
    let length = time(source, &raw.r#for)?;
    let length_span = Some(raw.r#for.span());
    if length.is_zero() {
        let text = "a fault lasts for more than zero";
        return Err(FileError::at(source, length_span, text));
    }

    let span = Some(raw.r#do.span());
    Ok(LinkFault {
        robot: raw.robot.into_inner(),
        begin,
        end: begin
            .checked_add(length)
            .ok_or_else(|| FileError::at(source, length_span, "this never ends"))?,
        shape: shape(raw.r#do.into_inner())
            .map_err(|reason| FileError::at(source, span, &reason))?,
    })
}

fn time(source: &Source, time: &Spanned<Time>) -> Result<Duration, FileError> {
    duration(*time.get_ref()).map_err(|reason| FileError::at(source, Some(time.span()), &reason))
}

fn shape(raw: RawShape) -> Result<LinkShape, String> {
    let slow = match raw {
        RawShape::Word(PlanWord::Cut) => return Ok(LinkShape::of_flow(Flow::Cut)),
        RawShape::Word(PlanWord::Close) => return Ok(LinkShape::of_flow(Flow::Closed)),
        RawShape::Slow(slow) => slow,
    };
    let shape = LinkShape {
        delay: slow.delay.map_or(Ok(Duration::ZERO), duration)?,
        jitter: slow.jitter.map_or(Ok(Duration::ZERO), duration)?,
        bandwidth_bps: slow.bandwidth_bps,
        ..LinkShape::default()
    };

    if slow.bandwidth_bps == Some(0) {
        return Err("a bandwidth is above zero; to let nothing through, write \"cut\"".to_owned());
    }

    if shape == LinkShape::default() {
        return Err("this fault does nothing".to_owned());
    }

    Ok(shape)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<FaultPlan, FileError> {
        let robots = ["Butler", "Leguin"].map(|name| RobotName::new(name).unwrap());
        let source = Source {
            name: "plan.toml".to_owned(),
            text: text.to_owned(),
        };
        FaultPlan::parse(&source, &robots.into_iter().collect())
    }

    fn fault(robot: &str, at: &str, length: &str, what: &str) -> String {
        format!(
            "[[link_fault]]\nrobot = \"{robot}\"\nat = \"{at}\"\nfor = \"{length}\"\ndo = {what}\n"
        )
    }

    #[test]
    fn a_plan_has_the_shape_of_each_link_at_each_time() {
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
            let robot = RobotName::new(robot).unwrap();
            plan.shape(&robot, Duration::from_secs(s)).to_string()
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

        assert_eq!(shown("Butler", 1), "bandwidth 64000 bit/s");
        assert_eq!(shown("Butler", 2), "whole");
        assert!(plan.check_cuts_only("a namespace's link").is_err());
    }

    #[test]
    fn a_proxy_plays_what_a_plan_for_several_links_does_with_its_own() {
        let text =
            fault("Leguin", "5 s", "5 s", "\"cut\"") + &fault("Butler", "1 s", "1 s", "\"cut\"");
        let named = |name: &str| name.parse::<RobotName>().unwrap();
        let plan = parse(&text).unwrap().of(&named("Butler")).unwrap();
        assert_eq!(plan.robots(), BTreeSet::from([&named("Butler")]));

        let error = parse(&text).unwrap().of(&named("Vonda")).unwrap_err();
        assert_eq!(
            error.in_words(),
            "the plan has no fault of the link of Vonda, but of Butler, Leguin"
        );
    }

    #[test]
    fn the_shipped_plan_can_be_played() {
        let file =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/links/cut_leguin.toml");
        let plan =
            FaultPlan::load(&file, &BTreeSet::from([RobotName::new("Leguin").unwrap()])).unwrap();
        assert_eq!(plan.changes().len(), 4);
    }

    fn scenario(network: &str) -> Scenario {
        let mut text = format!("seed = 5\ntick = \"0.5 s\"\n{network}\n");
        for (name, x_m) in [("A", 2), ("B", 4), ("C", 6)] {
            text += &format!("[[robot]]\nname = \"{name}\"\nat = [\"{x_m} m\", \"2 m\"]\n");
        }
        let source = Source {
            name: "scenario.toml".to_owned(),
            text,
        };

        Scenario::parse(&source, Path::new(".")).unwrap()
    }

    #[test]
    fn a_simulated_partition_is_a_cut_of_links_at_the_same_simulated_time() {
        let partition = |more: &str| {
            let head =
                "[[network.partition]]\ngroups = [[\"A\"], [\"C\", \"B\"]]\nfrom = \"60 s\"\n";
            scenario(&format!("{head}{more}\n"))
        };
        let plan = FaultPlan::of_partitions(&partition("until = \"100 s\""), 20.0).unwrap();
        let a = RobotName::new("A").unwrap();
        for (s, shape) in [(2, "whole"), (3, "cut"), (4, "cut"), (5, "whole")] {
            let found = plan.shape(&a, Duration::from_secs(s));
            assert_eq!(found.to_string(), shape, "{s} s");
        }
        assert_eq!(plan.robots().len(), 1, "the larger group keeps its links");

        let endless = FaultPlan::of_partitions(&partition(""), 20.0).unwrap();
        assert!(endless.changes().contains(&NEVER));

        for refused in ["one_way = true", "cuts = [\"queries\"]"] {
            assert!(
                FaultPlan::of_partitions(&partition(refused), 20.0).is_err(),
                "{refused}"
            );
        }

        assert!(FaultPlan::of_partitions(&scenario(""), 20.0).is_err());
    }

    #[test]
    fn errors_show_the_reason() {
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
        let plan = parse(&text).unwrap();
        let mut seen = Vec::new();
        let begun = Instant::now();
        let played: Result<(), ()> = plan.play(
            begun,
            |robot, shape, _| {
                seen.push(format!("{robot} {shape}"));
                Ok(())
            },
            || begun.elapsed() > Duration::from_millis(200),
        );

        assert_eq!(played, Ok(()));
        assert_eq!(seen, ["Leguin cut", "Butler cut", "Leguin whole"]);
    }
}
