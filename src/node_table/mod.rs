//! [`NodeTable`]: the transfer function used by every renderer but the reference, which evaluates the formula where a job has one;
//! [`JointTable`]: a transfer function of more than the scalar, for the reference too; [`TransferTable`]: either of them.

mod joint;
mod thinned;
mod transfer_table;

pub use joint::{JointAxis, JointTable, JointTableError};
use serde::{Deserialize, Serialize};
pub use thinned::THINNED_TOLERANCE;
pub use transfer_table::TransferTable;

/// One node of a [`NodeTable`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Node {
    /// Scalar value, in the field's unit.
    pub scalar: f64,
    /// Display-referred colour, not premultiplied, 0..=1.
    pub rgb: [f64; 3],
    /// Extinction per world unit of length; finite, >= 0.
    pub tau: f64,
}

/// A piecewise linear transfer function: nodes sorted by scalar; between two nodes colour and extinction are linear; two nodes at one
/// scalar make a step (at the scalar itself the right one holds). Below the first and above the last node their values continue.
///
/// Widgets, ensembles, range maps and opacities are turned into nodes by `transfer`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Nodes")]
pub struct NodeTable {
    nodes: Vec<Node>,
}

/// The serialized form of a table.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Nodes {
    nodes: Vec<Node>,
}

impl TryFrom<Nodes> for NodeTable {
    type Error = NodeTableError;

    fn try_from(Nodes { nodes }: Nodes) -> Result<Self, NodeTableError> {
        Self::new(nodes)
    }
}

/// Why nodes do not make a table.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NodeTableError {
    /// There is no node.
    #[error("a transfer function needs at least one node")]
    Empty,
    /// A number is NaN or infinite, tau negative, or a colour outside 0..=1.
    #[error("node {0} has a value that is not finite, a negative extinction or a colour outside 0..1")]
    BadValue(usize),
    /// Nodes are not sorted by scalar.
    #[error("node {0} lies before the node in front of it")]
    NotSorted(usize),
    /// More than two nodes at one scalar.
    #[error("node {0} is the third at one scalar; two make a step, more have no meaning")]
    TripleNode(usize),
}

impl NodeTable {
    /// A table of these nodes.
    ///
    /// # Errors
    /// If they are empty, unsorted, not finite, out of range, or more than two at one scalar.
    pub fn new(nodes: Vec<Node>) -> Result<Self, NodeTableError> {
        if nodes.is_empty() {
            return Err(NodeTableError::Empty);
        }
        for (i, n) in nodes.iter().enumerate() {
            let colour_ok = n.rgb.iter().all(|c| (0.0..=1.0).contains(c));
            if !(n.scalar.is_finite() && n.tau.is_finite() && n.tau >= 0.0 && colour_ok) {
                return Err(NodeTableError::BadValue(i));
            }
            if i > 0 && n.scalar < nodes[i - 1].scalar {
                return Err(NodeTableError::NotSorted(i));
            }
            if i > 1 && n.scalar == nodes[i - 2].scalar {
                return Err(NodeTableError::TripleNode(i));
            }
        }
        Ok(Self { nodes })
    }

    /// A table without extinction.
    pub fn transparent() -> Self {
        Self { nodes: vec![Node { scalar: 0.0, rgb: [0.0; 3], tau: 0.0 }] }
    }

    /// The nodes, sorted by scalar.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Colour and extinction at a finite scalar (at a step, the right-hand side).
    pub fn eval(&self, scalar: f64) -> Node {
        let after = self.nodes.partition_point(|n| n.scalar <= scalar);
        let (Some(&hi), true) = (self.nodes.get(after), after > 0) else {
            return Node { scalar, ..if after == 0 { self.nodes[0] } else { self.nodes[after - 1] } };
        };
        Node::lerp(&self.nodes[after - 1], &hi, scalar)
    }

    /// Whether extinction is non-zero somewhere in the closed range `[lo, hi]`. Exact: nodes are compared, nothing is interpolated, so that
    /// a spike of any width counts, and the foot of a ramp however close to its transparent end.
    pub fn is_visible_in(&self, lo: f64, hi: f64) -> bool {
        let below = self.nodes.partition_point(|n| n.scalar < lo);
        let until = self.nodes.partition_point(|n| n.scalar <= hi);
        let reached = &self.nodes[below..until];
        // Beyond these nodes, the pieces in which the range begins and ends: each is visible if either of its ends is (a piece that the
        // range only touches at a node belongs to its neighbours).
        let begins = reached.first().is_none_or(|n| n.scalar > lo) && self.piece_shows(below);
        let ends = reached.last().is_none_or(|n| n.scalar < hi) && self.piece_shows(until);
        begins || ends || reached.iter().any(|n| n.tau > 0.0)
    }

    /// Whether there is extinction strictly between node `at - 1` and node `at`; beyond the first and the last node their values continue.
    fn piece_shows(&self, at: usize) -> bool {
        let shows = |at: usize| self.nodes.get(at).is_some_and(|n| n.tau > 0.0);
        shows(at) || at > 0 && shows(at - 1)
    }
}

