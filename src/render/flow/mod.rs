//! A field of vectors as textured splats (Xue and Crawfis 2004, after Crawfis and Max 1993).
//!
//! A splat lies at each site of a vector, a vertex or the centroid of a cell, as wide as the cells there. It has an icon along the projected
//! vector, and the icon's pattern drifts through the splat's window, which stays. docs/flow.md derives the formulas.
//!
//! ```text
//! for each site with a vector: its splat on the screen            splat.rs
//! splats in order of (depth, site)                                splats.rs
//! for each row of pixels: what each splat has there               rows.rs, lanes.rs
//! or as words for a GPU, which projects them, and lists them for
//! each tile of pixels                                             ready.rs
//! ```
//!
//! All fragments of a splat are at its centre's depth along the view direction, so that one order holds in every pixel. Those that hang out of
//! the cells that are shown are left out. They reach the cells as [`LayerFragments`](super::LayerFragments), which every renderer composites between
//! its segments. A GPU finds what its rays see of the splats by itself: the fragments of a frame take some hundred times the memory of its splats.

mod icon;
mod kernel;
mod lanes;
mod mixture;
mod names;
mod picture;
#[cfg(feature = "gpu")]
mod ready;
mod rows;
mod splat;
mod splats;
#[cfg(test)]
mod tests;
#[cfg(feature = "gpu")]
mod texels;

pub use icon::Icon;
pub(in crate::render) use icon::TEXELS;
pub use kernel::FlowVolume;
pub(crate) use kernel::Kernels;
pub(crate) use mixture::Mixture;
pub use mixture::{FlowIcons, Pattern, Thresholds};
pub use names::IconName;
pub use picture::{Picture, Unfit};
pub(in crate::render) use splat::{COMPRESSED, END, PIXEL};
pub use splats::FlowSplats;
#[cfg(all(test, feature = "gpu"))]
pub(in crate::render) use texels::{constants_of_drawing, constants_of_projecting};

use super::cpu::layers::{Inside, InsideFinder};
use super::surfaces::FieldBeside;
use crate::camera::View;
use crate::field::Association;
use crate::mesh::{Mesh, Plane, Symmetric};
use crate::random::{hash, unit};
use crate::task::Cancel;
use crate::visibility::CellSet;
use crate::words::words;
use glam::DVec3;
use icon::IconSums;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// How splats look.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlowStyle {
    /// The pattern.
    #[serde(default)]
    pub icon: Icon,
    /// Width of a splat's kernel, in root mean squares of the edges at its vertex.
    pub size: f64,
    /// Length of one period of the pattern, in world units; `None`: [`Self::EDGES`] of the mesh's edges.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// Opacity of the pattern where it is 1.
    pub opacity: f64,
    /// World length that a vector of length 1 moves in a unit of time.
    pub speed: f64,
    /// Number of splats, evenly through the volume; `None`: one at each vertex, or in each cell if the vectors are of cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splats: Option<u32>,
    /// What patterns of vectors nearly along the ray are.
    #[serde(default, skip_serializing_if = "FlowFidelity::is_usual")]
    pub fidelity: FlowFidelity,
    /// What shows the scalars.
    #[serde(default, skip_serializing_if = "FlowVolume::is_usual")]
    pub volume: FlowVolume,
}

/// What patterns are whose vector is nearly along the ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FlowFidelity {
    /// They go over into their mean, and do not spin as the vector turns.
    #[default]
    Smooth,
    /// They are compressed by three at most (Xue and Crawfis 2004, section 2.2), and spin.
    Paper,
}

words!(FlowFidelity, "there is no way of flow", ["smooth" = Smooth, "paper" = Paper]);

impl FlowFidelity {
    fn is_usual(&self) -> bool {
        *self == Self::default()
    }

    /// How much of a pattern is left at a foreshortening.
    pub(in crate::render) fn contrast(self, foreshortening: f64) -> f64 {
        match self {
            Self::Smooth => splat::smoothstep(foreshortening * COMPRESSED),
            Self::Paper => 1.0,
        }
    }
}

impl Default for FlowStyle {
    fn default() -> Self {
        Self {
            icon: Icon::default(),
            size: 0.5,
            length: None,
            opacity: 0.6,
            speed: 1.0,
            splats: None,
            fidelity: FlowFidelity::Smooth,
            volume: FlowVolume::Exact,
        }
    }
}

impl FlowStyle {
    /// Edges of the mesh (root mean square) that a period is long by default.
    pub const EDGES: f64 = 4.0;

