//! An estimate with its 95 % confidence interval.

use serde::Serialize;

use crate::digits::{decimals, decimals_alone, fixed, signed};
use crate::distribution::student_975;
use crate::sample::mean;

/// Most decimals beyond those that an interval supports.
const MAX_FURTHER_DECIMALS: usize = 3;

/// Fewest values of the interval of a mean.
pub const MIN_VALUES: usize = 3;

/// Values that are equal in exact numbers may differ in their last bits: by this share of the largest.
const ROUNDING: f64 = 1e-12;

/// How far an end may be from a skewed mean, in half widths of Student's t. Hall's transformation by itself makes intervals of
/// few values up to several times as long, which adds less than 1 % to their coverage.
const LONGEST: f64 = 2.0;

/// An estimate with its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The estimate; NaN, `null` in JSON, where it is not a finite number.
    pub value: f64,
    /// Size of the sample: runs, or pairs of runs.
    pub n: usize,
    /// Its interval.
    #[serde(flatten)]
    pub interval: Interval,
}

/// A 95 % confidence interval, or why there is none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "interval", rename_all = "snake_case")]
pub enum Interval {
    /// The interval.
    Ends {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// Fewer values than it needs.
    TooFew,
    /// All values are equal, so that the sample does not show how much they vary.
    AllEqual,
    /// The values are so large that their mean or their variance is not a finite number.
    NotFinite,
}

/// Mean, standard deviation and skewness of a sample.
struct Moments {
    n: usize,
    mean: f64,
    deviation: f64,
    /// The adjusted coefficient of Fisher and Pearson.
    skewness: f64,
}

impl Estimate {
    /// The mean of independent values: Student's t, and beyond it on the side to which the values are skewed the interval of
    /// Hall's transformation, up to twice as far. With few runs, t by itself misses the mean of skewed values, such as the longest
    /// wait of a run.
    #[must_use]
    pub fn mean(values: &[f64]) -> Self {
        Self::of(values, |moments| {
            let (low, high) = moments.student();
            let (hall_low, hall_high) = moments.hall();
            let most = LONGEST * (high - moments.mean);
            (
                low.min(hall_low.max(moments.mean - most)),
                high.max(hall_high.min(moments.mean + most)),
            )
        })
    }

    /// The mean of the differences of pairs: Student's t. What pairs have in common cancels out, and with it most of the skew.
    #[must_use]
    pub fn difference(differences: &[f64]) -> Self {
        Self::of(differences, Moments::student)
    }

    /// Lower and upper end, if there is an interval.
    #[must_use]
    pub fn bounds(&self) -> Option<(f64, f64)> {
        match self.interval {
            Interval::Ends { low, high } => Some((low, high)),
            Interval::TooFew | Interval::AllEqual | Interval::NotFinite => None,
        }
    }

    /// The same in another unit, such as percent.
    #[must_use]
    pub fn scaled(mut self, factor: f64) -> Self {
        self.value *= factor;
        if let Interval::Ends { low, high } = &mut self.interval {
            *low *= factor;
            *high *= factor;
        }
        self
    }

    /// Decimals that its interval supports, or that its value has. An end that is not zero is not shown as zero: on which side of zero
    /// it is decides.
    #[must_use]
    pub fn decimals(&self) -> usize {
        let Some((low, high)) = self.bounds() else {
            return decimals_alone(self.value);
        };

        let supported = decimals((high - low) / 2.0);
        let hides_a_sign = |decimals: usize| {
            let is_hidden = |end: f64| end != 0.0 && signed(end, decimals) == fixed(0.0, decimals);
            is_hidden(low) || is_hidden(high)
        };
        let needed = (supported..=supported + MAX_FURTHER_DECIMALS).find(|one| !hides_a_sign(*one));
        needed.unwrap_or(supported)
    }

    /// The estimate of a difference, with signs.
    #[must_use]
    pub fn signed(&self) -> String {
        self.text(signed, "in every pair")
    }

