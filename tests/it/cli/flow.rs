//! Flow on the command line.

use super::Place;
use super::points::apart;
use tetreel::image::{Planes, read_exr};

/// A generated tornado of twenty steps: pressure, and velocity with three components.
pub(super) fn tornado() -> Place {
    let place = Place::empty();
    place.ok(&["synth", "tornado", "--cells", "1500", "--steps", "20", "-o", "t.zarr", "--quiet"]);
    place
}

/// A step, drawn with these options.
pub(super) fn exr(place: &Place, step: &str, options: &[&str]) -> Planes {
    let words = ["render", "t.zarr", "--field", "pressure", "--size", "48x36", "--exr", "raw", "-o", "f.exr"];
    place.ok(&[&words[..], &["--steps", step], options].concat());
    read_exr(&place.path("f.exr")).unwrap().planes
}

pub(super) fn rmse(a: &Planes, b: &Planes) -> f64 {
    let channels = a.color.pixels.iter().flatten().zip(b.color.pixels.iter().flatten());
    let (sum, count) = channels.fold((0.0, 0), |(sum, n), (a, b)| (sum + f64::from(a - b).powi(2), n + 1));
    (sum / f64::from(count)).sqrt()
}

pub(super) const FLOW: [&str; 2] = ["--flow", "velocity"];

#[test]
fn flow_is_drawn_within_the_volume_by_every_renderer_as_the_judge_draws_it() {
    let place = tornado();
    let with_flow = |options: &[&str]| exr(&place, "11", &[&FLOW[..], options].concat());
    let judge = with_flow(&["--mode", "reference"]);
    for mode in ["raycast", "havs", "points"] {
        let found = with_flow(&["--mode", mode, "--stats", "s.json"]);
        assert!(rmse(&found, &judge) <= 1e-5 && apart(&found, &judge) <= 1e-3, "{mode}");
        let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(place.path("s.json")).unwrap()).unwrap();
        let count = |name: &str| stats[0]["stats"][name].as_f64().unwrap();
        assert!(count("flow_splats") > 100.0 && count("flow_fragments") > 1000.0 && count("ms_flow") > 0.0, "{stats}");
    }
    let volume = exr(&place, "11", &[]);
    assert!(apart(&volume, &judge) > 0.05);
    // Each option changes the picture.
    let mut seen = vec![volume, judge];
    for options in [
        &["--flow-icon", "arrows"][..],
        &["--flow-splats", "50"],
        &["--flow-size", "0.8"],
        &["--flow-length", "2"],
        &["--flow-opacity", "0.2"],
        &["--flow-speed", "1.5"],
        &["--flow-fidelity", "paper"],
        &["--flow-volume", "splats"],
        &["--flow-volume", "splats", "--flow-fidelity", "paper"],
        &["--flow-volume", "none"],
        &["--flow-color", "velocity:mag@viridis"],
    ] {
        let found = with_flow(options);
        assert!(seen.iter().all(|other| apart(other, &found) > 1e-3), "{options:?} is another image");
        seen.push(found);
    }
    assert!(with_flow(&["--no-volume"]) == with_flow(&["--flow-volume", "none"]));
    // What hangs out of the domain is not drawn, whatever the volume shows.
    let cut = ["--no-volume", "--crop", "min=-3.3,-9,2 max=3.7,9,8"];
    let judge = with_flow(&[&cut[..], &["--mode", "reference"]].concat());
    for mode in ["raycast", "havs"] {
        let found = with_flow(&[&cut[..], &["--mode", mode, "--stats", "s.json"]].concat());
        assert!(rmse(&found, &judge) <= 1e-5 && apart(&found, &judge) <= 1e-3, "{mode}");
        let outside = &stats(&place)[0]["stats"]["flow_outside"];
        assert!(outside.as_u64().unwrap() > 100, "{outside}");
    }
}

