//! Intersections of rays with planes.

use crate::camera::View;
use crate::mesh::Plane;
use crate::render::medium::Segment;
use crate::visibility::CutPlanes;
use glam::DVec3;

/// The planes of a scene in view coordinates.
pub(in crate::render) struct CutsInView {
    sections: Vec<PlaneInView>,
    clips: Vec<PlaneInView>,
    normals: Vec<DVec3>,
}

impl CutsInView {
    /// Converts planes in local coordinates of a mesh to a view in the same.
    pub(in crate::render) fn new(planes: &CutPlanes, view: &View) -> Self {
        let in_view = |planes: &[Plane]| planes.iter().map(|plane| PlaneInView::new(plane, view)).collect();
        let normals = planes.sections.iter().map(|section| section.normal).collect();
        Self { sections: in_view(&planes.sections), clips: in_view(&planes.clips), normals }
    }

    #[inline(always)]
    pub(in crate::render) fn is_empty(&self) -> bool {
        self.sections.is_empty() && self.clips.is_empty()
    }

    /// The depths between which clips leave a part of a segment, its ends included; `None` if they leave nothing.
    pub(in crate::render) fn left_of(&self, segment: &Segment) -> Option<[f64; 2]> {
        let [mut from, mut to] = segment.part;
        for clip in &self.clips {
            let (at_zero, slope) = clip.along(segment);
            let depth = -at_zero / slope;
            if slope > 0.0 {
                to = to.min(depth);
            } else if slope < 0.0 {
                from = from.max(depth);
            } else if at_zero > 0.0 {
                return None;
            }
        }
        (from <= to).then_some([from, to])
    }

    /// The next section on a segment between two depths, nearest first, equal depths in their order: its depth and its number, from 1.
    /// `last`: the previous result. A section at the far end of the segment belongs to the next cell.
    pub(in crate::render) fn next_section(
        &self,
        segment: &Segment,
        [from, to]: [f64; 2],
        last: (f64, usize),
    ) -> Option<(f64, usize)> {
        let depth = |section: &PlaneInView| {
            let (at_zero, slope) = section.along(segment);
            -at_zero / slope
        };
        // False for NaN.
        let is_met = |(depth, _): &(f64, usize)| *depth >= from && *depth <= to && *depth < segment.part[1];
        let met = self.sections.iter().map(depth).zip(1..).filter(is_met);
        met.filter(|met| *met > last).min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

impl CutsInView {
    /// Normal of a section, by its number from 1.
    pub(in crate::render) fn section_normal(&self, number: usize) -> DVec3 {
        self.normals[number - 1]
    }
}

/// A plane in view coordinates: the distance of a point (x, y, z) is x right + y up + z forward + offset.
struct PlaneInView {
    right: f64,
    up: f64,
    forward: f64,
    offset: f64,
    perspective: bool,
}

impl PlaneInView {
    fn new(plane: &Plane, view: &View) -> Self {
        let [right, up, forward] = [view.right, view.up, view.forward].map(|axis| plane.normal.dot(axis));
        Self { right, up, forward, offset: plane.distance(view.eye), perspective: view.perspective }
    }

    /// The distance from the plane along the ray of a segment: at depth 0, and its increase per unit of depth.
    #[inline(always)]
    fn along(&self, segment: &Segment) -> (f64, f64) {
        let beside = segment.line.px * self.right + segment.line.py * self.up;
        if self.perspective { (self.offset, beside + self.forward) } else { (self.offset + beside, self.forward) }
    }
}
