//! Functions on sheets on the command line.

use super::points::{apart, exr};
use super::{Place, render};
use tetreel::image::{Planes, read_exr};

#[test]
fn functions_are_drawn_by_options_and_by_a_project() {
    let place = Place::with_slab();
    let walk = exr(&place, &["--mode", "raycast"]);
    let by_error = exr(&place, &["--mode", "sheets", "--stats", "s.json"]);
    let stats = std::fs::read_to_string(place.path("s.json")).unwrap();
    let stats: serde_json::Value = serde_json::from_str(&stats).unwrap();
    let count = |name: &str| stats[0]["stats"][name].as_u64().unwrap();
    assert!(count("sheets") > 0 && count("functions_drawn") > 0, "{stats}");
    // Another field on the same mesh: less steep, as thick.
    assert!(apart(&walk, &by_error) > 1e-3 && by_error.color.pixels.iter().any(|p| p[3] > 0.1));
    let fine = exr(&place, &["--mode", "sheets", "--sampling-error", "1e-5"]);
    assert!(apart(&fine, &by_error) <= 1e-3);
    let coarse = exr(&place, &["--mode", "sheets", "--sheets", "3"]);
    assert!(apart(&fine, &coarse) > apart(&fine, &by_error));
    let project =
        "version = 1\n[data]\nsource = \"slab.zarr\"\nfield = \"linear\"\n[look]\nmode = \"sheets\"\nsheets = 3\n";
    std::fs::write(place.path("p.toml"), project).unwrap();
    let rendered = |out: &str, options: &[&str]| {
        let words = ["render", "p.toml", "-o", out, "--exr", "raw", "--steps", "2", "--size", "64x64"];
        place.ok(&[&words, options].concat());
        read_exr(&place.path(out)).unwrap().planes
    };
    let by_project = rendered("p.exr", &[]);
    let by_option = rendered("o.exr", &["--sampling-error", "1e-5"]);
    assert!(apart(&by_project, &by_option) > 0.0, "the option replaces the key of the project");
    let walked = rendered("w.exr", &["--mode", "raycast"]);
    assert!(apart(&walked, &by_option) > 1e-3, "the keys are not those of another mode");
}

#[test]
fn a_constant_field_is_the_same_in_functions_as_in_cells() {
    let place = Place::with_slab();
    let constant = |rest: &[&str]| {
        let words = ["render", "slab.zarr", "--field", "constant", "--steps", "2", "--size", "64x64"];
        place.ok(&[&words[..], &["-o", "c.exr", "--exr", "raw"], rest].concat());
        read_exr(&place.path("c.exr")).unwrap().planes
    };
    let walk = constant(&[]);
    assert!(walk.color.pixels.iter().any(|p| p[3] > 0.1));
    // Optical depths are sums of some hundred parts, each rounded to 2^-24 of itself; transparencies are at most 1.
    for spacing in [&["--sheets", "40"][..], &["--sampling-error", "1e-7"]] {
        assert!(apart(&walk, &constant(&[&["--mode", "sheets"], spacing].concat())) <= 2e-6, "{spacing:?}");
    }
}

