//! The simulated network against the laws of its models and of protocols over it: retries, bursts, maximum consensus, rumors.

#![expect(clippy::print_stdout, reason = "a test prints what it measures")]

use std::collections::{BTreeMap, BTreeSet};
use std::convert::Infallible;
use std::sync::Arc;

use environment::Simulation;
use environment::medium::{Medium, SentCommand};
use lockstep::{Bulletin, Exchange, IncarnationNotice, Sent, TickOutcome};
use protocol::messages::{CommandText, Point, Report, TickUpdate};
use protocol::random::{stream, unit};
use protocol::{RobotName, Tick};
use radio::{outage, regularized_gamma};
use scenario::Scenario;

use crate::common::{self, report};

/// Quantile of the normal distribution for bounds of 99 %.
const Z_99: f64 = 2.576;

fn scenario(network: &str, places: &[(f64, f64)]) -> Scenario {
    let mut text = format!(
        "seed = 11\ntick = \"0.1 s\"\nduration = \"24 h\"\n[field]\nsize = [\"60 m\", \"60 m\"]\nbody = \"0.5 m\"\n[network]\n{network}\n"
    );
    for (index, (x, y)) in places.iter().enumerate() {
        text += &format!("[[robot]]\nname = \"R{index:02}\"\nat = [\"{x} m\", \"{y} m\"]\n");
    }
    common::scenario(&text)
}

/// Places of robots in rows, 2 m apart.
fn rows(count: usize) -> Vec<(f64, f64)> {
    let place = |index: usize| {
        let (column, row) = (index % 8, index / 8);
        (2.0 + 2.0 * column as f64, 2.0 + 2.0 * row as f64)
    };
    (0..count).map(place).collect()
}

/// Robots that pass on what the first one knows at the beginning of each episode.
struct Gossip<F> {
    names: Vec<RobotName>,
    places: Vec<Point>,
    /// Ticks of an episode; all know it by then.
    episode: Tick,
    /// The robots that one which knows it sends it to in a tick.
    targets: F,
    knows: BTreeSet<usize>,
    /// In how many ticks all knew it, by episode.
    times: Vec<Option<Tick>>,
}

impl<F: FnMut(Tick, usize) -> Vec<usize>> Gossip<F> {
    /// The times after which all robots knew it, in so many episodes.
    fn play(
        network: &str,
        places: &[(f64, f64)],
        episode: Tick,
        count: u64,
        targets: F,
    ) -> Vec<Tick> {
        let scenario = scenario(network, places);
        let mut simulation = Simulation::new(scenario, 1).unwrap();
        let names = simulation.names().to_vec();
        let at = names.iter().map(|name| simulation.location(name).unwrap());
        let mut gossip = Self {
            places: at.collect(),
            names,
            episode,
            targets,
            knows: BTreeSet::new(),
            times: Vec::new(),
        };
        simulation.init(&mut gossip).unwrap();
        for _ in 0..episode * count {
            simulation.step(&mut gossip).unwrap();
        }
        let ended = gossip.times.iter().take(count as usize);
        // All know it before the next episode.
        ended.map(|time| time.unwrap()).collect()
    }

    /// Those that received it in this tick know it. Messages of an earlier episode are void in the first tick of one.
    fn learn(&mut self, tick: Tick, received: &BTreeSet<usize>) {
        let since = (tick - 1) % self.episode;
        if since == 0 {
            self.knows = BTreeSet::from([0]);
            self.times.push(None);
        } else {
            self.knows.extend(received);
        }
        let time = self.times.last_mut().unwrap();
        if time.is_none() && self.knows.len() == self.names.len() {
            *time = Some(since);
        }
    }
}

impl<F> Exchange<TickUpdate, Arc<Report>, CommandText> for Gossip<F>
where
    F: FnMut(Tick, usize) -> Vec<usize>,
{
    type Error = Infallible;

    fn exchange(
        &mut self,
        tick: Tick,
        bulletin: &dyn Bulletin<TickUpdate>,
    ) -> Result<TickOutcome<Arc<Report>, CommandText>, Infallible> {
        let mut received = BTreeSet::new();
        for name in bulletin.robots() {
            let update: TickUpdate = bulletin.compose(&name, IncarnationNotice::default());
            if !update.commands.is_empty() {
                received.insert(self.names.binary_search(&name).unwrap());
            }
        }
        if tick > 0 {
            self.learn(tick, &received);
        }

        let mut outcome = TickOutcome::default();
        for (index, name) in self.names.iter().enumerate() {
            let mut commands = Vec::new();
            if self.knows.contains(&index) {
                for target in (self.targets)(tick, index) {
                    commands.push(Sent {
                        to: self.names[target].clone().into(),
                        command: CommandText::named("max"),
                    });
                }
            }
            let mut report = report(tick, self.places[index]);
            report.commands = commands.len() as u32;
            outcome
                .reports
                .insert(name.clone(), (Arc::new(report), commands));
        }
        Ok(outcome)
    }
}

