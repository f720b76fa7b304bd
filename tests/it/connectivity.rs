//! Faces and neighbours are made where they are asked for, and only there; cells that do not fit together are drawn without them.

use crate::series::{ingested, table_for};
use glam::DVec3;
use std::path::Path;
use tetreel::camera::Camera;
use tetreel::error::FileResult;
use tetreel::field::{Association, Component, FieldInfo, SeriesSource, TimeAxis};
use tetreel::ingest::{IngestOptions, ingest};
use tetreel::mesh::{ConnectivityChoice, Mesh, RawMesh};
use tetreel::pipeline::{FaceDetail, FrameRequest, Pipeline, SampleSet, TetDraw};
use tetreel::render::points::PointStyle;
use tetreel::render::{Frame, Planes};
use tetreel::store::{Store, StoredConnectivity};
use tetreel::synth::{SeriesName, SynthSpec, generate};
use tetreel::task::{Cancel, Silent};

/// A pipeline of a store, and a request for a frame of it by points.
fn opened(store: &Path) -> (Pipeline, FrameRequest) {
    let pipeline = Pipeline::open(&Store::open(store).unwrap(), None).unwrap();
    let camera = Camera::default_for(pipeline.mesh().frame()).unwrap();
    let table = table_for(&pipeline, "inferno@0:0,1:0.5");
    let request = FrameRequest::new(1, camera, table, (64, 64)).with_draw(TetDraw::Points(PointStyle::EXACT));
    (pipeline, request)
}

fn is_visible(frame: &Frame) -> bool {
    frame.planes.color.pixels.iter().any(|pixel| pixel[3] > 0.1)
}