#[test]
fn sheets_are_those_of_the_judge_by_options_and_in_projects() {
    let place = Place::with_slab();
    let small = |options: &[&str]| {
        let words = [
            "render",
            "slab.zarr",
            "--field",
            "linear",
            "--size",
            "32x32",
            "--steps",
            "2",
            "-o",
            "f.exr",
            "--exr",
            "raw",
        ];
        place.ok(&[&words, options].concat());
        read_exr(&place.path("f.exr")).unwrap().planes
    };
    let judge = small(&["--mode", "reference", "--representation", "vertices"]);
    let fine = small(&["--mode", "sheets", "--sampling-error", "1e-5"]);
    let rmse = |a: &Planes, b: &Planes| {
        let channels = a.color.pixels.iter().flatten().zip(b.color.pixels.iter().flatten());
        let (sum, count) = channels.fold((0.0, 0), |(sum, n), (a, b)| (sum + f64::from(a - b).powi(2), n + 1));
        (sum / f64::from(count)).sqrt()
    };
    println!("{:.1e} {:.1e}", rmse(&judge, &fine), apart(&judge, &fine));
    assert!(rmse(&judge, &fine) <= 1e-4 && apart(&judge, &fine) <= 1e-3);
    let light = ["--shade-volume", "--light", "1,2,3"];
    let lit = small(&[&["--mode", "sheets", "--sampling-error", "1e-5"], &light[..]].concat());
    let judged = small(&[&["--mode", "reference", "--representation", "vertices"], &light[..]].concat());
    assert!(rmse(&judged, &lit) <= 1e-4 && apart(&judged, &lit) <= 1e-3);
    assert!(apart(&fine, &lit) > 1e-2, "{light:?}");
    // The comparison can fail: cells are another field, few sheets are off.
    let cells = small(&["--mode", "reference"]);
    let few = small(&["--representation", "vertices", "--sheets", "3"]);
    assert!(apart(&judge, &cells) > 1e-3 && apart(&judge, &few) > 1e-3);
    let rendered = |look: &str, options: &[&str]| {
        let project = format!("version = 1\n[data]\nsource = \"slab.zarr\"\nfield = \"linear\"\n[look]\n{look}");
        std::fs::write(place.path("p.toml"), project).unwrap();
        let words = ["render", "p.toml", "-o", "p.exr", "--exr", "raw", "--size", "32x32", "--steps", "2"];
        place.ok(&[&words, options].concat());
        read_exr(&place.path("p.exr")).unwrap().planes
    };
    let (of_judge, of_sheets) =
        ("mode = \"reference\"\nrepresentation = \"vertices\"\n", "representation = \"vertices\"\nsheets = 3\n");
    assert_eq!(apart(&rendered(of_judge, &[]), &judge), 0.0);
    assert_eq!(apart(&rendered(of_sheets, &[]), &few), 0.0);
    // The user's option takes the place of what does not go with it.
    assert_eq!(apart(&rendered(of_judge, &["--representation", "cells"]), &cells), 0.0);
    assert_eq!(apart(&rendered(of_sheets, &["--mode", "reference"]), &judge), 0.0);
    let walk = small(&["--mode", "raycast"]);
    assert_eq!(apart(&rendered(of_sheets, &["--mode", "raycast"]), &walk), 0.0);
    assert_eq!(apart(&rendered("mode = \"raycast\"\n", &["--representation", "vertices", "--sheets", "3"]), &few), 0.0);
    let refused = |look: &str, options: &[&str], parts: &[&str]| {
        let project = format!("version = 1\n[data]\nsource = \"slab.zarr\"\nfield = \"linear\"\n[look]\n{look}");
        std::fs::write(place.path("p.toml"), project).unwrap();
        place.refuses(&[&["render", "p.toml", "-o", "f.png", "--steps", "1"], options].concat(), parts);
    };
    refused("mode = \"havs\"\nrepresentation = \"vertices\"\n", &[], &["--mode havs", "--representation cells"]);
    refused("representation = \"octree\"\n", &[], &["cells", "vertices"]);
    refused("representation = \"vertices\"\nlod = 0.5\n", &[], &["all cells"]);
}

#[test]
fn a_mode_of_another_representation_is_refused_with_the_remedy() {
    let place = Place::with_slab();
    for mode in ["raycast", "havs", "points"] {
        let options = ["-o", "f.png", "--steps", "1", "--representation", "vertices", "--mode", mode];
        place.refuses(&render(&options), &[mode, "choose sheets or reference", "--representation cells"]);
    }
    let vertices = ["--representation", "vertices", "--mode", "reference"];
    for (options, parts) in [
        (&["--representation", "cells", "--mode", "sheets"][..], &["--mode sheets", "--representation vertices"][..]),
        (&["--representation", "octree"], &["octree", "cells or vertices"]),
        (&["--representation", "vertices", "--lod", "0.5"], &["--lod"]),
        (&[&vertices[..], &["--sheets", "9"]].concat(), &["are about functions on sheets"]),
        (&[&vertices[..], &["--iso", "0.5"]].concat(), &["isosurfaces", "--representation cells"]),
        (&[&vertices[..], &["--cut", "point=0,0,0 normal=1,0,0"]].concat(), &["cuts", "--representation cells"]),
        (&[&vertices[..], &["--surface", "solid"]].concat(), &["surfaces of the domain", "--representation cells"]),
        (&[&vertices[..], &["--backend", "gpu"]].concat(), &["on the CPU only", "--backend gpu"]),
    ] {
        place.refuses(&render(&[&["-o", "f.png", "--steps", "1"], options].concat()), parts);
    }
}

