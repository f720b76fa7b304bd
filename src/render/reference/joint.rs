//! Pieces of a segment through a [`JointTable`](crate::node_table::JointTable).

use crate::node_table::Node;
use crate::render::JointScene;
use crate::render::medium::Segment;

/// The segment, cut where the scalar meets a node, where the value at vertices meets a row, and where both together meet the diagonal of
/// a rectangle: table values at both ends of each piece, as limits from inside, and its share of the length.
pub(super) fn pieces(scene: &JointScene, segment: &Segment) -> Vec<(Node, Node, f64)> {
    let (table, cell_value) = (&scene.table, scene.cell_value(segment.cell));
    let (scalars, values) = (segment.part_scalar, segment.part_value());
    let scalar = |u: f64| scalars[0] + u * (scalars[1] - scalars[0]);
    let value = |u: f64| values[0] + u * (values[1] - values[0]);
    let meets = |axis: &[f64], near: f64, far: f64| -> Vec<f64> {
        let shares = axis.iter().map(|place| (place - near) / (far - near));
        shares.filter(|u| (0.0..=1.0).contains(u)).collect()
    };
    let mut cuts = vec![0.0, 1.0];
    cuts.extend(meets(table.scalars(), scalars[0], scalars[1]));
    cuts.extend(meets(table.vertex_axis(), values[0], values[1]));
    cuts.sort_by(f64::total_cmp);
    let mut diagonals = Vec::new();
    for pair in cuts.windows(2) {
        // The piece lies in one rectangle, that of its middle.
        let middle = 0.5 * (pair[0] + pair[1]);
        let (Some([left, right]), Some([lower, upper])) =
            (around(table.scalars(), scalar(middle)), around(table.vertex_axis(), value(middle)))
        else {
            continue;
        };
        let above = |u: f64| (value(u) - lower) / (upper - lower) - (scalar(u) - left) / (right - left);
        let share = above(pair[0]) / (above(pair[0]) - above(pair[1]));
        if (0.0..=1.0).contains(&share) {
            diagonals.push(pair[0] + share * (pair[1] - pair[0]));
        }
    }
    cuts.extend(diagonals);
    cuts.sort_by(f64::total_cmp);
    let at = |u: f64| table.eval(scalar(u), value(u), cell_value);
    let longer = cuts.windows(2).filter(|pair| pair[1] > pair[0]);
    longer.map(|pair| line_between(pair[0], pair[1], at)).collect()
}

/// The axis positions that enclose a value.
fn around(axis: &[f64], at: f64) -> Option<[f64; 2]> {
    let above = axis.partition_point(|&place| place <= at);
    Some([*axis.get(above.checked_sub(1)?)?, *axis.get(above)?])
}

/// The limits of `at` at both ends of a piece on which it is linear, extrapolated from two points inside: at the ends it may have a step.
fn line_between(start: f64, end: f64, at: impl Fn(f64) -> Node) -> (Node, Node, f64) {
    let [first, second] = [0.25, 0.75].map(|f| at(start + f * (end - start)));
    let beyond = |a: f64, b: f64| 1.5 * a - 0.5 * b;
    let line = |a: &Node, b: &Node| Node {
        scalar: beyond(a.scalar, b.scalar),
        rgb: std::array::from_fn(|c| beyond(a.rgb[c], b.rgb[c])),
        // Rounding may leave slightly negative values at the foot of a ramp.
        tau: beyond(a.tau, b.tau).max(0.0),
    };
    (line(&first, &second), line(&second, &first), end - start)
}