    /// Splats up to which each can be told from the others.
    pub const FEW: u32 = 1000;

    /// Splats of which each can be seen in the volume of a mesh: at most [`Self::FEW`], which together fill as much of it as one for each vertex or
    /// cell that has a vector. They are wider, and their pattern is longer, by the cube root of how much fewer they are.
    pub fn few_on(mesh: &Mesh, sites: Association) -> Self {
        let usual = Self::default();
        let count = match sites {
            Association::Point => mesh.positions.local.len(),
            Association::Cell => mesh.topology.tets.len(),
        };
        let wider = (count as f64 / f64::from(Self::FEW)).cbrt();
        if wider <= 1.0 {
            return usual;
        }
        let length = wider * usual_period(mesh, sites) * mesh.positions.scale;
        Self { splats: Some(Self::FEW), size: wider * usual.size, length: Some(length), ..usual }
    }

    /// Colour of splats without a field: seen on black and on white.
    pub const COLOR: [f64; 3] = [1.0, 0.5, 0.1];

    /// Checks that all is in range.
    ///
    /// # Errors
    /// If size or length are not above zero and finite, the opacity is not in 0..=1, the speed is negative or not finite, or there is no splat.
    pub fn check(&self) -> Result<(), String> {
        let is_length = |length: f64| length > 0.0 && length.is_finite();
        if !is_length(self.size) {
            return Err(format!("splats of flow have a size of {}; it must be above zero", self.size));
        }
        if let Some(length) = self.length.filter(|length| !is_length(*length)) {
            return Err(format!("the pattern of flow has a length of {length}; it must be above zero"));
        }
        if !(0.0..=1.0).contains(&self.opacity) {
            return Err(format!("flow has an opacity of {}; it lies between 0 and 1", self.opacity));
        }
        if !(self.speed >= 0.0 && self.speed.is_finite()) {
            return Err(format!("flow has a speed of {}; it must be zero or above", self.speed));
        }
        if self.splats == Some(0) {
            return Err("flow has no splats; choose at least one, or leave their number out".to_owned());
        }
        Ok(())
    }
}

/// Colours of splats.
#[derive(Clone, Debug)]
pub enum FlowColors {
    /// One for all.
    One([f64; 3]),
    /// By a field with one scalar per vector.
    Of(FieldBeside),
}

/// How wide the splats of a mesh are.
#[derive(Debug)]
pub(crate) struct Shapes {
    /// What has the vectors: vertices, or cells.
    pub(in crate::render) sites: Association,
    /// [`Mesh::vertex_shapes`] or [`Mesh::cell_shapes`].
    pub(in crate::render) of_sites: Vec<Symmetric>,
    /// Root mean square of the edges at the sites; 0 without one.
    mean_edge: f64,
}

impl Shapes {
    pub(crate) fn of(mesh: &Mesh, sites: Association) -> Self {
        let of_sites = match sites {
            Association::Point => mesh.vertex_shapes(),
            Association::Cell => mesh.cell_shapes(),
        };
        let traces = of_sites.iter().map(|[xx, _, _, yy, _, zz]| xx + yy + zz);
        let mean_edge = (traces.sum::<f64>() / of_sites.len().max(1) as f64).sqrt();
        Self { sites, of_sites, mean_edge }
    }
}

/// The splats of a frame.
#[derive(Clone, Debug)]
pub struct FlowScene {
    pub(crate) style: FlowStyle,
    /// Icons in place of the style's.
    pub(crate) mixture: Option<Mixture>,
    pub(crate) mesh: Arc<Mesh>,
    /// The components of the vectors, one per site.
    pub(crate) vectors: [Arc<Vec<f32>>; 3],
    /// The way that each site's flow has travelled since the first step: the integral of the vectors' lengths over time.
    pub(crate) travel: Arc<Vec<f64>>,
    /// The time after that for which each vector's flow has gone on, and the time over which the pattern is averaged.
    pub(crate) held: HeldFlow,
    pub(crate) colors: FlowColors,
    /// What the splats show of the scalars, if they are the volume.
    pub(crate) kernels: Option<Kernels>,
    pub(crate) shapes: Arc<Shapes>,
    /// The cells that are shown. Outside of them nothing is drawn, unless the splats are the volume.
    pub(crate) cells: Arc<CellSet>,
    /// [`inside`] of the view that is drawn, if it is known.
    pub(crate) inside: Option<Arc<Inside>>,
    /// Whether each site is a cell that is shown, or a vertex of one.
    pub(crate) shown: Arc<Vec<bool>>,
    /// Ascending sites with a splat; `None`: all.
    pub(crate) chosen: Option<Arc<Vec<u32>>>,
    /// Half spaces in which nothing is shown (local coordinates).
    pub(crate) clips: Vec<Plane>,
}

