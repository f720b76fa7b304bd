//! Isosurfaces on the command line.

use super::{Place, render};
use crate::cubes::cubes;
use crate::series::ingested;
use tetreel::field::Association;
use tetreel::image::{Planes, read_exr};

/// An EXR of the slab at a step with these options.
fn exr(place: &Place, options: &[&str]) -> Planes {
    let step: &[&str] = if options.contains(&"--steps") { &[] } else { &["--steps", "2"] };
    place.ok(&render(&[&["-o", "f.exr", "--exr", "raw"], step, options].concat()));
    read_exr(&place.path("f.exr")).unwrap().planes
}

#[test]
fn isosurfaces_are_drawn_in_their_colours_with_the_volume_and_without() {
    let place = Place::with_slab();
    let info = place.json(&["info", "slab.zarr", "--json"]);
    let range =
        info["fields"].as_array().unwrap().iter().find(|field| field["name"] == "linear").unwrap()["range"].clone();
    let middle = 0.5 * (range[0].as_f64().unwrap() + range[1].as_f64().unwrap());
    let iso = format!("{middle}:#ff0000");
    let alone = exr(&place, &["--iso", &iso, "--no-volume", "--shade", "none"]);
    let seen: Vec<_> = alone.color.pixels.iter().filter(|p| p[3] > 0.0).collect();
    assert!(seen.len() > 50 && seen.iter().all(|p| **p == [1.0, 0.0, 0.0, 1.0]), "{} pixels", seen.len());
    let both = exr(&place, &["--iso", &iso]);
    let volume = exr(&place, &[]);
    assert!(both.color != volume.color && both.color != alone.color);
    // Half of the light passes; a negative number is a value, not an option.
    let half = exr(&place, &["--iso", &format!("{middle}:#00ff00:0.5"), "--no-volume", "--shade=none"]);
    assert!(half.color.pixels.iter().all(|p| *p == [0.0; 4] || *p == [0.0, 0.5, 0.0, 0.5]));
    for mode in ["havs", "reference"] {
        let other = exr(&place, &["--iso", &iso, "--mode", mode]);
        let apart = both.color.pixels.iter().flatten().zip(other.color.pixels.iter().flatten());
        assert!(apart.fold(0.0_f32, |most, (a, b)| most.max((a - b).abs())) < 1e-5, "{mode}");
    }
}

#[test]
fn surfaces_that_are_never_met_or_are_none_are_refused_before_anything_is_written() {
    let place = Place::with_slab();
    for (options, parts) in [
        (&["--iso", "1e6"][..], &["--iso 1000000 is never met", "field linear goes from", "in between"][..]),
        (&["--iso", "-1e6"], &["--iso -1000000 is never met"]),
        (&["--no-volume"], &["--no-volume leaves nothing", "--iso VALUE"]),
        (&["--iso", "0.5"].repeat(33), &["33 isosurfaces; a frame has at most 32"]),
    ] {
        place.refuses(&render(&[&["-o", "f.png", "--steps", "1"], options].concat()), parts);
    }
    for (options, word) in [
        (["--iso", "warm"], "is no isovalue"),
        (["--iso", "0.5:red"], "is no colour"),
        (["--iso", "0.5::2"], "an opacity of 2"),
        (["--shade", "smooth"], "cell, vertex, screen, depth or none"),
        (["--light", "0,0,0"], "is no light"),
    ] {
        let run = place.run(&render(&[&["-o", "f.png", "--steps", "1"][..], &options].concat()));
        assert_eq!((run.code, place.path("f.png").exists()), (Some(2), false));
        assert!(run.err.contains(word), "{}", run.err);
    }
}

#[test]
fn frames_without_the_isovalue_are_drawn_empty_and_counted() {
    let place = Place::with_slab();
    let info = place.json(&["info", "slab.zarr", "--json"]);
    let fields = info["fields"].as_array().unwrap();
    let hi = fields.iter().find(|field| field["name"] == "linear").unwrap()["range"][1].as_f64().unwrap();
    // The field grows: only the last step reaches this.
    let iso = format!("{}", 0.99 * hi);
    let options = ["-o", "f_%d.png", "--iso", &iso, "--no-volume", "--stats", "s.json"];
    let run = place.run(&render(&options));
    assert!(run.code == Some(0) && run.err.contains("; 4 of them show nothing"), "{}", run.err);
    let stats: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(place.path("s.json")).unwrap()).unwrap();
    let empty: Vec<bool> = stats.as_array().unwrap().iter().map(|frame| frame["empty"].as_bool().unwrap()).collect();
    assert_eq!(empty, [true, true, true, true, false]);
}

