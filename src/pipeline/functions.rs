//! Functions at the vertices in place of cells.

use super::series::Series;
use super::{Backend, FrameRequest, RequestError, TetLayer};
use crate::field::Association;
use crate::functions::Kernels;
use crate::functions::eval::{Found, value_and_gradient_at};
use crate::functions::vertices::VertexFunctions;
use crate::mesh::Mesh;
use crate::render::functions::{FieldDomain, FunctionDomain, FunctionForm, FunctionScene, SheetStyle, SlopeLight};
use crate::render::surfaces::SurfaceShading;
use crate::store::FieldReader;
use glam::DVec3;
use std::sync::{Arc, OnceLock};

/// The functions at the vertices of a mesh, and where they are, once they are asked for; or why there are none.
#[derive(Clone, Debug, Default)]
pub(super) struct KeptFunctions {
    kernels: OnceLock<Result<Arc<Kernels>, String>>,
    /// In the order of [`FunctionDomain::ALL`].
    domains: [OnceLock<FieldDomain>; FunctionDomain::ALL.len()],
}

impl KeptFunctions {
    /// Where the functions are.
    fn domain(&self, domain: FunctionDomain, kernels: &Kernels) -> FieldDomain {
        *self.domains[domain as usize].get_or_init(|| FieldDomain::of(domain, kernels))
    }
}

/// Refuses what needs cells, or a GPU.
///
/// # Errors
/// The first of these that the layer or the request has, with what to do instead.
pub(super) fn check(series: &Series, layer: &TetLayer, request: &FrameRequest) -> Result<(), RequestError> {
    let is_cloud = series.mesh().is_cloud();
    if series.values_of() == Association::Cell && !is_cloud {
        let name = &series.field.name;
        let problem =
            format!("'{name}' has values of cells; import the series with --cells-to-points, or draw its cells");
        return Err(RequestError::OfFunctions(problem));
    }
    let is_of_mesh = !is_cloud && domain_of(series.mesh(), layer.functions) == FunctionDomain::Mesh;
    if is_cloud && layer.functions.domain == Some(FunctionDomain::Mesh) {
        let problem = "points without cells have no mesh to be inside of; choose --domain box or coverage";
        return Err(RequestError::OfFunctions(problem.to_owned()));
    }
    let chooses_cells = !layer.parts.is_empty() || layer.regions.is_some();
    if !is_of_mesh && chooses_cells {
        let problem = "parts and regions are of cells (--parts, --regions); leave them out, or choose --domain mesh";
        return Err(RequestError::OfFunctions(problem.to_owned()));
    }
    let needs = [
        (request.backend == Backend::Gpu, "it has no GPU (--backend gpu)"),
        (!layer.surfaces.is_empty(), "there are no isosurfaces (--iso)"),
        (!layer.cuts.is_empty(), "there are no cuts and crops (--cut, --crop)"),
        (!layer.domain.is_empty(), "there are no surfaces of the domain and of regions (--surface)"),
        (layer.table.joint().is_some(), "transfer functions are of the scalar alone"),
    ];
    match needs.into_iter().find(|(is_asked, _)| *is_asked) {
        Some((_, what)) => Err(RequestError::OfFunctions(format!(
            "{what}; leave that out, or draw its cells (--representation cells with another mode)"
        ))),
        None => Ok(()),
    }
}

/// Where the field is: inside the mesh, or by coverage where points have no cells, unless another domain is chosen.
fn domain_of(mesh: &Mesh, form: FunctionForm) -> FunctionDomain {
    form.domain.unwrap_or(if mesh.is_cloud() { FunctionDomain::Coverage } else { FunctionDomain::Mesh })
}

impl Series {
    /// The field of a step as functions at the vertices, in a style, a form and light.
    ///
    /// # Errors
    /// If the mesh has no functions, or those of the store cannot be used.
    pub(super) fn functions(
        &self,
        style: SheetStyle,
        form: FunctionForm,
        shading: &SurfaceShading,
    ) -> Result<FunctionScene, RequestError> {
        let kept = self.functions.kernels.get_or_init(|| self.find_functions());
        let kernels = kept.clone().map_err(RequestError::OfFunctions)?;
        let domain = domain_of(&self.mesh, form);
        let domain = self.functions.domain(domain, &kernels);
        let range = self.field.range.map_or(0.0, |[lo, hi]| f64::from(hi) - f64::from(lo));
        let around = || self.functions.domain(FunctionDomain::Box, &kernels).within().unwrap_or_default();
        let light = shading.lights_volume().then(|| SlopeLight::new(shading.towards_light(), around(), range));
        Ok(FunctionScene { domain, normalise: form.normalise, light, ..FunctionScene::new(kernels, style, range) })
    }

