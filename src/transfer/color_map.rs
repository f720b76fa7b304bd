//! Colour maps: piecewise-linear RGB over 0..1, and the built-in ones.

use super::TransferError;

/// One point of a [`ColorMap`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorPoint {
    /// Position on the axis of the map, 0..=1.
    pub position: f64,
    /// Display-referred colour, 0..=1.
    pub rgb: [f64; 3],
}

/// A colour map: display-referred RGB, piecewise linear over 0..=1, constant outside. Two points at one position make a
/// step; at the position itself the right one holds.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorMap {
    name: String,
    points: Vec<ColorPoint>,
    nan_color: Option<[f64; 3]>,
}

impl ColorMap {
    /// A map of these points. Positions may be any increasing numbers; they are stretched to 0..=1 (a single position
    /// becomes 0).
    ///
    /// # Errors
    /// If there is no point, a position is not finite or lies before the one in front of it, or a colour is outside 0..=1.
    pub fn new(
        name: impl Into<String>,
        mut points: Vec<ColorPoint>,
        nan_color: Option<[f64; 3]>,
    ) -> Result<Self, TransferError> {
        let name = name.into();
        let (Some(first), Some(last)) = (points.first().copied(), points.last().copied()) else {
            return Err(TransferError::BadMap { name, problem: "has no points".into() });
        };
        let mut previous = f64::NEG_INFINITY;
        for (i, point) in points.iter().enumerate() {
            let colour_ok = point.rgb.iter().all(|c| (0.0..=1.0).contains(c));
            if !(point.position.is_finite() && point.position >= previous && colour_ok) {
                let problem = format!("point {i}: positions must be finite and increase, colours must be in 0..1");
                return Err(TransferError::BadMap { name, problem });
            }
            previous = point.position;
        }
        if nan_color.is_some_and(|c| !c.iter().all(|c| (0.0..=1.0).contains(c))) {
            return Err(TransferError::BadMap { name, problem: "the NaN colour must be in 0..1".into() });
        }
        // Halved, because the difference of two finite numbers may overflow.
        let width = 0.5 * last.position - 0.5 * first.position;
        for point in &mut points {
            let from_first = 0.5 * point.position - 0.5 * first.position;
            point.position = if width > 0.0 { from_first / width } else { 0.0 };
        }
        points.dedup_by(|next, kept| next == kept);
        Ok(Self { name, points: outer_of_equal(&points, |p| p.position), nan_color })
    }

    /// Name of the map; a reversed one ends with `_r`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The points, sorted by position, from 0 to 1; never more than two at one position.
    pub fn points(&self) -> &[ColorPoint] {
        &self.points
    }

    /// Colour of missing values, if the map has one.
    pub fn nan_color(&self) -> Option<[f64; 3]> {
        self.nan_color
    }

    /// The map reversed; `_r` is added to its name, or removed.
    #[must_use]
    pub fn reversed(&self) -> ColorMap {
        let name = self.name.strip_suffix("_r").map_or_else(|| format!("{}_r", self.name), str::to_owned);
        let turned = |p: &ColorPoint| ColorPoint { position: 1.0 - p.position, rgb: p.rgb };
        ColorMap { name, points: self.points.iter().rev().map(turned).collect(), nan_color: self.nan_color }
    }

    /// Colour at a position (at a step, the right one).
    pub fn eval(&self, position: f64) -> [f64; 3] {
        self.eval_sides(position)[1]
    }

    /// Colour just left of a position, and at it.
    pub(super) fn eval_sides(&self, position: f64) -> [[f64; 3]; 2] {
        sides_at(&self.points, position, |p| (p.position, p.rgb), mix)
    }
}

