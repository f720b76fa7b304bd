//! `tetreel render`: what is drawn over frames, and where they are rendered.

use super::{Place, STEPS, render};
use serde_json::Value;
#[cfg(feature = "gpu")]
use tetreel::image::Planes;
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
    let (bare, noted) = (read_exr(&bare).unwrap().planes, read_exr(&noted).unwrap().planes);
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
    for cpu in [["--backend", "cpu"], ["--mode", "reference"]] {
        let named = ["-o", "f.png", "--steps", "1", "--adapter", "no such GPU"];
        place
            .refuses(&render(&[&named[..], &cpu].concat()), &["--adapter", &cpu.join(" "), "leave one of the two out"]);
    }
    #[cfg(feature = "gpu")]
    place.refuses(
        &render(&["-o", "f.png", "--steps", "1", "--adapter", "no such GPU"]),
        &["no GPU", "--backend cpu renders without one"],
    );
}

#[test]
fn fewer_rays_are_cast_where_that_is_asked_for_and_files_say_so() {
    let place = Place::with_slab();
    let exr = |rays: &[&'static str]| {
        let how = [&["-o", "f.exr", "--steps", "1", "--exr", "raw", "--stats", "s.json"], rays].concat();
        place.ok(&render(&how));
        let stats: Value = serde_json::from_slice(&std::fs::read(place.path("s.json")).unwrap()).unwrap();
        let frame = &stats.get("frames").unwrap_or(&stats)[0];
        let rays: u64 = frame["stats"]["rays_by_level"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum();
        (read_exr(&place.path("f.exr")).unwrap(), rays)
    };
    let ((exact, all), (same, at_zero)) = (exr(&[]), exr(&["--rays", "adaptive:0"]));
    assert!(exact.planes == same.planes);
    assert_eq!((all, at_zero), (64 * 64, 64 * 64));
    let (fewer, rays) = exr(&["--rays", "adaptive:0.2", "--backend", "cpu"]);
    assert!(rays > 0 && rays < 64 * 64 && fewer.planes != exact.planes, "{rays}");
    assert!(std::fs::read(place.path("f.exr")).unwrap().windows(8).any(|bytes| bytes == b"contrast"));
    for (how, words) in [
        (&["--rays", "few"][..], &["--rays", "exact, adaptive or adaptive:CONTRAST"][..]),
        (&["--rays", "adaptive:-1"], &["--rays", "0 to 1"]),
        (&["--rays", "adaptive", "--mode", "havs"], &["--rays adaptive", "havs", "--rays exact"]),
        (&["--rays", "adaptive", "--mode", "reference"], &["reference"]),
        (&["--rays", "adaptive", "--lod", "0.5"], &["havs"]),
        (&["--rays", "adaptive", "--iso", "0.5", "--ao"], &["--ao", "--rays exact"]),
    ] {
        place.refuses(&render(&[&["-o", "no.png", "--steps", "1"], how].concat()), words);
    }
    // Of a project, all moments count before the first is rendered.
    let project = "version = 1\n[data]\nsource = \"slab.zarr\"\n[output]\noutput = \"p_%d.png\"\nsize = \"64x64\"\nrays = \"adaptive\"\n\
                   [[timeline.lod]]\ntime = 0.0\nvalue = 1.0\n[[timeline.lod]]\ntime = 9.0\nvalue = 0.5\n";
    std::fs::write(place.path("p.toml"), project).unwrap();
    place.refuses(&["render", "p.toml"], &["--rays adaptive", "[[timeline.lod]]", "--rays exact"]);
    assert!(!place.path("p_0.png").exists());
    place.ok(&["render", "p.toml", "--rays", "exact"]);
}

#[test]
fn small_images_come_to_full_size_where_that_is_asked_for_and_files_say_so() {
    let place = Place::with_slab();
    let exr = |how: &[&'static str]| {
        let how = [&["-o", "f.exr", "--steps", "1", "--exr", "raw", "--stats", "s.json"], how].concat();
        place.ok(&render(&how));
        let stats: Value = serde_json::from_slice(&std::fs::read(place.path("s.json")).unwrap()).unwrap();
        let layers = stats.get("frames").unwrap_or(&stats)[0]["stats"]["depth_layers"].as_u64().unwrap();
        let bytes = std::fs::read(place.path("f.exr")).unwrap();
        let says = ["image_scale", "upsample", "kernel", "sigma_depth", "layers"]
            .map(|key| bytes.windows(key.len()).any(|bytes| bytes == key.as_bytes()));
        (read_exr(&place.path("f.exr")).unwrap().planes, layers, says)
    };
    let (exact, _, says) = exr(&[]);
    assert_eq!(says, [false; 5]);
    for (how, layers, says) in [
        (&["--image-scale", "1/4"][..], 0, [true, true, false, false, false]),
        (&["--image-scale", "1/2", "--upsample", "nearest"], 0, [true, true, false, false, false]),
        (&["--image-scale", "1/8", "--upsample", "joint", "--kernel", "5", "--layers", "2"], 2, [true; 5]),
        (
            &["--image-scale", "1/2", "--upsample", "joint2x2", "--sigma-depth", "0.1"],
            6,
            [true, true, false, true, true],
        ),
        (&["--lod", "0.2", "--upsample", "joint"], 3, [true; 5]),
        (&["--mode", "havs", "--image-scale", "1/2"], 0, [true, true, false, false, false]),
    ] {
        let (planes, drawn, said) = exr(how);
        assert_eq!((planes.color.width, planes.color.height), (64, 64), "{how:?}");
        assert!(planes.color != exact.color, "{how:?}");
        assert_eq!((drawn, said), (layers, says), "{how:?}");
    }
    assert!(exr(&["--image-scale", "1"]).0 == exact);
    for (how, words) in [
        (&["--image-scale", "1/3"][..], &["--image-scale", "1/3", "1/2"][..]),
        (&["--image-scale", "NaN"], &["--image-scale", "NaN", "1/8"]),
        (&["--image-scale", "1/2", "--upsample", "cubic"], &["--upsample", "cubic", "joint2x2"]),
        (&["--image-scale", "1/2", "--upsample", "joint", "--kernel", "0"], &["--kernel", "0", "1..=64"]),
        (&["--image-scale", "1/2", "--upsample", "joint", "--kernel", "65"], &["--kernel", "65", "1..=64"]),
        (&["--image-scale", "1/2", "--upsample", "joint", "--sigma-depth", "0"], &["--sigma-depth", "0", "above 0"]),
        (&["--image-scale", "1/2", "--upsample", "joint", "--sigma-depth", "inf"], &["--sigma-depth", "inf"]),
        (&["--image-scale", "1/2", "--upsample", "joint", "--sigma-depth", "-1"], &["--sigma-depth", "-1"]),
        (&["--image-scale", "1/2", "--upsample", "joint", "--layers", "0"], &["--layers", "0", "1..=3"]),
        (&["--image-scale", "1/2", "--upsample", "joint", "--layers", "4"], &["--layers", "4", "1..=3"]),
        (&["--upsample", "joint"], &["--upsample joint", "--image-scale", "--lod"]),
        (&["--upsample", "bilinear", "--lod", "0.5"], &["--upsample bilinear", "--image-scale"]),
        (&["--kernel", "8"], &["--kernel", "--upsample joint"]),
        (&["--image-scale", "1/2", "--layers", "2"], &["--layers", "--upsample joint", "joint2x2"]),
        (&["--image-scale", "1/2", "--upsample", "joint2x2", "--kernel", "8"], &["--kernel", "--upsample joint"]),
        (&["--image-scale", "1/2", "--mode", "reference"], &["reference", "--image-scale", "--mode"]),
        (&["--image-scale", "1/2", "--rays", "adaptive"], &["--rays adaptive", "--image-scale", "--rays exact"]),
    ] {
        place.refuses(&render(&[&["-o", "no.png", "--steps", "1"], how].concat()), words);
    }
    let project = "version = 1\n[data]\nsource = \"slab.zarr\"\n[output]\noutput = \"p_%d.exr\"\nsize = \"64x64\"\nsteps = \"1\"\n\
                   image-scale = \"1/4\"\nupsample = \"joint\"\nkernel = 6\nsigma-depth = 0.02\nlayers = 1\n";
    std::fs::write(place.path("u.toml"), project).unwrap();
    place.ok(&["render", "u.toml", "--stats", "s.json"]);
    let bytes = std::fs::read(place.path("p_0.exr")).unwrap();
    assert!(bytes.windows(11).any(|bytes| bytes == b"sigma_depth"));
    // Another scale on the command line drops the file's filter.
    place.ok(&["render", "u.toml", "--image-scale", "1", "-o", "full.exr"]);
    let bytes = std::fs::read(place.path("full.exr")).unwrap();
    assert!(["upsample", "sigma_depth"].iter().all(|key| !bytes.windows(key.len()).any(|b| b == key.as_bytes())));
    let asked = ["render", "u.toml", "--image-scale", "1", "--upsample", "joint", "-o", "no.exr"];
    place.refuses(&asked, &["--upsample joint", "--image-scale"]);
    assert!(!place.path("no.exr").exists());
}

#[test]
fn steps_behind_the_last_one_are_left_out_which_is_said() {
    let place = Place::with_slab();
    let run = place.run(&render(&["-o", "f_%d.png", "--steps", "1..99:2"]));
    assert_eq!(run.code, Some(0), "{}", run.err);
    assert!(run.err.contains("--steps 1..99:2: the last step of the series is 4"), "{}", run.err);
    assert_eq!([0, 1, 2].map(|n| place.path(&format!("f_{n}.png")).exists()), [true, true, false]);
    let run = place.run(&["export", "slab.zarr", "-o", "part.pvd", "--steps", "3..7"]);
    assert!(run.out.contains("2 steps") && run.err.contains("the last step of the series is 4"), "{}", run.err);
    for more in [&[][..], &["--append"]] {
        place.ok(&[&["import", "part.pvd", "-o", "part.zarr", "--steps", "0..5"][..], more].concat());
        assert_eq!(place.json(&["info", "part.zarr", "--json"])["time"]["steps"], 2);
    }
}

#[test]
fn the_last_word_says_what_was_written_and_what_was_there() {
    let place = Place::with_slab();
    let said = |file: &str, more: &[&str]| place.run(&render(&[&["-o", file, "--resume"][..], more].concat())).err;
    let first = said("f_%d.png", &[]);
    assert!(first.contains("wrote 5 frames, f_0.png to f_4.png\n"), "{first}");
    std::fs::remove_file(place.path("f_3.png")).unwrap();
    let some = said("f_%d.png", &[]);
    assert!(some.contains("wrote 1 of 5 frames, f_0.png to f_4.png; 4 were there already"), "{some}");
    let none = said("f_%d.png", &[]);
    assert!(none.contains("all 5 frames were there already, f_0.png to f_4.png") && !none.contains("wrote"), "{none}");
    let one = ["--steps", "2"];
    assert!(said("one.png", &one).contains("wrote one.png\n"));
    assert!(said("one.png", &one).contains("one.png was there already"));
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
    for how in [&["--mode", "raycast"][..], &["--mode", "havs"], &["--mode", "havs", "--lod", "0.3", "--inexact-order"]]
    {
        let run = |backend: &str| frame_of(&place, backend, how);
        let (cpu, gpu) = (run("cpu"), run("gpu"));
        crate::render::assert_within(&format!("{how:?}: GPU against CPU"), &gpu.color, &cpu.color);
        assert!(cpu.color.pixels.iter().any(|p| p[3] > 0.1));
    }
}

#[cfg(feature = "gpu")]
fn frame_of(place: &Place, backend: &str, how: &[&str]) -> Planes {
    let file = format!("{backend}.exr");
    let mut args = vec!["-o", &file, "--exr", "raw", "--steps", "3", "--backend", backend, "--stats", "s.json"];
    args.extend(how);
    place.ok(&render(&args));
    let stats = std::fs::read_to_string(place.path("s.json")).unwrap();
    assert_eq!(stats.contains("\"on_gpu\": true"), backend == "gpu", "{stats}");
    read_exr(&place.path(&file)).unwrap().planes
}

#[test]
fn a_trace_shows_that_frames_are_prepared_while_others_are_rendered() {
    let place = Place::with_slab();
    place.ok(&["render", "slab.zarr", "-o", "f_%d.png", "--size", "200x200", "--backend", "cpu", "--trace", "t.json"]);
    let trace: Vec<Value> = serde_json::from_slice(&std::fs::read(place.path("t.json")).unwrap()).unwrap();
    // Begin and end in microseconds of the spans of a stage, by frame.
    let spans = |stage: &str| {
        let of = |phase: &str| {
            let events = trace.iter().filter(|e| e["name"] == stage && e["ph"] == phase);
            events.map(|e| e["ts"].as_f64().unwrap()).collect::<Vec<_>>()
        };
        of("B").into_iter().zip(of("E")).collect::<Vec<_>>()
    };
    let [decode, order, placing, render, begin] = ["decode", "order", "place", "render", "begin"].map(spans);
    assert_eq!([&decode, &order, &placing, &render, &begin].map(Vec::len), [STEPS; 5]);
    let is_within = |(inner, outer): (&(f64, f64), &(f64, f64))| outer.0 <= inner.0 && inner.1 <= outer.1;
    assert!(placing.iter().zip(&order).all(is_within), "placed before the renderer has it: {placing:?} {order:?}");
    assert!(begin.iter().zip(&render).all(is_within));
    for frame in 0..STEPS {
        assert!(decode[frame].1 <= order[frame].0 && order[frame].1 <= render[frame].0, "a frame passes all stages");
    }
    // The renderer does not wait for the next frame to be prepared: that happened before it was done with this one.
    let overlaps = (1..STEPS).filter(|&n| decode[n].0 < render[n - 1].1).count();
    assert!(overlaps * 2 > STEPS, "{overlaps} of {}: {decode:?} {render:?}", STEPS - 1);
    let threads: Vec<&Value> =
        trace.iter().filter(|e| e["name"] == "thread_name").map(|e| &e["args"]["name"]).collect();
    assert!(["decode", "order", "render"].iter().all(|name| threads.iter().any(|t| t == name)), "{threads:?}");
}

#[test]
fn a_trace_takes_the_place_of_nothing() {
    let place = Place::with_slab();
    for (trace, why) in
        [("f_0.png", "the place of a frame"), ("slab.zarr/zarr.json", "part of the series"), ("no/t.json", "no")]
    {
        let run = place.run(&["render", "slab.zarr", "-o", "f_%d.png", "--backend", "cpu", "--trace", trace]);
        assert!(run.code == Some(2) && run.err.contains(why), "{}", run.err);
        assert!(!place.path("f_0.png").exists());
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("slab.zarr", place.path("link.zarr")).unwrap();
        let before = std::fs::read(place.path("slab.zarr/zarr.json")).unwrap();
        for (store, stats) in [
            ("link.zarr", "link.zarr/zarr.json"),
            ("link.zarr", "slab.zarr/zarr.json"),
            ("slab.zarr", "link.zarr/x.json"),
        ] {
            let run = place.run(&["render", store, "-o", "f_%d.png", "--backend", "cpu", "--stats", stats]);
            assert!(run.code == Some(2) && run.err.contains("part of the series"), "{store} {stats}: {}", run.err);
        }
        assert_eq!(std::fs::read(place.path("slab.zarr/zarr.json")).unwrap(), before);
    }
    std::fs::write(place.path("tf.json"), "{}").unwrap();
    let over_tf = place.run(&["render", "slab.zarr", "-o", "f_%d.png", "--tf", "tf.json", "--stats", "tf.json"]);
    assert!(over_tf.code == Some(2) && over_tf.err.contains("of the transfer function"), "{}", over_tf.err);
    let both = ["render", "slab.zarr", "-o", "f_%d.png", "--trace", "x.json", "--stats", "x.json"];
    assert!(place.run(&both).err.contains("same file"));
}

#[test]
fn the_playback_suite_measures_moving_time_and_seeks() {
    let place = Place::with_slab();
    let out = place.ok(&[
        "bench",
        "slab.zarr",
        "--suite",
        "playback",
        "--frames",
        "2",
        "--size",
        "32x32",
        "--backend",
        "cpu",
        "--json",
        "b.json",
    ]);
    assert!(out.contains("time moves, pipelined") && out.contains("seeks"), "{out}");
    let report: Value = serde_json::from_slice(&std::fs::read(place.path("b.json")).unwrap()).unwrap();
    let run = &report["playback"][0];
    assert_eq!((&run["pipelined"]["pairs"], &run["backend"], &run["codec"]), (&2.into(), &"cpu".into(), &"raw".into()));
    assert!(run["seek"]["ms"]["median"].as_f64().unwrap() > 0.0);
}

// Long: the suite measures all paths that there are.
#[test]
fn the_accuracy_suite_judges_functions_as_functions() {
    let place = Place::with_slab();
    let words = ["bench", "slab.zarr", "--suite", "accuracy", "--field", "linear", "--frames", "1", "--size", "16x12"];
    place.ok(&[&words[..], &["--representation", "vertices", "--json", "f.json"]].concat());
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(place.path("f.json")).unwrap()).unwrap();
    let runs = report["runs"].as_array().unwrap();
    let error = |spacing: &serde_json::Value| {
        let of_spacing = runs.iter().filter(|run| run["mode"] == "sheets" && &run["sheets"] == spacing);
        let errors: Vec<f64> = of_spacing.map(|run| run["error"]["rmse"].as_f64().unwrap()).collect();
        assert!(!errors.is_empty(), "{spacing}");
        errors.into_iter().fold(0.0, f64::max)
    };
    let [fine, few] = [serde_json::json!({"error": 1e-5}), serde_json::json!({"count": 32})].map(|of| error(&of));
    assert!(fine <= 1e-4 && fine < few, "{fine} {few}");
    assert!(runs.iter().all(|run| run["mode"] == "sheets" || run["mode"] == "reference"));
}

