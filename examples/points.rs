//! The pictures of `docs/points.md`: `cargo run --release --example points -- FOLDER SPX.zarr SPX2.zarr FIN.zarr`, stores of the public
//! meshes. A soup and a cloud are generated.

use glam::DVec3;
use std::{env::args, error::Error, f64::consts::TAU, path::Path, sync::Arc};
use tetreel::camera::Camera;
use tetreel::field::{Component, SeriesSource};
use tetreel::image::{PngDepth, RgbaImage, amplified_difference, contact_sheet, write_png};
use tetreel::mesh::{Cells, Mesh, RawMesh};
use tetreel::node_table::{Node, NodeTable};
use tetreel::pipeline::{Backend, FrameRequest, Pipeline, TetDraw};
use tetreel::random::SplitMix64;
use tetreel::render::cpu::points::Points;
use tetreel::render::points::{Compositing, Footprint, PointScene, PointStyle};
use tetreel::render::{RenderJob, Renderer};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, RangePolicy, TransferFunction, build_node_table};
use tetreel::visibility::{CellSet, Drawn};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Side of the square images in pixels.
const SIDE: usize = 128;
const ELLIPSE: PointStyle = PointStyle { footprint: Footprint::Ellipse, ..PointStyle::EXACT };

/// A step of a stored series.
struct Scene {
    pipeline: Pipeline,
    request: FrameRequest,
}

impl Scene {
    fn of(store: &str, tf: &str) -> Result<Self> {
        let pipeline = Pipeline::open(&Store::open(store)?, None)?;
        let [lo, hi] = pipeline.field().range.ok_or("the field has no finite value")?.map(f64::from);
        let range = RangePolicy::Series.resolve((lo, hi), (lo, hi))?;
        let bounds = pipeline.mesh().positions.world_bounds();
        let table = table(tf, &range, bounds)?;
        let request = FrameRequest::new(0, camera(bounds)?, table, (SIDE, SIDE));
        Ok(Self { pipeline, request: FrameRequest { backend: Backend::Cpu, ..request } })
    }

    fn image(&mut self, draw: TetDraw) -> Result<RgbaImage> {
        Ok(self.pipeline.render(&self.request.clone().with_draw(draw))?.planes.color.clone())
    }

    fn points(&mut self, style: PointStyle) -> Result<RgbaImage> {
        self.image(TetDraw::Points(style))
    }

    /// The four footprints, as the dissertation composites them, and the truth.
    fn footprints(&mut self) -> Result<RgbaImage> {
        let shapes = [Footprint::Square, Footprint::Circle, Footprint::Ellipse, Footprint::Exact];
        let of = |footprint| PointStyle { footprint, compositing: Compositing::Gap, ..PointStyle::EXACT };
        let mut images = shapes.into_iter().map(|shape| self.points(of(shape))).collect::<Result<Vec<_>>>()?;
        images.push(self.image(TetDraw::Raycast)?);
        Ok(sheet(&images))
    }

    /// All fragments, half, a quarter and 15 % of them.
    fn levels(&mut self) -> Result<RgbaImage> {
        let of = |lod| PointStyle { lod, ..ELLIPSE };
        Ok(sheet(&[1.0, 0.5, 0.25, 0.15].map(of).into_iter().map(|of| self.points(of)).collect::<Result<Vec<_>>>()?))
    }

    /// The truth, gaps and cells by themselves, and twice the difference of each from the truth.
    fn cavity(&mut self) -> Result<RgbaImage> {
        let truth = self.image(TetDraw::Raycast)?;
        let gap = self.points(PointStyle { compositing: Compositing::Gap, ..PointStyle::EXACT })?;
        let own = self.points(PointStyle::EXACT)?;
        let off =
            |image: &RgbaImage| Ok::<_, Box<dyn Error>>(amplified_difference(image, &truth, [0.0; 3], Some(2.0))?.0);
        let differences = [off(&gap)?, off(&own)?];
        Ok(sheet(&[&[truth, gap, own], &differences[..]].concat()))
    }

    /// The truth, ellipses, and in green where cells lie whose spheres are narrower than a pixel.
    fn small(&mut self) -> Result<RgbaImage> {
        let mut images = vec![self.image(TetDraw::Raycast)?, self.points(ELLIPSE)?];
        let request = self.request.clone().with_draw(TetDraw::Points(ELLIPSE));
        let job = self.pipeline.prepare(&request)?;
        let (mesh, view) = (&job.mesh, &job.view);
        let half_pixel = view.half_height / view.height_px as f64;
        let is_small = |cell: &u32| {
            let corners = mesh.topology.tets[*cell as usize].map(|v| view.to_view(mesh.positions.world(v as usize)));
            let middle = corners.iter().sum::<DVec3>() / 4.0;
            let radius = corners.iter().fold(0.0, |most: f64, corner| most.max(corner.distance(middle)));
            radius < half_pixel * middle.z
        };
        let ids: Vec<u32> = (0..mesh.topology.tets.len() as u32).filter(is_small).collect();
        println!("  {} of {} cells are small", ids.len(), mesh.topology.tets.len());
        let green = NodeTable::new(vec![Node { scalar: 0.0, rgb: [0.1, 0.9, 0.2], tau: 1e6 }])?;
        let cells = Arc::new(Drawn { ids, is_complete: false });
        let points = Some(PointScene { cells, style: ELLIPSE });
        let small = Points::new().render(RenderJob { points, table: Arc::new(green), ..job })?.planes.color.clone();
        let over = small.pixels.iter().zip(&images[1].pixels);
        let pixels = over.map(|(a, b)| [0, 1, 2, 3].map(|c| a[c] + (1.0 - a[3]) * b[c])).collect();
        images.push(RgbaImage { pixels, ..small });
        Ok(sheet(&images))
    }
}

