//! Finds the cells that planes intersect or clip.

use super::{Activity, CellSet, Pool};
use crate::mesh::{Mesh, Plane};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::{Arc, Weak};

/// Tolerance (local units): cells whose corners are this close to a plane count as on both sides. Renderers intersect rays with planes from
/// the eye, with a rounding of some 2^-50 of its distance: far less, up to distances of a million times the mesh.
const MARGIN: f64 = 1e-7;

/// Section and clip planes through a mesh, local coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CutPlanes {
    /// Planes whose section is shown.
    pub sections: Vec<Plane>,
    /// Clip planes: the side that the normal points to is hidden.
    pub clips: Vec<Plane>,
}

impl CutPlanes {
    /// Whether there are no planes.
    pub fn is_empty(&self) -> bool {
        self.sections.is_empty() && self.clips.is_empty()
    }

    /// Whether a clip plane hides all of a cell with these corners (local coordinates).
    fn cut_away(&self, corners: [Vec3; 4]) -> bool {
        let corners = corners.map(|corner| corner.as_dvec3());
        self.clips.iter().any(|clip| corners.iter().all(|&corner| clip.distance(corner) > MARGIN))
    }

    /// Whether a section plane intersects a cell with these corners.
    fn cross(&self, corners: [Vec3; 4]) -> bool {
        let corners = corners.map(|corner| corner.as_dvec3());
        self.sections.iter().any(|section| {
            let distances = corners.map(|corner| section.distance(corner));
            distances.iter().any(|d| *d <= MARGIN) && distances.iter().any(|d| *d >= -MARGIN)
        })
    }

    /// Whether the clip planes leave any part of a mesh visible.
    pub fn leave_something_of(&self, mesh: &Mesh) -> bool {
        mesh.topology.tets.par_iter().any(|&tet| !self.cut_away(mesh.positions.corners(tet)))
    }
}

/// The cells that planes intersect and clip, cached while mesh and planes stay.
#[derive(Debug, Default)]
pub struct CutCells {
    of: Weak<Mesh>,
    planes: CutPlanes,
    /// Cells that a section plane intersects.
    crossed: CellSet,
    /// Cells that are clipped completely.
    away: CellSet,
    pool: Pool<CellSet>,
    /// Input sets and result of the last update.
    last: Option<([Weak<CellSet>; 2], Activity, u64)>,
}