/// Checks by Pearson's chi-square test at 1 % that times have a distribution, given its distribution function. Times that are
/// expected less than five times are taken together.
#[track_caller]
fn check_distribution(what: &str, times: &[Tick], cdf: impl Fn(Tick) -> f64) {
    let n = times.len() as f64;
    let mut counts: BTreeMap<Tick, f64> = BTreeMap::new();
    for time in times {
        *counts.entry(*time).or_default() += 1.0;
    }

    let last = times.iter().copied().max().unwrap();
    let mut classes = Vec::new();
    let (mut observed, mut expected, mut below) = (0.0, 0.0, 0.0);
    for time in 0..=last {
        observed += counts.get(&time).copied().unwrap_or_default();
        let share = if time == last { 1.0 } else { cdf(time) };
        expected += n * (share - below);
        below = share;
        if expected >= 5.0 {
            classes.push((observed, expected));
            (observed, expected) = (0.0, 0.0);
        }
    }
    if let Some(rest) = classes.last_mut() {
        rest.0 += observed;
        rest.1 += expected;
    }

    let mut statistic = 0.0;
    for (observed, expected) in &classes {
        statistic += (observed - expected) * (observed - expected) / expected;
    }
    let freedom = (classes.len() - 1) as f64;
    let p = 1.0 - regularized_gamma(freedom / 2.0, statistic / 2.0);
    println!("{what}: chi-square {statistic:.2} with {freedom} degrees of freedom, p = {p:.3}");
    assert!(classes.len() >= 4, "{what}: too few classes");
    assert!(p > 0.01, "{what}: p = {p}, {classes:?}");
}

/// Probability that a geometric variable with these losses is at most `t`.
fn geometric_cdf(loss: f64, t: Tick) -> f64 {
    1.0 - (0..t).map(|_| loss).product::<f64>()
}

/// The distribution function, by ticks from 0, of a sum of geometric times of so many hops.
fn path_law(loss: f64, hops: u32, last: Tick) -> Vec<f64> {
    let step = |t: usize| geometric_cdf(loss, t as Tick) - geometric_cdf(loss, t as Tick - 1);
    let mut shares = vec![0.0; last as usize + 1];
    shares[0] = 1.0;
    for _ in 0..hops {
        let mut next = vec![0.0; shares.len()];
        for t in 1..next.len() {
            next[t] = (1..=t).map(|first| step(first) * shares[t - first]).sum();
        }
        shares = next;
    }

    let mut below = 0.0;
    for share in &mut shares {
        below += *share;
        *share = below;
    }
    shares
}