#[test]
fn a_surface_may_have_the_colours_of_another_field() {
    let place = Place::with_slab();
    place.ok(&["synth", "tornado", "-o", "t.zarr", "--cells", "3000", "--steps", "3"]);
    let info = place.json(&["info", "t.zarr", "--json"]);
    let fields = info["fields"].as_array().unwrap();
    let scalar = |field: &serde_json::Value| field["range"].as_array().is_some();
    let names: Vec<&str> =
        fields.iter().filter(|field| scalar(field)).map(|field| field["name"].as_str().unwrap()).collect();
    let [shown, other, ..] = names[..] else { panic!("{names:?}") };
    let range = &fields.iter().find(|field| field["name"] == shown).unwrap()["range"];
    let middle = 0.5 * (range[0].as_f64().unwrap() + range[1].as_f64().unwrap());
    let draw = |iso: &str, file: &str, more: &[&str]| {
        let args = [
            &["render", "t.zarr", "-o", file, "--exr", "raw", "--size", "64x64", "--steps", "1"][..],
            &["--field", shown, "--no-volume", "--shade", "none", "--iso", iso],
            more,
        ]
        .concat();
        place.ok(&args);
        read_exr(&place.path(file)).unwrap().planes
    };
    let own = draw(&format!("{middle}"), "own.exr", &[]);
    let by_itself = draw(&format!("{middle}:by={shown}@viridis"), "itself.exr", &["--tf", "viridis"]);
    let by_other = draw(&format!("{middle}:by={other}@viridis:0.5"), "other.exr", &[]);
    // By itself it has one colour: that of the middle of the range.
    let colors: Vec<[f32; 4]> = by_itself.color.pixels.iter().filter(|p| p[3] > 0.0).copied().collect();
    assert!(colors.len() > 20 && colors.iter().all(|p| (p[0] - colors[0][0]).abs() < 1e-4), "{} pixels", colors.len());
    let seen: Vec<[f32; 4]> = by_other.color.pixels.iter().filter(|p| p[3] > 0.0).copied().collect();
    assert!(seen.iter().any(|p| (p[0] - seen[0][0]).abs() > 1e-3) && seen.iter().all(|p| p[3] <= 1.0));
    assert!(own.depth == by_other.depth && own.color != by_other.color);
    let judge = draw(&format!("{middle}:by={other}@viridis:0.5"), "judge.exr", &["--mode", "reference"]);
    let apart = judge.color.pixels.iter().flatten().zip(by_other.color.pixels.iter().flatten());
    assert!(apart.fold(0.0_f32, |most, (a, b)| most.max((a - b).abs())) < 1e-4);
    // A section as well.
    let cut = format!("point=0,0,0 normal=0,0,1 field={other}");
    place.run(&[
        "render", "t.zarr", "-o", "cut.exr", "--steps", "1", "--size", "64x64", "--field", shown, "--cut", &cut,
    ]);
    let missing =
        ["render", "t.zarr", "-o", "x.png", "--steps", "1", "--field", shown, "--iso", &format!("{middle}:by=nothing")];
    place.refuses(&missing, &["colours by 'nothing'", "nothing"]);
}

#[test]
fn parts_that_there_are_not_are_refused_and_the_only_one_is_the_whole() {
    let place = Place::with_slab();
    let all = exr(&place, &[]);
    assert!(exr(&place, &["--parts", "0"]).color == all.color);
    let missing = render(&["-o", "x.png", "--steps", "1", "--parts", "0,1"]);
    place.refuses(&missing, &["--parts 1: the mesh has 1 part, counted from 0"]);
    for (regions, problem) in [("linear=1", "has values of vertices"), ("linear", "write FIELD=VALUE")] {
        let wrong = render(&["-o", "x.png", "--steps", "1", "--regions", regions]);
        place.refuses(&wrong, &["--regions", problem]);
    }
}

