//! `tetreel render`: what is drawn over frames, and where they are rendered.

use super::{Place, render};
use tetreel::image::{RgbaImage, read_exr, read_png};

/// Pixels that differ.
fn changed(a: &RgbaImage, b: &RgbaImage) -> Vec<usize> {
    (0..a.pixels.len()).filter(|&i| a.pixels[i] != b.pixels[i]).collect()
}

#[test]
fn annotations_are_drawn_where_they_belong_and_over_nothing_else() {
    let place = Place::with_slab();
    let at = |name: &'static str, parts: &[&'static str]| {
        let size = ["--size", "240x180", "--steps", "2", "-o", name];
        place.ok(&[&["render", "slab.zarr", "--field", "linear", "--tf", "viridis@0:0.01,1:0.2"], &size, parts].concat());
        place.path(name)
    };
    let plain = read_png(&at("plain.png", &[])).unwrap();
    for (parts, x, y) in [("time", 0..120, 120..180), ("legend", 120..240, 0..180), ("title", 0..240, 0..60)] {
        let drawn = read_png(&at("drawn.png", &["--annotate", parts])).unwrap();
        let changed = changed(&plain, &drawn);
        assert!(changed.len() > 20, "{parts}: {} pixels", changed.len());
        assert!(changed.iter().all(|i| x.contains(&(i % 240)) && y.contains(&(i / 240))), "{parts}");
    }
    // The colours of an EXR have them, its depths do not.
    let (bare, noted) = (at("bare.exr", &[]), at("noted.exr", &["--annotate", "time,legend,title=Slab, heated"]));
    let (bare, noted) = (read_exr(&bare).unwrap(), read_exr(&noted).unwrap());
    assert!(!changed(&bare.color, &noted.color).is_empty());
    assert_eq!(bare.depth, noted.depth);
}

#[test]
fn other_annotations_make_other_frames() {
    let place = Place::with_slab();
    let run = |parts: &str| {
        place.ok(&render(&["-o", "f.png", "--steps", "1", "--resume", "--stats", "s.json", "--annotate", parts]));
        std::fs::read_to_string(place.path("s.json")).unwrap().contains("\"kept\"")
    };
    assert_eq!([run("time"), run("time"), run("time,title"), run("time")], [false, true, false, false]);
}

#[test]
fn backends_and_annotations_that_do_not_exist_are_refused() {
    let place = Place::with_slab();
    place
        .refuses(&render(&["-o", "f.png", "--steps", "1", "--mode", "reference", "--backend", "gpu"]), &["on the CPU"]);
    for (option, value, word) in
        [("--backend", "cuda", "auto, cpu or gpu"), ("--annotate", "clock", "time, legend, title")]
    {
        let run = place.run(&render(&["-o", "f.png", "--steps", "1", option, value]));
        assert_eq!((run.code, place.path("f.png").exists()), (Some(2), false));
        assert!(run.err.contains(word), "{}", run.err);
    }
    #[cfg(feature = "gpu")]
    place.refuses(
        &render(&["-o", "f.png", "--steps", "1", "--adapter", "no such GPU"]),
        &["no GPU", "--backend cpu renders without one"],
    );
}

#[test]
fn statistics_take_the_place_of_nothing() {
    let place = Place::with_slab();
    place.refuses(&render(&["-o", "f.png", "--steps", "1", "--stats", "f.png"]), &["f.png", "place of a frame"]);
    place.refuses(&render(&["-o", "f_%d.png", "--stats", "./f_3.png"]), &["f_3.png", "place of a frame"]);
    place.refuses(&render(&["-o", "f.png", "--steps", "1", "--stats", "slab.zarr/zarr.json"]), &["part of the series"]);
    place.refuses(&render(&["-o", "f.png", "--steps", "1", "--stats", "."]), &["is a folder"]);
}

#[test]
fn frames_of_other_times_are_rendered_again() {
    let place = Place::empty();
    place.ok(&["synth", "slab", "-o", "slabs", "--cells", "500", "--steps", "3"]);
    let pvd = place.path("slabs/slabs.pvd");
    let kept = || {
        place.ok(&["import", "slabs/slabs.pvd", "-o", "slab.zarr", "--overwrite"]);
        place.ok(&render(&["-o", "f_%d.png", "--resume", "--stats", "s.json"]));
        std::fs::read_to_string(place.path("s.json")).unwrap().matches("\"kept\"").count()
    };
    assert_eq!((kept(), kept()), (0, 3));
    let text = std::fs::read_to_string(&pvd).unwrap();
    let last = text.rsplit("timestep=\"").next().unwrap().split('"').next().unwrap();
    let later = text.replace(&format!("timestep=\"{last}\""), "timestep=\"77.5\"");
    assert_ne!(later, text);
    std::fs::write(&pvd, later).unwrap();
    assert_eq!(kept(), 2, "the last step has another time");
}

#[cfg(feature = "gpu")]
#[test]
fn frames_of_both_backends_are_the_same_picture() {
    if crate::render::gpu::context().is_none() {
        return;
    }
    let place = Place::with_slab();
    let run = |backend: &str| {
        let file = format!("{backend}.exr");
        place.ok(&render(&["-o", &file, "--exr", "raw", "--steps", "3", "--backend", backend, "--stats", "s.json"]));
        let stats = std::fs::read_to_string(place.path("s.json")).unwrap();
        assert_eq!(stats.contains("\"on_gpu\": true"), backend == "gpu", "{stats}");
        read_exr(&place.path(&file)).unwrap()
    };
    let (cpu, gpu) = (run("cpu"), run("gpu"));
    crate::render::assert_within("GPU against CPU", &gpu.color, &cpu.color);
    assert!(cpu.color.pixels.iter().any(|p| p[3] > 0.1));
}