/// The usual camera, nearer.
fn camera(bounds: (DVec3, DVec3)) -> Result<Camera> {
    let usual = Camera::default_for(bounds)?;
    Ok(Camera { position: usual.focal_point + 0.62 * (usual.position - usual.focal_point), ..usual })
}

fn table(tf: &str, range: &MappedRange, (lo, hi): (DVec3, DVec3)) -> Result<Arc<NodeTable>> {
    let lengths = Lengths::of_diagonal((hi - lo).length());
    Ok(Arc::new(build_node_table(&TransferFunction::parse(tf)?, range, OpacityKind::Alpha, &lengths)?))
}

fn sheet(images: &[RgbaImage]) -> RgbaImage {
    contact_sheet(images, images.len(), 4, [0.0; 3])
}

/// All cells of a mesh as points.
fn drawn(mesh: Mesh, scalars: Vec<f32>, tf: &str) -> Result<RgbaImage> {
    let style = PointStyle::usual_of(&mesh);
    let bounds = mesh.frame();
    let ids: Vec<u32> = (0..mesh.topology.tets.len() as u32).collect();
    let table = table(tf, &MappedRange::new(0.0, 1.0, false)?, bounds)?;
    let active = Arc::new(CellSet::all(ids.len()));
    let view = camera(bounds)?.view(2 * SIDE, 2 * SIDE)?;
    let points = Some(PointScene { cells: Arc::new(Drawn { ids, is_complete: true }), style });
    let job = RenderJob { points, ..RenderJob::new(Arc::new(mesh), Arc::new(scalars), active, view, table) };
    Ok(Points::new().render(job)?.planes.color.clone())
}

/// Cells of a jet, each with vertices of its own and smaller than it was.
fn soup() -> Result<RgbaImage> {
    let jet = generate(&SynthSpec { cells: 1_500, steps: 9, ..SynthSpec::new(SeriesName::Jet) })?;
    let (raw, mut values) = (jet.mesh()?, Vec::new());
    jet.read(&jet.fields()[0], Component::Index(0), 8, &mut values)?;
    let (mut points, mut scalars) = (Vec::new(), Vec::new());
    for tet in &raw.cells.tets {
        let corners = tet.map(|v| raw.points[v as usize]);
        let middle = corners.iter().sum::<DVec3>() / 4.0;
        points.extend(corners.map(|corner| middle + 0.7 * (corner - middle)));
        scalars.extend(tet.map(|v| values[v as usize]));
    }
    let tets: Vec<[u32; 4]> = (0..raw.cells.tets.len() as u32).map(|cell| [0, 1, 2, 3].map(|i| 4 * cell + i)).collect();
    let (mesh, _) = Mesh::build(RawMesh { points, cells: tets.into() })?;
    let scalars = mesh.vertex_source.iter().map(|&v| scalars[v as usize]).collect();
    drawn(mesh, scalars, "inferno@0:0.03,0.3:0.1,1:0.8")
}

/// Particles around a ring, with a scalar by their place along it.
fn cloud() -> Result<RgbaImage> {
    let mut random = SplitMix64::new(3);
    let (mut points, mut radii, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..4_000 {
        let (along, wide) = (random.unit(), 0.5 * random.unit().sqrt());
        let around = TAU * (3.0 * along + random.unit() * 0.55);
        let (out, up) = (2.0 + wide * around.cos(), wide * around.sin());
        points.push(DVec3::new(out * (TAU * along).cos(), out * (TAU * along).sin(), up));
        radii.push(random.between(0.015, 0.05));
        values.push((0.5 + 0.5 * (TAU * along).sin()) as f32);
    }
    let cells = Cells { points: (0..points.len() as u32).collect(), radii, ..Cells::default() };
    let (mesh, _) = Mesh::build_cloud(&RawMesh { points, cells })?;
    let scalars = mesh.vertex_source.iter().map(|&v| values[v as usize]).collect();
    drawn(mesh, scalars, "plasma@0:0.6,1:0.6")
}

fn main() -> Result<()> {
    let words: Vec<String> = args().skip(1).collect();
    let [folder, spx, spx2, fin] = words.try_into().map_err(|_| "give FOLDER SPX.zarr SPX2.zarr FIN.zarr")?;
    let write = |what: &str, image: &RgbaImage| -> Result<()> {
        let path = Path::new(&folder).join(format!("points_{what}.png"));
        write_png(&path, image, Some([0.0; 3]), PngDepth::Eight)?;
        println!("{}", path.display());
        Ok(())
    };
    const DENSE: &str = "viridis@0:0.05,1:0.5";
    write("footprints", &Scene::of(&spx, DENSE)?.footprints()?)?;
    write("cavity", &Scene::of(&spx, DENSE)?.cavity()?)?;
    write("levels", &Scene::of(&spx2, DENSE)?.levels()?)?;
    write("small", &Scene::of(&fin, DENSE)?.small()?)?;
    write("without_mesh", &sheet(&[soup()?, cloud()?]))
}