    fn text(&self, number: impl Fn(f64, usize) -> String, all_equal: &str) -> String {
        let decimals = self.decimals();
        let value = number(self.value, decimals);
        match self.interval {
            Interval::Ends { low, high } => {
                let low = number(low, decimals);
                let high = number(high, decimals);
                format!("{value} [{low}, {high}]")
            }
            Interval::AllEqual => format!("{value} {all_equal}"),
            Interval::TooFew if self.n == 0 => "no value".to_owned(),
            Interval::TooFew => format!("{value} (n {})", self.n),
            Interval::NotFinite => "not finite".to_owned(),
        }
    }

    fn of(values: &[f64], ends: impl Fn(&Moments) -> (f64, f64)) -> Self {
        let n = values.len();
        let value = mean(values);
        let largest = values
            .iter()
            .fold(0.0, |most: f64, value| most.max(value.abs()));
        let is_equal = values
            .iter()
            .all(|other| (other - value).abs() <= ROUNDING * largest);

        let interval = if n > 0 && !value.is_finite() {
            Interval::NotFinite
        } else if n < MIN_VALUES {
            Interval::TooFew
        } else if is_equal {
            Interval::AllEqual
        } else {
            let (low, high) = ends(&Moments::of(values, value));
            if low.is_finite() && high.is_finite() {
                Interval::Ends { low, high }
            } else {
                Interval::NotFinite
            }
        };
        let value = if value.is_finite() { value } else { f64::NAN };
        Self { value, n, interval }
    }
}

impl std::fmt::Display for Estimate {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text(fixed, "in every run"))
    }
}

impl Moments {
    fn of(values: &[f64], mean: f64) -> Self {
        let n = values.len() as f64;
        let mut squares = 0.0;
        let mut cubes = 0.0;
        for value in values {
            let difference = value - mean;
            squares += difference * difference;
            cubes += difference * difference * difference;
        }

        let deviation = (squares / n).sqrt();
        let skewness = cubes / n / (deviation * deviation * deviation);
        Self {
            n: values.len(),
            mean,
            deviation: (squares / (n - 1.0)).sqrt(),
            skewness: skewness * (n * (n - 1.0)).sqrt() / (n - 2.0),
        }
    }

    fn student(&self) -> (f64, f64) {
        let half_width = self.t() * self.deviation;
        (self.mean - half_width, self.mean + half_width)
    }

    /// The interval of the cubic transformation of Hall (1992, On the removal of skewness by transformation, J. R. Statist. Soc.
    /// B 54), with the quantile of t in place of that of the normal distribution. Without skew it is that of t.
    fn hall(&self) -> (f64, f64) {
        let skewness = self.skewness;
        if skewness.abs() < 1e-9 {
            return self.student();
        }

        let transformed = |t: f64| {
            let shifted = 1.0 + skewness * (t - skewness / (6.0 * self.n as f64));
            3.0 / skewness * (libm::cbrt(shifted) - 1.0)
        };
        let t = self.t();
        (
            self.mean - self.deviation * transformed(t),
            self.mean - self.deviation * transformed(-t),
        )
    }