#[test]
fn surfaces_of_regions_are_drawn_and_those_that_there_are_not_are_refused() {
    let place = Place::with_slab();
    let fields = [("T", Association::Point), ("block", Association::Cell)];
    let source = cubes([2, 2, 2], false, 2, &fields, |_, _, at| if at.x < 1.0 { 1.0 } else { 2.0 });
    ingested(&source, &place.path("b.zarr"), "0..1");
    let args = |more: &[&'static str]| {
        [&["render", "b.zarr", "--field", "T", "--steps", "1", "--size", "64x64", "--shade", "none"][..], more].concat()
    };
    let draw = |more: &[&'static str]| {
        place.ok(&args(&[&["-o", "f.exr", "--exr", "raw"], more].concat()));
        read_exr(&place.path("f.exr")).unwrap().planes
    };
    let red = |planes: &Planes| planes.color.pixels.iter().filter(|p| **p == [1.0, 0.0, 0.0, 1.0]).count();
    let shell = ["--no-volume", "--surface", "solid:block=2:#ff0000"];
    let (half, whole) = (draw(&shell), draw(&["--no-volume", "--surface", "solid:block=1..2:#ff0000"]));
    assert!(red(&half) > 200 && red(&whole) > red(&half) + 100, "{} of {}", red(&half), red(&whole));
    assert!(half.color.pixels.iter().all(|p| *p == [0.0; 4] || *p == [1.0, 0.0, 0.0, 1.0]));
    assert!(draw(&[&shell[..], &["--regions", "block=1"]].concat()) == half, "whatever the volume shows");
    for mode in ["havs", "reference"] {
        assert!(draw(&[&shell[..], &["--mode", mode]].concat()).color == half.color, "{mode}");
    }
    for (surface, parts) in [
        ("solid:T=1", ["--surface solid:T=1", "'T' has values of vertices; regions are chosen by a field of cells"]),
        ("edges:block=9", ["--surface edges:block=9", "no cell has such a value; those of 'block' go from 1 to 2"]),
        ("solid:part=1:#ff0000", ["--surface solid:part=1", "'part'"]),
        ("solid:block=x", ["--surface", "write VALUE,FROM..TO"]),
    ] {
        place.refuses(&args(&["-o", "x.png", "--surface", surface]), &parts);
    }
}

#[test]
fn a_field_of_vectors_has_no_isosurface_without_a_component() {
    let place = Place::with_slab();
    place.ok(&["synth", "tornado", "-o", "t.zarr", "--cells", "2000", "--steps", "2"]);
    let info = place.json(&["info", "t.zarr", "--json"]);
    let fields = info["fields"].as_array().unwrap();
    let names: Vec<&str> = fields.iter().map(|field| field["name"].as_str().unwrap()).collect();
    let vector = names.iter().find_map(|name| name.strip_suffix(":0")).unwrap_or_else(|| panic!("{names:?}"));
    let run = place.run(&["render", "t.zarr", "-o", "f.png", "--field", vector, "--iso", "0.5", "--steps", "1"]);
    assert_eq!((run.code, place.path("f.png").exists()), (Some(2), false), "{}", run.err);
    assert!(run.err.contains(":mag"), "{}", run.err);
}

#[test]
fn a_resumed_run_keeps_frames_of_the_same_surfaces_only() {
    let place = Place::with_slab();
    let run = |options: &[&str]| {
        place.ok(&render(&[&["-o", "f.png", "--steps", "1", "--resume", "--stats", "s.json"], options].concat()));
        std::fs::read_to_string(place.path("s.json")).unwrap().contains("\"kept\"")
    };
    let lit = ["--iso", "0.4", "--shade", "vertex"];
    assert_eq!([run(&[]), run(&["--shade", "vertex"])], [false, true], "nothing is lit");
    assert_eq!([run(&lit), run(&lit), run(&["--iso", "0.4"]), run(&["--iso", "0.41"])], [false, true, false, false]);
}

