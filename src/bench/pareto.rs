//! Pareto fronts.

/// The points that no other one dominates: none is at least as small in both coordinates and smaller in one. Indices, in the order of the
/// first coordinate. Equal points are all included; points with NaN are not.
pub fn pareto_front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).filter(|&at| !points[at].iter().any(|c| c.is_nan())).collect();
    order.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]).then(points[a][1].total_cmp(&points[b][1])));
    let mut front: Vec<usize> = Vec::new();
    for at in order {
        let [x, y] = points[at];
        // The last point of the front is the lowest so far, and not further right.
        if front.last().is_none_or(|&last| y < points[last][1] || points[last] == [x, y]) {
            front.push(at);
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn dominates(a: [f64; 2], b: [f64; 2]) -> bool {
        a[0] <= b[0] && a[1] <= b[1] && a != b
    }

    #[test]
    fn the_front_of_known_points_is_what_a_hand_would_draw() {
        let points = [[5.0, 1.0], [1.0, 9.0], [2.0, 9.0], [3.0, 2.0], [3.0, 4.0], [4.0, 2.0], [9.0, 0.0]];
        assert_eq!(pareto_front(&points), [1, 3, 0, 6]);
        assert_eq!(pareto_front(&[[1.0, 1.0], [1.0, 1.0], [2.0, 1.0]]), [0, 1]);
        assert_eq!(pareto_front(&[[f64::NAN, 0.0], [1.0, 1.0], [0.0, f64::NAN]]), [1]);
        assert_eq!(pareto_front(&[]), [] as [usize; 0]);
    }

    proptest! {
        #[test]
        fn nothing_beats_what_is_in_front_and_something_beats_all_else(
            // Few values, so that ties occur.
            points in prop::collection::vec(prop::array::uniform2((0..12_u8).prop_map(f64::from)), 0..40)
        ) {
            let front = pareto_front(&points);
            for at in 0..points.len() {
                let is_beaten = points.iter().any(|&other| dominates(other, points[at]));
                prop_assert_eq!(front.contains(&at), !is_beaten);
            }
            prop_assert!(front.windows(2).all(|pair| points[pair[0]][0] <= points[pair[1]][0]));
        }
    }
}
