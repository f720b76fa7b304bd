//! Ensembles on more than the scalar, as true tables (dissertation 7.3): members that keep their axes.
//!
//! At one gradient magnitude and one coefficient of variation an ensemble is a curve over the scalar, exactly, and that of all
//! blending rules ([`Ensemble::curve_on`]). A [`GridTable`] has these curves at places of both axes: wherever a member changes
//! at once, just before it and there; where one changes gradually, in 64 steps of the axis.

use super::{Context, Ensemble, Function, Line, Member, Reduction, Space};
use crate::node_table::{GridTable, Node, NodeTable};
use crate::transfer::TransferError;
use crate::transfer::curve::Curve;
use crate::transfer::table::OpacityKind;
use crate::transfer::widget::{GAP, line_of};
use rayon::prelude::*;

/// Places of an axis along which a member changes gradually: as many as a histogram has bins there, so that both meet at the
/// octaves between which an axis is not linear.
const STEPS: usize = 64;

/// Values that a table may have: 16 MiB of them. With more, scalars near to each other become one step.
const MOST_VALUES: usize = 1 << 20;

/// An axis beside the scalar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Second {
    Gradient,
    Cov,
}

impl Member {
    /// Whether it has axes beside the scalar and keeps them.
    fn keeps(&self, second: Second) -> bool {
        let axis = match self.space {
            Space::Scalar => None,
            Space::ScalarGradient => Some(Second::Gradient),
            Space::Cov | Space::ScalarCov => Some(Second::Cov),
        };
        self.enabled && self.reduction == Reduction::Keep && axis == Some(second)
    }

    /// The positions of its second axis between which it is linear, as far as it is anywhere.
    fn places(&self, kind: OpacityKind) -> Vec<f64> {
        let mut places = Vec::new();
        // Just before, and there.
        let add_edge = |places: &mut Vec<f64>, at: f64| places.extend([at - GAP, at]);
        let steps = |[lo, hi]: [f64; 2]| {
            let all = (0..=STEPS).map(|i| i as f64 / STEPS as f64);
            all.filter(move |at| lo < *at && *at < hi)
        };
        match (&self.function, self.space) {
            (Function::Widgets(widgets), Space::ScalarGradient | Space::ScalarCov) => {
                for (extent, is_gradual) in widgets.iter().map(|widget| widget.extent_of_y()) {
                    extent.iter().for_each(|&end| add_edge(&mut places, end));
                    places.extend(steps(extent).filter(|_| is_gradual));
                }
            }
            (function, _) => {
                let knots: Vec<f64> = match function {
                    Function::Widgets(widgets) => line_of(widgets, None, kind).knots().collect(),
                    Function::TransferFunction(tf) => {
                        let colors = tf.color_map().points().iter().map(|p| p.position);
                        colors.chain(tf.points().iter().map(|p| p.position)).collect()
                    }
                };
                knots.iter().for_each(|&knot| add_edge(&mut places, self.map.inverse(knot)));
                places.extend(self.map.points().iter().map(|p| p[0]));
                places.extend(steps([0.0, 1.0]));
            }
        }
        places
    }
}

/// The positions of an axis at which an ensemble's curves are taken, and the values there, strictly increasing.
fn places(ensembles: &[&Ensemble], second: Second, context: &Context) -> Result<(Vec<f64>, Vec<f64>), TransferError> {
    let members = || ensembles.iter().flat_map(|e| &e.members).filter(|member| member.keeps(second));
    let Some(first) = members().next() else { return Ok((vec![0.0], vec![0.0])) };
    let counts = match second {
        Second::Gradient => context.scalar_gradient,
        Second::Cov => context.scalar_cov,
    };
    let Some(counts) = counts else {
        return first.bad("has no histogram of its space, which says what its second axis covers");
    };
    let mut places: Vec<f64> = members().flat_map(|member| member.places(context.kind)).collect();
    places.push(0.0);
    places.retain(|at| (0.0..=1.0).contains(at));
    places.sort_by(f64::total_cmp);
    // Nearer than what editing leaves between two edges is one.
    places.dedup_by(|next, kept| *next - *kept < 0.5 * GAP);
    // An axis of one value has all its positions there; that of the value is 0.
    let mut both: Vec<(f64, f64)> = places.into_iter().map(|at| (at, counts.second_at(at))).collect();
    both.dedup_by(|next, kept| next.1 <= kept.1);
    Ok(both.into_iter().unzip())
}

impl Ensemble {
    /// Whether a member keeps axes beside the scalar: then [`Self::curve`] does not say all of it, [`Self::grid`] does.
    pub fn keeps_axes(&self) -> bool {
        self.members.iter().any(|member| member.keeps(Second::Gradient) || member.keeps(Second::Cov))
    }