#[cfg(feature = "gpu")]
#[test]
fn the_gpu_draws_what_the_cpu_draws_or_leaves_it_to_the_cpu() {
    if crate::render::gpu::context().is_none() {
        return;
    }
    let place = tornado();
    let backends = |options: &[&str]| {
        ["cpu", "gpu"].map(|backend| exr(&place, "11", &[options, &["--backend", backend]].concat()))
    };
    let lit = ["--surface", "solid:#ff8800:0.5", "--surface", "wireframe:#000000"];
    for mode in ["raycast", "havs"] {
        for options in [&FLOW[..], &[&FLOW[..], &["--no-volume"]].concat(), &[&FLOW[..], &lit].concat(), &lit] {
            let [cpu, gpu] = backends(&[options, &["--mode", mode]].concat());
            let [with, without] = [&gpu, &exr(&place, "11", &["--mode", mode])].map(|image| apart(image, &cpu));
            assert!(
                rmse(&cpu, &gpu) <= 1e-5 && with <= 1e-3 && without > 0.05,
                "{mode}, {options:?}: {with} {without}"
            );
        }
    }
    for options in [&["--mode", "points"][..], &["--rays", "adaptive:0.1"]] {
        let words = ["render", "t.zarr", "--field", "pressure", "-o", "x.png", "--steps", "1", "--backend", "gpu"];
        place.refuses(&[&words[..], &FLOW, options].concat(), &["fragments of other layers", "backend cpu"]);
    }
}

#[test]
fn a_frame_that_was_sought_has_the_bits_of_the_one_that_was_played_and_contrast_decides_nothing() {
    let place = tornado();
    let words = ["render", "t.zarr", "--field", "pressure", "--size", "48x36", "--exr", "raw", "--steps", "0..19"];
    place.ok(&[&words[..], &["-o", "f_%02d.exr"], &FLOW].concat());
    for step in [0, 9, 16, 19] {
        let played = read_exr(&place.path(&format!("f_{step:02}.exr"))).unwrap().planes;
        assert!(exr(&place, &step.to_string(), &FLOW) == played, "{step}");
    }
    // Whatever the contrast, rays are cast where splats are.
    let alone = [&FLOW[..], &["--no-volume"]].concat();
    let all = exr(&place, "9", &alone);
    assert!(all.color.pixels.iter().any(|p| p[3] > 0.1));
    for options in [&["--rays", "adaptive:0.9"][..], &["--threads", "1"], &["--skip", "none"]] {
        assert!(exr(&place, "9", &[&alone[..], options].concat()) == all, "{options:?}");
    }
}

#[test]
fn a_held_step_flows_on_by_a_rate_and_a_rate_of_zero_stands_still() {
    let place = tornado();
    let words = ["render", "t.zarr", "--field", "pressure", "--size", "48x36", "--no-volume"];
    let held = |name: &str, options: &[&str]| -> Vec<Planes> {
        let files = format!("{name}_%d.exr");
        let files = ["-o", &files, "--exr", "raw", "--fps", "5", "--steps", "9"];
        place.ok(&[&words[..], &files, &FLOW, options].concat());
        let frames = (0..).map(|i| place.path(&format!("{name}_{i}.exr"))).take_while(|file| file.exists());
        frames.map(|file| read_exr(&file).unwrap().planes).collect()
    };
    let usual = held("usual", &["--flow-hold", "0.8", "--stats", "s.json"]);
    assert_eq!(usual.len(), 4);
    // A tenth of the volume over the series is faster than can be followed: some of a step's splats, and most are not.
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(place.path("s.json")).unwrap()).unwrap();
    for frame in stats.as_array().unwrap() {
        let [fast, splats] = ["flow_fast", "flow_splats"].map(|name| frame["stats"][name].as_u64().unwrap());
        assert!(fast > 0 && 4 * fast < splats, "{fast} of {splats}");
    }
    for i in 1..4 {
        assert!((0..i).all(|j| apart(&usual[i], &usual[j]) > 1e-2), "{i}");
    }
    // The same by the duration, and by any run that has the frame.
    assert!(held("by", &["--duration", "0.8"]) == usual && held("less", &["--flow-hold", "0.4"]) == usual[..2]);
    let still = held("still", &["--flow-hold", "0.6", "--flow-rate", "0"]);
    assert!(still.iter().all(|frame| *frame == exr(&place, "9", &[&FLOW[..], &["--no-volume"]].concat())));
    // Twice the rate for half of the time is the same way, blurred over twice as much of it.
    let [slow, fast] =
        ["1", "2"].map(|rate| held(&format!("rate{rate}"), &["--flow-hold", "0.8", "--flow-rate", rate]));
    assert!(apart(&slow[2], &fast[1]) < apart(&slow[2], &slow[1]) && apart(&slow[3], &fast[3]) > 1e-2);
    for (options, parts) in [
        (&["--flow-hold", "1", "--steps", "1..3"][..], &["--flow-hold", "one step", "--steps N"][..]),
        (&["--flow-hold", "1"], &["--steps N"]),
        (&["--flow-hold", "0", "--steps", "1"], &["--flow-hold", "positive"]),
        (&["--flow-hold", "1", "--duration", "1", "--steps", "1"], &["--flow-hold", "--duration"]),
        (&["--flow-rate=-1", "--steps", "1"], &["rate of -1"]),
        (&["--flow-rate", "nan", "--steps", "1"], &["rate of NaN"]),
    ] {
        place.refuses(&[&words[..], &["-o", "x_%d.png"], &FLOW, options].concat(), parts);
    }
    place.refuses(
        &[&words[..], &["-o", "x_%d.png", "--flow-hold", "1", "--steps", "1"]].concat(),
        &["--flow-hold", "--flow FIELD"],
    );
}

