//! The cells that are drawn as points, from frame to frame.

use super::PipelineError;
use crate::camera::View;
use crate::lod::{CellSelector, Ranking};
use crate::mesh::Mesh;
use crate::render::points::{PointScene, PointStyle};
use crate::stats::FrameStats;
use crate::task::Cancel;
use crate::visibility::{CellSet, DepthOrder, Drawn, Elements, Pool, Selection};
use std::sync::Arc;

/// Lists of the cells of successive frames.
#[derive(Debug)]
pub(super) struct PointLists {
    selector: CellSelector,
    depth: DepthOrder,
    /// The last list in the order of ids.
    last: Option<(Arc<Selection>, Arc<Drawn>)>,
    pool: Pool<Drawn>,
    /// Scratch memory.
    ends: Vec<u32>,
}

impl Default for PointLists {
    fn default() -> Self {
        let depth = DepthOrder::of(Elements::Cells);
        let (selector, last) = Default::default();
        Self { selector, depth, last, pool: Pool::default(), ends: Vec::new() }
    }
}

impl PointLists {
    /// The points of a frame: the active cells of the level of detail, the first of the ranking, in depth order if their fragments are not
    /// sorted. Without a ranking they come in the order of ids.
    ///
    /// # Errors
    /// `Cancelled`.
    pub(super) fn find(
        &mut self,
        (mesh, active, ranking): (&Arc<Mesh>, &Arc<CellSet>, Option<&Arc<Ranking>>),
        style: PointStyle,
        view: &View,
        cancel: &Cancel,
        stats: &mut FrameStats,
    ) -> Result<PointScene, PipelineError> {
        let count = style.points(active.count());
        let selection = self.selector.select(ranking, count, active);
        let cells = if style.exact_order {
            self.listed(selection)
        } else {
            let (sorts, skipped) = (self.depth.sorts(), self.depth.sorts_skipped());
            let drawn = self.depth.order(mesh, view.forward, &selection, cancel).ok_or(PipelineError::Cancelled)?;
            stats.face_sorts = self.depth.sorts() - sorts;
            stats.face_sorts_skipped = self.depth.sorts_skipped() - skipped;
            drawn
        };
        Ok(PointScene { cells, style })
    }