const EPISODES: u64 = 10_000;

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn maximum_consensus_on_a_path_takes_a_sum_of_geometric_times() {
    for (loss, episode) in [(0.25, 30), (0.5, 60)] {
        let network = format!("commands.loss = {loss}");
        let along = |_, index: usize| if index < 4 { vec![index + 1] } else { vec![] };
        let times = Gossip::play(&network, &rows(5), episode, EPISODES, along);
        let law = path_law(loss, 4, episode);
        check_distribution(&format!("path, loss {loss}"), &times, |t| law[t as usize]);

        // Mean h/(1-q), variance hq/(1-q)².
        let mean = times.iter().sum::<Tick>() as f64 / EPISODES as f64;
        let variance = 4.0 * loss / ((1.0 - loss) * (1.0 - loss));
        let room = Z_99 * (variance / EPISODES as f64).sqrt();
        assert!((mean - 4.0 / (1.0 - loss)).abs() <= room, "{mean}");
    }
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn maximum_consensus_over_fading_radios_loses_by_the_outage_of_a_hop() {
    // 30 dB at 1 m are enough for 10 m; hops of 8 m.
    let radio = "radio = { path_loss = { exponent = 3.0, loss_db = 40.0 }, sensitivity_dbm = -70.0, fading = \"rayleigh\" }";
    let loss = outage::rayleigh(0.8 * 0.8 * 0.8);
    let places = [0.0, 8.0, 16.0, 24.0].map(|x| (2.0 + x, 2.0));
    let along = |_, index: usize| if index < 3 { vec![index + 1] } else { vec![] };
    let times = Gossip::play(radio, &places, 40, EPISODES, along);
    let law = path_law(loss, 3, 40);
    check_distribution("path by radio", &times, |t| law[t as usize]);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn maximum_consensus_on_a_star_takes_the_longest_of_geometric_times() {
    let loss = 0.4;
    let network = format!("commands.loss = {loss}");
    let outward = |_, index: usize| if index == 0 { (1..7).collect() } else { vec![] };
    let times = Gossip::play(&network, &rows(7), 40, EPISODES, outward);
    let cdf = |t| (0..6).map(|_| geometric_cdf(loss, t)).product::<f64>();
    check_distribution("star", &times, cdf);
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn maximum_consensus_on_a_tree_takes_the_longest_way_down() {
    let loss = 0.3;
    let network = format!("commands.loss = {loss}");
    // The children of 0 are 1 and 2, those of 1 are 3 and 4, those of 2 are 5 and 6.
    let down = |_, index: usize| {
        if index < 3 {
            vec![2 * index + 1, 2 * index + 2]
        } else {
            vec![]
        }
    };
    let times = Gossip::play(&network, &rows(7), 40, EPISODES, down);
    let branch = |t: Tick| -> f64 {
        let after = |first: Tick| {
            let leaf = geometric_cdf(loss, t - first);
            (geometric_cdf(loss, first) - geometric_cdf(loss, first - 1)) * leaf * leaf
        };
        (1..=t).map(after).sum()
    };
    check_distribution("tree", &times, |t| branch(t) * branch(t));
}

/// Distribution of the number of robots that know a rumor after a round, given that before: each that knows it sends it to one other
/// robot by chance, where it arrives with this probability. Sends one after the other give the same number.
fn rumor_round(before: &[f64], arrives: f64) -> Vec<f64> {
    let n = before.len() - 1;
    let mut after = vec![0.0; n + 1];
    for (know, share) in before.iter().enumerate() {
        if *share == 0.0 {
            continue;
        }
        let mut now = vec![0.0; n + 1];
        now[know] = *share;
        for _ in 0..know {
            for count in (1..=n).rev() {
                let spreads = arrives * (n - count) as f64 / (n - 1) as f64;
                let moved = now[count] * spreads;
                now[count] -= moved;
                if count < n {
                    now[count + 1] += moved;
                }
            }
        }
        for (count, share) in now.iter().enumerate() {
            after[count] += share;
        }
    }
    after
}

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn a_rumor_spreads_as_its_law_says() {
    const ROBOTS: usize = 32;
    const RUMORS: u64 = 1500;
    let arrives = 0.7;
    let episode = 40;
    let anyone = |tick: Tick, index: usize| {
        let mut chance = stream(4, &format!("rumor/{tick}/{index}"));
        let other = (unit(&mut chance) * (ROBOTS - 1) as f64) as usize;
        vec![other + usize::from(other >= index)]
    };
    let times = Gossip::play(
        "commands.loss = 0.3",
        &rows(ROBOTS),
        episode,
        RUMORS,
        anyone,
    );

    let mut states = vec![vec![0.0; ROBOTS + 1]];
    states[0][1] = 1.0;
    for round in 0..episode as usize {
        let next = rumor_round(&states[round], arrives);
        states.push(next);
    }
    check_distribution("rumor", &times, |t| states[t as usize][ROBOTS]);

    // Doerr, Huber and Levavi: log2 n / log2(1+p) + ln n / p rounds, up to terms that do not grow with n.
    let n = ROBOTS as f64;
    let rounds = libm::log(n) / libm::log(1.0 + arrives) + libm::log(n) / arrives;
    let mean = times.iter().sum::<Tick>() as f64 / RUMORS as f64;
    println!("rumor: {mean:.2} rounds on average, {rounds:.2} by the law");
    assert!((mean - rounds).abs() < 1.5, "{mean} is not {rounds}");
}

fn ab(network: &str) -> Medium {
    let scenario = scenario(network, &rows(2));
    let roster = scenario.roster();
    Medium::new(scenario.seed, scenario.tick_s, scenario.network, roster)
}

/// Whether the command from R00 to R01 that is sent in each tick is lost.
fn losses(network: &str, ticks: u64) -> Vec<bool> {
    let mut medium = ab(network);
    let [from, to] = ["R00", "R01"].map(|name| RobotName::new(name).unwrap());
    let mut lost = Vec::new();
    for tick in 1..=ticks {
        medium.accept(SentCommand {
            to: to.clone(),
            from: from.clone(),
            seq: tick,
            text: CommandText::named("x"),
        });
        lost.push(medium.decide(tick + 1, Vec::new()).delivered.is_empty());
    }
    lost
}

#[test]
fn retries_until_one_arrives_are_geometric() {
    for (loss, ticks) in [(0.3, 200_000), (0.6, 300_000)] {
        let mut attempts = Vec::new();
        let mut tries = 0;
        for lost in losses(&format!("commands.loss = {loss}"), ticks) {
            tries += 1;
            if !lost {
                attempts.push(tries);
                tries = 0;
            }
        }
        let n = attempts.len() as f64;
        assert!(n >= 1e5, "{n} draws");
        let cdf = |t| geometric_cdf(loss, t);
        check_distribution(&format!("retries, loss {loss}"), &attempts, cdf);

        // Mean 1/(1-q), variance q/(1-q)²; the variance of that of a sample is (μ4 - σ⁴)/n, and μ4 = σ⁴ (9 + (1-q)²/q).
        let mean = attempts.iter().sum::<Tick>() as f64 / n;
        let deviation = |tries: &Tick| (*tries as f64 - mean) * (*tries as f64 - mean);
        let variance = attempts.iter().map(deviation).sum::<f64>() / (n - 1.0);
        let pass = 1.0 - loss;
        let expected = loss / (pass * pass);
        assert!(
            (mean - 1.0 / pass).abs() <= Z_99 * (expected / n).sqrt(),
            "{mean}"
        );
        let room = Z_99 * expected * ((8.0 + pass * pass / loss) / n).sqrt();
        assert!(
            (variance - expected).abs() <= room,
            "{variance}, not {expected} within {room}"
        );
    }
}

#[test]
fn bursts_have_the_loss_length_and_correlation_of_gilbert_and_elliott() {
    let (enter, leave) = (0.02, 0.1);
    let ticks = 1_000_000;
    let lost = losses(
        &format!("commands.burst = {{ enter = {enter}, leave = {leave} }}"),
        ticks,
    );
    let bad = enter / (enter + leave);
    let stays = 1.0 - enter - leave;

    // Losses are correlated: their mean varies as that of fewer that are not.
    let n = ticks as f64;
    let share = lost.iter().filter(|lost| **lost).count() as f64 / n;
    let room = Z_99 * (bad * (1.0 - bad) * (1.0 + stays) / (1.0 - stays) / n).sqrt();
    assert!(
        (share - bad).abs() <= room,
        "{share}, not {bad} within {room}"
    );

    // Bursts are geometric with mean 1/leave.
    let mut bursts = Vec::new();
    let mut length = 0;
    for lost in &lost {
        if *lost {
            length += 1;
        } else if length > 0 {
            bursts.push(length);
            length = 0;
        }
    }
    check_distribution("bursts", &bursts, |t| geometric_cdf(1.0 - leave, t));

    // Correlation at lag k, by batches, which are nearly independent.
    const BATCHES: usize = 100;
    for (lag, expected) in [(1, stays), (3, stays * stays * stays)] {
        let mut estimates = Vec::new();
        for batch in lost.chunks(lost.len() / BATCHES) {
            let number = |lost: &bool| f64::from(u8::from(*lost)) - bad;
            let pairs = batch.iter().zip(&batch[lag..]);
            let products: f64 = pairs.map(|(one, other)| number(one) * number(other)).sum();
            estimates.push(products / (batch.len() - lag) as f64 / (bad * (1.0 - bad)));
        }
        let n = BATCHES as f64;
        let mean = estimates.iter().sum::<f64>() / n;
        let squares: f64 = estimates
            .iter()
            .map(|one| (one - mean) * (one - mean))
            .sum();
        let room = Z_99 * (squares / (n - 1.0) / n).sqrt();
        assert!(
            (mean - expected).abs() <= room,
            "lag {lag}: {mean}, not {expected} within {room}"
        );
    }
}

#[test]
fn a_bursty_link_that_is_bad_loses_as_its_burst_says() {
    let lost = losses(
        "commands = { loss = 0.1, burst = { enter = 0.05, leave = 0.2, loss = 0.8 } }",
        400_000,
    );
    // enter/(enter+leave) h_B + leave/(enter+leave) h_G: in a burst the larger of both probabilities holds.
    let expected = 0.2 * 0.8 + 0.8 * 0.1;
    let n = lost.len() as f64;
    let share = lost.iter().filter(|lost| **lost).count() as f64 / n;
    // Of the variance that of the state is correlated.
    let of_state = 0.2 * 0.8 * 0.7 * 0.7 * (1.0 + 0.75) / (1.0 - 0.75);
    let own = 0.2 * 0.8 * 0.2 + 0.8 * 0.1 * 0.9;
    let room = Z_99 * ((of_state + own) / n).sqrt();
    assert!(
        (share - expected).abs() <= room,
        "{share}, not {expected} within {room}"
    );
}
