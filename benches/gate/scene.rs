//! Scenes of kernels and ratios: a generated jet.

use glam::DVec3;
use std::error::Error;
use std::sync::Arc;
use tetreel::camera::Camera;
use tetreel::field::{Component, SeriesSource};
use tetreel::lod::{Ranking, Selector};
use tetreel::mesh::Mesh;
use tetreel::node_table::NodeTable;
use tetreel::render::RenderJob;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::Cancel;
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, TransferFunction, build_node_table};
use tetreel::visibility::{CellSet, DepthOrder, Drawn};

/// Transfer function in which every cell is visible.
pub const DENSE: &str = "viridis@0:0.05,1:0.5";
/// Transfer function in which few cells are visible.
pub const TENTS: &str = "viridis@0:0,0.2:0,0.25:0.3,0.3:0,0.48:0,0.53:0.5,0.58:0,0.72:0,0.8:0.8,0.88:0,1:0";
/// Range of the jet's scalars.
pub const RANGE: (f64, f64) = (0.0, 1.2);

/// A jet at some steps.
pub struct Jet {
    pub mesh: Arc<Mesh>,
    /// Scalars of the steps.
    pub scalars: Vec<Arc<Vec<f32>>>,
    bounds: (DVec3, DVec3),
}

impl Jet {
    /// A jet of about this number of cells, at these of nine steps.
    pub fn new(cells: u64, steps: &[usize]) -> Result<Self, Box<dyn Error>> {
        let jet = generate(&SynthSpec { cells, steps: 9, ..SynthSpec::new(SeriesName::Jet) })?;
        let (mesh, _) = Mesh::build(jet.mesh()?)?;
        let (mut values, mut scalars) = (Vec::new(), Vec::new());
        for &step in steps {
            jet.read(&jet.fields()[0], Component::Index(0), step, &mut values)?;
            scalars.push(Arc::new(mesh.vertex_source.iter().map(|&v| values[v as usize]).collect()));
        }
        let bounds = mesh.positions.world_bounds();
        Ok(Self { mesh: Arc::new(mesh), scalars, bounds })
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.mesh.topology.tets.len()
    }

    /// Unit distance: one per cent of the diagonal.
    pub fn unit_distance(&self) -> f64 {
        0.01 * (self.bounds.1 - self.bounds.0).length()
    }

    /// The table of a transfer function.
    pub fn table(&self, tf: &str) -> Result<Arc<NodeTable>, Box<dyn Error>> {
        let range = MappedRange::new(RANGE.0, RANGE.1, false)?;
        let table = build_node_table(
            &TransferFunction::parse(tf)?,
            &range,
            // Linear between points, so that tables are as short as possible: their length is not tested.
            OpacityKind::Extinction,
            &Lengths::of_unit_distance(self.unit_distance()),
        )?;
        Ok(Arc::new(table))
    }

    /// A job of all cells at the first step, square, `pixels` wide.
    pub fn job(&self, tf: &str, pixels: usize) -> Result<RenderJob, Box<dyn Error>> {
        let scalars = self.scalars.first().ok_or("no step was read")?.clone();
        let view = Camera::default_for(self.bounds)?.view(pixels, pixels)?;
        let active = Arc::new(CellSet::all(self.cells()));
        Ok(RenderJob::new(self.mesh.clone(), scalars, active, view, self.table(tf)?))
    }

    /// A job of a share of the interior faces, front to back.
    pub fn job_of_faces(&self, tf: &str, pixels: usize, share: f64) -> Result<RenderJob, Box<dyn Error>> {
        let job = self.job(tf, pixels)?;
        let ranking = Arc::new(Ranking::by_hash(&self.mesh.topology));
        let selection = Selector::default().select(&self.mesh, &ranking, share, &job.active);
        let drawn: Option<Arc<Drawn>> =
            DepthOrder::default().order(&self.mesh, job.view.forward, &selection, &Cancel::new());
        Ok(RenderJob { faces: Some(drawn.ok_or("cancelled")?), ..job })
    }
}
