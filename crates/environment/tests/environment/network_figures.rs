//! The figure of `docs/network.md`: the simulated network against its closed forms. With `CARS_UPDATE=1` the test writes it.
//!
//! The assertions over more draws are in `crates/radio/tests` and `crates/environment/tests`; this one shows them.

#[path = "../../../pictures/tests/shipped/mod.rs"]
mod shipped;

use std::collections::BTreeSet;

use environment::medium::{Medium, SentCommand};
use pictures::{Chart, ChartPanel, PlottedEstimate, Trend, TrendLine, TrendPoint};
use protocol::RobotName;
use protocol::messages::{CommandText, Point};
use protocol::random::{stream, unit};
use radio::{SendQueue, Transmitter, outage};

use shipped::assert_figure_is_shipped;

use crate::common::medium_of;

/// Quantile of the normal distribution for intervals of 99 %.
const Z_99: f64 = 2.576;
/// Messages of each point.
const DRAWS: u64 = 10_000;
/// 30 dB are left at 1 m, so the mean power is enough up to 10 m.
const RADIO: &str = "path_loss = { exponent = 3.0, loss_db = 40.0 }, sensitivity_dbm = -70.0";

/// What is measured at a value of the factor, and what the closed form says.
struct Measured {
    x: f64,
    value: f64,
    /// Half of the interval.
    room: f64,
    expected: f64,
}

impl Measured {
    /// The mean of a sample.
    fn mean(x: f64, sample: &[f64], expected: f64) -> Self {
        let n = sample.len() as f64;
        let value = sample.iter().sum::<f64>() / n;
        let squares: f64 = sample.iter().map(|one| (one - value) * (one - value)).sum();
        Self {
            x,
            value,
            room: Z_99 * (squares / (n - 1.0) / n).sqrt(),
            expected,
        }
    }
}

/// A network between so many robots.
fn medium(network: &str, robots: usize) -> Medium {
    let mut text =
        format!("seed = 36\n[field]\nsize = [\"900 m\", \"9 m\"]\n[network]\n{network}\n");
    for index in 0..robots {
        text += &format!(
            "[[robot]]\nname = \"R{index:02}\"\nat = [\"{} m\", \"2 m\"]\n",
            2 + 2 * index
        );
    }
    medium_of(&text)
}

fn name(index: usize) -> RobotName {
    RobotName::new(&format!("R{index:02}")).unwrap()
}

fn command(from: usize, to: usize, seq: u64) -> SentCommand {
    SentCommand {
        to: name(to),
        from: name(from),
        seq,
        text: CommandText::named("x"),
    }
}

/// The share of commands that a radio loses, by distance. Each is sent from another place.
fn lost_by_distance(radio: &str, expected: impl Fn(f64) -> f64) -> Vec<Measured> {
    let mut points = Vec::new();
    for distance_m in [2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0] {
        let mut medium = medium(&format!("radio = {{ {RADIO}, {radio} }}"), 2);
        let mut lost = Vec::new();
        for draw in 0..DRAWS {
            let y = 30.0 * draw as f64;
            medium.accept(command(0, 1, draw));
            let places = [0.0, distance_m].map(|x| Point { x, y }).to_vec();
            let is_lost = medium.decide(draw + 2, places).delivered.is_empty();
            lost.push(f64::from(u8::from(is_lost)));
        }
        points.push(Measured::mean(distance_m, &lost, expected(distance_m)));
    }
    points
}

/// The share of the mean power that is enough at a distance.
fn enough(distance_m: f64) -> f64 {
    let ratio = distance_m / 10.0;
    ratio * ratio * ratio
}

/// How long messages wait in the queue of a sender, in times that one takes, by the load.
fn waits_by_load() -> Vec<Measured> {
    let transmitter = Transmitter {
        bit_rate_bps: 8.0,
        queue_bytes: 1e9,
        overhead_bytes: 1.0,
    };
    let mut points = Vec::new();
    for load in [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8] {
        let mut chance = stream(36, &format!("load/{load}"));
        let mut queue = SendQueue::default();
        let mut now_s = 0.0;
        let mut batches = Vec::new();
        for _ in 0..50 {
            let mut waited_s = 0.0;
            for _ in 0..DRAWS {
                now_s -= libm::log(1.0 - unit(&mut chance)) / load;
                waited_s += queue.offer(now_s, 0, &transmitter).unwrap() - now_s - 1.0;
            }
            batches.push(waited_s / DRAWS as f64);
        }
        points.push(Measured::mean(load, &batches, outage::waiting_s(load, 1.0)));
    }
    points
}

/// In how many ticks a network brings what the first robot knows to all others, again and again. `targets` are those to which one
/// that knows it sends it in a tick.
fn ticks_until_all_know(
    medium: &mut Medium,
    robots: usize,
    times: usize,
    mut targets: impl FnMut(u64, usize) -> Option<usize>,
) -> Vec<f64> {
    let mut tick = 1;
    let mut ended = Vec::new();
    while ended.len() < times {
        let mut knows = BTreeSet::from([0]);
        let begin = tick;
        while knows.len() < robots {
            for from in &knows {
                if let Some(to) = targets(tick, *from) {
                    medium.accept(command(*from, to, tick));
                }
            }
            tick += 1;
            for to in medium.decide(tick, Vec::new()).delivered.into_keys() {
                knows.insert((0..robots).find(|index| name(*index) == to).unwrap());
            }
        }
        ended.push((tick - begin) as f64);
    }
    ended
}

