//! A linear scale from values to pixels, with round ticks.

/// From values to pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scale {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) from_px: f64,
    pub(crate) to_px: f64,
}

impl Scale {
    /// A scale that begins and ends exactly with these values. An empty range becomes one around its value.
    pub(crate) fn new(from: f64, to: f64, from_px: f64, to_px: f64) -> Self {
        let is_range = from.is_finite() && to.is_finite() && to > from;
        let (from, to) = if is_range {
            (from, to)
        } else if from.is_finite() {
            (from - 0.5, from + 0.5)
        } else {
            (0.0, 1.0)
        };

        Self {
            from,
            to,
            from_px,
            to_px,
        }
    }

    /// The place of a value. Values outside of the range are at its ends.
    pub(crate) fn at(&self, value: f64) -> f64 {
        let share = (value - self.from) / (self.to - self.from);
        let share = if share.is_nan() { 0.0 } else { share };
        self.from_px + share.clamp(0.0, 1.0) * (self.to_px - self.from_px)
    }

    /// Round values within the range, about so many, and the decimals with which they are written.
    pub(crate) fn ticks(&self, about: usize) -> (Vec<f64>, usize) {
        let step = round_step((self.to - self.from) / about.max(1) as f64);
        let first = (self.from / step - 1e-9).ceil();
        let last = (self.to / step + 1e-9).floor();

        let mut ticks = Vec::new();
        let mut at = first;
        while at <= last && ticks.len() < 100 {
            ticks.push(at * step);
            at += 1.0;
        }
        (ticks, step_decimals(step))
    }
}

/// Widens a range so that it begins and ends with round numbers.
#[must_use]
pub fn round_range(from: f64, to: f64, about: usize) -> (f64, f64) {
    let span = if to > from { to - from } else { 1.0 };
    let step = round_step(span / about.max(1) as f64);
    let begin = (from / step + 1e-9).floor() * step;
    let end = (to / step - 1e-9).ceil() * step;
    (begin, if end > begin { end } else { begin + step })
}

/// The least of 1, 2, 5, 10, … and their tenths, hundredths, … that is at least `least`.
fn round_step(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }

    let mut decade = 1.0;
    while decade > least {
        decade /= 10.0;
    }
    while decade * 10.0 <= least {
        decade *= 10.0;
    }
    for factor in [1.0, 2.0, 5.0] {
        if decade * factor >= least * (1.0 - 1e-9) {
            return decade * factor;
        }
    }
    decade * 10.0
}

fn step_decimals(step: f64) -> usize {
    let mut decimals = 0;
    let mut scaled = step;
    while decimals < 6 && (scaled - scaled.round()).abs() > 1e-6 {
        scaled *= 10.0;
        decimals += 1;
    }
    decimals
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round() {
        let scale = Scale::new(0.0, 600.0, 0.0, 300.0);
        assert_eq!(
            scale.ticks(4),
            (vec![0.0, 200.0, 400.0, 600.0], 0),
            "a step of at least 150"
        );
        let scale = Scale::new(-0.03, 0.11, 0.0, 300.0);
        let (ticks, decimals) = scale.ticks(4);
        assert_eq!(decimals, 2);
        assert_eq!(ticks.len(), 3, "{ticks:?}");
    }

    #[test]
    fn any_range_has_a_scale() {
        let ranges = [
            (0.0, 0.0),
            (5.0, 5.0),
            (f64::NAN, 1.0),
            (1.0, f64::INFINITY),
            (3.0, 1.0),
        ];
        for (from, to) in ranges {
            let scale = Scale::new(from, to, 10.0, 20.0);
            assert!((10.0..=20.0).contains(&scale.at(from)), "{from} to {to}");
            assert!(!scale.ticks(5).0.is_empty());
        }
    }

    #[test]
    fn a_range_is_widened_to_round_numbers() {
        assert_eq!(round_range(3.0, 97.0, 5), (0.0, 100.0));
        assert_eq!(round_range(-12.0, 4.0, 4), (-15.0, 5.0));
        assert_eq!(round_range(2.0, 2.0, 4), (2.0, 2.5));
    }
}
