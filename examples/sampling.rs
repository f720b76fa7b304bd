//! The pictures of `docs/sampling.md` and `docs/limitations.md`: rays cast, upsampled small images, quality at equal time, and details
//! missed by rays. `cargo run --release --example sampling [FOLDER [STORE.zarr [STEP [TF]]]]`; without a store it generates a jet first.
//! All pictures but the last two show that series, and their names begin with its name.

use glam::DVec3;
use std::{env::args, error::Error, path::Path, sync::Arc};
use tetreel::camera::{Camera, Projection};
use tetreel::image::{PngDepth, RgbaImage, amplified_difference, compare_raw, contact_sheet, write_png};
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::mesh::{Mesh, RawMesh};
use tetreel::node_table::{Node, NodeTable};
use tetreel::pipeline::{
    Backend, FaceDetail, FrameRequest, ImageScale, Pipeline, SampleSet, TetDraw, UpsampleKind, Upsampling,
};
use tetreel::render::cpu::raycast::Raycast;
use tetreel::render::{RenderJob, Renderer};
use tetreel::store::Store;
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};
use tetreel::transfer::{Lengths, OpacityKind, RangePolicy, TransferFunction, build_node_table};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Side of the square images in pixels.
const SIDE: usize = 512;
/// Side of the inset in pixels, and its magnification.
const INSET: usize = 128;
const MAGNIFIED: usize = 3;

struct Pictures {
    pipeline: Pipeline,
    request: FrameRequest,
    exact: RgbaImage,
}

impl Pictures {
    fn of(store: &Store, step: Option<usize>, tf: &str) -> Result<Self> {
        let mut pipeline = Pipeline::open(store, None)?;
        let step = step.unwrap_or(pipeline.times().len() / 2);
        let [lo, hi] = pipeline.field().range.ok_or("the field has no finite value")?.map(f64::from);
        let range = RangePolicy::Series.resolve((lo, hi), (lo, hi))?;
        let bounds = pipeline.mesh().positions.world_bounds();
        let lengths = Lengths::of_diagonal((bounds.1 - bounds.0).length());
        let table = build_node_table(&TransferFunction::parse(tf)?, &range, OpacityKind::Alpha, &lengths)?;
        let request = FrameRequest::new(step, Camera::default_for(bounds)?, Arc::new(table), (SIDE, SIDE));
        let request = FrameRequest { backend: Backend::Cpu, ..request };
        let exact = pipeline.render(&request)?.planes.color.clone();
        Ok(Self { pipeline, request, exact })
    }

    /// The image of a request; prints its error and its time, the least of five.
    fn image(&mut self, name: &str, request: &FrameRequest) -> Result<RgbaImage> {
        let (mut ms, mut rays) = (f64::INFINITY, 0);
        for _ in 0..5 {
            let stats = &self.pipeline.render(request)?.stats;
            (ms, rays) = (ms.min(stats.ms_worked()), stats.rays_by_level.iter().sum());
        }
        let image = self.pipeline.render(request)?.planes.color.clone();
        let off = compare_raw(&image, &self.exact)?;
        let share = if rays > 0 {
            format!(", {:.1} % of the rays", 100.0 * rays as f64 / (SIDE * SIDE) as f64)
        } else {
            String::new()
        };
        println!("  {name}: {ms:.1} ms, RMSE {:.1e}, max {:.1e}{share}", off.rmse, off.max);
        Ok(image)
    }

    fn adaptive(&self, contrast: f32) -> Result<FrameRequest> {
        Ok(FrameRequest { samples: SampleSet::Adaptive { contrast: contrast.try_into()? }, ..self.request.clone() })
    }

    fn upsampled(&self, kind: UpsampleKind, scale: ImageScale) -> FrameRequest {
        FrameRequest { upsampling: Some(Upsampling { scale, filter: kind.usual(scale) }), ..self.request.clone() }
    }

    fn few_faces(&self, lod: f64) -> FrameRequest {
        self.request.clone().with_draw(TetDraw::Faces(FaceDetail { lod, ..FaceDetail::ALL }))
    }

