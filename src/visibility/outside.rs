//! Finds the clusters outside of a view.
//!
//! One box test per cluster covers all of its cells (view-frustum culling of bounding volumes: Assarsson and Moller, "Optimized View
//! Frustum Culling Algorithms for Bounding Boxes", J. Graphics Tools 5 (2000); clusters are so few that a single level is enough).

use super::{CellSet, Clusters};
use crate::camera::View;
use glam::{DVec3, Vec3};

/// The clusters that a view needs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NeededClusters {
    /// Whether a ray may meet an active cell of each cluster of cells.
    pub cells: Vec<bool>,
    /// Whether such a cluster of cells uses each cluster of vertices.
    pub vertices: Vec<bool>,
    /// Number of clusters with active cells that no ray meets.
    pub outside: u64,
}

impl Clusters {
    /// Finds the clusters with an `active` cell that a ray of `view` (in the mesh's local coordinates) may pass through: in front of the
    /// eye in perspective, else anywhere on its line. Conservative by much more than the rounding of view coordinates.
    pub fn needed(&self, view: &View, active: &CellSet, out: &mut NeededClusters) {
        let sides = Sides::new(view);
        out.vertices.clear();
        out.vertices.resize(self.vertices.div_ceil(Self::VERTICES), false);
        out.cells.clear();
        out.outside = 0;
        // All cells of a cluster, but for its last few, fill words of the set.
        const WORDS: usize = Clusters::CELLS / 64;
        for ((bounds, cluster), words) in self.boxes.iter().zip(0..).zip(active.words().chunks(WORDS)) {
            let has_active = words.iter().any(|&word| word != 0);
            let is_outside = has_active && sides.have_outside(*bounds);
            out.outside += u64::from(is_outside);
            let is_needed = has_active && !is_outside;
            out.cells.push(is_needed);
            if is_needed {
                self.of_cluster(cluster).iter().for_each(|&cluster| out.vertices[cluster as usize] = true);
            }
        }
    }
}

/// The four side planes of the view volume, as `normal . (p - eye) <= distance` inside. In perspective nothing behind the eye is inside.
struct Sides {
    eye: DVec3,
    normals: [DVec3; 4],
    distances: [f64; 4],
    margin: f64,
}

impl Sides {
    fn new(view: &View) -> Self {
        let [right, up] = [(view.right, view.half_width), (view.up, view.half_height)].map(|(axis, half)| {
            if view.perspective { [axis - half * view.forward, -axis - half * view.forward] } else { [axis, -axis] }
        });
        let distances = if view.perspective {
            [0.0; 4]
        } else {
            [view.half_width, view.half_width, view.half_height, view.half_height]
        };
        // View coordinates and sheared ones are rounded by a few 2^-53 of the summed magnitudes.
        let magnitudes = (view.eye.length() + 4.0) * (1.0 + view.half_width + view.half_height);
        Self { eye: view.eye, normals: [right[0], right[1], up[0], up[1]], distances, margin: 1e-9 * magnitudes }
    }