impl CutCells {
    /// The cells that are visible with these planes: active ones and finite ones that a section intersects, except fully clipped ones
    /// unless `keep_away`. Also returns the number of active cells left out.
    pub fn update(
        &mut self,
        mesh: &Arc<Mesh>,
        planes: &CutPlanes,
        keep_away: bool,
        activity: Activity,
    ) -> (Activity, u64) {
        if self.of.as_ptr() != Arc::as_ptr(mesh) || self.planes != *planes {
            let (topology, positions) = (&mesh.topology, &mesh.positions);
            let corners = |cell: usize| positions.corners(topology.tets[cell]);
            self.crossed = CellSet::of(topology.tets.len(), |cell| planes.cross(corners(cell)));
            self.away = CellSet::of(topology.tets.len(), |cell| planes.cut_away(corners(cell)));
            (self.of, self.planes, self.last) = (Arc::downgrade(mesh), planes.clone(), None);
        }
        let of = [&activity.finite, &activity.active].map(Arc::downgrade);
        if let Some((last, cut, left_out)) = &self.last
            && !keep_away
            && std::iter::zip(last, &of).all(|(a, b)| a.ptr_eq(b))
        {
            return (Activity { classified: activity.classified, ..cut.clone() }, *left_out);
        }
        let Activity { finite, active, classified } = activity;
        let Self { crossed, away, pool, .. } = self;
        let mut left_out = 0;
        let cut = pool.make(|set| {
            set.resize(finite.universe());
            let words = set.words_mut().iter_mut().zip(active.words()).zip(finite.words());
            for (at, ((out, &active), &finite)) in words.enumerate() {
                let seen = active | crossed.words()[at] & finite;
                let away = if keep_away { 0 } else { away.words()[at] };
                left_out += u64::from((active & away).count_ones());
                *out = seen & !away;
            }
        });
        let active = if *cut == *active { active } else { cut };
        let active = if *active == *finite { finite.clone() } else { active };
        let cut = Activity { finite, active, classified };
        self.last = (!keep_away).then(|| (of, cut.clone(), left_out));
        (cut, left_out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::test_meshes::kuhn_grid;
    use glam::DVec3;

    fn mesh() -> Arc<Mesh> {
        Arc::new(Mesh::build(kuhn_grid([6, 5, 4])).unwrap().0)
    }

    fn plane(mesh: &Mesh, share: f64, normal: DVec3) -> Plane {
        let positions = &mesh.positions;
        let (lo, hi) = positions.local.iter().fold((Vec3::MAX, Vec3::MIN), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
        let point = lo.as_dvec3().lerp(hi.as_dvec3(), share);
        Plane::new(positions, positions.origin + positions.scale * point, normal).unwrap()
    }

    fn all(mesh: &Mesh) -> Activity {
        let all = Arc::new(CellSet::all(mesh.topology.tets.len()));
        Activity { finite: all.clone(), active: all, classified: 0 }
    }

    #[test]
    fn cells_behind_a_clip_are_left_out_and_those_on_a_section_are_there() {
        let mesh = mesh();
        let clip = plane(&mesh, 0.4, DVec3::new(1.0, 0.3, -0.2));
        let section = plane(&mesh, 0.3, DVec3::new(-1e-200, 0.0, 2e-200));
        let planes = CutPlanes { sections: vec![section], clips: vec![clip] };
        assert!(planes.leave_something_of(&mesh));
        let none = Arc::new(CellSet::none(mesh.topology.tets.len()));
        let transparent = Activity { active: none, ..all(&mesh) };
        let mut cut = CutCells::default();
        let (found, left_out) = cut.update(&mesh, &planes, false, transparent.clone());
        assert_eq!(left_out, 0, "nothing was active");
        let distances = |cell: u32, plane: &Plane| {
            mesh.positions.corners(mesh.topology.tets[cell as usize]).map(|p| plane.distance(p.as_dvec3()))
        };
        let cells = 0..mesh.topology.tets.len() as u32;
        for cell in cells.clone() {
            let (on, beyond) = (distances(cell, &section), distances(cell, &clip).iter().all(|d| *d > MARGIN));
            let crosses = on.iter().any(|d| *d <= MARGIN) && on.iter().any(|d| *d >= -MARGIN);
            assert_eq!(found.active.contains(cell), crosses && !beyond, "cell {cell}");
        }
        assert!(found.active.count() > 10);
        let (again, _) = cut.update(&mesh, &planes, false, transparent);
        assert!(Arc::ptr_eq(&again.active, &found.active), "known from before");
        let (found, left_out) = cut.update(&mesh, &planes, false, all(&mesh));
        assert_eq!(left_out as usize + found.active.count(), mesh.topology.tets.len());
        assert!(cells.clone().any(|cell| !found.active.contains(cell)) && found.active.count() > 10);
        let (kept, left_out) = cut.update(&mesh, &planes, true, all(&mesh));
        assert!(left_out == 0 && Arc::ptr_eq(&kept.active, &kept.finite));
    }

    #[test]
    fn planes_that_leave_nothing_are_known() {
        let mesh = mesh();
        let clip = |share, sign: f64| plane(&mesh, share, DVec3::new(sign, 0.0, 0.0));
        let leave = |clips: Vec<Plane>| CutPlanes { sections: Vec::new(), clips }.leave_something_of(&mesh);
        assert!(leave(vec![clip(0.6, 1.0), clip(0.4, -1.0)]));
        // Beyond one end of the mesh, and beyond the other.
        assert!(!leave(vec![clip(-0.1, 1.0)]) && !leave(vec![clip(1.1, -1.0)]));
    }
}
