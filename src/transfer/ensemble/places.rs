//! Places of a joint table: the positions on an ensemble's second axis at which curves are taken.
//!
//! Where a member has an edge there are two places, just before it and at it; where it changes gradually there are 64 evenly spaced ones
//! and those that these miss: opacity points, and points of colour maps where these bend too much in between.
//! The place before an edge is 2^-20 of the axis in front of it, the one behind it less than 2^-21. The built-in maps make 65 (gray) to 177
//! (turbo) places.

use super::{Context, Ensemble, Function, Member, Reduction, Space};
use crate::transfer::TransferError;
use crate::transfer::color_map::{ColorMap, mix};
use crate::transfer::function::TransferFunction;
use crate::transfer::opacity::OpacityKind;
use crate::transfer::tolerance::JOINT_TOLERANCE;
use crate::transfer::widget::{GAP, line_of};

/// Evenly spaced places of an axis along which a member changes gradually: as many as a histogram has bins there, so that both meet at the
/// octaves between which an axis is not linear.
const STEPS: usize = 64;

/// Places are rounded up to multiples of this, half the distance [`GAP`] between an edge and the place before it, so that this stays before
/// the edge. Places nearer to each other are merged into one, behind all of their edges.
const GRAIN: f64 = 0.5 * GAP;

/// An axis beside the scalar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Second {
    Gradient,
    Cov,
}

impl Member {
    /// Whether the member is enabled, has this second axis and keeps it.
    pub(super) fn keeps(&self, second: Second) -> bool {
        let axis = match self.space {
            Space::Scalar => None,
            Space::ScalarGradient => Some(Second::Gradient),
            Space::Cov | Space::ScalarCov => Some(Second::Cov),
        };
        self.enabled && self.reduction == Reduction::Keep && axis == Some(second)
    }

    /// The positions on its second axis between which it is linear, as far as it is anywhere.
    fn places(&self, kind: OpacityKind) -> Vec<f64> {
        match (&self.function, self.space) {
            (Function::Widgets(widgets), Space::ScalarGradient | Space::ScalarCov) => {
                let mut places = Vec::new();
                for (extent, is_gradual) in widgets.iter().map(|widget| widget.extent_of_y()) {
                    extent.iter().for_each(|&end| places.extend(edge(end)));
                    places.extend(steps().filter(|at| is_gradual && extent[0] < *at && *at < extent[1]));
                }
                places
            }
            (Function::Widgets(widgets), _) => {
                let line = line_of(widgets, None, kind);
                let is_step = |knot: f64| {
                    let [left, right] = line.sides(knot);
                    left != right
                };
                let knots = line.knots().flat_map(|knot| self.knot(knot, is_step(knot)));
                knots.chain(self.gradual()).collect()
            }
            (Function::TransferFunction(tf), _) => self.places_of(tf),
        }
    }

    /// The places at which a function of the second axis alone is sampled.
    fn gradual(&self) -> impl Iterator<Item = f64> {
        steps().chain(self.map.points().iter().map(|p| p[0]))
    }

    /// The place of a position on the member's axis, rounded so as not to lie before it.
    fn place_of(&self, position: f64) -> f64 {
        let at = self.map.inverse(position);
        if self.map.eval(at) < position { at.next_up() } else { at }
    }

    /// [`Self::place_of`] a point, preceded by the place before it if it is a step.
    fn knot(&self, position: f64, is_step: bool) -> impl Iterator<Item = f64> + use<> {
        edge(self.place_of(position)).into_iter().skip(usize::from(!is_step))
    }

    /// [`Self::places`] of a transfer function of the second axis alone.
    fn places_of(&self, tf: &TransferFunction) -> Vec<f64> {
        let mut places: Vec<f64> = self.gradual().collect();
        let position = |i: usize| tf.points().get(i).map(|p| p.position);
        for (i, point) in tf.points().iter().enumerate() {
            places.extend(self.knot(point.position, position(i + 1) == Some(point.position)));
        }
        let is_step = |at: f64| {
            let [left, right] = tf.color_map().eval_sides(at);
            left != right
        };
        let knots: Vec<f64> = tf.color_map().points().iter().map(|p| p.position).collect();
        places.extend(knots.iter().filter(|at| is_step(**at)).flat_map(|at| self.knot(*at, true)));
        let ends: Vec<f64> = steps().map(|at| self.map.eval(at)).collect();
        ends.windows(2).for_each(|ends| self.add_bends(tf.color_map(), &knots, [ends[0], ends[1]], &mut places));
        places
    }

    /// Adds points of a colour map between `ends`, positions of the member's axis, until linear interpolation along the second axis is
    /// within [`JOINT_TOLERANCE`] of its colours: the farthest point first, then in both parts.
    fn add_bends(&self, colors: &ColorMap, knots: &[f64], ends: [f64; 2], places: &mut Vec<f64>) {
        let [from, to] = ends.map(|position| self.map.inverse(position));
        let ([_, a], [b, _]) = (colors.eval_sides(ends[0]), colors.eval_sides(ends[1]));
        let off = |at: f64| {
            let line = mix(a, b, (self.map.inverse(at) - from) / (to - from));
            let sides = colors.eval_sides(at);
            sides.iter().flatten().zip(line.iter().cycle()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
        };
        let inside = knots.iter().filter(|at| ends[0] < **at && **at < ends[1]).map(|&at| (at, off(at)));
        let Some((farthest, error)) = inside.max_by(|a, b| a.1.total_cmp(&b.1)) else { return };
        if error > JOINT_TOLERANCE {
            places.push(self.place_of(farthest));
            self.add_bends(colors, knots, [ends[0], farthest], places);
            self.add_bends(colors, knots, [farthest, ends[1]], places);
        }
    }
}

/// The 64 evenly spaced places of an axis, and its end.
fn steps() -> impl Iterator<Item = f64> {
    (0..=STEPS).map(|i| i as f64 / STEPS as f64)
}

/// The places just before an edge and at it.
fn edge(at: f64) -> [f64; 2] {
    [at - GAP, at]
}

/// The positions of an axis at which an ensemble's curves are taken, and the values there, strictly increasing.
pub(super) fn places(
    ensembles: &[&Ensemble],
    second: Second,
    context: &Context,
) -> Result<(Vec<f64>, Vec<f64>), TransferError> {
    let members = || ensembles.iter().flat_map(|e| &e.members).filter(|member| member.keeps(second));
    let Some(first) = members().next() else { return Ok((vec![0.0], vec![0.0])) };
    let counts = match second {
        Second::Gradient => context.scalar_gradient,
        Second::Cov => context.scalar_cov,
    };
    let Some(counts) = counts else {
        return first.bad("has no histogram of its space, which says what its second axis covers");
    };
    let grain = |at: f64| (at / GRAIN).ceil() * GRAIN;
    let mut places: Vec<f64> = members().flat_map(|member| member.places(context.kind)).map(grain).collect();
    places.push(0.0);
    places.retain(|at| (0.0..=1.0).contains(at));
    places.sort_by(f64::total_cmp);
    // On an axis of one value only position 0 is kept.
    let mut both: Vec<(f64, f64)> = places.into_iter().map(|at| (at, counts.second_at(at))).collect();
    both.dedup_by(|next, kept| next.0 <= kept.0 || next.1 <= kept.1);
    Ok(both.into_iter().unzip())
}

#[cfg(test)]
#[path = "places_tests.rs"]
mod tests;