    /// What the functions give at a place in world coordinates for the values of vertices, in float64, with the gradient per world unit; `None`
    /// where none reaches, or the mesh has none.
    pub(crate) fn functions_at(&self, values: &[f32], world: DVec3) -> Option<Found<f64, DVec3>> {
        let kernels = self.functions.kernels.get_or_init(|| self.find_functions()).as_ref().ok()?;
        let positions = &self.mesh.positions;
        let found = value_and_gradient_at(kernels, values, positions.local_from_world(world))?;
        Some(Found { gradient: found.gradient / positions.scale, ..found })
    }

    /// The functions that the store has, else those that follow from the mesh.
    fn find_functions(&self) -> Result<Arc<Kernels>, String> {
        let stored = self.source.reader().map_or(Ok(None), FieldReader::functions);
        let stored = stored.and_then(|found| found.map(|found| found.kernels(&self.mesh)).transpose());
        match stored.map_err(|error| error.to_string())? {
            Some(kernels) => Ok(Arc::new(kernels)),
            None if self.mesh.is_cloud() => of_points(&self.mesh).map(Arc::new),
            None => of_vertices(&self.mesh).map(Arc::new),
        }
    }
}

fn of_vertices(mesh: &Mesh) -> Result<Kernels, String> {
    VertexFunctions::default().of(mesh).map(|found| found.kernels)
}

#[cfg(feature = "clouds")]
fn of_points(mesh: &Mesh) -> Result<Kernels, String> {
    crate::functions::points::PointFunctions::default().of(mesh)
}

/// A build without the feature `clouds` has no search for neighbours.
#[cfg(not(feature = "clouds"))]
fn of_points(_: &Mesh) -> Result<Kernels, String> {
    Err("this build without the feature clouds finds no neighbours of points".to_owned())
}

#[cfg(test)]
mod tests {
    use crate::camera::Camera;
    use crate::node_table::{Node, NodeTable};
    use crate::pipeline::{Backend, FrameRequest, Pipeline, TetDraw, test_series};
    use crate::render::functions::{SheetSpacing, SheetStyle};
    use crate::render::surfaces::Isosurface;
    use crate::visibility::Skip;
    use std::sync::Arc;

    fn request() -> FrameRequest {
        let camera = Camera::default_for(test_series::mesh().positions.world_bounds()).unwrap();
        let node = |scalar: f64, tau| Node { scalar, rgb: [1.0, scalar, 0.3], tau };
        let table = Arc::new(NodeTable::new(vec![node(0.0, 0.0), node(0.4, 0.0), node(1.0, 2.0)]).unwrap());
        FrameRequest::new(1, camera, table, (32, 24)).with_draw(TetDraw::Sheets(SheetStyle::default()))
    }

    #[test]
    fn functions_are_drawn_through_the_pipeline_the_same_with_and_without_skipping() {
        let mut pipeline = Pipeline::new(test_series::jet());
        let all = pipeline.render(&FrameRequest { skip: Skip::NONE, ..request() }).unwrap().clone();
        let fewer = pipeline.render(&request()).unwrap().clone();
        assert_eq!(all.planes, fewer.planes);
        assert!(fewer.stats.sheets > 0 && fewer.stats.functions_total > 0 && !fewer.stats.on_gpu);
        assert!(fewer.planes.color.pixels.iter().any(|p| p[3] > 0.01));
        let cells = pipeline.render(&request().with_draw(TetDraw::Raycast)).unwrap();
        assert_ne!(cells.planes, fewer.planes);
        let style = SheetStyle { spacing: SheetSpacing::Count(9) };
        let even = pipeline.render(&request().with_draw(TetDraw::Sheets(style))).unwrap();
        assert_ne!(even.planes, fewer.planes);
        // The request as text is the same request.
        let text = request().to_text().unwrap();
        assert_eq!(FrameRequest::from_text(&text).unwrap(), request());
    }

    #[test]
    fn what_needs_cells_or_a_gpu_is_refused_with_what_to_do() {
        let mut pipeline = Pipeline::new(test_series::jet());
        let mut refused = |request: FrameRequest| pipeline.render(&request).unwrap_err().to_string();
        let with_iso = request().with_tets(|tets| tets.surfaces = vec![Isosurface::new(0.5)]);
        assert!(refused(with_iso).contains("isosurfaces"));
        assert!(refused(FrameRequest { backend: Backend::Gpu, ..request() }).contains("no GPU"));
        let judged = request().with_draw(TetDraw::Judge).with_tets(|tets| tets.surfaces = vec![Isosurface::new(0.5)]);
        assert!(refused(judged).contains("isosurfaces"));
        let style = SheetStyle { spacing: SheetSpacing::Count(1) };
        assert!(refused(request().with_draw(TetDraw::Sheets(style))).contains("sheets"));
    }
}
