//! What was used before, for comparison: the bootstrap (BCa), Greenwood's band, the log-rank test.

use protocol::random;
use statistics::CensoredTime;

/// Resamples of an interval. It had 10,000; the coverage is the same.
const RESAMPLES: usize = 1_000;

/// The bias-corrected and accelerated bootstrap of a statistic of so many pairs (Efron 1987).
pub(crate) fn bca(n: usize, statistic: impl Fn(&[usize]) -> f64) -> Option<(f64, f64)> {
    let all: Vec<usize> = (0..n).collect();
    let value = statistic(&all);
    let mut stream = random::stream(0, "tests/bootstrap");
    let mut resampled = Vec::new();
    let mut indices = vec![0; n];
    for _ in 0..RESAMPLES {
        for index in &mut indices {
            *index = (random::unit(&mut stream) * n as f64) as usize;
        }
        resampled.push(statistic(&indices));
    }
    resampled.sort_by(f64::total_cmp);
    let rounding = 1e-12 * resampled[0].abs().max(resampled[RESAMPLES - 1].abs());
    if resampled[RESAMPLES - 1] - resampled[0] <= rounding {
        return None;
    }

    let mut without_one = Vec::new();
    for left_out in 0..n {
        let mut others = all.clone();
        others.remove(left_out);
        without_one.push(statistic(&others));
    }
    let mean = without_one.iter().sum::<f64>() / n as f64;
    let mut squares = 0.0;
    let mut cubes = 0.0;
    for value in &without_one {
        squares += (mean - value) * (mean - value);
        cubes += (mean - value) * (mean - value) * (mean - value);
    }
    let acceleration = if squares == 0.0 {
        0.0
    } else {
        cubes / (6.0 * squares * squares.sqrt())
    };

    let below = resampled.partition_point(|other| *other < value - rounding);
    let not_above = resampled.partition_point(|other| *other <= value + rounding);
    let draws = 2.0 * RESAMPLES as f64;
    let bias = quantile(((below + not_above) as f64).clamp(1.0, draws - 1.0) / draws);
    let end = |tail: f64| {
        let z = bias + quantile(tail);
        let p = cdf(bias + z / (1.0 - acceleration * z));
        statistics::quantile(&resampled, p).unwrap()
    };
    Some((end(0.025), end(0.975)))
}

/// The interval of the share of runs with an event by Greenwood's variance on the scale log(-log) of the share without it.
pub(crate) fn greenwood(events: usize, n: usize) -> (f64, f64) {
    let without = (n - events) as f64 / n as f64;
    if events == 0 || events == n {
        return (1.0 - without, 1.0 - without);
    }
    let variance = events as f64 / (n as f64 * (n - events) as f64);
    let width = 1.959_964 * variance.sqrt() / libm::log(without).abs();
    let end = |width: f64| 1.0 - libm::pow(without, libm::exp(width));
    (end(-width), end(width))
}

/// The difference of the areas under the curves of Kaplan and Meier up to a time, of the pairs with these indices.
pub(crate) fn restricted_s(
    pairs: &[(CensoredTime, CensoredTime)],
    indices: &[usize],
    until_s: f64,
) -> f64 {
    let mut arm: Vec<CensoredTime> = indices.iter().map(|index| pairs[*index].0).collect();
    let mut baseline: Vec<CensoredTime> = indices.iter().map(|index| pairs[*index].1).collect();
    area_s(&mut arm, until_s) - area_s(&mut baseline, until_s)
}

fn area_s(times: &mut [CensoredTime], until_s: f64) -> f64 {
    times.sort_by(|a, b| {
        let by_time = a.time_s.total_cmp(&b.time_s);
        by_time.then(b.is_event.cmp(&a.is_event))
    });
    let mut area_s = 0.0;
    let mut since_s = 0.0;
    let mut share = 1.0;
    for (before, time) in times.iter().enumerate() {
        if time.time_s >= until_s {
            break;
        }
        if time.is_event {
            area_s += share * (time.time_s - since_s);
            since_s = time.time_s;
            let at_risk = (times.len() - before) as f64;
            share *= (at_risk - 1.0) / at_risk;
        }
    }
    area_s + share * (until_s - since_s)
}

/// The p value of the log-rank test, which takes no account of pairs.
pub(crate) fn log_rank(pairs: &[(CensoredTime, CensoredTime)]) -> f64 {
    let both = pairs.iter().flat_map(|(arm, base)| [arm, base]);
    let mut events_s: Vec<f64> = both
        .filter(|time| time.is_event)
        .map(|time| time.time_s)
        .collect();
    events_s.sort_by(f64::total_cmp);
    events_s.dedup();

    let mut excess = 0.0;
    let mut variance = 0.0;
    for time_s in events_s {
        let at_risk = |time: &CensoredTime| f64::from(u8::from(time.time_s >= time_s));
        let event =
            |time: &CensoredTime| f64::from(u8::from(time.is_event && time.time_s == time_s));
        let mut counts = [0.0; 4];
        for (arm, base) in pairs {
            for (count, one) in
                counts
                    .iter_mut()
                    .zip([at_risk(arm), at_risk(base), event(arm), event(base)])
            {
                *count += one;
            }
        }
        let all = counts[0] + counts[1];
        let events = counts[2] + counts[3];
        let share = counts[0] / all;
        excess += counts[2] - events * share;
        if all > 1.0 {
            variance += events * share * (1.0 - share) * (all - events) / (all - 1.0);
        }
    }
    if variance == 0.0 {
        return 1.0;
    }
    libm::erfc((excess * excess / variance / 2.0).sqrt())
}

fn cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z / std::f64::consts::SQRT_2)
}

fn quantile(p: f64) -> f64 {
    let mut low = -10.0;
    let mut high = 10.0;
    for _ in 0..60 {
        let middle: f64 = (low + high) / 2.0;
        if cdf(middle) < p {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}