#[test]
fn the_accuracy_suite_writes_records_tables_and_plots() {
    let place = Place::with_slab();
    let suite = ["bench", "slab.zarr", "--suite", "accuracy", "--field", "linear", "--frames", "1", "--size", "40x30"];
    let on_cpu = ["--backend", "cpu", "--json", "a.json", "--plot", "plots"];
    let run = place.run(&[&suite[..], &on_cpu].concat());
    assert_eq!(run.code, Some(0), "{}", run.err);
    let table: Vec<&str> = run.out.lines().filter(|line| line.starts_with('|')).collect();
    assert_eq!(table[0], "| path | ms | dense: RMSE | max | tents: RMSE | max | FLIP |", "{}", run.out);
    assert!(table.iter().any(|row| row.contains("havs, k = 2 inexact")), "{}", run.out);
    assert!(table.iter().any(|row| row.starts_with("| slab | tents | 100 % |")), "{}", run.out);
    assert!(run.err.contains("accuracy_ratio.svg was not written"), "{}", run.err);
    for name in ["time", "k", "lod", "table", "scale"] {
        let svg = std::fs::read_to_string(place.path(&format!("plots/accuracy_{name}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("slab"), "{name}");
    }
    assert!(!place.path("plots/accuracy_ratio.svg").exists());
    let report: Value = serde_json::from_slice(&std::fs::read(place.path("a.json")).unwrap()).unwrap();
    let scene = &report["runs"][0]["scene"];
    assert_eq!((&scene["series"], &scene["transfer_function"]), (&"slab".into(), &"dense".into()));

    // What cannot work is refused before anything is measured.
    std::fs::write(place.path("blocked"), "a file where a folder is wanted").unwrap();
    place.refuses(&[&suite[..], &["--plot", "blocked"]].concat(), &["blocked"]);
    place.refuses(&[&suite[..], &["--plot", "blocked/plots"]].concat(), &["blocked"]);
    place.refuses(&[&suite[..], &["--lod", "0.1"]].concat(), &["--suite accuracy", "--lod"]);
    place.refuses(&[&suite[..], &["--representation", "vertices", "--sheets", "9"]].concat(), &["--sheets"]);
    place.refuses(&["bench", "slab.zarr", "--plot", "more"], &["--plot", "--suite accuracy"]);
}
