//! Ensembles as joint tables (dissertation 7.3): members that keep their axes.
//!
//! At one gradient magnitude and one coefficient of variation an ensemble is exactly a curve over the scalar, whatever its blending rules
//! ([`Ensemble::curve_on`]). A [`JointTable`] has these curves at [`places`] of both axes.
//! A table with too many values has runs of scalars in place of scalars: a shell within a run stays visible, but its place and shape are
//! those of the run, and a narrow gap may be filled.

use super::places::{Second, places};
use super::{Context, Ensemble, Line};
use crate::node_table::{JointTable, Node, NodeTable};
use crate::transfer::TransferError;
use crate::transfer::curve::Curve;
use rayon::prelude::*;

/// Most values of a table: 16 MiB. With more, neighbouring scalars are merged into steps.
const MOST_VALUES: usize = 1 << 20;

/// Fewest scalars that a table has room for; fewer steps would not resemble a curve.
const LEAST_SCALARS: usize = 16;

impl Ensemble {
    /// Whether a member keeps axes beside the scalar: then [`Self::joint_table`] is needed, as [`Self::curve`] reduces it.
    pub fn keeps_axes(&self) -> bool {
        self.members.iter().any(|member| member.keeps(Second::Gradient) || member.keeps(Second::Cov))
    }

    /// The table over the scalar, coefficients of variation (table rows) and gradient magnitudes (table layers), with extinction per world
    /// unit of length. Members that do not keep their axes are reduced first.
    ///
    /// # Errors
    /// As [`Self::curve`].
    pub fn joint_table(&self, context: &Context) -> Result<JointTable, TransferError> {
        joint_table(&[self], context, |line| self.curve_on(context, line))
    }
}

/// The table of the curves that `curve_on` gives on lines along the scalar, at the places of all these ensembles: for two that are blended,
/// the union of their spaces (dissertation 7.4).
///
/// # Errors
/// The errors of `curve_on`, and if a histogram is missing, the unit distance of the context is not usable, or there are too many places.
pub fn joint_table(
    ensembles: &[&Ensemble],
    context: &Context,
    curve_on: impl Fn(&Line) -> Result<Curve, TransferError> + Sync,
) -> Result<JointTable, TransferError> {
    let (gradients, layers) = places(ensembles, Second::Gradient, context)?;
    let (covs, rows) = places(ensembles, Second::Cov, context)?;
    let most = MOST_VALUES / LEAST_SCALARS;
    if covs.len().saturating_mul(gradients.len()) > most {
        return Err(TransferError::TooManyPlaces { covs: covs.len(), gradients: gradients.len(), most });
    }
    let lines: Vec<Line> =
        gradients.iter().flat_map(|&gradient| covs.iter().map(move |&cov| Line { gradient, cov })).collect();
    let table = |line: &Line| curve_on(line)?.line_of_joint_table(&context.lengths);
    let tables: Vec<NodeTable> = lines.par_iter().map(table).collect::<Result<_, _>>()?;
    let columns = columns_of(&tables, MOST_VALUES / tables.len());
    let values = tables.iter().flat_map(|table| columns.iter().flat_map(|column| column.values(table))).collect();
    let axis = columns.iter().flat_map(Column::scalars).collect();
    Ok(JointTable::new(axis, rows, layers, values)?)
}

/// One scalar of a joint table, or both sides of a step.
struct Column {
    scalar: f64,
    /// The scalars at which its left and its right side are evaluated.
    from: [f64; 2],
    is_step: bool,
}

/// A node of a table.
#[derive(Clone, Copy, Debug)]
struct Knot {
    scalar: f64,
    tau: f64,
    /// Whether it is the first of two different nodes at one scalar.
    is_step: bool,
}

/// The scalars of a joint table: those of the nodes of all tables, at most `most` of them, two at a step.
///
/// With too many, runs of equally many neighbours become one step each, so that columns are dense where nodes are.
fn columns_of(tables: &[NodeTable], most: usize) -> Vec<Column> {
    let mut nodes: Vec<Knot> = tables.iter().flat_map(knots).collect();
    nodes.sort_by(|a, b| a.scalar.total_cmp(&b.scalar));
    let each: Vec<&[Knot]> = nodes.chunk_by(|a, b| a.scalar == b.scalar).collect();
    let columns: Vec<Column> = each.iter().map(|knot| Column::of(std::slice::from_ref(knot))).collect();
    if columns.iter().map(|column| column.scalars().count()).sum::<usize>() <= most {
        return columns;
    }
    let run = each.len().div_ceil((most / 2).max(1));
    each.chunks(run).map(Column::of).collect()
}

fn knots(table: &NodeTable) -> impl Iterator<Item = Knot> {
    table.nodes().iter().enumerate().map(move |(i, node)| {
        let is_step = table.nodes().get(i + 1).is_some_and(|next| next.scalar == node.scalar && next != node);
        Knot { scalar: node.scalar, tau: node.tau, is_step }
    })
}

impl Column {
    /// One column for a run of scalars, each given by its nodes: placed at the scalar with most nodes, among equals at that of largest
    /// extinction.
    fn of(knots: &[&[Knot]]) -> Self {
        let tau = |nodes: &[Knot]| nodes.iter().map(|node| node.tau).fold(0.0, f64::max);
        let order = |a: &&&[Knot], b: &&&[Knot]| a.len().cmp(&b.len()).then_with(|| tau(a).total_cmp(&tau(b)));
        let most = knots.iter().max_by(order).copied().unwrap_or_default();
        let scalar = |nodes: Option<&&[Knot]>| nodes.and_then(|nodes| nodes.first()).map_or(0.0, |node| node.scalar);
        Self {
            scalar: scalar(Some(&most)),
            from: [scalar(knots.first()), scalar(knots.last())],
            is_step: knots.len() > 1 || most.iter().any(|node| node.is_step),
        }
    }

    fn scalars(&self) -> impl Iterator<Item = f64> + use<> {
        std::iter::repeat_n(self.scalar, if self.is_step { 2 } else { 1 })
    }

    /// Red, green, blue and extinction of `table` in this column: left of its first scalar, if it is a step, and at its last one. A larger
    /// extinction in between replaces the larger of these two, so that nothing visible is lost.
    fn values(&self, table: &NodeTable) -> impl Iterator<Item = [f32; 4]> + use<> {
        let [from, to] = self.from;
        let (mut left, mut right) = (sides(table, from)[0], sides(table, to)[1]);
        let between = table.nodes().iter().skip(table.nodes().partition_point(|n| n.scalar < from));
        let between = between.take_while(|n| n.scalar <= to).chain([&left, &right]).copied();
        if let Some(peak) = between.max_by(|a, b| a.tau.total_cmp(&b.tau)).filter(|n| n.tau > left.tau.max(right.tau)) {
            *(if left.tau > right.tau { &mut left } else { &mut right }) = peak;
        }
        let value = |n: Node| {
            let [r, g, b] = n.rgb.map(|c| c as f32);
            // An extinction beyond f32 is opaque at any length.
            [r, g, b, (n.tau as f32).min(f32::MAX)]
        };
        self.is_step.then(|| value(left)).into_iter().chain([value(right)])
    }
}

/// The nodes of a table just left of a scalar, and at it.
fn sides(table: &NodeTable, scalar: f64) -> [Node; 2] {
    let right = table.eval(scalar);
    let first = table.nodes().partition_point(|n| n.scalar < scalar);
    match table.nodes().get(first) {
        Some(left) if left.scalar == scalar => [*left, right],
        _ => [right; 2],
    }
}

#[cfg(test)]
#[path = "joint_tests.rs"]
mod tests;
