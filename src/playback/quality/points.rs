//! Frames drawn as points, with fewer of them.
//!
//! A coarser frame has the user's style with a smaller level of detail. Only `own` *exact* becomes `own` *ellipse*: enlarged cells cut each
//! other where ellipses add up. RMSE at a quarter of the fragments of a jet, SPX2 and the blunt fin: 0.048, 0.033 and 0.082 against 0.019,
//! 0.024 and 0.065; at a third of the time of a frame in full or less ellipses are off by less on all three. All ellipses of a mesh
//! take 1.4 to 2 times as long as all exact footprints, hence half the level of detail for about the same time. `gap` keeps its footprints: there
//! *exact* is off by least at any level (docs/points.md, table 3.2).
//!
//! At equal time a smaller image is off by less than fewer points, by factors of 2 to 40 (docs/points.md, *While something moves*): it
//! comes first. Where it saves little, as points are more than pixels, fewer points do.

use super::Quality;
use crate::render::points::{Compositing, Footprint, PointStyle};

/// The level of detail at which ellipses take about as long as all exact footprints.
const AS_EXACT: f64 = 0.5;

/// The style with about this share of the fragments of `full`, and of their time.
pub(super) fn coarser(full: PointStyle, share: f64) -> PointStyle {
    let lod = full.lod * share;
    match (full.footprint, full.compositing) {
        (Footprint::Exact, Compositing::Own) => {
            PointStyle { footprint: Footprint::Ellipse, lod: AS_EXACT * lod, ..full }
        }
        _ => PointStyle { lod, ..full },
    }
}

impl Quality {
    /// The quality of a frame in a style, if that in full has the style `full`: the inverse of [`Self::of_request`] for points. A style that
    /// is not a coarser one of `full` is itself in full.
    pub fn of_points(drawn: PointStyle, full: PointStyle) -> Self {
        let all = coarser(full, 1.0);
        let is_coarser = drawn != full && drawn == PointStyle { lod: drawn.lod, ..all } && drawn.lod <= all.lod;
        if is_coarser && all.lod > 0.0 { Self::Points(drawn.lod / all.lod) } else { Self::Exact }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::node_table::NodeTable;
    use crate::pipeline::{FaceDetail, FrameRequest, TetDraw};
    use crate::playback::quality::Family;
    use glam::DVec3;
    use std::sync::Arc;

    fn request(style: PointStyle) -> FrameRequest {
        let camera = Camera::default_for((DVec3::ZERO, DVec3::ONE)).unwrap();
        FrameRequest::new(0, camera, Arc::new(NodeTable::transparent()), (32, 24)).with_draw(TetDraw::Points(style))
    }

    #[test]
    fn a_coarser_frame_is_the_users_style_with_fewer_points_and_says_so() {
        let gap = PointStyle { compositing: Compositing::Gap, ..PointStyle::EXACT };
        let half = PointStyle { lod: 0.5, ..PointStyle::EXACT };
        for full in [PointStyle::EXACT, PointStyle::BALLS, gap, half, PointStyle { lod: 0.3, ..PointStyle::BALLS }] {
            assert_eq!(Quality::of_points(full, full), Quality::Exact);
            for quality in Family::Points.qualities().skip(1) {
                let Quality::Points(share) = quality else { panic!("{quality:?}") };
                let drawn = quality.of_request(request(full), FaceDetail::ALL).tets().unwrap().draw.drawn_by();
                let drawn = drawn.points().unwrap();
                let is_own_exact = (full.footprint, full.compositing) == (Footprint::Exact, Compositing::Own);
                let footprint = if is_own_exact { Footprint::Ellipse } else { full.footprint };
                let lod = full.lod * share * if is_own_exact { 0.5 } else { 1.0 };
                assert!((drawn.lod - lod).abs() < 1e-15, "{full:?} {share}: {drawn:?}");
                assert_eq!(drawn, PointStyle { footprint, lod: drawn.lod, ..full });
                let Quality::Points(again) = Quality::of_points(drawn, full) else { panic!("{full:?} {share}") };
                assert!((again - share).abs() < 1e-15, "{again} {share}");
            }
        }
        // A frame of an earlier style, and nothing at all.
        assert_eq!(Quality::of_points(PointStyle::EXACT, PointStyle::BALLS), Quality::Exact);
        assert_eq!(Quality::of_points(gap, PointStyle::EXACT), Quality::Exact);
        let none = PointStyle { lod: 0.0, ..PointStyle::EXACT };
        assert_eq!(Quality::of_points(coarser(none, 0.5), none), Quality::Exact);
    }

    #[test]
    fn only_points_become_fewer_points() {
        for draw in [TetDraw::Auto, TetDraw::Raycast, TetDraw::ALL_FACES, TetDraw::Reference] {
            let other = request(PointStyle::EXACT).with_draw(draw);
            assert_eq!(Quality::Points(0.5).of_request(other.clone(), FaceDetail::ALL), other);
        }
    }
}