#[test]
fn the_timeline_of_a_project_moves_an_isovalue() {
    let place = Place::with_slab();
    let info = place.json(&["info", "slab.zarr", "--json"]);
    let fields = info["fields"].as_array().unwrap();
    let range = &fields.iter().find(|field| field["name"] == "linear").unwrap()["range"];
    let [lo, hi] = [0, 1].map(|end| range[end].as_f64().unwrap());
    let share = |share: f64| lo + share * (hi - lo);
    let end = info["time"]["last"].as_f64().unwrap();
    let project = |keys: [f64; 2]| {
        format!(
            "version = 1\n[data]\nsource = \"slab.zarr\"\nfield = \"linear\"\n[look]\niso = [\"{}:#ff0000\"]\nno-volume = true\n\
             shade = \"none\"\n[output]\noutput = \"p_%d.exr\"\nsize = \"64x64\"\nexr = \"raw\"\n[[timeline.isovalue]]\ntime = 0.0\n\
             value = {:?}\n[[timeline.isovalue]]\ntime = {end:?}\nvalue = {:?}\n",
            share(0.5),
            keys[0],
            keys[1]
        )
    };
    std::fs::write(place.path("p.toml"), project([share(0.3), share(0.7)])).unwrap();
    place.ok(&["render", "p.toml"]);
    let moved = |step: usize| read_exr(&place.path(&format!("p_{step}.exr"))).unwrap().planes;
    let alone = |share_at: f64, step: &str| {
        let iso = format!("{}:#ff0000", share(share_at));
        let options = ["-o", "f.exr", "--exr", "raw", "--steps", step, "--iso", &iso, "--no-volume", "--shade", "none"];
        place.ok(&render(&options));
        read_exr(&place.path("f.exr")).unwrap().planes
    };
    for (step, share) in [(0, 0.3), (4, 0.7)] {
        let alone = alone(share, &step.to_string());
        assert!(moved(step).color == alone.color && moved(step).depth == alone.depth, "step {step}");
        assert!(moved(2).depth != alone.depth, "in between it is elsewhere");
    }
    // Its opacity has keys of its own.
    let fading = format!(
        "{}[[timeline.iso-opacity]]\ntime = 0.0\nvalue = 1.0\n[[timeline.iso-opacity]]\ntime = {end:?}\nvalue = 0.5\n",
        project([share(0.5); 2])
    );
    std::fs::write(place.path("fading.toml"), fading).unwrap();
    place.ok(&["render", "fading.toml", "-o", "fading_%d.exr"]);
    let most = |step: usize| {
        let image = read_exr(&place.path(&format!("fading_{step}.exr"))).unwrap().planes;
        image.color.pixels.iter().map(|p| p[3]).fold(0.0, f32::max)
    };
    assert_eq!([most(0), most(4)], [1.0, 0.5]);
    assert!((0.5..1.0).contains(&most(2)));
    // A surface of the command line stays where it is; one that is never within the range is refused.
    place.ok(&["render", "p.toml", "--iso", &format!("{}:#ff0000", share(0.5)), "-o", "q_%d.exr"]);
    let still = [0, 4].map(|step| read_exr(&place.path(&format!("q_{step}.exr"))).unwrap().planes.color);
    assert!(still == [alone(0.5, "0").color, alone(0.5, "4").color]);
    std::fs::write(place.path("p.toml"), project([share(1.5), share(1.2)])).unwrap();
    place.refuses(&["render", "p.toml"], &["is never met", "field linear goes from"]);
}

/// The box of the slab's mesh.
fn bounds(place: &Place) -> [[f64; 3]; 2] {
    let info = place.json(&["info", "slab.zarr", "--json"]);
    [0, 1].map(|end: usize| [0, 1, 2].map(|axis| info["mesh"]["bounds"][end][axis].as_f64().unwrap()))
}

#[test]
fn planes_cut_the_mesh_in_every_mode_and_a_box_is_its_six_sides() {
    let place = Place::with_slab();
    let [lo, hi] = bounds(&place);
    let at = |share: f64| [0, 1, 2].map(|axis: usize| lo[axis] + share * (hi[axis] - lo[axis]));
    let text = |[x, y, z]: [f64; 3]| format!("{x},{y},{z}");
    let cut = format!("point={} normal=1,0.2,0", text(at(0.5)));
    let clip = format!("{cut} clip");
    let whole = exr(&place, &[]);
    let images =
        [&["--cut", &cut][..], &["--cut", &clip], &["--cut", &cut, "--no-volume"], &["--cut", &clip, "--cut", &cut]]
            .map(|options| {
                let image = exr(&place, options);
                for mode in ["havs", "reference"] {
                    let other = exr(&place, &[options, &["--mode", mode]].concat());
                    let apart = image.color.pixels.iter().flatten().zip(other.color.pixels.iter().flatten());
                    let most = apart.fold(0.0_f32, |most, (a, b)| most.max((a - b).abs()));
                    assert!(most < 1e-4, "{options:?}, {mode}: {most}");
                }
                image.color
            });
    assert!(images.iter().enumerate().all(|(i, image)| *image != whole.color && !images[..i].contains(image)));
    let crop = format!("min={} max={}", text(at(0.2)), text(at(0.7)));
    let mut sides: Vec<String> = Vec::new();
    for (axis, normal) in ["1,0,0", "0,1,0", "0,0,1"].into_iter().enumerate() {
        let turned = normal.replace('1', "-1");
        sides.push(format!("point={} normal={turned} clip", text(at(0.2))));
        sides.push(format!("point={} normal={normal} clip", text(at(0.7))));
        assert!(axis < 3);
    }
    let options: Vec<&str> = sides.iter().flat_map(|side| ["--cut", side]).collect();
    let (boxed, by_sides) = (exr(&place, &["--crop", &crop]).color, exr(&place, &options).color);
    assert!(boxed != whole.color && boxed == by_sides);
}

