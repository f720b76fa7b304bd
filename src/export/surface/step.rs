//! The surface of a step.

use super::{Shape, SurfaceError};
use crate::error::{FileError, FileResult};
use crate::export::appended::Values;
use crate::export::stored::Group;
use crate::field::{Association, FieldInfo};
use crate::mesh::contour::{Domain, Surface};
use crate::mesh::{Plane, Positions, Topology};
use crate::render::surfaces::Cut;
use crate::store::{FieldReader, Store};
use glam::DVec3;
use rayon::prelude::*;

/// The surface of a step, as written to a file.
#[derive(Default)]
pub(super) struct StepSurface {
    /// Time of the step.
    pub time: f64,
    /// World coordinates.
    pub points: Vec<DVec3>,
    /// Vertex indices of the triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Whether triangles have isovalues.
    pub is_isosurface: bool,
    /// Isovalue of each triangle of isosurfaces.
    pub isovalues: Vec<f64>,
    /// Field values per point, and per triangle for fields of cells.
    pub fields: Vec<Values>,
    /// Number of triangles left out because their area is zero.
    pub dropped: u64,
}

/// Computes the surfaces of a store's steps.
pub(super) struct Steps<'a> {
    store: &'a Store,
    cuts: Cuts,
    topology: Topology,
    points: Vec<DVec3>,
    fields: Vec<(FieldInfo, Vec<Component>)>,
    /// Whether each vertex, and each cell, lacks a finite value; the latter is empty without fields of cells.
    missing: Vec<bool>,
    missing_cells: Vec<bool>,
}

/// A component of a field: its reader, and its values at the current step.
type Component = (FieldReader, Vec<f32>);

enum Cuts {
    Isovalues(Vec<f64>),
    /// Signed distance of each vertex from the plane.
    Plane(Vec<f64>),
    Boundary,
}

impl<'a> Steps<'a> {
    /// Reads the mesh. An isosurface uses the first field.
    pub fn new(store: &'a Store, shape: &Shape, groups: Vec<Group>) -> Result<Self, SurfaceError> {
        let mesh = store.mesh()?;
        if mesh.is_cloud() {
            let error = FileError::unsupported(store.path(), "mesh", "is of points alone, which have no surfaces");
            return Err(error.remedy("leave --iso, --slice and --surface out").into());
        }
        if !mesh.is_connected && matches!(shape, Shape::Boundary) {
            let problem = "was imported without connectivity, by which its surface is known";
            let error = FileError::unsupported(store.path(), "mesh", problem);
            return Err(error.remedy("import the series again with --connectivity full").into());
        }
        let (topology, positions) = (mesh.topology, mesh.positions);
        let points = match store.source_points()? {
            Some(points) => points,
            None => (0..positions.local.len()).into_par_iter().map(|v| positions.world(v)).collect(),
        };
        let cuts = match shape {
            Shape::Isovalues(values) => Cuts::Isovalues(values.clone()),
            Shape::Boundary => Cuts::Boundary,
            Shape::Plane(plane) => Cuts::Plane(distances(plane, &points, &positions)?),
        };
        let buffered = |reader: FieldReader| {
            let values = vec![0.0; reader.value_count()];
            (reader, values)
        };
        let has_cells = groups.iter().any(|group| group.info.association == Association::Cell);
        let missing_cells = vec![false; if has_cells { topology.tets.len() } else { 0 }];
        let field = |group: Group| (group.info, group.components.into_iter().map(buffered).collect());
        let fields = groups.into_iter().map(field).collect();
        Ok(Self { store, cuts, topology, missing: vec![false; points.len()], missing_cells, points, fields })
    }

    /// The surface of a step of the series.
    pub fn surface(&mut self, step: usize) -> FileResult<StepSurface> {
        self.missing.fill(false);
        self.missing_cells.fill(false);
        for (info, components) in &mut self.fields {
            let missing = match info.association {
                Association::Point => &mut self.missing,
                Association::Cell => &mut self.missing_cells,
            };
            for (reader, values) in components {
                reader.decode_step(step, values)?;
                let pairs = missing.par_iter_mut().with_min_len(1 << 14).zip(&*values);
                pairs.for_each(|(missing, value)| *missing |= !value.is_finite());
            }
        }
        let Self { topology, points, missing, missing_cells, .. } = &*self;
        let domain = Domain { topology, points, missing, missing_cells };
        let mut out = StepSurface { time: self.store.times().values[step], ..StepSurface::default() };
        out.is_isosurface = matches!(self.cuts, Cuts::Isovalues(_));
        out.fields = self.fields.iter().map(|(info, _)| Values::empty(info.clone())).collect();
        match &self.cuts {
            Cuts::Boundary => self.add(domain.boundary(), &mut out)?,
            Cuts::Plane(distances) => self.add(domain.section(distances), &mut out)?,
            Cuts::Isovalues(isovalues) => {
                let scalar = &self.fields[0].1[0].1;
                for &isovalue in isovalues {
                    self.add(domain.contour(|v| f64::from(scalar[v as usize]), isovalue), &mut out)?;
                    out.isovalues.resize(out.triangles.len(), isovalue);
                }
            }
        }
        Ok(out)
    }

    /// Appends a surface with its fields to `out`.
    fn add(&self, surface: Surface, out: &mut StepSurface) -> FileResult<()> {
        let Some(first) = u32::try_from(out.points.len() + surface.points.len()).ok().map(|_| out.points.len() as u32)
        else {
            let error =
                FileError::unsupported(self.store.path(), "", "a step has surfaces of more than 2^32 - 1 points");
            return Err(error.remedy("write fewer isovalues at a time"));
        };
        let mut values = Vec::new();
        for ((info, components), field) in self.fields.iter().zip(&mut out.fields) {
            for ((_, found), out) in components.iter().zip(&mut field.components) {
                match info.association {
                    Association::Point => {
                        surface.interpolate(found, &mut values);
                        out.extend_from_slice(&values);
                    }
                    Association::Cell => out.extend(surface.cells.iter().map(|&cell| found[cell as usize])),
                }
            }
        }
        out.points.extend(surface.points);
        out.triangles.extend(surface.triangles.into_iter().map(|t| t.map(|i| first + i)));
        out.dropped += surface.dropped;
        Ok(())
    }
}

/// Signed distances of points (world coordinates) from a plane, positive on the side of its normal, in local units.
///
/// # Errors
/// If no point, or every point, is at 0 or on the positive side: there is no section then.
fn distances(cut: &Cut, points: &[DVec3], positions: &Positions) -> Result<Vec<f64>, SurfaceError> {
    let plane = Plane::new(positions, cut.point.into(), cut.normal.into());
    // The origin is subtracted first, so that a mesh far from it keeps its precision.
    let distance = |plane: Plane, p: &DVec3| plane.distance((*p - positions.origin) / positions.scale);
    let found = plane.map(|plane| points.par_iter().map(|p| distance(plane, p)).collect::<Vec<f64>>());
    let meets = |found: &Vec<f64>| found.iter().any(|d| *d < 0.0) && found.iter().any(|d| *d >= 0.0);
    let (lo, hi) = positions.world_bounds();
    found.filter(meets).ok_or(SurfaceError::Missed { plane: *cut, lo: lo.to_array(), hi: hi.to_array() })
}