#[test]
fn a_store_may_lack_the_arrays_and_points_do_not_make_them() {
    let temp = tempfile::tempdir().unwrap();
    let series = generate(&SynthSpec { cells: 3000, steps: 2, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    let store = temp.path().join("jet.zarr");
    ingested(&series, &store, "0..1");
    let (mut whole, request) = opened(&store);
    let walk = request.clone().with_draw(TetDraw::Raycast);
    let [points, walked]: [Planes; 2] = [&request, &walk].map(|r| whole.render(r).unwrap().planes.clone());
    for array in ["faces", "face_cells", "neighbours"] {
        std::fs::remove_dir_all(store.join("mesh/0").join(array)).unwrap();
    }
    let (mut bare, _) = opened(&store);
    let frame = bare.render(&request).unwrap();
    assert!(is_visible(frame) && frame.planes == points);
    assert_eq!(bare.mesh().topology.known_connectivity(), None, "points ask for no faces");
    assert!(bare.render(&walk).unwrap().planes == walked);
    assert_eq!(bare.mesh().topology.known_connectivity(), Some(whole.mesh().topology.connectivity()));
}

/// Cells of their own with a scalar at each of their corners.
struct Soup {
    mesh: RawMesh,
    times: TimeAxis,
    fields: [FieldInfo; 1],
    values: Vec<f32>,
}

impl Soup {
    /// The cells of `mesh` in another order, each with vertices of its own.
    fn torn(mesh: &Mesh, scalars: &[f32]) -> Self {
        let tets = &mesh.topology.tets;
        // From both ends in turn.
        let count = tets.len();
        let order = (0..count).map(|i| tets[if i % 2 == 0 { i / 2 } else { count - 1 - i / 2 }]);
        let corners: Vec<u32> = order.flatten().collect();
        let points: Vec<DVec3> = corners.iter().map(|&v| mesh.positions.world(v as usize)).collect();
        let values = corners.iter().map(|&v| scalars[v as usize]).collect();
        let cells: Vec<[u32; 4]> =
            (0..points.len() as u32 / 4).map(|cell| [0, 1, 2, 3].map(|i| 4 * cell + i)).collect();
        Self {
            mesh: RawMesh { points, cells: cells.into() },
            times: TimeAxis { values: vec![0.0, 1.0] },
            fields: [FieldInfo { name: "s".to_owned(), components: 1, association: Association::Point }],
            values,
        }
    }

    fn import(&self, out: &Path, connectivity: ConnectivityChoice) -> tetreel::ingest::IngestReport {
        let options = IngestOptions { connectivity, overwrite: true, ..Default::default() };
        ingest(self, out, &options, &Silent, &Cancel::new()).unwrap()
    }
}

impl SeriesSource for Soup {
    fn describe(&self) -> String {
        "a soup".to_owned()
    }

    fn times(&self) -> &TimeAxis {
        &self.times
    }

    fn fields(&self) -> &[FieldInfo] {
        &self.fields
    }

    fn mesh(&self) -> FileResult<RawMesh> {
        Ok(self.mesh.clone())
    }

    fn read(&self, _: &FieldInfo, _: Component, _: usize, out: &mut Vec<f32>) -> FileResult<()> {
        out.clone_from(&self.values);
        Ok(())
    }
}

/// A store of a jet and the same cells as a soup.
fn whole_and_torn(folder: &Path) -> (std::path::PathBuf, Soup) {
    let series = generate(&SynthSpec { cells: 3000, steps: 2, ..SynthSpec::new(SeriesName::Jet) }).unwrap();
    let whole = folder.join("whole.zarr");
    let store = ingested(&series, &whole, "0..1");
    let field = store.field(&store.fields()[0].name.parse().unwrap()).unwrap();
    let mut scalars = vec![0.0; field.value_count()];
    field.decode_step(1, &mut scalars).unwrap();
    let soup = Soup::torn(&store.mesh().unwrap(), &scalars);
    (whole, soup)
}

#[test]
fn a_torn_mesh_is_drawn_by_points_with_the_bits_of_the_whole_one() {
    let temp = tempfile::tempdir().unwrap();
    let (whole, soup) = whole_and_torn(temp.path());
    let torn = temp.path().join("torn.zarr");
    let report = soup.import(&torn, ConnectivityChoice::Auto);
    let cells = soup.mesh.cells.len() as u64;
    let found = report.repair.unconnected.unwrap();
    assert_eq!((report.repair.cells_out, report.repair.vertices_out), (cells, 4 * cells), "no points are joined");
    assert_eq!(found.alone, found.faces);
    assert!(!torn.join("mesh/0/faces").exists() && !torn.join("mesh/0/neighbours").exists());
    let info = Store::open(&torn).unwrap().info().unwrap();
    assert_eq!((info.mesh.connectivity, info.version.store.as_str()), (StoredConnectivity::None, "1.2"));
    assert!(info.to_string().contains("without connectivity"), "{info}");

    let ((mut whole, request), (mut torn, _)) = (opened(&whole), opened(&torn));
    let points = whole.render(&request).unwrap().planes.clone();
    let auto = torn.render(&request.clone().with_tets(|tets| tets.draw = TetDraw::Auto)).unwrap();
    assert!(is_visible(auto) && auto.stats.points_drawn > 0, "auto draws points");
    assert!(auto.planes == points);
    assert_eq!(torn.mesh().topology.known_connectivity(), None);
    // Another scalar is seen: the comparison can fail.
    let mut other = soup;
    other.values[1000] += 0.5;
    let changed = temp.path().join("changed.zarr");
    other.import(&changed, ConnectivityChoice::Auto);
    assert!(opened(&changed).0.render(&request).unwrap().planes != points);
}

#[test]
fn what_goes_from_cell_to_cell_is_refused_with_the_remedy_and_full_has_it() {
    let temp = tempfile::tempdir().unwrap();
    let (_, soup) = whole_and_torn(temp.path());
    let (bare, full) = (temp.path().join("bare.zarr"), temp.path().join("full.zarr"));
    soup.import(&bare, ConnectivityChoice::None);
    let report = soup.import(&full, ConnectivityChoice::Full);
    assert_eq!((report.repair.parts, report.repair.unconnected), (soup.mesh.cells.len() as u64, None));
    let info = Store::open(&full).unwrap().info().unwrap();
    assert_eq!((info.mesh.connectivity, info.version.store.as_str()), (StoredConnectivity::Full, "1.1"));
    let ((mut bare, request), (mut full, _)) = (opened(&bare), opened(&full));
    let half = TetDraw::Faces(FaceDetail { lod: 0.5, ..FaceDetail::ALL });
    let with = |change: &dyn Fn(&mut tetreel::pipeline::TetLayer)| request.clone().with_tets(change);
    for (request, what) in [
        (request.clone().with_draw(TetDraw::Raycast), "raycast"),
        (request.clone().with_draw(TetDraw::ALL_FACES), "havs"),
        (request.clone().with_draw(half), "havs"),
        (with(&|tets| tets.parts = vec![0]), "parts"),
        (with(&|tets| tets.domain = vec!["solid".parse().unwrap()]), "surfaces"),
        (FrameRequest { samples: "adaptive".parse::<SampleSet>().unwrap(), ..request.clone() }, "contrast"),
    ] {
        let refused = bare.render(&request).unwrap_err().to_string();
        for part in [what, "--connectivity full", "--mode points"] {
            assert!(refused.contains(part), "{refused}");
        }
    }
    assert_eq!(bare.mesh().topology.known_connectivity(), None);
    // Isosurfaces lie in cells, and the reference goes to each.
    let iso =
        with(&|tets| tets.surfaces = vec!["0.5".parse::<tetreel::render::surfaces::IsosurfaceText>().unwrap().surface]);
    for request in [&iso, &request.clone().with_draw(TetDraw::Reference)] {
        assert!(is_visible(bare.render(request).unwrap()));
    }
    let [by_points, walked] =
        [&request, &request.clone().with_draw(TetDraw::Raycast)].map(|r| full.render(r).unwrap().planes.clone());
    let pairs = by_points.color.pixels.iter().flatten().zip(walked.color.pixels.iter().flatten());
    assert!(pairs.fold(0.0f32, |most, (a, b)| most.max((a - b).abs())) <= 1e-3, "the walk enters each cell by itself");
}

#[test]
fn a_store_that_says_something_else_of_its_connectivity_is_invalid() {
    let temp = tempfile::tempdir().unwrap();
    let (_, soup) = whole_and_torn(temp.path());
    let store = temp.path().join("s.zarr");
    soup.import(&store, ConnectivityChoice::None);
    let file = store.join("mesh/0/zarr.json");
    let text = std::fs::read_to_string(&file).unwrap();
    let said = "\"connectivity\": \"none\"";
    assert!(text.contains(said), "{text}");
    for (other, is_connected) in [
        ("\"connectivity\": \"full\"", Some(true)),
        ("\"connectivity\": \"some\"", None),
        ("\"connectivity\": 3", None),
    ] {
        std::fs::write(&file, text.replace(said, other)).unwrap();
        match (Store::open(&store), is_connected) {
            (Ok(store), Some(expected)) => assert_eq!(store.mesh().unwrap().is_connected, expected),
            (Err(error), None) => assert!(error.to_string().contains("mesh/0"), "{error}"),
            (opened, _) => panic!("{other}: {:?}", opened.map(|_| ())),
        }
    }
}
