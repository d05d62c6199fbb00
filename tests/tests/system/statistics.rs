//! The laboratory's statistics, compared with SciPy and lifelines over samples of many kinds. What is exact agrees to 1e-9; what
//! is drawn agrees within its own error. Which methods are used is decided by `tests/tests/coverage`.

use protocol::random::{self, Stream};
use serde_json::{Value, json};
use statistics::{
    CensoredTime, Estimate, PairedTimes, SignFlip, Survival, dominance, ecdf, quantile,
};
use system_tests::root;
use system_tests::tools::{has_modules, python};

/// Sizes of samples: the least that has an interval, those below and above the limit of exact tests, and more than one word
/// of signs.
const SIZES: [usize; 5] = [3, 8, 14, 16, 65];
/// The quantiles that are compared.
const QUANTILES: [f64; 6] = [0.0, 0.1, 0.25, 0.5, 0.9, 1.0];

/// How a sample is drawn.
type Draw = fn(&mut Stream) -> f64;

#[test]
#[ignore = "thorough: with `-- --include-ignored`"]
fn all_numbers_are_those_of_scipy_and_lifelines() {
    let install = "pip install scipy lifelines";
    if !has_modules("the statistics", "lifelines, scipy", install) {
        return;
    }

    let mut stream = random::stream(1, "tests/statistics");
    let mut samples = Vec::new();
    let mut pairs = Vec::new();
    for size in SIZES {
        for draw in [uniform as Draw, skewed, counted] {
            let values: Vec<f64> = (0..size).map(|_| draw(&mut stream)).collect();
            samples.push(sample(&values));
        }
        for draw in [skewed as Draw, counted] {
            let arm = times(&mut stream, size, draw);
            let baseline = times(&mut stream, size, draw);
            pairs.push(pair(&arm, &baseline));
        }
    }
    let mut shares = Vec::new();
    for n in [1, 3, 8, 64] {
        for only_arm in [0, 1, n / 2, n] {
            for only_baseline in [0, 1, n - only_arm] {
                if only_arm + only_baseline <= n {
                    shares.push(share(only_arm, only_baseline, n));
                }
            }
        }
    }
    compare(&json!({ "samples": samples, "pairs": pairs, "shares": shares }));
}

/// The shares of pairs in which one run only has an event, and what is found of them.
fn share(only_arm: usize, only_baseline: usize, n: usize) -> Value {
    json!({
        "only_arm": only_arm,
        "only_baseline": only_baseline,
        "n": n,
        "share": Estimate::share(only_arm, n),
        "difference": Estimate::difference_of_shares(only_arm, only_baseline, n),
    })
}

fn uniform(stream: &mut Stream) -> f64 {
    random::unit(stream) - 0.4
}

fn skewed(stream: &mut Stream) -> f64 {
    let uniform = random::unit(stream);
    100.0 * uniform * uniform * uniform
}

/// A number with many ties.
fn counted(stream: &mut Stream) -> f64 {
    (random::unit(stream) * 6.0).floor() - 2.0
}

/// Times, a quarter of which is censored.
fn times(stream: &mut Stream, size: usize, draw: Draw) -> Vec<CensoredTime> {
    let mut times = Vec::new();
    for _ in 0..size {
        times.push(CensoredTime {
            time_s: draw(stream).abs(),
            is_event: random::unit(stream) > 0.25,
        });
    }
    times
}

/// A sample, and what is found of it.
fn sample(values: &[f64]) -> Value {
    json!({
        "values": values,
        "mean": Estimate::mean(values),
        "difference": Estimate::difference(values),
        "quantiles": QUANTILES.map(|p| (p, quantile(values, p))),
        "ecdf": ecdf(values),
        "dominance": dominance(values),
        "sign_flip": SignFlip::of(values),
    })
}

/// The times of two arms, and what is found of them.
fn pair(arm: &[CensoredTime], baseline: &[CensoredTime]) -> Value {
    let paired = PairedTimes::of(arm, baseline);
    json!({
        "arm": written(arm),
        "baseline": written(baseline),
        "survival": Survival::of(arm),
        "until_s": paired.until_s,
        "differences_s": paired.differences_s,
    })
}

fn written(times: &[CensoredTime]) -> Value {
    times
        .iter()
        .map(|time| json!([time.time_s, time.is_event]))
        .collect()
}

/// Gives everything to the script that compares it; the script fails at the first difference.
fn compare(found: &Value) {
    let script = root().join("tests/statistics/compare.py");
    let output = python(&script, &found.to_string());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let compared: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        compared,
        json!({ "samples": 15, "pairs": 10, "shares": found["shares"].as_array().unwrap().len() }),
        "{errors}"
    );
}
