//! A table with fewer nodes, for approximate integration.

use super::{Node, NodeTable};

/// Largest error of a colour channel, and of the optical depth of the given length: this, or this share of the depth, whichever is larger.
pub const THINNED_TOLERANCE: f64 = 1.0 / 16_384.0;

/// Nodes are always kept such that they divide the range into at least this many parts, so that a changed node affects one part only.
const PARTS: f64 = 16.0;

impl NodeTable {
    /// The table with fewer nodes: within [`THINNED_TOLERANCE`] of the colours and of the optical depth of `length` everywhere.
    ///
    /// Steps and ends are kept, and nodes at which extinction begins, ends, turns or is zero.
    pub fn thinned(&self, length: f64) -> NodeTable {
        let kept: Vec<usize> = (0..self.nodes.len()).filter(|&i| self.is_kept(i)).collect();
        let mut nodes = vec![self.nodes[0]];
        for pair in kept.windows(2) {
            let mut start = pair[0];
            while start < pair[1] {
                start = self.farthest(start, pair[1], length);
                nodes.push(self.nodes[start]);
            }
        }
        NodeTable { nodes }
    }

    fn is_kept(&self, i: usize) -> bool {
        if i == 0 || i + 1 == self.nodes.len() {
            return true;
        }
        let [before, here, after] = [i - 1, i, i + 1].map(|i| &self.nodes[i]);
        let (lo, hi) = (self.nodes[0].scalar, self.nodes[self.nodes.len() - 1].scalar);
        let part = |n: &Node| (PARTS * ((n.scalar - lo) / (hi - lo))).floor();
        let turns = (here.tau - before.tau) * (after.tau - here.tau) <= 0.0 && [before.tau, after.tau] != [here.tau; 2];
        let is_edge = here.tau == 0.0 && (before.tau > 0.0 || after.tau > 0.0);
        let is_step = before.scalar == here.scalar || here.scalar == after.scalar;
        turns || is_edge || is_step || part(before) != part(here)
    }

    /// The last node up to `end` such that a straight line from node `start` passes all nodes in between within tolerance.
    fn farthest(&self, start: usize, end: usize, length: f64) -> usize {
        let from = &self.nodes[start];
        // Per channel the range of slopes of lines that pass the nodes so far.
        let (mut least, mut most) = ([f64::NEG_INFINITY; 4], [f64::INFINITY; 4]);
        let mut farthest = start + 1;
        for i in start + 1..=end {
            let node = &self.nodes[i];
            let width = node.scalar - from.scalar;
            let slopes = slopes(from, node, width);
            if (0..4).all(|c| (least[c]..=most[c]).contains(&slopes[c])) {
                farthest = i;
            }
            let slack = tolerance(node, length).map(|t| t / width);
            for c in 0..4 {
                least[c] = least[c].max(slopes[c] - slack[c]);
                most[c] = most[c].min(slopes[c] + slack[c]);
            }
            if (0..4).any(|c| least[c] > most[c]) {
                break;
            }
        }
        farthest
    }
}

/// Tolerances of red, green, blue and extinction at a node.
fn tolerance(node: &Node, length: f64) -> [f64; 4] {
    let of_color = THINNED_TOLERANCE;
    [of_color, of_color, of_color, THINNED_TOLERANCE * node.tau.max(1.0 / length)]
}

/// Slopes of red, green, blue and extinction from one node to another.
fn slopes(from: &Node, to: &Node, width: f64) -> [f64; 4] {
    let color = |c: usize| (to.rgb[c] - from.rgb[c]) / width;
    [color(0), color(1), color(2), (to.tau - from.tau) / width]
}

#[cfg(test)]
mod tests {
    use super::super::tests::{tables, values};
    use super::*;
    use proptest::prelude::*;

    /// Largest error of a channel of `b`, relative to the tolerance, at nodes of `a`.
    fn error(a: &NodeTable, b: &NodeTable, length: f64) -> f64 {
        let of = |node: &Node, sides: [Node; 2]| {
            let allowed = tolerance(node, length);
            let off = sides.map(|side| {
                (0..4).map(|c| (values(&side)[c] - values(node)[c]).abs() / allowed[c]).fold(0.0, f64::max)
            });
            off[0].min(off[1])
        };
        let sides = |scalar: f64| {
            let just_left = b.nodes().iter().find(|n| n.scalar == scalar).copied();
            [b.eval(scalar), just_left.unwrap_or_else(|| b.eval(scalar))]
        };
        a.nodes().iter().map(|n| of(n, sides(n.scalar))).fold(0.0, f64::max)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn it_is_within_tolerance_at_all_nodes_and_clear_where_the_table_is(table in tables(), length in 1e-3..1e3_f64) {
            let thinned = table.thinned(length);
            // Between nodes both are linear: the largest error is at a node. A rounding of each slope and of the line at the node.
            prop_assert!(error(&table, &thinned, length) <= 1.0 + 1e-9);
            for pair in table.nodes().windows(2) {
                let scalar = 0.5 * (pair[0].scalar + pair[1].scalar);
                prop_assert_eq!(table.is_visible_in(scalar, scalar), thinned.is_visible_in(scalar, scalar));
            }
            prop_assert!(NodeTable::new(thinned.nodes().to_vec()).is_ok());
        }
    }

    #[test]
    fn a_smooth_table_loses_most_of_its_nodes_and_more_would_be_noticed() {
        let wave = |i: usize| (i as f64 * 0.001).sin().abs();
        let node = |i: usize| Node { scalar: i as f64, rgb: [wave(i), 0.5, 0.25], tau: 3.0 * wave(i + 500) };
        let table = NodeTable::new((0..10_000).map(node).collect()).unwrap();
        let thinned = table.thinned(2.0);
        assert!(thinned.nodes().len() < 1500, "{}", thinned.nodes().len());
        let fewer: Vec<Node> = thinned.nodes().iter().step_by(3).chain(thinned.nodes().last()).copied().collect();
        assert!(error(&table, &NodeTable::new(fewer).unwrap(), 2.0) > 2.0);
        let straight =
            NodeTable::new((0..1000).map(|i| Node { scalar: i as f64, rgb: [0.5; 3], tau: i as f64 }).collect())
                .unwrap();
        assert!(straight.thinned(1.0).nodes().len() <= 18);
    }

    #[test]
    fn steps_turns_and_single_nodes_stay() {
        let node = |scalar: f64, tau: f64| Node { scalar, rgb: [0.5; 3], tau };
        for nodes in [
            vec![node(1.0, 2.0)],
            vec![node(1.0, 2.0), node(1.0, 3.0)],
            vec![node(0.0, 0.0), node(0.5, 1e-9), node(1.0, 0.0)],
            vec![node(0.0, 0.0), node(0.5, 0.0), node(0.5, 1e-9), node(1.0, 1e-9)],
            vec![node(-1e308, 1.0), node(0.0, 2.0), node(1e308, 1.0)],
        ] {
            let table = NodeTable::new(nodes).unwrap();
            assert_eq!(table.thinned(1.0), table);
        }
    }
}