#[test]
fn cuts_that_leave_or_meet_nothing_are_refused_before_anything_is_written() {
    let place = Place::with_slab();
    let [lo, hi] = bounds(&place);
    let beyond = format!("{},{},{}", hi[0] + 1.0, hi[1], hi[2]);
    let away = format!("point={},0,0 normal=1,0,0 clip", lo[0] - 1.0);
    let section = format!("point={beyond} normal=1,0,0");
    let crop = format!("min={beyond} max={},{},{}", hi[0] + 2.0, hi[1] + 1.0, hi[2] + 1.0);
    for (options, parts) in [
        (["--cut", &away], &["leave nothing", "the mesh goes from", "turn its normal"][..]),
        (["--cut", &section], &["meets nothing", "the mesh goes from"]),
        (["--crop", &crop], &["--crop leaves nothing"]),
    ] {
        place.refuses(&render(&[&["-o", "f.png", "--steps", "1"][..], &options].concat()), parts);
    }
    for (options, word) in [
        (["--cut", "point=0,0,0"], "normal= is missing"),
        (["--cut", "point=0,0,0 normal=0,0,0"], "has no direction"),
        (["--cut", "point=0,0,nan normal=0,0,1"], "three finite numbers"),
        (["--crop", "min=0,0,0 max=0,1,1"], "from 0 to 0 in x"),
    ] {
        let run = place.run(&render(&[&["-o", "f.png", "--steps", "1"][..], &options].concat()));
        assert_eq!((run.code, place.path("f.png").exists()), (Some(2), false));
        assert!(run.err.contains(word), "{}", run.err);
    }
}

#[test]
fn the_timeline_of_a_project_moves_a_cut() {
    let place = Place::with_slab();
    let [lo, hi] = bounds(&place);
    let end = place.json(&["info", "slab.zarr", "--json"])["time"]["last"].as_f64().unwrap();
    let project = |keys: [f64; 2]| {
        format!(
            "version = 1\n[data]\nsource = \"slab.zarr\"\nfield = \"linear\"\n[look]\ncut = [\"point={},0,0 normal=2,0,0\"]\n\
             no-volume = true\n[output]\noutput = \"p_%d.exr\"\nsize = \"64x64\"\nexr = \"raw\"\n[[timeline.cut]]\ntime = 0.0\n\
             value = {:?}\n[[timeline.cut]]\ntime = {end:?}\nvalue = {:?}\n",
            lo[0], keys[0], keys[1]
        )
    };
    let width = hi[0] - lo[0];
    std::fs::write(place.path("p.toml"), project([0.25 * width, 0.75 * width])).unwrap();
    place.ok(&["render", "p.toml"]);
    for (step, share) in [(0, 0.25), (4, 0.75)] {
        let cut = format!("point={},0,0 normal=1,0,0", lo[0] + share * width);
        let alone = exr(&place, &["--steps", &step.to_string(), "--cut", &cut, "--no-volume"]);
        let moved = read_exr(&place.path(&format!("p_{step}.exr"))).unwrap().planes;
        assert!(moved.color == alone.color && moved.depth == alone.depth, "step {step}");
    }
    std::fs::write(place.path("p.toml"), project([-2.0 * width, -width])).unwrap();
    place.refuses(&["render", "p.toml"], &["meets nothing", "the mesh goes from"]);
    std::fs::write(place.path("p.toml"), project([-2.0 * width, 2.0 * width])).unwrap();
    place.ok(&["render", "p.toml"]);
}