/// The statistics of a run, a frame each.
pub(super) fn stats(place: &Place) -> Vec<serde_json::Value> {
    let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(place.path("s.json")).unwrap()).unwrap();
    stats.as_array().unwrap().clone()
}

#[test]
fn flow_fades_by_keys_of_the_timeline_and_costs_nothing_where_it_is_gone() {
    let place = tornado();
    let size = ["--size", "48x36", "--exr", "raw", "--stats", "s.json"];
    let all = ["render", "t.zarr", "-o", "v_%02d.exr", "--field", "pressure", "--steps", "0..19"];
    place.ok(&[&all[..], &size].concat());
    let times: Vec<f64> = stats(&place).iter().map(|frame| frame["time"].as_f64().unwrap()).collect();
    let (a, b) = (times[5], times[15]);
    let head = "version = 1\n[data]\nsource = \"t.zarr\"\nfield = \"pressure\"\n";
    let flow = "[flow]\nfield = \"velocity\"\nopacity = 0.3\n";
    let keys = format!("[[timeline.flow]]\ntime = {a}\nvalue = 0.0\n[[timeline.flow]]\ntime = {b}\nvalue = 0.8\n");
    let write = |text: &str| std::fs::write(place.path("p.toml"), text).unwrap();
    write(&format!("{head}{flow}{keys}"));
    let movie = ["render", "p.toml", "-o", "f_%02d.exr", "--steps", "0..19", "--resume"];
    let movie = [&movie[..], &size].concat();
    place.ok(&movie);
    let frames = stats(&place);
    let count = |step: usize, name: &str| frames[step]["stats"][name].as_f64().unwrap();
    let frame = |name: &str, step: usize| read_exr(&place.path(&format!("{name}_{step:02}.exr"))).unwrap().planes;
    for step in [0, 5] {
        assert!(frame("f", step) == frame("v", step), "{step}");
        assert_eq!(["flow_splats", "flow_fragments", "ms_flow"].map(|name| count(step, name)), [0.0; 3]);
    }
    let weight = (times[9] - a) / (b - a);
    for (step, opacity) in [(9, 0.8 * weight), (15, 0.8), (19, 0.8)] {
        let options = ["--flow-opacity", &opacity.to_string()];
        assert!(frame("f", step) == exr(&place, &step.to_string(), &[&FLOW[..], &options].concat()), "{step}");
        assert!(count(step, "flow_splats") > 0.0);
    }
    // Frames that another key leaves as they were are kept.
    write(&format!("{head}{flow}{}", keys.replace("0.8", "0.6")));
    place.ok(&movie);
    let origins: Vec<bool> = stats(&place).iter().map(|frame| frame["origin"] == "kept").collect();
    assert_eq!(origins, (0..20).map(|step| step <= 5).collect::<Vec<_>>());
    // An opacity of the command holds at all times.
    let given = ["render", "p.toml", "-o", "g.exr", "--steps", "0", "--flow-opacity", "0.5"];
    place.ok(&[&given[..], &size].concat());
    assert!(
        read_exr(&place.path("g.exr")).unwrap().planes
            == exr(&place, "0", &[&FLOW[..], &["--flow-opacity", "0.5"]].concat())
    );
    for (text, parts) in [
        (
            format!("{flow}{}", keys.replace("0.8", "1.5")),
            &["[[timeline.flow]]", "opacity of 1.5", "between 0 and 1"][..],
        ),
        (format!("{flow}{}", keys.replace("0.8", "nan")), &["[[timeline.flow]]", "opacity of NaN"]),
        (
            format!("{flow}{}", keys.replace(&format!("time = {b}"), &format!("time = {a}"))),
            &["two keys at time", "another time"],
        ),
        (format!("{flow}{}", keys.replace("value", "opacity")), &["`opacity`", "`time`, `transition`, `value`"]),
        (keys.clone(), &["add [flow]", "[[timeline.flow]] out"]),
    ] {
        write(&format!("{head}{text}"));
        place.refuses(&["render", "p.toml", "-o", "x.exr", "--steps", "0"], &[&["p.toml"], parts].concat());
    }
}