impl Node {
    /// Linear interpolation between two nodes with different scalars.
    pub fn lerp(a: &Node, b: &Node, scalar: f64) -> Node {
        let f = (scalar - a.scalar) / (b.scalar - a.scalar);
        let mix = |x: f64, y: f64| x + (y - x) * f;
        Node { scalar, rgb: std::array::from_fn(|i| mix(a.rgb[i], b.rgb[i])), tau: mix(a.tau, b.tau) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Tables with steps, flat pieces, transparent pieces and ramps, over ranges near and far.
    pub(super) fn tables() -> impl Strategy<Value = NodeTable> {
        let value = prop_oneof![Just(0.0), Just(1.0), 0.0..1.0_f64];
        // A gap of 0 makes a step.
        let node = (prop_oneof![Just(0.0), 1e-6..1.0_f64, Just(1e3)], prop::array::uniform4(value));
        let offset = prop_oneof![Just(0.0), -10.0..10.0_f64, Just(1e6)];
        (offset, prop::collection::vec(node, 1..12)).prop_map(|(offset, nodes)| {
            let mut scalar: f64 = offset;
            let mut table: Vec<Node> = Vec::new();
            for (gap, [r, g, b, tau]) in nodes {
                scalar += gap;
                let is_third = table.len() > 1 && table[table.len() - 2].scalar == scalar;
                if !is_third {
                    table.push(Node { scalar, rgb: [r, g, b], tau: 30.0 * tau });
                }
            }
            NodeTable::new(table).unwrap()
        })
    }

    pub(super) fn values(node: &Node) -> [f64; 4] {
        [node.rgb[0], node.rgb[1], node.rgb[2], node.tau]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn between_two_nodes_values_go_from_one_to_the_other_and_never_back(
            table in tables(), shares in prop::collection::vec(0.0..1.0_f64, 1..12),
        ) {
            let mut shares = shares;
            shares.sort_by(f64::total_cmp);
            for pair in table.nodes().windows(2) {
                let (from, to) = (values(&pair[0]), values(&pair[1]));
                let mut last = from;
                for share in &shares {
                    let scalar = pair[0].scalar + share * (pair[1].scalar - pair[0].scalar);
                    // At a step, and where rounding reaches the next node, the next piece holds.
                    if scalar >= pair[1].scalar {
                        continue;
                    }
                    let now = values(&table.eval(scalar));
                    for i in 0..4 {
                        // A rounding of the larger end at most.
                        let slack = 4.0 * f64::EPSILON * from[i].max(to[i]);
                        let way = if to[i] >= from[i] { now[i] - last[i] } else { last[i] - now[i] };
                        prop_assert!(way >= -slack, "value {i} goes back at {scalar}: {last:?}, {now:?}");
                        prop_assert!((from[i].min(to[i]) - slack..=from[i].max(to[i]) + slack).contains(&now[i]));
                    }
                    last = now;
                }
            }
        }

        #[test]
        fn nodes_are_met_exactly_and_hold_on_outside(table in tables(), beyond in 1e-3..1e9_f64) {
            let nodes = table.nodes();
            for (i, node) in nodes.iter().enumerate() {
                let right = nodes.get(i + 1).filter(|next| next.scalar == node.scalar).unwrap_or(node);
                prop_assert_eq!(values(&table.eval(node.scalar)), values(right), "at a step the right side holds");
            }
            let (first, last) = (nodes[0], nodes[nodes.len() - 1]);
            prop_assert_eq!(values(&table.eval(first.scalar - beyond)), values(&first));
            prop_assert_eq!(values(&table.eval(last.scalar + beyond)), values(&last));
        }

        #[test]
        fn what_is_seen_anywhere_in_a_range_makes_it_visible(table in tables(), ends in prop::array::uniform2(-0.1..1.1_f64)) {
            let nodes = table.nodes();
            let (lo, hi) = (nodes[0].scalar, nodes[nodes.len() - 1].scalar);
            let at = |share: f64| lo + share * (hi - lo + 1.0);
            let (from, to) = (at(ends[0].min(ends[1])), at(ends[0].max(ends[1])));
            // Extinction is linear between nodes: a piece without its ends shows something throughout or nowhere.
            let first = [f64::NEG_INFINITY, nodes[0].scalar, nodes[0].tau];
            let last = [nodes[nodes.len() - 1].scalar, f64::INFINITY, nodes[nodes.len() - 1].tau];
            let between = nodes.windows(2).map(|n| [n[0].scalar, n[1].scalar, n[0].tau.max(n[1].tau)]);
            let shows = between.chain([first, last]).any(|[a, b, tau]| a < to && b > from && tau > 0.0);
            let expected = shows || nodes.iter().any(|n| (from..=to).contains(&n.scalar) && n.tau > 0.0);
            prop_assert_eq!(table.is_visible_in(from, to), expected);
            for i in 0..=32 {
                let seen = table.eval(from + (to - from) * f64::from(i) / 32.0).tau > 0.0;
                prop_assert!(!seen || expected);
            }
        }
    }

    /// At the very foot of a ramp the extinction that is computed is zero by rounding; the one that is there is not.
    #[test]
    fn the_foot_of_a_ramp_is_visible_however_close_to_its_end() {
        let node = |scalar: f64, tau: f64| Node { scalar, rgb: [0.5; 3], tau };
        let table = NodeTable::new(vec![node(-0.05, 0.1), node(0.0, 0.0)]).unwrap();
        assert_eq!(table.eval(-1e-45).tau, 0.0, "what is interpolated says nothing is there");
        assert!(table.is_visible_in(-1e-45, 0.0) && table.is_visible_in(-1e-45, -1e-45));
        assert!(!table.is_visible_in(0.0, 0.0) && !table.is_visible_in(0.0, 1e9));
    }
}