impl FlowScene {
    /// Splats of vectors at the vertices of a mesh, or in its cells, all of them shown.
    pub fn new(
        mesh: Arc<Mesh>,
        sites: Association,
        style: FlowStyle,
        vectors: [Arc<Vec<f32>>; 3],
        travel: Arc<Vec<f64>>,
    ) -> Self {
        let shapes = Arc::new(Shapes::of(&mesh, sites));
        let shown = Arc::new(vec![true; shapes.of_sites.len()]);
        let cells = Arc::new(CellSet::all(mesh.topology.tets.len()));
        let colors = FlowColors::One(FlowStyle::COLOR);
        let held = HeldFlow::default();
        Self {
            style,
            mixture: None,
            mesh,
            vectors,
            travel,
            held,
            colors,
            kernels: None,
            shapes,
            cells,
            inside: None,
            shown,
            chosen: None,
            clips: Vec::new(),
        }
    }

    /// The sites of splats, ascending.
    pub(in crate::render) fn sites(&self) -> Vec<u32> {
        match &self.chosen {
            Some(chosen) => (**chosen).clone(),
            None => (0..self.shapes.of_sites.len() as u32).collect(),
        }
    }

    /// Where a site is, in local coordinates: a vertex, or the centroid of a cell.
    pub(in crate::render) fn center(&self, site: u32) -> DVec3 {
        let positions = &self.mesh.positions;
        match self.shapes.sites {
            Association::Point => positions.local[site as usize].as_dvec3(),
            Association::Cell => {
                let [a, b, c, d] = positions.corners(self.mesh.topology.tets[site as usize]).map(|p| p.as_dvec3());
                0.25 * (a + b + c + d)
            }
        }
    }

    /// Length of a period in local units.
    pub(in crate::render) fn period(&self) -> f64 {
        match self.style.length {
            Some(length) => length / self.mesh.positions.scale,
            None => FlowStyle::EDGES * self.shapes.mean_edge,
        }
    }

    /// The vector of a site.
    pub(in crate::render) fn vector(&self, site: u32) -> DVec3 {
        DVec3::from_array(self.vectors.each_ref().map(|of| f64::from(of[site as usize])))
    }

    /// Whether a site may have a splat.
    pub(in crate::render) fn shows(&self, site: u32) -> bool {
        let at = self.center(site);
        self.shown[site as usize] && !self.clips.iter().any(|clip| clip.distance(at) > 0.0)
    }

    /// The colour of a site; `None` if its scalar is not finite.
    pub(in crate::render) fn color(&self, site: u32) -> Option<[f64; 3]> {
        match &self.colors {
            FlowColors::One(color) => Some(*color),
            FlowColors::Of(FieldBeside { scalars, colors }) => {
                let scalar = f64::from(scalars.values()[site as usize]);
                scalar.is_finite().then(|| colors.eval(scalar).rgb)
            }
        }
    }

    /// Where in the pattern a splat's centre is, in periods along and across: by chance at first, and moved on by the flow.
    pub(in crate::render) fn phase(&self, site: u32) -> [f64; 2] {
        let [along, across] = [0, 1].map(|part| unit(hash(PHASES, 2 * u64::from(site) + part)));
        let periods = self.periods(self.travel[site as usize] + self.held.time * self.vector(site).length());
        // What is infinite has no place in the pattern.
        let moved = if periods.is_finite() { periods - periods.floor() } else { 0.0 };
        [(along - moved).rem_euclid(1.0), across]
    }

    /// Periods of the pattern that pass a splat's centre while the shutter is open.
    pub(in crate::render) fn blur(&self, site: u32) -> f64 {
        self.periods(self.held.shutter * self.vector(site).length())
    }

    /// Periods in a way that the flow has travelled.
    fn periods(&self, way: f64) -> f64 {
        way * self.style.speed / self.mesh.positions.scale / self.period()
    }

    /// Where fragments of a view in local coordinates are drawn; `None`: everywhere, as the edge of kernels is the volume's.
    pub(in crate::render) fn inside(&self, view: &View) -> Option<Arc<Inside>> {
        if self.kernels.is_some() {
            return None;
        }
        let found =
            || inside(&mut InsideFinder::default(), (&self.mesh, &self.cells), &self.clips, view, &Cancel::new());
        self.inside.clone().or_else(found)
    }
}