    /// The table over the scalar, coefficients of variation (rows) and magnitudes of gradients (layers), for extinctions per world
    /// unit of length. Members that do not keep their axes are reduced first.
    ///
    /// # Errors
    /// As [`Self::curve`].
    pub fn grid(&self, context: &Context) -> Result<GridTable, TransferError> {
        grid_table(&[self], context, |line| self.curve_on(context, line))
    }
}

/// The table of what `curve_on` gives on lines along the scalar, with places for all of these ensembles: of two that go over
/// into each other, the union of their spaces (dissertation 7.4).
///
/// # Errors
/// Those of `curve_on`, and if a histogram is missing or the unit distance of the context is of no use.
pub fn grid_table(
    ensembles: &[&Ensemble],
    context: &Context,
    curve_on: impl Fn(&Line) -> Result<Curve, TransferError> + Sync,
) -> Result<GridTable, TransferError> {
    let (gradients, layers) = places(ensembles, Second::Gradient, context)?;
    let (covs, rows) = places(ensembles, Second::Cov, context)?;
    let lines: Vec<Line> =
        gradients.iter().flat_map(|&gradient| covs.iter().map(move |&cov| Line { gradient, cov })).collect();
    let table = |line: &Line| curve_on(line)?.node_table(context.unit_distance);
    let tables: Vec<NodeTable> = lines.par_iter().map(table).collect::<Result<_, _>>()?;
    let scalars = Columns::of(&tables, MOST_VALUES / tables.len());
    let values = tables.iter().flat_map(|table| scalars.0.iter().flat_map(|column| column.values(table))).collect();
    let axis = scalars.0.iter().flat_map(Column::scalars).collect();
    Ok(GridTable::new(axis, rows, layers, values)?)
}

/// One scalar of a grid, or both sides of a step.
struct Column {
    scalar: f64,
    /// Where the values of its left and its right side are read.
    from: [f64; 2],
    is_step: bool,
}

/// The scalars of a grid.
struct Columns(Vec<Column>);

impl Columns {
    /// The scalars of the nodes of all tables, `most` of them at most, two at a step; of no fewer than two.
    fn of(tables: &[NodeTable], most: usize) -> Self {
        let mut nodes: Vec<f64> = tables.iter().flat_map(|t| t.nodes().iter().map(|n| n.scalar)).collect();
        nodes.sort_by(f64::total_cmp);
        let is_step = |scalar: f64| tables.iter().any(|table| differ(sides(table, scalar)));
        let of_group = |group: &[f64]| {
            let (first, last) = (group[0], group[group.len() - 1]);
            // The scalar that most tables have a node at.
            let runs = group.chunk_by(|a, b| a == b).max_by_key(|run| run.len());
            Column {
                scalar: runs.map_or(first, |run| run[0]),
                from: [first, last],
                is_step: first < last || is_step(first),
            }
        };
        let columns: Vec<Column> = nodes.chunk_by(|a, b| a == b).map(of_group).collect();
        if columns.iter().map(|column| column.scalars().count()).sum::<usize>() <= most {
            return Self(columns);
        }
        let (lo, hi) = (nodes[0], nodes[nodes.len() - 1]);
        let cells = (most / 2).max(2) as f64 - 1.0;
        let cell = |scalar: f64| ((scalar - lo) / (hi - lo) * cells) as usize;
        Self(nodes.chunk_by(|a, b| cell(*a) == cell(*b)).map(of_group).collect())
    }
}

impl Column {
    fn scalars(&self) -> impl Iterator<Item = f64> + use<> {
        std::iter::repeat_n(self.scalar, if self.is_step { 2 } else { 1 })
    }

    /// Red, green, blue and extinction of a table here.
    fn values(&self, table: &NodeTable) -> impl Iterator<Item = [f32; 4]> + use<> {
        let [from_left, from_right] = self.from;
        let (left, right) = (sides(table, from_left)[0], sides(table, from_right)[1]);
        let value = |n: Node| {
            let [r, g, b] = n.rgb.map(|c| c as f32);
            // An extinction that single precision does not have is opaque at any length.
            [r, g, b, (n.tau as f32).min(f32::MAX)]
        };
        let first = if self.is_step { Some(value(left)) } else { None };
        first.into_iter().chain([value(right)])
    }
}

/// What a table has just left of a scalar, and there.
fn sides(table: &NodeTable, scalar: f64) -> [Node; 2] {
    let right = table.eval(scalar);
    let first = table.nodes().partition_point(|n| n.scalar < scalar);
    match table.nodes().get(first) {
        Some(left) if left.scalar == scalar => [*left, right],
        _ => [right; 2],
    }
}

fn differ([left, right]: [Node; 2]) -> bool {
    (left.rgb, left.tau) != (right.rgb, right.tau)
}

#[cfg(test)]
#[path = "grid_tests.rs"]
mod tests;