    /// The full image, that of fewer rays, the density of rays, and twenty times the difference.
    fn rays(&mut self) -> Result<RgbaImage> {
        let fewer = self.image("contrast 0.05", &self.adaptive(0.05)?)?;
        let (density, difference) = (density(&self.exact, &fewer), self.difference(&fewer)?);
        Ok(contact_sheet(&[self.exact.clone(), fewer, density, difference], 2, 6, [0.0; 3]))
    }

    fn difference(&self, image: &RgbaImage) -> Result<RgbaImage> {
        Ok(amplified_difference(image, &self.exact, [0.0; 3], Some(20.0))?.0)
    }

    /// Insets of the full image and of each filter's upsampled images; each row is a scale, 1/8, 1/4 and 1/2.
    fn filters(&mut self) -> Result<RgbaImage> {
        let mut images = Vec::new();
        for scale in [ImageScale::Eighth, ImageScale::Quarter, ImageScale::Half] {
            images.push(inset(&self.exact, &self.exact));
            for kind in [UpsampleKind::Joint, UpsampleKind::Joint2x2, UpsampleKind::Bilinear, UpsampleKind::Nearest] {
                let image = self.image(&format!("{scale} {kind}"), &self.upsampled(kind, scale))?;
                images.push(inset(&image, &self.exact));
            }
        }
        Ok(contact_sheet(&images, 5, 6, [0.0; 3]))
    }

    /// The full image, and those of 1/2, 1/4 and 1/8 after the joint filter.
    fn row(&mut self) -> Result<RgbaImage> {
        let mut images = vec![self.exact.clone()];
        for scale in [ImageScale::Half, ImageScale::Quarter, ImageScale::Eighth] {
            images.push(self.image(&format!("{scale} joint"), &self.upsampled(UpsampleKind::Joint, scale))?);
        }
        Ok(contact_sheet(&images, 4, 6, [0.0; 3]))
    }

    /// A tenth of the faces, the same after the joint filter, and all faces.
    fn filtered_faces(&mut self) -> Result<RgbaImage> {
        let few = self.few_faces(0.1);
        let filter = UpsampleKind::Joint.usual(ImageScale::Full);
        let filtered = FrameRequest { upsampling: Some(Upsampling { scale: ImageScale::Full, filter }), ..few.clone() };
        let [few, filtered] = [self.image("a tenth of the faces", &few)?, self.image("filtered", &filtered)?];
        Ok(contact_sheet(&[few, filtered, self.exact.clone()], 3, 6, [0.0; 3]))
    }

    /// Fewer rays, a small image and fewer faces, with twenty times their difference from the full image below.
    fn equal_time(&mut self) -> Result<RgbaImage> {
        self.image("all rays", &self.request.clone())?;
        let ways = [
            ("contrast 0.05", self.adaptive(0.05)?),
            ("image 1/2", self.upsampled(UpsampleKind::Bilinear, ImageScale::Half)),
            ("2 % of the faces", self.few_faces(0.02)),
        ];
        let mut images = Vec::new();
        for (name, request) in ways {
            images.push(self.image(name, &request)?);
        }
        let differences = images.iter().map(|image| self.difference(image)).collect::<Result<Vec<_>>>()?;
        images.extend(differences);
        Ok(contact_sheet(&images, 3, 6, [0.0; 3]))
    }
}

/// Share of the pixels around each that equal the full image bit by bit, where that is not empty: dark for few, bright for all.
fn density(exact: &RgbaImage, image: &RgbaImage) -> RgbaImage {
    const AROUND: usize = 4;
    let (width, height) = (exact.width, exact.height);
    let is_cast = |at: usize| exact.pixels[at] == image.pixels[at];
    let pixel = |at: usize| {
        let (x, y) = (at % width, at / width);
        let rows = y.saturating_sub(AROUND)..(y + AROUND).min(height);
        let columns = x.saturating_sub(AROUND)..(x + AROUND).min(width);
        let all = rows.len() * columns.len();
        let cast =
            rows.flat_map(|row| columns.clone().map(move |column| row * width + column)).filter(|&at| is_cast(at));
        let share = cast.count() as f32 / all as f32;
        let shade = if exact.pixels[at][3] > 0.0 { share.sqrt() } else { 0.0 };
        [shade, shade * shade, 0.25 * shade * shade * shade, 1.0]
    };
    RgbaImage { width, height, pixels: (0..width * height).map(pixel).collect() }
}