    /// The quantile of t, in standard deviations of the mean.
    fn t(&self) -> f64 {
        student_975(self.n - 1) / (self.n as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_interval_of_t_is_the_published_one() {
        // Darwin's maize (Fisher 1935, The Design of Experiments, section 17): mean 20.93, t 2.148, and 2.145 for 5 %.
        let maize = [
            49.0, -67.0, 8.0, 16.0, 6.0, 23.0, 28.0, 41.0, 14.0, 29.0, 56.0, 24.0, 75.0, 60.0,
            -48.0,
        ];
        let found = Estimate::difference(&maize);
        let (low, high) = found.bounds().unwrap();
        assert!((found.value - 20.933).abs() < 1e-3, "{found:?}");
        assert!(
            (low - 20.933 * (1.0 - 2.145 / 2.148)).abs() < 0.02,
            "{found:?}"
        );
        assert!((low + high - 2.0 * found.value).abs() < 1e-9);
    }

    #[test]
    fn the_mean_of_skewed_values_has_a_longer_upper_part() {
        let waits = [1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 5.0, 40.0];
        let (low, high) = Estimate::difference(&waits).bounds().unwrap();
        let (skewed_low, skewed_high) = Estimate::mean(&waits).bounds().unwrap();
        assert_eq!(skewed_low, low);
        assert!(skewed_high > high + 5.0, "{skewed_high}, {high}");
    }

    #[test]
    fn there_is_no_interval_where_nothing_can_be_said() {
        for of in [Estimate::mean, Estimate::difference] {
            assert_eq!(of(&[]).interval, Interval::TooFew);
            assert_eq!(of(&[1.0, 2.0]).interval, Interval::TooFew);
            assert_eq!(of(&[0.1; 9]).interval, Interval::AllEqual);
            assert_eq!(of(&[1.7e308; 4]).interval, Interval::NotFinite);
            // The mean is finite, and the variance is not.
            assert_eq!(of(&[1e200, -1e200, 3.0]).interval, Interval::NotFinite);
            assert!(of(&[0.0, 0.0, 1.0]).bounds().is_some());
        }
        assert_eq!(Estimate::mean(&[0.0; 5]).to_string(), "0 in every run");
        assert_eq!(Estimate::difference(&[1.0; 5]).signed(), "+1 in every pair");
        assert_eq!(Estimate::mean(&[1.7e308; 4]).to_string(), "not finite");
    }

    #[test]
    fn an_end_that_is_not_zero_is_not_shown_as_zero() {
        let text = |low: f64, high: f64| {
            let interval = Interval::Ends { low, high };
            let value = (low + high) / 2.0;
            Estimate {
                value,
                n: 9,
                interval,
            }
            .signed()
        };
        assert_eq!(text(-25.19, -0.218), "-12.7 [-25.2, -0.2]");
        assert_eq!(text(-0.04, 25.0), "+12.48 [-0.04, +25.00]");
        assert_eq!(text(0.0, 25.0), "+12 [0, +25]");
        assert_eq!(text(-25.0, 1e-17), "-12 [-25, 0]");
    }

    #[test]
    fn digits_follow_the_interval() {
        let text = |values: &[f64]| Estimate::difference(values).signed();
        assert_eq!(
            text(&[0.001, 0.002, 0.006, 0.008]),
            "+0.0043 [-0.0010, +0.0095]"
        );
        assert_eq!(
            text(&[-0.01, -0.02, 0.06, -0.08]),
            "-0.013 [-0.104, +0.079]"
        );
        assert_eq!(text(&[100.0, 200.0, 330.0]), "+210 [-76, +496]");
    }

    proptest! {
        #[test]
        fn the_interval_moves_and_turns_with_the_sample(
            values in prop::collection::vec(-50_i32..50, 0..20),
            shift in -50_i32..50,
        ) {
            let sample: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
            let moved: Vec<f64> = sample.iter().map(|value| value + f64::from(shift)).collect();
            let turned: Vec<f64> = sample.iter().map(|value| -value).collect();

            for of in [Estimate::mean, Estimate::difference] {
                let own = of(&sample);
                match (own.bounds(), of(&moved).bounds(), of(&turned).bounds()) {
                    (Some((low, high)), Some(moved), Some(turned)) => {
                        prop_assert!(low < own.value && own.value < high);
                        prop_assert!((moved.0 - low - f64::from(shift)).abs() < 1e-6);
                        prop_assert!((moved.1 - high - f64::from(shift)).abs() < 1e-6);
                        prop_assert!((turned.0 + high).abs() < 1e-6);
                        prop_assert!((turned.1 + low).abs() < 1e-6);
                    }
                    ends => prop_assert_eq!(ends, (None, None, None)),
                }
            }
        }
    }
}
