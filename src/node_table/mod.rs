//! [`NodeTable`]: the transfer function as every renderer sees it, the reference included.

use serde::{Deserialize, Serialize};

/// One node of a [`NodeTable`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Node {
    /// Scalar value, in the field's unit.
    pub scalar: f64,
    /// Display-referred colour, not premultiplied, 0..=1.
    pub rgb: [f64; 3],
    /// Extinction per world unit of length; finite, >= 0.
    pub tau: f64,
}

/// A piecewise linear transfer function: nodes sorted by scalar; between two nodes colour and extinction are linear;
/// two nodes at one scalar make a step (at the scalar itself the right one holds). Below the first and above the last node
/// their values hold on.
///
/// Widgets, ensembles, range maps and opacities are turned into nodes by `transfer`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NodeTable {
    nodes: Vec<Node>,
}

/// Why nodes do not make a table.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NodeTableError {
    /// A table has at least one node.
    #[error("a transfer function needs at least one node")]
    Empty,
    /// A number is NaN or infinite, tau negative, or a colour outside 0..=1.
    #[error("node {0} has a value that is not finite, a negative extinction or a colour outside 0..1")]
    BadValue(usize),
    /// Nodes are sorted by scalar.
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

    /// Whether extinction is non-zero somewhere in the closed range `[lo, hi]`. Exact: decided from nodes, so that a spike
    /// of any width counts.
    pub fn is_visible_in(&self, lo: f64, hi: f64) -> bool {
        if self.eval(lo).tau > 0.0 || self.eval(hi).tau > 0.0 {
            return true;
        }
        let first = self.nodes.partition_point(|n| n.scalar < lo);
        self.nodes[first..].iter().take_while(|n| n.scalar <= hi).any(|n| n.tau > 0.0)
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
