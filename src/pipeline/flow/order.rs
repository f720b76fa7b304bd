//! The second stage of flow: its fragments in a view.

use super::FlowValues;
use crate::camera::View;
use crate::field::{Association, Scalars};
use crate::mesh::{Mesh, Plane};
use crate::node_table::NodeTable;
use crate::pipeline::PipelineError;
use crate::render::LayerFragments;
use crate::render::cpu::layers::InsideFinder;
use crate::render::flow::{self, FlowCounts, FlowScene, FlowSplats, FlowVolume, Kernels, Shapes};
use crate::render::reference::flow_fragments;
use crate::stats::FrameStats;
use crate::task::Cancel;
use crate::visibility::CellSet;
use std::sync::{Arc, Weak};
use std::time::Instant;

/// The second stage of flow: fragments, and what they are found by from request to request.
#[derive(Debug, Default)]
pub(in crate::pipeline) struct OrderFlow {
    of: Weak<Mesh>,
    sites: Option<Association>,
    shapes: Option<Arc<Shapes>>,
    chosen: Option<(u32, Arc<Vec<u32>>)>,
    /// The volumes that splats stand for, for a number of them.
    volumes: Option<(Option<u32>, Arc<Vec<f64>>)>,
    cells: Weak<CellSet>,
    shown: Arc<Vec<bool>>,
    /// The fragments of the last frames.
    drawn: Vec<Arc<LayerFragments>>,
    /// Where rays are inside of these cells.
    inside: InsideFinder,
}

/// What draws a frame's splats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::pipeline) enum FlowBy {
    /// The judge.
    Judge,
    /// A renderer, which draws splats itself or needs their fragments.
    Renderer {
        /// Whether it draws splats itself.
        draws: bool,
    },
}

/// The splats of a frame, and the fragments of all of its other layers.
pub(in crate::pipeline) type Drawn = (Option<Arc<FlowSplats>>, Option<Arc<LayerFragments>>);

/// Frames whose fragments may be needed at once: one is rendered while the next one is ordered.
const FRAMES: usize = 2;

/// Most fragments whose memory is used again: 200 MB.
const MOST_KEPT: usize = 1 << 23;

impl OrderFlow {
    /// The splats of a view, and their fragments among those of other layers, unless the renderer draws splats; of the judge fragments alone.
    /// Splats are in the cells that are shown, or at their vertices; where they are the volume they show these scalars by this table.
    ///
    /// # Errors
    /// If they are too many, or `Cancelled`.
    pub(in crate::pipeline) fn draw(
        &mut self,
        values: FlowValues,
        (mesh, cells): (&Arc<Mesh>, &Arc<CellSet>),
        (scalars, table): (&Scalars, &Arc<NodeTable>),
        clips: &[Plane],
        (local_view, by, others): (&View, FlowBy, Option<Arc<LayerFragments>>),
        (stats, cancel): (&mut FrameStats, &Cancel),
    ) -> Result<Drawn, PipelineError> {
        let started = Instant::now();
        let FlowValues { style, held, sites, vectors, travel, mixture, colors } = values;
        if self.of.as_ptr() != Arc::as_ptr(mesh) || self.sites != Some(sites) {
            *self = Self { of: Arc::downgrade(mesh), sites: Some(sites), ..Self::default() };
        }
        if self.cells.as_ptr() != Arc::as_ptr(cells) {
            self.shown = Arc::new(shown(mesh, sites, cells));
            self.cells = Arc::downgrade(cells);
        }
        let kernels = (style.volume == FlowVolume::Splats).then(|| Kernels {
            scalars: scalars.clone(),
            table: table.clone(),
            volumes: self.volumes(mesh, sites, style.splats),
        });
        // The judge finds them itself.
        let inside = match kernels.is_some() || by == FlowBy::Judge {
            true => None,
            false => {
                let found = flow::inside(&mut self.inside, (mesh, cells), clips, local_view, cancel);
                Some(found.ok_or(PipelineError::Cancelled)?)
            }
        };
        let scene = FlowScene {
            style,
            mixture,
            mesh: mesh.clone(),
            vectors,
            travel,
            held,
            colors,
            kernels,
            shapes: self.shapes.get_or_insert_with(|| Arc::new(Shapes::of(mesh, sites))).clone(),
            cells: cells.clone(),
            inside,
            shown: self.shown.clone(),
            chosen: style.splats.map(|count| self.chosen(mesh, sites, count)),
            clips: clips.to_vec(),
        };
        let drawn = self.drawn_by(by, (&scene, local_view), others, stats)?;
        stats.ms_flow = started.elapsed().as_secs_f64() * 1e3;
        Ok(drawn)
    }