/// A magnified part of an image, where opacity begins in the middle row of the full one.
fn inset(image: &RgbaImage, exact: &RgbaImage) -> RgbaImage {
    let row = exact.height / 2;
    let begins = (0..exact.width).find(|&x| exact.pixels[row * exact.width + x][3] > 0.05).unwrap_or(exact.width / 2);
    let (x0, y0) = (begins.saturating_sub(INSET / 4).min(exact.width - INSET), row - INSET / 2);
    let side = INSET * MAGNIFIED / 2;
    let pixel = |at: usize| {
        let (x, y) = ((at % side) * 2 / MAGNIFIED, (at / side) * 2 / MAGNIFIED);
        image.pixels[(y0 + y) * image.width + x0 + x]
    };
    RgbaImage { width: side, height: side, pixels: (0..side * side).map(pixel).collect() }
}

/// A sheet seen edge-on, thinner than the distance of two rays, in a thin fog: all rays, and those selected by contrast.
fn missed(store: &Store) -> Result<RgbaImage> {
    let mesh = Pipeline::open(store, None)?.mesh().clone();
    let (lo, hi) = mesh.positions.world_bounds();
    let middle = 0.5 * (lo + hi);
    let (size, eye) = (hi - lo, 4.0 * (hi - lo).length());
    // Near the axis of a parallel view, between two rays of the coarsest level.
    let place = middle.y + size.y * 0.02;
    let node = |scalar: f64, tau: f64| Node { scalar, rgb: [1.0, 0.8, 0.3], tau };
    let (thin, dense) = (0.004, 60.0 / size.x);
    let fog = 0.2 / size.x;
    let nodes = vec![node(-1.0, fog), node(-thin, fog), node(0.0, dense), node(thin, fog), node(1.0, fog)];
    let scalars: Vec<f32> = (0..mesh.positions.local.len())
        .map(|vertex| ((mesh.positions.world(vertex).y - place) / size.y) as f32)
        .collect();
    let camera = Camera {
        position: middle - DVec3::X * eye,
        focal_point: middle,
        view_up: DVec3::Z,
        projection: Projection::Parallel { scale: 0.6 * size.z.max(size.y) },
        near: 0.0,
    };
    let cells = Arc::new(tetreel::visibility::finite_cells(&mesh.topology, &scalars));
    let table = Arc::new(NodeTable::new(nodes)?);
    let job = RenderJob::new(mesh, Arc::new(scalars), cells, camera.view(SIDE / 2, SIDE / 2)?, table);
    let images = all_and_fewer("a thin sheet from its edge", &job)?;
    Ok(contact_sheet(&images, 2, 6, [0.0; 3]))
}

/// All rays of a job, and those selected by contrast.
fn all_and_fewer(name: &str, job: &RenderJob) -> Result<[RgbaImage; 2]> {
    let image = |contrast| -> Result<RgbaImage> {
        Ok(Raycast::new().render(RenderJob { contrast, ..job.clone() })?.planes.color.clone())
    };
    let images = [image(None)?, image(Some(0.05f32.try_into()?))?];
    println!("{name}: max {:.2}", compare_raw(&images[0], &images[1])?.max);
    Ok(images)
}

