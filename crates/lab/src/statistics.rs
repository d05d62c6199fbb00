//! Confidence intervals of means, and times to an event that some runs do not reach.

/// A mean with the half width of its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Mean of the sample.
    pub mean: f64,
    /// The interval is `mean` ± this (Student's t).
    pub half_width: f64,
    /// Size of the sample.
    pub n: usize,
}

/// Times to an event that does not occur in every run.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Survival {
    /// Size of the sample.
    pub n: usize,
    /// Number of runs with the event.
    pub events: usize,
    /// Time by which half of the runs have the event, by Kaplan and Meier, seconds; `None` if that is not reached.
    pub median_s: Option<f64>,
    /// Longest time in the sample, seconds: where there is no median, it is more than this.
    pub until_s: f64,
}

/// A time, seconds, and whether it ends with the event; otherwise the run ends then, without the event (right-censored).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeTo {
    /// The time, seconds.
    pub time_s: f64,
    /// Whether the event occurs then.
    pub is_event: bool,
}

/// Fewest values of a useful interval; with fewer, the quantile below would not be exact to three digits.
pub const MIN_SAMPLE: u64 = 8;

impl Estimate {
    /// Mean and interval of independent values, at least two.
    #[must_use]
    pub fn of(values: &[f64]) -> Self {
        let count = values.len();
        let n = count as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|value| (value - mean) * (value - mean));
        let variance = squares.sum::<f64>() / (n - 1.0);
        Self {
            mean,
            half_width: student_975(n - 1.0) * (variance / n).sqrt(),
            n: count,
        }
    }
}

impl Survival {
    /// The estimate of Kaplan and Meier (1958).
    #[must_use]
    pub fn of(times: &[TimeTo]) -> Self {
        /// The product below is rounded, also where it is one half.
        const HALF: f64 = 0.5 + 1e-9;

        let mut sorted = times.to_vec();
        // An event at the time at which another run is censored comes first.
        sorted.sort_by(|a, b| {
            let by_time = a.time_s.total_cmp(&b.time_s);
            by_time.then(b.is_event.cmp(&a.is_event))
        });

        let mut at_risk = sorted.len();
        let mut share = 1.0;
        let mut median_s = None;
        for time in &sorted {
            if time.is_event {
                share *= 1.0 - 1.0 / at_risk as f64;
            }
            if share <= HALF && median_s.is_none() {
                median_s = Some(time.time_s);
            }
            at_risk -= 1;
        }

        Self {
            n: sorted.len(),
            events: sorted.iter().filter(|time| time.is_event).count(),
            median_s,
            until_s: sorted.last().map_or(0.0, |time| time.time_s),
        }
    }
}

impl std::fmt::Display for Survival {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.median_s {
            Some(median_s) => write!(f, "{median_s:.0}"),
            None => write!(f, "> {:.0}", self.until_s),
        }
    }
}

impl std::fmt::Display for Estimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.1} \u{b1} {:.1}", self.mean, self.half_width)
    }
}

/// The 0.975 quantile of Student's t with `df` degrees of freedom: the expansion 26.7.5 of Abramowitz and Stegun,
/// Handbook of Mathematical Functions (1964).
fn student_975(df: f64) -> f64 {
    /// The 0.975 quantile of the normal distribution.
    const Z: f64 = 1.959_963_984_540_054;
    let z2 = Z * Z;
    let g1 = Z * (z2 + 1.0) / 4.0;
    let g2 = Z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0;
    let g3 = Z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0;
    let g4 = Z * ((((79.0 * z2 + 776.0) * z2 + 1482.0) * z2 - 1920.0) * z2 - 945.0) / 92160.0;
    Z + (g1 + (g2 + (g3 + g4 / df) / df) / df) / df
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_published_tables() {
        // NIST/SEMATECH e-Handbook of Statistical Methods, table of critical values of Student's t.
        for (df, t) in [
            (7.0, 2.365),
            (10.0, 2.228),
            (15.0, 2.131),
            (31.0, 2.040),
            (100.0, 1.984),
        ] {
            let found = student_975(df);
            assert!((found - t).abs() < 1e-3, "{df}: {found}");
        }
    }

    #[test]
    fn an_interval_covers_the_true_mean_as_often_as_it_says() {
        let mut stream = protocol::random::stream(1, "statistics");
        let mut covered = 0;
        for _ in 0..4000 {
            let mut values = [0.0; 8];
            for value in &mut values {
                // A sum of twelve uniform numbers is close enough to normal; its mean is 6.
                let uniform = (0..12).map(|_| protocol::random::unit(&mut stream));
                *value = uniform.sum();
            }

            let estimate = Estimate::of(&values);
            if (estimate.mean - 6.0).abs() <= estimate.half_width {
                covered += 1;
            }
        }
        let share = f64::from(covered) / 4000.0;
        assert!((0.935..0.965).contains(&share), "{share}");
    }

    #[test]
    fn equal_values_leave_no_doubt() {
        assert_eq!(
            Estimate::of(&[3.0; 32]),
            Estimate {
                mean: 3.0,
                half_width: 0.0,
                n: 32
            }
        );
    }

    #[test]
    fn the_median_time_is_that_of_kaplan_and_meier() {
        fn survival(times: &[(f64, bool)]) -> Survival {
            let mut sample = Vec::new();
            for (time_s, is_event) in times {
                sample.push(TimeTo {
                    time_s: *time_s,
                    is_event: *is_event,
                });
            }
            Survival::of(&sample)
        }

        // The remission times of Freireich et al. (1963), 6-mercaptopurine; their median is 23 weeks.
        let events = [6.0, 6.0, 6.0, 7.0, 10.0, 13.0, 16.0, 22.0, 23.0];
        let censored = [
            6.0, 9.0, 10.0, 11.0, 17.0, 19.0, 20.0, 25.0, 32.0, 32.0, 34.0, 35.0,
        ];
        let mut weeks = Vec::new();
        weeks.extend(events.map(|week| (week, true)));
        weeks.extend(censored.map(|week| (week, false)));
        let found = survival(&weeks);
        assert_eq!((found.n, found.events), (21, 9));
        assert_eq!(found.median_s, Some(23.0));

        let half = survival(&[(10.0, true), (20.0, true), (600.0, false), (600.0, false)]);
        assert_eq!(half.median_s, Some(20.0));
        assert_eq!(half.to_string(), "20");

        let fewer = survival(&[(10.0, true), (600.0, false), (600.0, false)]);
        assert_eq!(fewer.median_s, None);
        assert_eq!(fewer.to_string(), "> 600");
    }
}