/// The value just left of a position, and at it, of points sorted by position, given by `place` as position and value: `mix` between two of
/// them, constant outside.
pub(super) fn sides_at<P, V: Default>(
    points: &[P],
    position: f64,
    place: impl Fn(&P) -> (f64, V),
    mix: impl Fn(V, V, f64) -> V,
) -> [V; 2] {
    let left = points.partition_point(|p| place(p).0 < position);
    let right = points.partition_point(|p| place(p).0 <= position);
    let of = |index: Option<usize>| index.and_then(|i| points.get(i)).map(&place);
    let between = |after: usize| match (of(after.checked_sub(1)), of(Some(after))) {
        (Some((a, from)), Some((b, to))) => mix(from, to, (position - a) / (b - a)),
        (Some((_, end)), None) | (None, Some((_, end))) => end,
        (None, None) => V::default(), // not reached: there is a point
    };
    [between(left), between(right)]
}

/// Interpolates from `a` at 0 to `b` at 1: exact at both ends, monotone, and constant if they are equal.
pub(super) fn lerp(a: f64, b: f64, f: f64) -> f64 {
    if f == 1.0 { b } else { (a + f * (b - a)).clamp(a.min(b), a.max(b)) }
}

/// [`lerp`] of three channels.
pub(super) fn mix(a: [f64; 3], b: [f64; 3], f: f64) -> [f64; 3] {
    std::array::from_fn(|i| lerp(a[i], b[i], f))
}

/// Sorted points, of which only the first and the last are kept where more than two are at one position: the two sides of a step.
pub(super) fn outer_of_equal<P: Copy>(points: &[P], position: impl Fn(&P) -> f64) -> Vec<P> {
    let is_at = |i: usize, j: usize| position(&points[i]) == position(&points[j]);
    let is_between = |i: usize| i > 0 && i + 1 < points.len() && is_at(i - 1, i + 1);
    (0..points.len()).filter(|&i| !is_between(i)).map(|i| points[i]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(points: &[(f64, f64)]) -> ColorMap {
        let points = points.iter().map(|&(position, g)| ColorPoint { position, rgb: [g; 3] }).collect();
        ColorMap::new("test", points, None).unwrap()
    }

    #[test]
    fn positions_are_stretched_to_the_unit_interval() {
        let m = map(&[(-10.0, 0.0), (0.0, 0.5), (30.0, 1.0)]);
        assert_eq!(m.points().iter().map(|p| p.position).collect::<Vec<_>>(), [0.0, 0.25, 1.0]);
        assert_eq!(map(&[(-f64::MAX, 0.0), (f64::MAX, 1.0)]).eval(0.5), [0.5; 3]);
        assert_eq!(map(&[(7.0, 0.3)]).eval(0.9), [0.3; 3]);
    }

    #[test]
    fn a_step_has_two_sides_and_reversing_swaps_them() {
        let m = map(&[(0.0, 0.0), (0.5, 0.25), (0.5, 0.4), (0.5, 0.75), (1.0, 1.0)]);
        assert_eq!(m.points().len(), 4);
        assert_eq!(m.eval_sides(0.5), [[0.25; 3], [0.75; 3]]);
        assert_eq!(m.reversed().eval_sides(0.5), [[0.75; 3], [0.25; 3]]);
        assert_eq!((m.reversed().name(), m.reversed().reversed()), ("test_r", m.clone()));
        assert_eq!((m.eval(-3.0), m.eval(3.0)), ([0.0; 3], [1.0; 3]));
    }

    #[test]
    fn bad_points_are_errors() {
        let new = |points: Vec<(f64, f64)>| {
            let points = points.iter().map(|&(position, g)| ColorPoint { position, rgb: [g; 3] }).collect();
            ColorMap::new("bad", points, None)
        };
        assert!(new(vec![]).is_err());
        assert!(new(vec![(0.0, 1.5)]).is_err());
        assert!(new(vec![(0.0, f64::NAN)]).is_err());
        assert!(new(vec![(f64::INFINITY, 0.0)]).is_err());
        let error = new(vec![(1.0, 0.0), (0.0, 0.0)]).unwrap_err().to_string();
        assert!(error.contains("'bad'") && error.contains("point 1"), "{error}");
    }
}
