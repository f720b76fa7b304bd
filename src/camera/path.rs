//! Interpolation between two cameras, for keys on a timeline.

use super::{Camera, CameraError, Projection, length};
use glam::{DMat3, DQuat, DVec3};

impl Camera {
    /// The camera at `weight` 0..=1 from `a` to `b`; exactly those at the ends.
    ///
    /// The focal point moves straight; the eye turns around it at a constant rate by the shortest rotation (of viewing direction and up),
    /// while its distance changes geometrically: between two views from the same distance the mesh keeps its size, and a zoom has a
    /// constant rate. View angle and near distance change linearly, a parallel scale geometrically. The projection does not blend: that of
    /// `a` holds until the end, with the size at the focal point interpolated.
    ///
    /// # Errors
    /// If one of the two cameras has no view.
    pub fn between(a: &Camera, b: &Camera, weight: f64) -> Result<Camera, CameraError> {
        if weight <= 0.0 {
            return a.view(1, 1).map(|_| *a);
        }
        if weight >= 1.0 {
            return b.view(1, 1).map(|_| *b);
        }
        let is_alike = std::mem::discriminant(&a.projection) == std::mem::discriminant(&b.projection);
        // A camera with the other projection is converted, at equal size at the focal point.
        let b = if is_alike { *b } else { b.with_other_projection()? };
        let projection = mixed(a.projection, b.projection, weight);
        let (from, to) = (a.orientation()?, b.orientation()?);
        let turned = from.slerp(to, weight);
        let distance = geometric(length(a.focal_point - a.position), length(b.focal_point - b.position), weight);
        let focal_point = a.focal_point * (1.0 - weight) + b.focal_point * weight;
        let camera = Camera {
            position: focal_point - distance * (turned * DVec3::Z),
            focal_point,
            view_up: turned * DVec3::Y,
            projection,
            near: a.near * (1.0 - weight) + b.near * weight,
        };
        camera.view(1, 1).map(|_| camera)
    }

    /// The rotation that takes z to the viewing direction and y to the image's up.
    fn orientation(&self) -> Result<DQuat, CameraError> {
        let (forward, right) = self.forward_and_right()?;
        let up = right.cross(forward);
        // Right, up, forward is a left-handed system, so its first axis is negated.
        Ok(DQuat::from_mat3(&DMat3::from_cols(-right, up, forward)).normalize())
    }
}

/// Geometric interpolation between two positive numbers.
fn geometric(a: f64, b: f64, weight: f64) -> f64 {
    // Logarithms of each, since a quotient could overflow.
    (a.ln() * (1.0 - weight) + b.ln() * weight).exp()
}

fn mixed(a: Projection, b: Projection, weight: f64) -> Projection {
    match (a, b) {
        (Projection::Perspective { view_angle: from }, Projection::Perspective { view_angle: to }) => {
            Projection::Perspective { view_angle: from * (1.0 - weight) + to * weight }
        }
        (Projection::Parallel { scale: from }, Projection::Parallel { scale: to }) => {
            Projection::Parallel { scale: geometric(from, to, weight) }
        }
        _ => a,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Rounding of a few dozen operations on numbers of size ten.
    const ROUNDING: f64 = 1e-12;

    fn around(azimuth: f64, distance: f64) -> Camera {
        let (lo, hi) = (DVec3::new(-1.0, 2.0, -3.0), DVec3::new(2.0, 3.0, 1.0));
        let camera = Camera::default_for((lo, hi)).unwrap().orbit(azimuth, 0.0).unwrap();
        let direction = (camera.position - camera.focal_point).normalize();
        Camera { position: camera.focal_point + distance * direction, ..camera }
    }

    fn distance(camera: &Camera) -> f64 {
        (camera.position - camera.focal_point).length()
    }

    #[test]
    fn the_eye_goes_round_the_focal_point_and_not_through_it() {
        let (a, b) = (around(0.0, 10.0), around(120.0, 10.0));
        let middle = Camera::between(&a, &b, 0.5).unwrap();
        assert!((distance(&middle) - 10.0).abs() < ROUNDING, "{}", distance(&middle));
        // Linear interpolation of the eye would come nearer.
        assert!(distance(&Camera { position: 0.5 * (a.position + b.position), ..a }) < 9.0);
        // Both cameras are equally far from it.
        let to = |c: &Camera| (c.position - middle.position).length();
        assert!((to(&a) - to(&b)).abs() < ROUNDING && to(&a) > 1.0);
    }

    #[test]
    fn distances_and_scales_change_by_factors() {
        let (a, b) = (around(0.0, 1.0), around(0.0, 100.0));
        assert!((distance(&Camera::between(&a, &b, 0.5).unwrap()) - 10.0).abs() < 10.0 * ROUNDING);
        let [a, b] = [1.0, 1e4].map(|scale| Camera { projection: Projection::Parallel { scale }, ..a });
        let Projection::Parallel { scale } = Camera::between(&a, &b, 0.25).unwrap().projection else { panic!() };
        assert!((scale - 10.0).abs() < 10.0 * ROUNDING, "{scale}");
    }

    #[test]
    fn another_projection_comes_at_the_end_and_what_is_seen_does_not_jump_there() {
        let a = around(10.0, 8.0);
        let b = around(40.0, 12.0).with_other_projection().unwrap();
        let almost = Camera::between(&a, &b, 1.0 - 1e-9).unwrap();
        assert!(matches!(almost.projection, Projection::Perspective { .. }));
        assert_eq!(Camera::between(&a, &b, 1.0).unwrap(), b);
        let half = |camera: &Camera| camera.half_height_at_focus().unwrap();
        // The size there differs by the last billionth of the way.
        assert!((half(&almost) / half(&b) - 1.0).abs() < 1e-8, "{} {}", half(&almost), half(&b));
    }

    #[test]
    fn cameras_without_a_view_are_errors() {
        let good = around(0.0, 5.0);
        let bad = Camera { position: good.focal_point, ..good };
        for weight in [0.0, 0.5, 1.0] {
            assert_eq!(Camera::between(&bad, &good, weight).is_err(), weight < 1.0);
            assert_eq!(Camera::between(&good, &bad, weight).is_err(), weight > 0.0);
        }
    }

    proptest! {
        #[test]
        fn there_is_a_view_everywhere_on_the_way_and_ends_are_exact(
            azimuth in -360.0..360.0_f64, distances in prop::array::uniform2(1e-3..1e6_f64), weight in 0.0..=1.0_f64,
        ) {
            let (a, b) = (around(0.0, distances[0]), around(azimuth, distances[1]));
            let on_the_way = Camera::between(&a, &b, weight).unwrap();
            prop_assert!(on_the_way.view(4, 4).is_ok());
            let least = distances[0].min(distances[1]);
            prop_assert!(distance(&on_the_way) > least * (1.0 - 1e-9) && distance(&on_the_way) < (distances[0].max(distances[1])) * (1.0 + 1e-9));
            prop_assert_eq!(Camera::between(&a, &b, 0.0).unwrap(), a);
            prop_assert_eq!(Camera::between(&a, &b, 1.0).unwrap(), b);
        }
    }
}