/// Five parts, five pixels in size, in front of a larger one: all rays, and those selected by contrast, the coarsest of which meet the
/// second and fourth part.
fn missed_parts() -> Result<RgbaImage> {
    const SIDE: usize = 128;
    const ENLARGED: usize = 2;
    let pixel = 2.0 / SIDE as f64;
    let corner = |i: usize| {
        let end = |axis: usize, lo: f64, hi: f64| if i >> axis & 1 == 1 { hi } else { lo };
        DVec3::new(end(0, -0.8, 0.8), end(1, -0.8, 0.8), end(2, -2.0, -1.0))
    };
    let mut points: Vec<DVec3> = (0..8).map(corner).collect();
    let mut tets: Vec<[u32; 4]> = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]].map(|[a, b]| [0, a, b, 7]).to_vec();
    for column in [20, 40, 60, 80, 100] {
        let at = |px: usize| (px as f64 + 0.5) * pixel - 1.0;
        let place = DVec3::new(at(column), -at(SIDE / 2), 1.0);
        let first = points.len() as u32;
        tets.push([0, 1, 2, 3].map(|corner| first + corner));
        let corners = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        points.extend(corners.map(|corner| place + 2.5 * pixel * DVec3::from_array(corner)));
    }
    let mesh = Arc::new(Mesh::build(RawMesh { points, cells: tets.into() })?.0);
    let is_part = |vertex: usize| mesh.positions.world(vertex).z > 0.0;
    let scalars: Vec<f32> =
        (0..mesh.positions.local.len()).map(|vertex| f32::from(u8::from(is_part(vertex)))).collect();
    let node = |scalar, rgb, tau| Node { scalar, rgb, tau };
    let table = NodeTable::new(vec![node(0.0, [0.3, 0.5, 1.0], 0.5), node(1.0, [1.0, 0.8, 0.3], 100.0)])?;
    let camera = Camera {
        position: 10.0 * DVec3::Z,
        focal_point: DVec3::ZERO,
        view_up: DVec3::Y,
        projection: Projection::Parallel { scale: 1.0 },
        near: 0.0,
    };
    let cells = Arc::new(tetreel::visibility::finite_cells(&mesh.topology, &scalars));
    let job = RenderJob::new(mesh, Arc::new(scalars), cells, camera.view(SIDE, SIDE)?, Arc::new(table));
    let enlarged = |image: RgbaImage| {
        let side = SIDE * ENLARGED;
        let pixel = |at: usize| image.pixels[at / side / ENLARGED * SIDE + at % side / ENLARGED];
        RgbaImage { width: side, height: side, pixels: (0..side * side).map(pixel).collect() }
    };
    Ok(contact_sheet(&all_and_fewer("parts before a larger one", &job)?.map(enlarged), 2, 6, [0.0; 3]))
}

fn main() -> Result<()> {
    let temp = tempfile::tempdir()?;
    let generated = temp.path().join("jet.zarr");
    let path = args().nth(2).unwrap_or_else(|| generated.display().to_string());
    if path == generated.display().to_string() {
        let jet = generate(&SynthSpec { cells: 135_000, steps: 8, ..SynthSpec::new(SeriesName::Jet) })?;
        ingest(&jet, &generated, &IngestOptions::default(), &Silent, &Cancel::new())?;
    }
    let store = Store::open(&path)?;
    let step = args().nth(3).map(|text| text.parse()).transpose()?;
    let tf = args().nth(4).unwrap_or_else(|| "viridis@0:0.01,1:0.1".to_owned());
    let folder = args().nth(1).unwrap_or_else(|| ".".to_owned());
    let name = Path::new(&path).file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let write = |what: &str, image: &RgbaImage| -> Result<()> {
        let path = Path::new(&folder).join(format!("sampling_{what}.png"));
        write_png(&path, image, Some([0.0; 3]), PngDepth::Eight)?;
        println!("{}", path.display());
        Ok(())
    };
    let mut pictures = Pictures::of(&store, step, &tf)?;
    write(&format!("{name}_rays"), &pictures.rays()?)?;
    write(&format!("{name}_filters"), &pictures.filters()?)?;
    write(&format!("{name}_row"), &pictures.row()?)?;
    write(&format!("{name}_faces"), &pictures.filtered_faces()?)?;
    write(&format!("{name}_equal_time"), &pictures.equal_time()?)?;
    write("missed", &missed(&store)?)?;
    write("missed_parts", &missed_parts()?)
}
