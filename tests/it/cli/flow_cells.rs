//! Flow of vectors of cells.

use super::Place;
use super::points::apart;
use crate::import::series::Grid;
use crate::meshes::grid;
use tetreel::image::{Planes, read_exr};
use tetreel::store::{Store, StoredTravel};

/// Cubes along an edge.
const SIDE: usize = 3;

/// A vortex of ten steps on cubes, which become several tetrahedra each: `u` and `c` are of cells, `v` and `T` of points.
fn vortex() -> Place {
    let place = Place::empty();
    let points: Vec<[f64; 3]> = grid(SIDE, 0.1, 5, |_| true).points.iter().map(|p| p.to_array()).collect();
    let id = |i: usize, j: usize, k: usize| i + (SIDE + 1) * (j + (SIDE + 1) * k);
    let cube = |n: usize| {
        let (i, j, k) = (n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE);
        let corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
        corners.map(|[a, b, c]| id(i + a, j + b, k + c))
    };
    let cubes: Vec<[usize; 8]> = (0..SIDE.pow(3)).map(cube).collect();
    let middle =
        |corners: &[usize; 8]| [0, 1, 2].map(|axis| corners.iter().map(|&p| points[p][axis]).sum::<f64>() / 8.0);
    let middles: Vec<[f64; 3]> = cubes.iter().map(middle).collect();
    for step in 0..10 {
        let rate = 1.0 + 0.5 * f64::from(step).sin();
        let turn = |at: &Vec<[f64; 3]>| at.iter().flat_map(|[x, y, _]| [-rate * y, rate * x, 0.5]).collect();
        let height = |at: &Vec<[f64; 3]>| at.iter().map(|[_, _, z]| *z).collect();
        let step_grid = Grid {
            points: points.clone(),
            cells: cubes.iter().map(|corners| (12, corners.to_vec())).collect(),
            point_arrays: vec![("T", 1, height(&points)), ("v", 3, turn(&points))],
            cell_arrays: vec![("c", 1, height(&middles)), ("u", 3, turn(&middles))],
            time: Some(0.5 * f64::from(step)),
            ..Grid::default()
        };
        std::fs::write(place.path(&format!("a_{step}.vtu")), step_grid.text()).unwrap();
    }
    let files: Vec<String> = (0..10).map(|step| format!("a_{step}.vtu")).collect();
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    place.ok(&[&["import"], &files[..], &["-o", "t.zarr", "--quiet"]].concat());
    place
}

fn exr(place: &Place, step: &str, options: &[&str]) -> Planes {
    let words = ["render", "t.zarr", "--field", "T", "--size", "48x36", "--exr", "raw", "-o", "f.exr"];
    place.ok(&[&words[..], &["--steps", step, "--stats", "s.json"], options].concat());
    read_exr(&place.path("f.exr")).unwrap().planes
}

fn splats(place: &Place) -> u64 {
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(place.path("s.json")).unwrap()).unwrap();
    stats[0]["stats"]["flow_splats"].as_u64().unwrap()
}

#[test]
fn vectors_of_cells_have_a_splat_in_each_cell_as_the_judge_draws_them() {
    let place = vortex();
    let flow = |options: &[&str]| exr(&place, "9", &[&["--flow", "u"], options].concat());
    let judge = flow(&["--mode", "reference"]);
    let cells = Store::open(place.path("t.zarr")).unwrap().mesh().unwrap().topology.tets.len() as u64;
    for mode in ["raycast", "havs", "points"] {
        let found = flow(&["--mode", mode]);
        assert!(splats(&place) == cells, "{mode}: {} of {cells}", splats(&place));
        // The bound of splats in a volume.
        assert!(apart(&found, &judge) <= 1e-3, "{mode}");
    }
    let mut seen = vec![judge, exr(&place, "9", &[])];
    for options in
        [&["--flow", "v"][..], &["--flow", "u", "--flow-splats", "20"], &["--flow", "u", "--flow-color", "c@viridis"]]
    {
        let found = exr(&place, "9", options);
        assert!(seen.iter().all(|other| apart(other, &found) > 1e-3), "{options:?} is another image");
        seen.push(found);
    }
    flow(&["--flow-splats", "20"]);
    assert!((1..=20).contains(&splats(&place)));
    // Cells that are cut away have none.
    flow(&["--crop", "min=-1,-1,-1 max=0,1,1"]);
    assert!(0 < splats(&place) && splats(&place) < cells);
    for (options, parts) in [
        (&["--flow", "u", "--flow-color", "T"][..], &["'T'", "of vertices", "vectors of cells", "field of cells"][..]),
        (&["--flow", "v", "--flow-color", "c"], &["'c'", "of cells", "vectors of vertices", "field of vertices"]),
        (&["--flow", "u", "--flow-volume", "splats"], &["vectors and scalars", "both of cells", "'exact'"]),
        (&["--field", "c", "--flow", "v", "--flow-volume", "splats"], &["vectors and scalars", "both of vertices"]),
    ] {
        let field = if options[0] == "--field" { &[][..] } else { &["--field", "T"] };
        let words = ["render", "t.zarr", "-o", "x.png", "--steps", "1", "--size", "8x8"];
        place.refuses(&[&words[..], field, options].concat(), parts);
        assert!(!place.path("x.png").exists());
    }
    // Where both are of cells, each shows its own.
    let [splats, exact] = ["splats", "exact"].map(|volume| {
        let words = ["render", "t.zarr", "--field", "c", "--flow", "u", "--flow-volume", volume, "-o", "f.exr"];
        place.ok(&[&words[..], &["--steps", "1", "--size", "48x36", "--exr", "raw"]].concat());
        read_exr(&place.path("f.exr")).unwrap().planes
    });
    assert!(apart(&splats, &exact) > 1e-3);
}

#[test]
fn the_ways_of_cells_are_kept_once_for_each_cell_of_the_source() {
    let place = vortex();
    let first = exr(&place, "9", &["--flow", "u"]);
    let store = Store::open(place.path("t.zarr")).unwrap();
    let readers = [0, 1, 2].map(|axis| store.field(&format!("u:{axis}").parse().unwrap()).unwrap());
    let travel = StoredTravel::of(readers.each_ref(), store.times()).unwrap();
    let ways = travel.row(0).unwrap();
    assert_eq!((travel.rows(), ways.len()), (1, store.mesh().unwrap().topology.tets.len()));
    assert!(ways.iter().all(|way| *way > 0.0));
    let bytes = std::fs::read(place.path("t.zarr/flow/u/travel/c/0/0")).unwrap();
    assert_eq!(bytes.len(), 4 * SIDE.pow(3) + 4);
    assert!(exr(&place, "9", &["--flow", "u"]) == first);
    std::fs::remove_dir_all(place.path("t.zarr/flow")).unwrap();
    assert!(exr(&place, "9", &["--flow", "u"]) == first);
}
