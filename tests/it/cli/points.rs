//! Cells as points on the command line.

use super::{Place, render};
use tetreel::image::{Planes, read_exr};

/// The second step of the slab, drawn with these options.
pub(super) fn exr(place: &Place, options: &[&str]) -> Planes {
    place.ok(&render(&[&["-o", "f.exr", "--exr", "raw", "--steps", "2"], options].concat()));
    read_exr(&place.path("f.exr")).unwrap().planes
}

/// Greatest difference of a channel.
pub(super) fn apart(a: &Planes, b: &Planes) -> f32 {
    let channels = a.color.pixels.iter().flatten().zip(b.color.pixels.iter().flatten());
    channels.fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

#[test]
fn points_are_drawn_in_all_footprints_and_ways_and_by_a_project() {
    let place = Place::with_slab();
    let walk = exr(&place, &["--mode", "raycast"]);
    let exact = exr(&place, &["--mode", "points"]);
    assert!(apart(&walk, &exact) <= 1e-3 && walk.color.pixels.iter().any(|p| p[3] > 0.1));
    let mut seen = vec![exact];
    for options in [
        &["--footprint", "ellipse"][..],
        &["--footprint", "circle"],
        &["--footprint", "square"],
        &["--compositing", "gap"],
        &["--footprint", "ellipse", "--point-radius", "0.6"],
        &["--footprint", "ellipse", "--lod", "0.5"],
    ] {
        let found = exr(&place, &[&["--mode", "points", "--stats", "s.json"], options].concat());
        assert!(seen.iter().all(|other| apart(other, &found) > 1e-3), "{options:?} is another image");
        let stats = std::fs::read_to_string(place.path("s.json")).unwrap();
        let stats: serde_json::Value = serde_json::from_str(&stats).unwrap();
        let count = |name: &str| stats[0]["stats"][name].as_u64().unwrap();
        assert!(count("points_drawn") > 0 && count("fragments") > 0, "{stats}");
        assert_eq!(count("points_drawn") < count("points_total"), options.contains(&"--lod"));
        seen.push(found);
    }
    let project = "version = 1\n[data]\nsource = \"slab.zarr\"\n[look]\nmode = \"points\"\nfootprint = \"ellipse\"\n\
                   point-radius = 0.6\n";
    std::fs::write(place.path("p.toml"), project).unwrap();
    let size = ["--size", "64x64"];
    place.ok(&[&["render", "p.toml", "-o", "p.exr", "--exr", "raw", "--steps", "2"], &size[..]].concat());
    place.ok(&[&["render", "p.toml", "-o", "w.exr", "--exr", "raw", "--steps", "2", "--mode", "raycast"], &size[..]]
        .concat());
    let [by_project, walked] = ["p.exr", "w.exr"].map(|name| read_exr(&place.path(name)).unwrap().planes);
    assert!(apart(&by_project, &walked) > 1e-3, "the keys are not those of another mode");
}

#[test]
fn options_that_points_cannot_have_are_refused_with_the_remedy() {
    let place = Place::with_slab();
    for (options, parts) in [
        (&["--footprint", "ellipse"][..], &["are about points", "--mode points"][..]),
        (&["--mode", "havs", "--compositing", "gap"], &["are about points", "--mode points"]),
        (&["--mode", "points", "--k", "4"], &["--k is about faces", "--mode havs"]),
        (&["--mode", "points", "--sampling", "regular"], &["--sampling regular is about faces"]),
        (&["--mode", "points", "--point-radius", "2"], &["--point-radius 2", "--footprint"]),
        (&["--mode", "points", "--footprint", "ellipse", "--iso", "0.5"], &["isosurfaces", "footprint exact"]),
    ] {
        place.refuses(&render(&[&["-o", "f.png", "--steps", "1"], options].concat()), parts);
    }
    for (options, word) in [
        (["--footprint", "hexagon"], "square, circle, ellipse or exact"),
        (["--compositing", "none"], "own or gap"),
        (["--point-radius", "0"], "above 0 and at most 8"),
        (["--point-radius", "-1"], "above 0 and at most 8"),
        (["--point-radius", "9"], "above 0 and at most 8"),
        (["--point-radius", "NaN"], "above 0 and at most 8"),
        (["--lod", "1.5"], "from 0 to 1"),
    ] {
        let run = place.run(&render(&[&["-o", "f.png", "--steps", "1", "--mode", "points"][..], &options].concat()));
        assert_eq!((run.code, place.path("f.png").exists()), (Some(2), false), "{options:?}");
        assert!(run.err.contains(word), "{}", run.err);
    }
    let project = "version = 1\n[data]\nsource = \"slab.zarr\"\n[look]\nmode = \"points\"\npoint-radius = 9.0\n";
    std::fs::write(place.path("p.toml"), project).unwrap();
    place.refuses(&["render", "p.toml", "-o", "p.png"], &["p.toml", "point-radius", "at most 8"]);
}
