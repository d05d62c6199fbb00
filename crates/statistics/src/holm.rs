//! Holm's correction of p values where several contrasts are tested.

/// The adjusted p values of a family of tests, in its order (Holm 1979): the probability that any of the hypotheses that are
/// rejected at a level is true is at most that level, however the tests depend on each other.
#[must_use]
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|a, b| p_values[*a].total_cmp(&p_values[*b]));

    let mut adjusted = vec![1.0; p_values.len()];
    let mut largest: f64 = 0.0;
    for (rank, index) in order.into_iter().enumerate() {
        let left = (p_values.len() - rank) as f64;
        largest = largest.max(left * p_values[index]).min(1.0);
        adjusted[index] = largest;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Holm's correction by its definition, as a closed test (Marcus, Peritz and Gabriel 1976): a hypothesis is rejected if
    /// Bonferroni's test rejects every intersection of hypotheses that contains it.
    fn closed(p_values: &[f64]) -> Vec<f64> {
        let mut adjusted = vec![0.0; p_values.len()];
        for set in 1_u32..1 << p_values.len() {
            let mut smallest: f64 = 1.0;
            for (index, p) in p_values.iter().enumerate() {
                if set >> index & 1 == 1 {
                    smallest = smallest.min(*p);
                }
            }

            let bonferroni = (f64::from(set.count_ones()) * smallest).min(1.0);
            for (index, value) in adjusted.iter_mut().enumerate() {
                if set >> index & 1 == 1 {
                    *value = bonferroni.max(*value);
                }
            }
        }
        adjusted
    }

    fn p_values() -> impl Strategy<Value = Vec<f64>> {
        prop::collection::vec(prop_oneof![0.0..=1.0, Just(0.03)], 0..8)
    }

    #[test]
    fn four_tests_are_corrected() {
        // 4 · 0.005; 3 · 0.01; 2 · 0.03; and 0.04 is not less than the one before.
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
        assert_eq!(adjusted, [0.03, 0.06, 0.06, 0.02]);
        assert!(holm(&[]).is_empty());
    }

    proptest! {
        #[test]
        fn the_correction_is_the_closed_test(p_values in p_values()) {
            prop_assert_eq!(holm(&p_values), closed(&p_values));
        }

        #[test]
        fn a_correction_keeps_the_order_and_lowers_nothing(p_values in p_values()) {
            let adjusted = holm(&p_values);
            for (index, p) in p_values.iter().enumerate() {
                prop_assert!(adjusted[index] >= *p);
                for (other, q) in p_values.iter().enumerate() {
                    if p <= q {
                        prop_assert!(adjusted[index] <= adjusted[other]);
                    }
                }
            }
        }
    }
}