    /// Whether a box lies wholly outside of one of the planes, by more than the margin.
    fn have_outside(&self, [least, greatest]: [Vec3; 2]) -> bool {
        let (least, greatest) = (least.as_dvec3(), greatest.as_dvec3());
        let (centre, half) = (0.5 * (least + greatest) - self.eye, 0.5 * (greatest - least));
        self.normals
            .iter()
            .zip(self.distances)
            .any(|(normal, distance)| normal.dot(centre) - normal.abs().dot(half) > distance + self.margin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use crate::mesh::Mesh;
    use crate::mesh::test_meshes::{Random, jittered, kuhn_grid};

    /// A mesh of several clusters.
    fn mesh() -> Mesh {
        Mesh::build(jittered(kuhn_grid([20, 20, 20]), &mut Random::new(3))).unwrap().0
    }

    /// Views in the mesh's local coordinates: inside, near and far, in any orientation, wide and narrow, in both projections.
    fn views() -> Vec<View> {
        let mut random = Random::new(17);
        let mut views = Vec::new();
        for i in 0..150 {
            let mut point = |reach: f64| reach * DVec3::new(random.signed(), random.signed(), random.signed());
            let (position, focal_point) = (point([0.8, 3.0, 1e4][i % 3]), point(1.0));
            let angle = [10.0, 60.0, 150.0][i / 3 % 3] * if i % 3 == 2 { 1e-4 } else { 1.0 };
            let projection = match i % 4 {
                0 => Projection::Parallel { scale: 0.3 },
                _ => Projection::Perspective { view_angle: angle },
            };
            let near = if i % 5 == 0 { 0.5 } else { 0.0 };
            let camera = Camera { position, focal_point, view_up: DVec3::Z, projection, near };
            views.push(camera.view(64, 48).unwrap());
        }
        views
    }

    /// Whether a point is within f64's accuracy of a ray through a pixel.
    fn is_seen(view: &View, p: DVec3) -> bool {
        let d = p - view.eye;
        let (x, y, w) = (view.right.dot(d), view.up.dot(d), view.forward.dot(d));
        let h = if view.perspective { w } else { 1.0 };
        h >= 0.0 && x.abs() <= view.half_width * h && y.abs() <= view.half_height * h
    }

    /// Whether a point of an active cell is visible but not in a needed cluster.
    fn misses(clusters: &Clusters, mesh: &Mesh, view: &View, active: &CellSet, needed: &NeededClusters) -> bool {
        let mut random = Random::new(1);
        (0..mesh.topology.tets.len()).filter(|&cell| active.contains(cell as u32)).any(|cell| {
            let corners = mesh.topology.tets[cell].map(|v| mesh.positions.local[v as usize].as_dvec3());
            let weights: [f64; 4] = std::array::from_fn(|_| 1.0 + random.signed());
            let sum: f64 = weights.iter().sum();
            let inside: DVec3 = corners.iter().zip(weights).map(|(&p, w)| p * (w / sum)).sum();
            let is_kept = needed.cells[cell / Clusters::CELLS];
            let has_vertices =
                mesh.topology.tets[cell].iter().all(|&v| needed.vertices[v as usize / Clusters::VERTICES]);
            corners.iter().chain([&inside]).any(|&p| is_seen(view, p)) && !(is_kept && has_vertices)
                || clusters.count() != needed.cells.len()
        })
    }

    #[test]
    fn what_is_seen_is_needed_and_much_is_not() {
        let mesh = mesh();
        let clusters = Clusters::new(&mesh);
        assert!(clusters.count() > 8);
        let mut some = CellSet::all(mesh.topology.tets.len());
        (0..some.universe() as u32 / 2).for_each(|cell| some.set(cell, false));
        let (mut outside, mut missed, mut needed) = (0, 0, NeededClusters::default());
        for (i, view) in views().iter().enumerate() {
            for active in [&CellSet::all(mesh.topology.tets.len()), &some] {
                clusters.needed(view, active, &mut needed);
                assert!(!misses(&clusters, &mesh, view, active, &needed), "view {i}: {view:?}");
                outside += needed.outside;
                // The comparison detects boxes that are too small.
                let mut small = Clusters::new(&mesh);
                for [least, greatest] in &mut small.boxes {
                    let inset = 0.3 * (*greatest - *least);
                    (*least, *greatest) = (*least + inset, *greatest - inset);
                }
                small.needed(view, active, &mut needed);
                missed += u32::from(misses(&small, &mesh, view, active, &needed));
            }
        }
        assert!(outside > 100 && missed > 20, "{outside} clusters outside, {missed} comparisons that notice");
    }

    #[test]
    fn clusters_without_active_cells_need_no_vertices() {
        let mesh = mesh();
        let (clusters, mut needed) = (Clusters::new(&mesh), NeededClusters::default());
        clusters.needed(&views()[1], &CellSet::none(mesh.topology.tets.len()), &mut needed);
        assert!(needed.outside == 0 && !needed.cells.contains(&true) && !needed.vertices.contains(&true));
        assert_eq!(
            (0..needed.vertices.len()).map(|c| clusters.vertices_in(c)).sum::<usize>(),
            mesh.positions.local.len()
        );
    }
}