    /// The cells of a selection in the order of ids.
    fn listed(&mut self, selection: Arc<Selection>) -> Arc<Drawn> {
        if let Some((of, drawn)) = &self.last
            && Arc::ptr_eq(of, &selection)
        {
            return drawn.clone();
        }
        self.last = None;
        let ends = &mut self.ends;
        let drawn = self.pool.make(|drawn| drawn.list(&selection, ends));
        self.last = Some((selection, drawn.clone()));
        drawn
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::node_table::{Node, NodeTable};
    use crate::pipeline::{Backend, FrameRequest, Pipeline, TetDraw, test_series};
    #[cfg(feature = "gpu")]
    use crate::render::Frame;
    use crate::render::points::{Compositing, Footprint};
    use crate::visibility::Skip;

    const ELLIPSE: PointStyle = PointStyle { footprint: Footprint::Ellipse, ..PointStyle::EXACT };

    fn request(style: PointStyle) -> FrameRequest {
        let camera = Camera::default_for(test_series::mesh().positions.world_bounds()).unwrap();
        let node = |scalar: f64, tau| Node { scalar, rgb: [1.0, scalar, 0.3], tau };
        let nodes = vec![node(0.0, 0.0), node(0.4, 0.0), node(0.6, 2.0), node(1.0, 0.5)];
        let table = Arc::new(NodeTable::new(nodes).unwrap());
        let request = FrameRequest::new(1, camera, table, (32, 24)).with_draw(TetDraw::Points(style));
        FrameRequest { backend: Backend::Cpu, ..request }
    }

    #[test]
    fn lists_are_kept_while_nothing_changes_and_cells_are_sorted_only_for_an_inexact_order() {
        let (mesh, never) = (test_series::mesh(), Cancel::new());
        let active = Arc::new(CellSet::all(mesh.topology.tets.len()));
        let ranking = Arc::new(Ranking::of_cells(mesh.topology.tets.len(), 0));
        let (mut lists, mut stats) = (PointLists::default(), FrameStats::default());
        let view = request(ELLIPSE).camera.view(32, 24).unwrap();
        for (lod, exact_order) in [(1.0, true), (0.5, true), (1.0, false), (0.5, false)] {
            let style = PointStyle { lod, exact_order, ..ELLIPSE };
            let mut found = || {
                let of = (&mesh, &active, Some(&ranking).filter(|_| lod < 1.0));
                lists.find(of, style, &view, &never, &mut stats).unwrap().cells
            };
            let (first, second) = (found(), found());
            assert!(Arc::ptr_eq(&first, &second));
            assert_eq!(first.ids.len(), style.points(active.count()));
            assert_eq!(first.is_complete, lod == 1.0);
            assert_eq!(first.ids.is_sorted(), exact_order);
            assert_eq!((stats.face_sorts, stats.face_sorts_skipped), if exact_order { (0, 0) } else { (0, 1) });
        }
        assert!(lists.depth.sorts() > 0 && lists.depth.sorts_skipped() > 0);
    }

    #[test]
    fn points_by_importance_are_other_cells_more_of_which_change() {
        let series = test_series::jet();
        let never = Cancel::new();
        let denominator = crate::moments::CovDenominator::default();
        let measure = Some(denominator);
        let [even, important] = [None, measure].map(|of| series.cell_ranking(of, &never).unwrap().unwrap());
        assert!(Arc::ptr_eq(&important, &series.cell_ranking(measure, &never).unwrap().unwrap()));
        let variation = series.variation(denominator, &never).unwrap().unwrap();
        let change = |ranking: &Ranking| -> f64 {
            let first = &ranking.ids()[..ranking.ids().len() / 4];
            first
                .iter()
                .flat_map(|&cell| series.mesh().topology.tets[cell as usize])
                .map(|v| f64::from(variation[v as usize]))
                .sum()
        };
        assert!(change(&important) > 1.1 * change(&even), "{} {}", change(&important), change(&even));
        let mut pipeline = Pipeline::new(series);
        let style = PointStyle { lod: 0.5, ..ELLIPSE };
        let by_chance = pipeline.render(&request(style)).unwrap().clone();
        let by_importance = pipeline.render(&request(PointStyle { importance: measure, ..style })).unwrap().clone();
        assert_eq!(by_chance.stats.points_drawn, by_importance.stats.points_drawn);
        assert_ne!(by_chance.planes, by_importance.planes);
        // Where all are drawn, it makes no difference.
        let [a, b] = [None, measure]
            .map(|importance| pipeline.render(&request(PointStyle { importance, ..ELLIPSE })).unwrap().planes.clone());
        assert_eq!(a, b);
    }

    #[test]
    fn a_request_without_transparent_cells_is_the_same_picture() {
        let mut pipeline = Pipeline::new(test_series::jet());
        for style in [PointStyle::EXACT, ELLIPSE, PointStyle { compositing: Compositing::Gap, ..ELLIPSE }] {
            let all = pipeline.render(&FrameRequest { skip: Skip::NONE, ..request(style) }).unwrap().clone();
            let fewer = pipeline.render(&request(style)).unwrap();
            assert_eq!(all.planes, fewer.planes, "{style:?}");
            assert!(all.planes.color.pixels.iter().any(|p| p[3] > 0.01), "{style:?}");
            // Gaps end at points of any cells.
            let skips = style.compositing == Compositing::Own;
            assert_eq!(fewer.stats.points_drawn < all.stats.points_drawn, skips, "{style:?}");
        }
    }

    #[test]
    fn points_are_refused_with_isosurfaces_where_they_are_not_the_cells() {
        let mut pipeline = Pipeline::new(test_series::jet());
        let iso = crate::render::surfaces::Isosurface::new(0.5);
        let with_iso = |style| request(style).with_tets(|tets| tets.surfaces = vec![iso]);
        assert!(pipeline.render(&with_iso(ELLIPSE)).unwrap_err().to_string().contains("footprint exact"));
        let exact = pipeline.render(&with_iso(PointStyle::EXACT)).unwrap().clone();
        let walked = pipeline.render(&with_iso(PointStyle::EXACT).with_draw(TetDraw::Raycast)).unwrap();
        let apart = exact.planes.color.pixels.iter().flatten().zip(walked.planes.color.pixels.iter().flatten());
        assert!(apart.fold(0.0f32, |most, (a, b)| most.max((a - b).abs())) < 1e-4);
    }

    #[cfg(feature = "gpu")]
    #[test]
    fn the_gpu_draws_the_points_that_it_is_asked_for_and_the_cpu_those_that_it_cannot() {
        let mut pipeline = Pipeline::new(test_series::jet());
        if pipeline.check_backend(Backend::Gpu).is_err() {
            return;
        }
        let apart = |a: &Frame, b: &Frame| {
            let channels = a.planes.color.pixels.iter().flatten().zip(b.planes.color.pixels.iter().flatten());
            channels.fold(0.0f32, |most, (a, b)| most.max((a - b).abs()))
        };
        for style in [PointStyle::EXACT, ELLIPSE, PointStyle { lod: 0.5, ..ELLIPSE }] {
            let expected = pipeline.render(&request(style)).unwrap().clone();
            let found = pipeline.render(&FrameRequest { backend: Backend::Gpu, ..request(style) }).unwrap().clone();
            assert!(found.stats.on_gpu && !expected.stats.on_gpu);
            assert_eq!(found.stats.points_drawn, expected.stats.points_drawn);
            // The bound of all renderers; points of another shape are further away.
            assert!(apart(&found, &expected) <= 1e-3, "{style:?}: {}", apart(&found, &expected));
            let other = PointStyle { radius: 0.5, footprint: Footprint::Circle, ..style };
            assert!(apart(&found, pipeline.render(&request(other)).unwrap()) > 1e-3);
        }
        let lit = request(PointStyle::EXACT).with_tets(|tets| tets.shading.volume = true);
        let constant = [PointStyle::EXACT, ELLIPSE].map(|of| request(PointStyle { constant_scalar: true, ..of }));
        let constant = constant.map(|request| ("one scalar in each cell", request));
        for (what, request) in [("light on the volume", lit)].into_iter().chain(constant) {
            let by = |backend| FrameRequest { backend, ..request.clone() };
            let refused = pipeline.render(&by(Backend::Gpu)).unwrap_err();
            assert!(refused.to_string().contains(what), "{refused}");
            let expected = pipeline.render(&by(Backend::Cpu)).unwrap().planes.clone();
            let found = pipeline.render(&by(Backend::Auto)).unwrap();
            assert!(!found.stats.on_gpu && found.planes == expected, "{what}");
        }
    }
}