#[test]
fn a_legend_has_a_second_bar_for_the_colours_of_the_flow() {
    let place = tornado();
    // Without an opacity nothing else is of the flow.
    let picture = |annotations: &str, options: &[&str]| {
        let words = ["render", "t.zarr", "--field", "pressure", "--size", "320x300", "--exr", "raw", "--steps", "4"];
        let flow = ["--flow", "velocity", "--flow-opacity", "0", "--annotate", annotations, "-o", "f.exr"];
        place.ok(&[&words[..], &flow, options].concat());
        read_exr(&place.path("f.exr")).unwrap().planes
    };
    let beside = ["--flow-color", "velocity:mag@viridis"];
    assert!(apart(&picture("legend", &[]), &picture("legend", &beside)) > 0.1);
    assert!(picture("none", &[]) == picture("none", &beside));
}

#[test]
fn flow_is_in_a_project_and_what_cannot_be_shown_is_refused_with_the_remedy() {
    let place = tornado();
    let project = "version = 1\n[data]\nsource = \"t.zarr\"\nfield = \"pressure\"\n[flow]\nfield = \"velocity\"\n\
                   icon = \"lines\"\nsize = 0.7\ncolor = \"velocity:mag@viridis\"\n";
    std::fs::write(place.path("p.toml"), project).unwrap();
    let size = ["--size", "48x36", "--exr", "raw", "--steps", "4"];
    place.ok(&[&["render", "p.toml", "-o", "p.exr"], &size[..]].concat());
    let options = ["--flow-icon", "lines", "--flow-size", "0.7", "--flow-color", "velocity:mag@viridis"];
    let by_options = exr(&place, "4", &[&FLOW[..], &options].concat());
    assert!(read_exr(&place.path("p.exr")).unwrap().planes == by_options);
    // What the user says comes before it.
    let other = ["--flow-icon", "arrows", "--flow-size", "0.7", "--flow-color", "velocity:mag@viridis"];
    place.ok(&[&["render", "p.toml", "-o", "q.exr", "--flow-icon", "arrows"], &size[..]].concat());
    let by_options = exr(&place, "4", &[&FLOW[..], &other].concat());
    assert!(read_exr(&place.path("q.exr")).unwrap().planes == by_options);
    for (options, parts) in [
        (&["--flow", "pressure"][..], &["'pressure'", "three components"][..]),
        (&["--flow", "wind"], &["'wind'", "velocity"]),
        (&["--flow", "velocity", "--flow-size", "0"], &["size of 0", "above zero"]),
        (&["--flow", "velocity", "--flow-length=-1"], &["length of -1"]),
        (&["--flow", "velocity", "--flow-opacity", "2"], &["opacity of 2"]),
        (&["--flow", "velocity", "--flow-splats", "0"], &["--flow-splats"]),
        (&["--flow", "velocity", "--flow-icon", "fish"], &["'fish'", "strokes, lines, particles or arrows"]),
        (&["--flow", "velocity", "--flow-color", "wind"], &["--flow-color", "'wind'"]),
        (&["--flow-icon", "lines"], &["--flow FIELD"]),
        (&["--flow-rate", "2"], &["--flow FIELD"]),
    ] {
        let words = ["render", "t.zarr", "--field", "pressure", "-o", "x.png", "--steps", "1", "--size", "8x8"];
        place.refuses(&[&words[..], options].concat(), parts);
        assert!(!place.path("x.png").exists());
    }
    // A step is held with the project's flow.
    place.ok(&[
        "render",
        "p.toml",
        "-o",
        "h_%d.png",
        "--size",
        "8x8",
        "--fps",
        "5",
        "--steps",
        "4",
        "--flow-hold",
        "0.4",
    ]);
    assert!(place.path("h_1.png").exists() && !place.path("h_2.png").exists());
    for (from, to, parts) in [
        ("icon =", "icons =", &["bad.toml", "line 7", "`icons`", "`field`, `icon`, `by`"][..]),
        ("field = \"velocity\"\n", "", &["bad.toml", "line 5", "`field`"]),
        ("size = 0.7", "size = 0", &["bad.toml", "flow", "size of 0"]),
        ("\"velocity\"", "\"wind\"", &["t.zarr", "'wind'", "velocity"]),
    ] {
        std::fs::write(place.path("bad.toml"), project.replace(from, to)).unwrap();
        place.refuses(&["render", "bad.toml", "-o", "x.png", "--steps", "1"], parts);
    }
    let slab = Place::with_slab();
    let words = ["render", "slab.zarr", "-o", "x.png", "--steps", "1", "--flow", "velocity"];
    slab.refuses(&words, &["'velocity'", "constant, linear"]);
}

