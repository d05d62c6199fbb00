//! Places labels beside each other.

/// Places for labels near where they are wanted, at least `distance` apart and, if they fit, between two ends. The places are in
/// the order of the labels.
pub(crate) fn spread(wanted: &[f64], distance: f64, (first, last): (f64, f64)) -> Vec<f64> {
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by(|a, b| wanted[*a].total_cmp(&wanted[*b]));

    let mut places = vec![0.0; wanted.len()];
    let mut free_from = first;
    for index in &order {
        places[*index] = wanted[*index].max(free_from);
        free_from = places[*index] + distance;
    }
    let mut free_to = last;
    for index in order.iter().rev() {
        if places[*index] > free_to {
            places[*index] = free_to;
        }
        free_to = places[*index] - distance;
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_label_is_over_another_one() {
        let places = spread(&[50.0, 50.0, 10.0, 99.0, 98.0], 10.0, (0.0, 100.0));
        assert_eq!(places, [50.0, 60.0, 10.0, 100.0, 90.0]);
    }
}