fn consensus_by_loss() -> Vec<Measured> {
    let mut points = Vec::new();
    for loss in [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6] {
        let mut medium = medium(&format!("commands.loss = {loss}"), 5);
        let along = |_, from: usize| (from < 4).then_some(from + 1);
        let times = ticks_until_all_know(&mut medium, 5, 2000, along);
        points.push(Measured::mean(loss, &times, 4.0 / (1.0 - loss)));
    }
    points
}

/// The mean number of ticks until all robots know a rumor: that of the Markov chain of their number. Each that knows it sends it to one
/// other one by chance; sends one after the other give the same number.
fn mean_of_rumor(robots: usize, arrives: f64) -> f64 {
    let mut shares = vec![0.0; robots + 1];
    shares[1] = 1.0;
    let mut mean = 0.0;
    while shares[robots] < 1.0 - 1e-9 {
        mean += 1.0 - shares[robots];
        let mut next = vec![0.0; robots + 1];
        for (know, share) in shares.iter().enumerate() {
            let mut now = vec![0.0; robots + 1];
            now[know] = *share;
            for _ in 0..know {
                for count in (1..robots).rev() {
                    let moved =
                        now[count] * arrives * (robots - count) as f64 / (robots - 1) as f64;
                    now[count] -= moved;
                    now[count + 1] += moved;
                }
            }
            for (count, share) in now.iter().enumerate() {
                next[count] += share;
            }
        }
        shares = next;
    }
    mean
}

fn rumor_by_robots() -> Vec<Measured> {
    let arrives: f64 = 0.7;
    let mut points = Vec::new();
    for robots in [8_usize, 16, 32, 64] {
        let mut medium = medium("commands.loss = 0.3", robots);
        let anyone = |tick: u64, from: usize| {
            let mut chance = stream(36, &format!("rumor/{robots}/{tick}/{from}"));
            let other = (unit(&mut chance) * (robots - 1) as f64) as usize;
            Some(other + usize::from(other >= from))
        };
        let times = ticks_until_all_know(&mut medium, robots, 200, anyone);
        let law = mean_of_rumor(robots, arrives);
        points.push(Measured::mean(robots as f64, &times, law));
    }
    points
}

fn panel(heading: &str, x_axis: &str, y_axis: &str, measured: &[Measured]) -> ChartPanel {
    let most = measured
        .iter()
        .map(|one| one.value.max(one.expected) + one.room);
    let line = |label: &str, arm: usize, is_measured: bool| {
        let point = |one: &Measured| TrendPoint {
            x: one.x,
            estimate: PlottedEstimate {
                value: if is_measured { one.value } else { one.expected },
                interval: is_measured.then_some((one.value - one.room, one.value + one.room)),
                n: 0,
                is_filled: is_measured,
            },
            runs: Vec::new(),
        };
        TrendLine {
            label: label.to_owned(),
            arm,
            points: measured.iter().map(point).collect(),
        }
    };
    let trend = Trend {
        title: heading.to_owned(),
        x_axis: x_axis.to_owned(),
        y_axis: y_axis.to_owned(),
        levels: measured
            .iter()
            .map(|one| (one.x, one.x.to_string()))
            .collect(),
        range: pictures::round_range(0.0, most.fold(0.0, f64::max), 5),
        reference: None,
        lines: vec![line("measured", 0, true), line("closed form", 1, false)],
    };
    ChartPanel::new(heading, Chart::Trend(trend))
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn the_figure_of_the_network_is_up_to_date() {
    let share = "Share that is lost";
    let distance = "Distance, m";
    let panels = vec![
        panel(
            "Rayleigh fading",
            distance,
            share,
            &lost_by_distance("fading = 'rayleigh'", |d| outage::rayleigh(enough(d))),
        ),
        panel(
            "Nakagami fading, m = 1.5",
            distance,
            share,
            &lost_by_distance("fading = { nakagami = 1.5 }", |d| {
                outage::nakagami(1.5, enough(d))
            }),
        ),
        panel(
            "Shadowing of 6 dB",
            distance,
            share,
            &lost_by_distance("shadowing = { sigma_db = 6.0 }", |d| {
                outage::log_normal(-10.0 * libm::log10(enough(d)), 6.0)
            }),
        ),
        panel(
            "Queue of a sender",
            "Load",
            "Mean wait, in times that a message takes",
            &waits_by_load(),
        ),
        panel(
            "Maximum consensus over 4 hops",
            "Share of messages lost",
            "Mean time, ticks",
            &consensus_by_loss(),
        ),
        panel(
            "A rumor, 30 % of messages lost",
            "Robots",
            "Mean time, ticks",
            &rumor_by_robots(),
        ),
    ];
    let caption = "The simulated network, measured with intervals of 99 %, and its closed forms.";
    assert_figure_is_shipped("network", panels, caption);
}