#[test]
fn that_nothing_flows_is_said_once_a_run_and_the_volume_is_drawn() {
    let place = Place::empty();
    place.ok(&["synth", "tornado", "--cells", "600", "--steps", "3", "-o", "run", "--quiet"]);
    for (name, still) in [("zero", "0 * velocity"), ("hole", "(0 / (time - time)) * velocity")] {
        let define = format!("still = {still}");
        let store = format!("{name}.zarr");
        place.ok(&["import", "run/run.pvd", "-o", &store, "--define", &define, "--quiet"]);
        let run = |options: &[&str]| {
            let words =
                ["render", &store, "--field", "pressure", "--size", "24x18", "--exr", "raw", "--stats", "s.json"];
            let run = place.run(&[&words[..], options].concat());
            assert_eq!(run.code, Some(0), "{}", run.err);
            run.err.matches("nothing flows").count()
        };
        let files = ["flow", "none"].map(|of| format!("{name}_{of}_%d.exr"));
        assert_eq!(run(&["-o", &files[0], "--flow", "still"]), 1);
        let stats: serde_json::Value = serde_json::from_slice(&std::fs::read(place.path("s.json")).unwrap()).unwrap();
        assert!(stats.as_array().unwrap().iter().all(|frame| frame["stats"]["flow_still"] == true), "{stats}");
        assert_eq!(run(&["-o", &files[1]]), 0);
        assert_eq!(run(&["-o", &format!("{name}.exr"), "--steps", "1", "--flow", "velocity"]), 0);
        for step in ["0", "1", "2"] {
            let [flow, none] =
                files.each_ref().map(|file| read_exr(&place.path(&file.replace("%d", step))).unwrap().planes);
            assert!(flow == none, "{name}");
        }
    }
}
