//! Scaling of scalars for the GPU.

use crate::node_table::NodeTable;

/// (scalar * prescale - offset) * scale: brings the scalars of a table into the range where f32 has most digits, and where none of
/// them is denormal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScalarMap {
    /// Factor that the CPU, which keeps denormals, has applied to scalars; a power of two.
    pub prescale: f64,
    /// Subtracted first; an f32, so that the difference to a scalar near it is exact.
    pub offset: f64,
    /// Factor after the subtraction; a power of two.
    pub scale: f64,
    /// Whether scalars are constant in cells: a scalar at a step of the table then has the side that it has on the CPU.
    pub of_cells: bool,
}

/// Places of a table beyond this are mapped to it.
const FAR: f64 = 3e38;

/// Larger or smaller scales would over- or underflow f32 in between.
const EXPONENT_MAX: i32 = 100;

impl ScalarMap {
    /// The map for a table whose scalars are multiplied by `prescale`.
    ///
    /// An offset is taken only if the nodes are far from zero compared with their distances: otherwise small scalars
    /// would lose digits.
    pub fn of_table(table: &NodeTable, prescale: f64) -> Self {
        let nodes = table.nodes();
        Self::of_range(nodes[0].scalar, nodes[nodes.len() - 1].scalar, prescale)
    }

    /// The map for nodes within a range.
    pub fn of_range(lo: f64, hi: f64, prescale: f64) -> Self {
        let (lo, hi) = (lo * prescale, hi * prescale);
        let is_far = lo.signum() == hi.signum() && lo.abs().min(hi.abs()) > hi - lo;
        let middle = f64::from((0.5 * lo + 0.5 * hi) as f32);
        let offset = if is_far && middle.is_finite() { middle } else { 0.0 };
        let largest = (lo - offset).abs().max((hi - offset).abs());
        let exponent = if largest > 0.0 { largest.log2().ceil() as i32 } else { 0 };
        let scale = 2f64.powi((-exponent).clamp(-EXPONENT_MAX, EXPONENT_MAX));
        Self { prescale, offset, scale, of_cells: false }
    }

    /// The mapped scalar.
    pub fn apply(self, scalar: f64) -> f64 {
        (scalar * self.prescale - self.offset) * self.scale
    }

    /// The mapped scalar by the steps in f32 of shaders (`view_transform.wgsl`), clamped to stay finite.
    pub fn seen(self, scalar: f32) -> f32 {
        let seen = (scalar * self.prescale as f32 - self.offset as f32) * self.scale as f32;
        seen.clamp(-1e30, 1e30)
    }

    /// The least mapped scalar that is at or above a place, as shaders see scalars.
    pub fn threshold(self, place: f64) -> f32 {
        let nearest = place as f32;
        self.seen(if f64::from(nearest) < place { nearest.next_up() } else { nearest })
    }

    /// A place of the table as shaders compare scalars with it: the nearest number to the mapped place, which only a constant scalar can
    /// meet; of cells its [threshold](Self::threshold).
    pub fn place(self, place: f64) -> f32 {
        // Mapped scalars end before the ends of the first and the last interval.
        let is_threshold = self.of_cells && place.is_finite();
        if is_threshold { self.threshold(place) } else { self.apply(place).clamp(-FAR, FAR) as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node_table::Node;

    const PLAIN: ScalarMap = ScalarMap { prescale: 1.0, offset: 0.0, scale: 1.0, of_cells: false };

    fn map(scalars: &[f64]) -> ScalarMap {
        let node = |&scalar: &f64| Node { scalar, rgb: [0.0; 3], tau: 1.0 };
        ScalarMap::of_table(&NodeTable::new(scalars.iter().map(node).collect()).unwrap(), 1.0)
    }

    #[test]
    fn a_range_far_from_zero_loses_its_offset_and_no_other_does() {
        assert_eq!(map(&[300.0, 300.5]), ScalarMap { offset: 300.25, scale: 4.0, ..PLAIN });
        assert_eq!(map(&[-1.0, 0.0, 3.0]), ScalarMap { scale: 0.25, ..PLAIN });
        assert_eq!(map(&[1e-6, 1e6]).offset, 0.0);
        assert_eq!(map(&[-7.0, -6.5]).offset, -6.75);
    }

    #[test]
    fn scalars_of_cells_have_their_sides_of_all_places() {
        let mut nearest_differs = 0;
        for scalars in [[0.1, 0.7], [0.3, 0.3], [300.1, 300.7], [1e-30, 2e-30], [-1e37, 0.7e37]] {
            let map = ScalarMap { of_cells: true, ..map(&scalars) };
            for place in scalars {
                let at = place as f32;
                for scalar in [at.next_down(), at, at.next_up()] {
                    let is_above = f64::from(scalar) >= place;
                    assert_eq!(map.seen(scalar) >= map.place(place), is_above, "{scalar} of {place}: {map:?}");
                    let nearest = ScalarMap { of_cells: false, ..map }.place(place);
                    nearest_differs += usize::from((map.seen(scalar) >= nearest) != is_above);
                }
            }
        }
        assert!(nearest_differs > 0, "the nearest number would do");
        let map = ScalarMap { of_cells: true, ..PLAIN };
        assert!(map.place(f64::INFINITY) > map.seen(f32::MAX) && map.place(f64::NEG_INFINITY) < map.seen(f32::MIN));
    }

    #[test]
    fn mapped_nodes_lie_within_one() {
        for scalars in [[1e-30, 2e-30], [-1e20, 5e20], [1e7, 1e7 + 64.0], [0.0, 0.0], [5.0, 5.0]] {
            let map = map(&scalars);
            assert!(scalars.iter().all(|&s| map.apply(s).abs() <= 1.0), "{scalars:?} {map:?}");
            assert_eq!(map.scale.log2().fract(), 0.0);
        }
    }
}