#[test]
fn what_functions_cannot_have_is_refused_with_the_remedy() {
    let place = Place::with_slab();
    for (options, parts) in [
        (&["--sheets", "9"][..], &["are about functions", "--mode sheets"][..]),
        (&["--mode", "raycast", "--sampling-error", "0.1"], &["are about functions", "--mode sheets"]),
        (&["--mode", "sheets", "--iso", "0.5"], &["isosurfaces", "--representation cells"]),
        (&["--mode", "sheets", "--cut", "point=0,0,0 normal=1,0,0"], &["cuts", "--representation cells"]),
        (&["--mode", "sheets", "--backend", "gpu"], &["on the CPU only", "--backend gpu"]),
        (&["--mode", "sheets", "--lod", "0.5"], &["--lod", "--mode havs"]),
        (&["--mode", "sheets", "--rays", "adaptive"], &["--rays adaptive", "--mode raycast"]),
    ] {
        place.refuses(&render(&[&["-o", "f.png", "--steps", "1"], options].concat()), parts);
    }
    for (options, word) in [
        (&["--sheets", "1"][..], "2..="),
        (&["--sheets", "70000"], "2..="),
        (&["--sampling-error", "0"], "share of the range"),
        (&["--sampling-error", "NaN"], "share of the range"),
        (&["--sampling-error", "-1"], "share of the range"),
        (&["--sheets", "9", "--sampling-error", "0.1"], "cannot be used with"),
    ] {
        let run = place.run(&render(&[&["-o", "f.png", "--steps", "1", "--mode", "sheets"], options].concat()));
        assert_eq!((run.code, place.path("f.png").exists()), (Some(2), false), "{options:?}");
        assert!(run.err.contains(word), "{}", run.err);
    }
}

#[test]
fn a_field_is_in_its_domain_and_normalised_as_is_asked_for() {
    let place = Place::with_slab();
    let drawn = |rest: &[&str]| {
        let words = ["render", "slab.zarr", "--field", "linear", "--size", "16x16", "--steps", "2", "--mode"];
        let run = place.run(&[&words[..], &["sheets", "-o", "d.exr", "--exr", "raw"], rest].concat());
        assert_eq!(run.code, Some(0), "{}", run.err);
        (read_exr(&place.path("d.exr")).unwrap().planes, run.err)
    };
    let usual = drawn(&[]);
    assert_eq!(apart(&usual.0, &drawn(&["--domain", "mesh"]).0), 0.0);
    // The mesh is a box.
    assert!(apart(&usual.0, &drawn(&["--domain", "box"]).0) <= 1e-3);
    let (around, said) = drawn(&["--domain", "coverage"]);
    assert!(apart(&usual.0, &around) > 1e-2 && !said.contains("eq20"));
    let (falling, said) = drawn(&["--domain", "coverage", "--normalise", "eq20"]);
    assert!(apart(&around, &falling) > 1e-3 && said.contains("values that are not in the data"), "{said}");
    for (options, parts) in [
        (&["--mode", "raycast", "--domain", "box"][..], &["are about functions", "--representation vertices"][..]),
        (&["--mode", "reference", "--normalise", "eq20"], &["are about functions", "--representation vertices"]),
        (&["--mode", "sheets", "--domain", "ball"], &["ball", "mesh, box or coverage"]),
        (&["--mode", "sheets", "--normalise", "no"], &["sum or eq20"]),
        (&["--mode", "sheets", "--domain", "coverage", "--parts", "0"], &["--parts", "--domain mesh"]),
    ] {
        place.refuses(&render(&[&["-o", "f.png", "--steps", "1"], options].concat()), parts);
    }
}