/// Where the rays of a view (local coordinates) are inside of the cells that are shown, or outside by [`ON_BOUNDARY`], and not clipped; `None` if
/// cancelled.
pub(crate) fn inside(
    finder: &mut InsideFinder,
    of: (&Arc<Mesh>, &Arc<CellSet>),
    clips: &[Plane],
    view: &View,
    cancel: &Cancel,
) -> Option<Arc<Inside>> {
    finder.find(of, clips, ON_BOUNDARY, view, cancel)
}

/// Local length by which a fragment may be outside of a face on which its splat lies.
///
/// Stored coordinates are of f32 within -1..=1, rounded by 2^-25 at most, and points by sqrt(3) times that: a vertex of a flat boundary lies off the
/// other vertices' plane by twice as much, less than 2^-23. What is left, 2^-26, is above f64's rounding of depths up to 2^24.
pub(in crate::render) const ON_BOUNDARY: f64 = 1.0 / (1u64 << 23) as f64;

/// A moment that is held while its flow goes on, in the series' unit of time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct HeldFlow {
    /// Time since the moment.
    pub(crate) time: f64,
    /// Time over which the pattern is averaged: that between two frames.
    pub(crate) shutter: f64,
}

/// The splats of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct FlowCounts {
    /// Those in view.
    pub(crate) splats: u64,
    /// Those of them whose pattern moves by more than a quarter of its period while the shutter is open.
    pub(crate) fast: u64,
    /// Their fragments that are left out, since they are outside of the cells.
    pub(crate) outside: u64,
}

impl FlowCounts {
    /// Whether a pattern that moves by so many periods from one frame to the next is too fast to be followed.
    pub(in crate::render) fn is_fast(periods: f64) -> bool {
        periods > FOLLOWED
    }
}

/// Periods between two frames up to which a pattern is seen to move: beyond a half it would run backwards.
pub(crate) const FOLLOWED: f64 = 0.25;

/// Seed of the places in the pattern.
const PHASES: u64 = 33;

/// The usual length of a period, in local units.
pub(crate) fn usual_period(mesh: &Mesh, sites: Association) -> f64 {
    FlowStyle::EDGES * Shapes::of(mesh, sites).mean_edge
}

/// The volume that each of `splats` sites with one stands for, or each of all sites; in local units.
pub(crate) fn volumes_of_splats(mesh: &Mesh, sites: Association, splats: Option<usize>) -> Vec<f64> {
    let volumes = volumes(mesh, sites);
    match splats.filter(|splats| *splats < volumes.len()) {
        Some(splats) => vec![volumes.iter().sum::<f64>() / splats as f64; volumes.len()],
        None => volumes,
    }
}

/// Volume of each site, in local units: that of a cell, or a quarter of each cell of a vertex.
fn volumes(mesh: &Mesh, sites: Association) -> Vec<f64> {
    let cells = (0..mesh.topology.tets.len() as u32).map(|cell| mesh.cell_volume(cell));
    if sites == Association::Cell {
        return cells.collect();
    }
    let mut volumes = vec![0.0; mesh.positions.local.len()];
    for (tet, volume) in mesh.topology.tets.iter().zip(cells) {
        tet.iter().for_each(|&vertex| volumes[vertex as usize] += 0.25 * volume);
    }
    volumes
}

/// Sites for a number of splats, ascending: evenly through the volume along the order of the sites, which is that of a curve. Fewer are a part
/// of more.
pub(crate) fn chosen(mesh: &Mesh, sites: Association, count: u32) -> Vec<u32> {
    let mut ends = volumes(mesh, sites);
    let all_sites = ends.len();
    if count as usize >= all_sites {
        return (0..all_sites as u32).collect();
    }
    let mut all = 0.0;
    ends.iter_mut().for_each(|end| {
        all += *end;
        *end = all;
    });
    let (mut is_chosen, mut found) = (vec![false; all_sites], Vec::with_capacity(count as usize));
    // Shares of the volume with mirrored digits (van der Corput): any first part of them is spread evenly.
    let shares = (0u32..).map(|index| f64::from(index.reverse_bits()) * (-32f64).exp2());
    let by_share = shares.map(|share| ends.partition_point(|end| *end <= share * all).min(all_sites - 1));
    // Large cells hold many shares: what is left over is taken in turn.
    for site in by_share.take(8 * all_sites).chain(0..all_sites) {
        if found.len() == count as usize {
            break;
        }
        if !std::mem::replace(&mut is_chosen[site], true) {
            found.push(site as u32);
        }
    }
    found.sort_unstable();
    found
}