    /// What a renderer, or the judge, draws of a scene, among the fragments of other layers.
    fn drawn_by(
        &mut self,
        by: FlowBy,
        (scene, local_view): (&FlowScene, &View),
        others: Option<Arc<LayerFragments>>,
        stats: &mut FrameStats,
    ) -> Result<Drawn, PipelineError> {
        let told = |stats: &mut FrameStats, counts: FlowCounts, fragments: usize| {
            (stats.flow_splats, stats.flow_fast) = (counts.splats, counts.fast);
            (stats.flow_fragments, stats.flow_outside) = (fragments as u64, counts.outside);
        };
        let FlowBy::Renderer { draws } = by else {
            let (fragments, counts) = flow_fragments(scene, local_view)?;
            told(stats, counts, fragments.count());
            let fragments = Arc::new(fragments);
            let all = others.map_or_else(|| fragments.clone(), |others| Arc::new(others.with(&fragments)));
            return Ok((None, Some(all)));
        };
        let splats = scene.splats(local_view).among(others);
        if draws {
            self.release();
            #[cfg(feature = "gpu")]
            told(stats, splats.make_ready(), 0);
            return Ok((Some(Arc::new(splats)), None));
        }
        let (fragments, counts) = splats.fragments(self.spare())?;
        told(stats, counts, fragments.count());
        let fragments = Arc::new(fragments);
        if fragments.count() <= MOST_KEPT {
            self.drawn.push(fragments.clone());
        }
        let all = splats.with_others(fragments);
        Ok((Some(Arc::new(splats)), Some(all)))
    }

    /// Frees the fragments of frames that have been rendered: the layer is shown no more.
    pub(in crate::pipeline) fn release(&mut self) {
        self.drawn.clear();
    }

    /// Fragments of a frame that has been rendered.
    fn spare(&mut self) -> Option<LayerFragments> {
        let kept = self.drawn.len().saturating_sub(FRAMES);
        self.drawn.drain(..kept);
        let free = self.drawn.iter().position(|fragments| Arc::strong_count(fragments) == 1)?;
        Arc::into_inner(self.drawn.remove(free))
    }

    /// The sites of a number of splats.
    fn chosen(&mut self, mesh: &Mesh, sites: Association, count: u32) -> Arc<Vec<u32>> {
        let known = self.chosen.take().filter(|(of, _)| *of == count);
        let chosen = known.map_or_else(|| Arc::new(flow::chosen(mesh, sites, count)), |(_, chosen)| chosen);
        self.chosen = Some((count, chosen.clone()));
        chosen
    }

    /// The volumes that sites stand for, of a number of splats or of all.
    fn volumes(&mut self, mesh: &Mesh, sites: Association, count: Option<u32>) -> Arc<Vec<f64>> {
        let known = self.volumes.take().filter(|(of, _)| *of == count);
        let splats = count.map(|count| count as usize);
        let made = || Arc::new(flow::volumes_of_splats(mesh, sites, splats));
        let volumes = known.map_or_else(made, |(_, volumes)| volumes);
        self.volumes = Some((count, volumes.clone()));
        volumes
    }
}

/// Whether each site is a cell of a set, or a vertex of one.
fn shown(mesh: &Mesh, sites: Association, cells: &CellSet) -> Vec<bool> {
    if sites == Association::Cell {
        return (0..mesh.topology.tets.len() as u32).map(|cell| cells.contains(cell)).collect();
    }
    let mut shown = vec![false; mesh.positions.local.len()];
    for (_, tet) in mesh.topology.tets.iter().enumerate().filter(|(cell, _)| cells.contains(*cell as u32)) {
        tet.iter().for_each(|&vertex| shown[vertex as usize] = true);
    }
    shown
}
