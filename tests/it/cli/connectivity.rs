//! Cells that do not fit together, from import to picture.

use super::Place;
use std::fmt::Write;

/// Writes 27 cubes of six tets, each tet with points of its own, as a legacy file.
pub(super) fn write_soup(place: &Place) {
    let mut tets: Vec<[[f64; 3]; 4]> = Vec::new();
    for cube in 0..27 {
        let first = [cube % 3, cube / 3 % 3, cube / 9].map(f64::from);
        for path in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut tet = [first; 4];
            for (i, axis) in path.into_iter().enumerate() {
                tet[i + 1..].iter_mut().for_each(|corner| corner[axis] += 1.0);
            }
            tets.push(tet);
        }
    }
    let (points, cells) = (tets.as_flattened(), tets.len());
    let count = points.len();
    let mut text =
        format!("# vtk DataFile Version 3.0\nsoup\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {count} double\n");
    points.iter().for_each(|[x, y, z]| writeln!(text, "{x} {y} {z}").unwrap());
    writeln!(text, "CELLS {cells} {}", 5 * cells).unwrap();
    (0..cells).for_each(|c| writeln!(text, "4 {} {} {} {}", 4 * c, 4 * c + 1, 4 * c + 2, 4 * c + 3).unwrap());
    writeln!(text, "CELL_TYPES {cells}").unwrap();
    (0..cells).for_each(|_| writeln!(text, "10").unwrap());
    writeln!(text, "POINT_DATA {count}\nSCALARS s float 1\nLOOKUP_TABLE default").unwrap();
    points.iter().for_each(|[x, y, z]| writeln!(text, "{}", x + 2.0 * y - z).unwrap());
    std::fs::write(place.path("soup.vtk"), text).unwrap();
}

const LOOK: [&str; 4] = ["--tf", "viridis@0:0.05,1:0.4", "--size", "48x48"];

fn render<'a>(store: &'a str, image: &'a str, rest: &[&'a str]) -> Vec<&'a str> {
    [&["render", store, "-o", image], &LOOK[..], rest].concat()
}

#[test]
fn a_soup_is_imported_without_connectivity_and_drawn_as_points() {
    let place = Place::empty();
    write_soup(&place);
    let planned = place.ok(&["import", "soup.vtk", "--dry-run"]);
    let said = place.ok(&["import", "soup.vtk", "-o", "soup.zarr"]);
    for text in [planned, said] {
        assert!(text.contains("without connectivity") && text.contains("648 of 648"), "{text}");
    }
    let info = place.json(&["info", "soup.zarr", "--json"]);
    assert_eq!(info["mesh"]["connectivity"], "none");
    assert_eq!(info["mesh"]["repair"]["unconnected"]["open"], 108);
    assert!(place.ok(&["info", "soup.zarr"]).contains("without connectivity"));

    place.ok(&render("soup.zarr", "auto.png", &[]));
    place.ok(&render("soup.zarr", "points.png", &["--mode", "points"]));
    let read = |name: &str| std::fs::read(place.path(name)).unwrap();
    assert!(read("auto.png") == read("points.png"));
    place.ok(&render("soup.zarr", "half.png", &["--lod", "0.5", "--stats", "half.json"]));
    let stats: serde_json::Value = serde_json::from_slice(&read("half.json")).unwrap();
    assert_eq!(stats[0]["stats"]["points_drawn"], 41, "a quarter of 162");
    // From the source, by way of the cache.
    place.ok(&render("soup.vtk", "cached.png", &[]));
    assert!(read("cached.png") == read("points.png"));

    place.ok(&["import", "soup.vtk", "-o", "full.zarr", "--connectivity", "full"]);
    assert_eq!(place.json(&["info", "full.zarr", "--json"])["mesh"].get("connectivity"), None);
    place.ok(&render("full.zarr", "full.png", &["--mode", "points"]));
    assert!(read("full.png") == read("points.png"));
    place.ok(&render("full.zarr", "walk.png", &["--mode", "raycast"]));
}

#[test]
fn what_needs_connectivity_is_refused_with_the_remedy() {
    let place = Place::empty();
    write_soup(&place);
    place.ok(&["import", "soup.vtk", "-o", "soup.zarr", "--connectivity", "none"]);
    for (options, what) in [
        (&["--mode", "raycast"][..], "raycast"),
        (&["--mode", "havs"], "havs"),
        (&["--rays", "adaptive"], "rays"),
        (&["--parts", "0"], "connected parts"),
        (&["--surface", "solid"], "surfaces"),
    ] {
        place.refuses(&render("soup.zarr", "f.png", options), &[what, "--connectivity full"]);
    }
    place.ok(&render("soup.zarr", "iso.png", &["--iso", "1.5"]));
    place.refuses(
        &["export", "soup.zarr", "-o", "s.ply", "--surface"],
        &["without connectivity", "--connectivity full"],
    );
    place.ok(&["export", "soup.zarr", "-o", "i.ply", "--field", "s", "--iso", "1.5"]);
    let run = place.run(&["import", "soup.vtk", "-o", "t.zarr", "--connectivity", "some"]);
    assert_eq!((run.code, place.path("t.zarr").exists()), (Some(2), false));
    assert!(run.err.contains("none, auto or full"), "{}", run.err);
}
