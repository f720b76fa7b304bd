//! `tetreel render PROJECT.toml` and `tetreel play PROJECT.toml`.

use super::Place;
use std::path::Path;
use tetreel::image::{Planes, RgbaImage, compare, read_exr, read_png};

/// The beginning of a project of the slab.
const DATA: &str = "version = 1\n[data]\nsource = \"../slab.zarr\"\nfield = \"linear\"\n";

/// Colour and opacities of `--tf`, as the only member of an ensemble.
fn ensemble(name: &str, map: &str, points: &str) -> String {
    format!(
        "[[ensembles]]\nname = \"{name}\"\n[[ensembles.members]]\nname = \"one\"\n\
         function = {{ transfer-function = {{ color_map = \"{map}\", points = [{points}] }} }}\n"
    )
}

fn camera(time: f64, x: f64) -> String {
    format!(
        "[[timeline.cameras]]\ntime = {time:?}\n[timeline.cameras.value]\nposition = [{x:?}, -5.0, 1.5]\nfocal_point = [0.0, 0.0, 0.0]\n\
         view_up = [0.0, 0.0, 1.0]\nnear = 0.0\nprojection = {{ perspective = {{ view_angle = 30.0 }} }}\n"
    )
}

/// A project in a folder of its own, and what `render` is told of it.
fn write(place: &Place, text: &str) {
    std::fs::create_dir_all(place.path("p")).unwrap();
    std::fs::write(place.path("p/case.toml"), text).unwrap();
}

fn frame(path: &Path) -> Planes {
    read_exr(path).unwrap().planes
}

/// Two ensembles, one going over into the other, seen by an eye that moves; seven frames over the five steps.
fn animation() -> String {
    let keys = "[[timeline.ensembles]]\ntime = 0.0\nvalue = \"a\"\ntransition = \"smooth\"\n\
                [[timeline.ensembles]]\ntime = 1.0\nvalue = \"b\"\n";
    let output = "[look]\nbackend = \"cpu\"\n[output]\noutput = \"out/f_%d.exr\"\nexr = \"raw\"\nsize = \"40x30\"\nduration = 0.7\nfps = \"10\"\n";
    let ensembles =
        ensemble("a", "viridis", "[0.0, 0.01], [1.0, 0.2]") + &ensemble("b", "inferno", "[0.0, 0.3], [1.0, 0.0]");
    format!("{DATA}{output}{ensembles}{keys}{}{}", camera(0.0, -1.0), camera(1.0, 2.0))
}

#[test]
fn a_project_makes_the_same_bits_again_whatever_the_threads() {
    let place = Place::with_slab();
    let times = place.json(&["info", "slab.zarr", "--json"]);
    assert_eq!(times["time"]["last"], 1.0, "{times}");
    write(&place, &animation());
    let run = |threads: &str| -> Vec<Planes> {
        place.ok(&["render", "p/case.toml", "--threads", threads]);
        (0..7).map(|n| frame(&place.path(&format!("p/out/f_{n}.exr")))).collect()
    };
    let frames = run("1");
    assert!(frames == run("3") && frames == run("2"));
    // Every frame has a camera and colours of its own, though a step is held for two of them.
    for (i, one) in frames.iter().enumerate() {
        assert!(one.color.pixels.iter().any(|p| p[3] > 0.1), "frame {i} is empty");
        assert!(frames[..i].iter().all(|other| other.color != one.color), "frame {i}");
    }
    // The middle of the transition is neither.
    assert!(!place.path("p/out/f_7.exr").exists());
}

#[test]
fn at_its_keys_a_project_shows_what_options_show() {
    let place = Place::with_slab();
    write(&place, &animation());
    place.ok(&["render", "p/case.toml"]);
    for (n, step, tf, eye) in [(0, "0", "viridis@0:0.01,1:0.2", "-1,-5,1.5"), (6, "4", "inferno@0:0.3,1:0", "2,-5,1.5")]
    {
        let camera = format!("pos={eye} focal=0,0,0 up=0,0,1 angle=30 near=0");
        let tail = ["-o", "one.exr", "--exr", "raw", "--size", "40x30", "--backend", "cpu"];
        let head = ["render", "slab.zarr", "--field", "linear", "--steps", step, "--tf", tf, "--camera", &camera];
        place.ok(&[&head[..], &tail[..]].concat());
        let (project, options) = (frame(&place.path(&format!("p/out/f_{n}.exr"))), frame(&place.path("one.exr")));
        assert!(project.color == options.color && project.depth == options.depth, "frame {n}");
        assert!(frame(&place.path("p/out/f_3.exr")).color != options.color);
    }
}

#[test]
fn options_come_before_what_a_project_says() {
    let place = Place::with_slab();
    write(&place, &animation());
    place.ok(&[
        "render",
        "p/case.toml",
        "-o",
        "small_%d.exr",
        "--size",
        "20x20",
        "--duration",
        "0.2",
        "--camera",
        "pos=0.5,-5,0.5",
    ]);
    let frames = [0, 1].map(|n| frame(&place.path(&format!("small_{n}.exr"))));
    assert_eq!((frames[0].color.width, frames[0].color.height), (20, 20));
    assert!(!place.path("small_2.exr").exists() && !place.path("p/out").exists());
    // The camera stands still, the colours do not.
    assert!(frames[0].color != frames[1].color);
    place.ok(&[
        "render",
        "p/case.toml",
        "-o",
        "gray.exr",
        "--steps",
        "0",
        "--duration",
        "0.1",
        "--tf",
        "gray@0:0.1,1:0.1",
    ]);
    let gray = frame(&place.path("gray.exr"));
    assert!(gray.color.pixels.iter().all(|p| p[0] == p[1] && p[1] == p[2]), "the transfer function of the command");
}

#[test]
fn mistakes_in_a_project_are_named_and_leave_nothing() {
    let place = Place::with_slab();
    let refuses = |text: &str, parts: &[&str]| {
        write(&place, text);
        place.refuses(&["render", "p/case.toml"], parts);
    };
    let good = animation();
    let line = 1 + good[..good.find("size").unwrap()].matches('\n').count();
    refuses(&good.replace("size =", "siez ="), &["case.toml", &format!("line {line}"), "siez"]);
    refuses(&good.replace("40x30", "40by30"), &["40by30"]);
    refuses(&good.replace("value = \"b\"", "value = \"c\""), &["case.toml", "'c'", "a, b"]);
    refuses(&good.replace("slab.zarr", "gone.zarr"), &["gone.zarr"]);
    let heavy = good.replacen("name = \"one\"", "name = \"one\"\nweight = 1.8", 1);
    let line = 1 + heavy[..heavy.find("weight").unwrap()].matches('\n').count();
    refuses(&heavy, &["case.toml", &format!("line {line} "), "1.8", "0 to 1"]);
    // What only shows when the colours are made.
    let mixed = good.replacen("points = [[0.0, 0.01]", "values = \"extinction\", points = [[0.0, 0.01]", 1);
    refuses(&mixed, &["case.toml", "opacity kind"]);
    refuses(
        &good.replace("time = 1.0\nvalue = \"b\"", "time = 0.0\nvalue = \"b\""),
        &["case.toml", "two keys at time 0"],
    );
    refuses(&good.replace("output = \"out/f_%d.exr\"\n", "").replace("exr = \"raw\"\n", ""), &["-o"]);
    refuses("", &["case.toml", "version"]);
    place.refuses(&["render", "p/gone.toml"], &["gone.toml"]);
}

#[test]
fn the_shipped_project_goes_from_an_overview_to_the_core() {
    let place = Place::empty();
    let project = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/projects/tornado.toml");
    let output = place.path("t_%d.png");
    let options = ["--size", "48x36", "--duration", "0.5", "--backend", "cpu", "-o"];
    place.ok(&[&["render", project.to_str().unwrap()], &options[..], &[output.to_str().unwrap()]].concat());
    // Six frames at 12 a second over the whole series: the first one is viridis, the last one gray but for what is fast.
    let [first, last] = [0, 5].map(|n| read_png(&place.path(&format!("t_{n}.png"))).unwrap());
    let share = |image: &RgbaImage, is: fn(&[f32; 4]) -> bool| {
        let seen = image.pixels.iter().filter(|p| is(p)).count();
        seen as f64 / image.pixels.len() as f64
    };
    let is_red = |p: &[f32; 4]| p[0] > 1.5 * p[1].max(p[2]) && p[0] > 0.05;
    assert!(share(&first, is_red) == 0.0 && share(&last, is_red) > 0.002, "{}", share(&last, is_red));
}

#[test]
fn every_shipped_project_is_drawn_and_looks_like_no_other() {
    let place = Place::empty();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/projects");
    let mut pictures = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let project = entry.unwrap().path();
        let name = project.file_stem().unwrap().to_str().unwrap().to_owned();
        let output = place.path(&format!("{name}.png"));
        let run = ["render", project.to_str().unwrap(), "--size", "32x24", "--steps", "6", "--backend", "cpu", "-o"];
        place.ok(&[&run[..], &[output.to_str().unwrap()]].concat());
        let image = read_png(&output).unwrap();
        let seen = image.pixels.iter().filter(|[r, g, b, _]| r + g + b > 0.05).count();
        assert!(seen > 5, "{name} is black but for {seen} pixels");
        pictures.push((name, image.pixels));
    }
    assert!(pictures.len() >= 11, "{}", pictures.len());
    for (i, (name, picture)) in pictures.iter().enumerate() {
        assert!(pictures[..i].iter().all(|(_, other)| other != picture), "{name}");
    }
}

#[test]
fn members_that_keep_their_axes_are_drawn_by_every_renderer_as_by_the_reference() {
    let place = Place::with_slab();
    // A haze, what changes much over time, and a boundary.
    let project = |reduction: &str| {
        let member = |space: &str, widget: &str| {
            format!(
                "[[ensembles.members]]\nname = \"{space}\"\nspace = \"{space}\"\nblend = \"add\"\nreduction = \"{reduction}\"\n\
                 [[ensembles.members.function.widgets]]\n{widget}\n"
            )
        };
        let rectangle = "rectangle = { x = [0.1, 0.9], y = [0.9, 1.0], rgb = [0.9, 0.2, 0.1], opacity = [0.1, 0.3] }";
        let triangle = "triangle-with-fall-off = { base = [0.5, 0.0], top = 1.0, left = 0.0, right = 1.0, rgb = [0.2, 0.3, 0.9], opacity = 0.4 }";
        let output = "[output]\noutput = \"out.exr\"\nexr = \"raw\"\nsize = \"40x30\"\nsteps = \"2\"\n";
        let haze = ensemble("a", "viridis", "[0.0, 0.01], [1.0, 0.02]");
        format!("{DATA}{output}{haze}{}{}", member("scalar-cov", rectangle), member("scalar-gradient", triangle))
    };
    let run = |reduction: &str, options: &[&str]| {
        write(&place, &project(reduction));
        place.ok(&[&["render", "p/case.toml"], options].concat());
        frame(&place.path("p/out.exr")).color
    };
    let judge = run("keep", &["--mode", "reference"]);
    let mut ways =
        vec![vec!["--mode", "raycast"], vec!["--mode", "havs"], vec!["--optics", "table3d"], vec!["--mode", "auto"]];
    ways.iter_mut().for_each(|way| way.extend(["--backend", "cpu"]));
    #[cfg(feature = "gpu")]
    if crate::render::gpu::context().is_some() {
        ways.extend(["raycast", "havs"].map(|mode| vec!["--backend", "gpu", "--mode", mode]));
    }
    for options in ways {
        let off = compare(&run("keep", &options), &judge, [0.0; 3]).unwrap();
        // The bounds of every renderer against the reference (docs/accuracy.md).
        assert!(off.rmse <= 1e-5 && off.max <= 1e-3, "{options:?}: {off:?}");
        let reduced = compare(&run("intensity", &options), &judge, [0.0; 3]).unwrap();
        assert!(reduced.max > 1e-2, "{options:?}: {reduced:?}");
    }
}

/// A window is refused only after everything that can be wrong with what it is to show.
#[cfg(feature = "gui")]
const NO_DISPLAY: &str = "there is no display";

#[cfg(feature = "gui")]
#[test]
fn a_project_is_played_as_far_as_there_is_a_display() {
    let place = Place::with_slab();
    // What only `render` needs may be wrong.
    write(&place, &animation().replace("out/f_%d.exr", "nowhere/f.exr"));
    place.refuses(&["play", "p/case.toml"], &[NO_DISPLAY]);
    for options in
        [&["--tf", "gray@0:0.1,1:0.1"][..], &["--size", "400x300"], &["--optics", "partial", "--threads", "2"]]
    {
        place.refuses(&[&["play"][..], options, &["p/case.toml"]].concat(), &[NO_DISPLAY]);
    }
}

#[cfg(feature = "gui")]
#[test]
fn mistakes_in_a_project_are_named_before_there_is_a_window() {
    let place = Place::with_slab();
    let good = animation();
    let refuses = |text: &str, options: &[&str], parts: &[&str]| {
        write(&place, text);
        place.refuses(&[&["play", "p/case.toml"][..], options].concat(), parts);
    };
    let line = 1 + good[..good.find("backend").unwrap()].matches('\n').count();
    refuses(&good.replace("backend =", "bakcend ="), &[], &["case.toml", &format!("line {line}"), "bakcend"]);
    refuses(&good.replace("value = \"b\"", "value = \"c\""), &[], &["case.toml", "'c'", "a, b"]);
    refuses(&good.replace("slab.zarr", "gone.zarr"), &[], &["gone.zarr"]);
    refuses(&good.replace("slab.zarr", "gone.pvd"), &[], &["gone.pvd"]);
    refuses(&good.replace("\"linear\"", "\"nothing\""), &[], &["'nothing'"]);
    refuses(&good.replace("[output]", "[playback]\nstride = 0\n[output]"), &[], &["case.toml", "stride of 0"]);
    refuses(&good.replace("[output]", "[playback]\nspeed = 1\n[output]"), &[], &["case.toml", "speed"]);
    let flat = good.replace("name = \"one\"", "name = \"one\"\nrange = { manual = [3.0, 2.0] }");
    refuses(&flat, &[], &["3..2"]);
    refuses(&good, &["--lod", "2"], &["--lod"]);
    refuses(&good, &["--tf", "nothing"], &["--tf"]);
    refuses(&good, &["slab.zarr"], &["case.toml", "alone"]);
    place.refuses(&["play", "p/gone.toml"], &["gone.toml"]);
}

#[test]
fn what_the_command_line_asks_for_need_not_fit_the_files_of_the_project() {
    let place = Place::with_slab();
    // Of a sequence of EXR files over a duration, over a colour.
    write(&place, &animation().replace("size =", "interpolate = true\nsize ="));
    place.ok(&["render", "p/case.toml", "--steps", "3", "-o", "one.png"]);
    assert!(read_png(&place.path("one.png")).is_ok() && !place.path("p/out").exists());
    place.ok(&["render", "p/case.toml", "--duration", "0.2", "-o", "two_%d.png"]);
    assert!(place.path("two_1.png").exists() && !place.path("two_2.png").exists());
    let of_png =
        animation().replace("f_%d.exr", "f_%d.png").replace("exr = \"raw\"", "background = \"white\"\nbit-depth = 16");
    write(&place, &of_png);
    place.ok(&["render", "p/case.toml", "-o", "f_%d.exr"]);
    assert!(frame(&place.path("f_6.exr")).color.pixels.iter().any(|p| p[3] == 0.0), "an EXR has opacity");
    place.ok(&["render", "p/case.toml", "--interpolate"]);
    place.refuses(&["render", "p/case.toml", "--range", "0,1"], &["--range", "case.toml"]);
    place.ok(&["render", "p/case.toml", "--range", "0,1", "--tf", "gray@0:0.1", "--steps", "0", "-o", "gray.png"]);
}

#[test]
fn nothing_is_written_before_all_that_the_timeline_names_is_known_to_work() {
    let place = Place::with_slab();
    // They are kept when they are first needed.
    let store = tetreel::store::Store::open(place.path("slab.zarr")).unwrap();
    let field = store.field(&"linear".parse().unwrap()).unwrap();
    field.histograms(&store.mesh().unwrap(), &tetreel::task::Cancel::new()).unwrap().unwrap();
    let good = animation();
    // Of the ensemble that the first frame does not show.
    let at = good.rfind("name = \"one\"").unwrap();
    let flat = format!("{}space = \"scalar-gradient\"\n{}", &good[..at], &good[at..]);
    write(&place, &flat);
    place.refuses(&["render", "p/case.toml"], &["p/case.toml", "'b'", "'one'", "widgets"]);
    assert!(!place.path("p/out").exists());
}

#[test]
fn side_files_are_never_the_project() {
    let place = Place::with_slab();
    write(&place, &animation());
    for option in ["--stats", "--trace"] {
        place.refuses(&["render", "p/case.toml", option, "p/../p/case.toml"], &[option, "case.toml", "project"]);
    }
    assert_eq!(std::fs::read_to_string(place.path("p/case.toml")).unwrap(), animation());
}

#[test]
fn a_folder_may_have_any_name() {
    let place = Place::with_slab();
    std::fs::create_dir_all(place.path("50%d %%")).unwrap();
    std::fs::write(place.path("50%d %%/render"), "").unwrap();
    std::fs::write(place.path("50%d %%/case.toml"), animation()).unwrap();
    place.ok(&["render", "50%d %%/case.toml", "--duration", "0.2"]);
    assert!(place.path("50%d %%/out/f_1.exr").exists());
}

#[test]
fn images_say_what_their_colours_are_of() {
    let place = Place::with_slab();
    let says = |file: &str, text: &str| {
        let bytes = std::fs::read(place.path(file)).unwrap();
        bytes.windows(text.len()).any(|part| part == text.as_bytes())
    };
    write(&place, &animation());
    place.ok(&["render", "p/case.toml", "--duration", "0.1", "-o", "of_project.exr"]);
    assert!(says("of_project.exr", "2 ensembles on a timeline"));
    // A camera path, and a legend of the map rather than of what is visible.
    write(&place, &format!("{DATA}{}{}", camera(0.0, -1.0), camera(1.0, 2.0)));
    let tf = "viridis@0.5:0,1:0.3";
    let options = ["--steps", "4", "--size", "120x90", "--backend", "cpu", "--tf", tf, "--annotate", "legend", "-o"];
    place.ok(&[&["render", "p/case.toml"], &options[..], &["of_tf.png"]].concat());
    place.ok(&["render", "p/case.toml", "--steps", "4", "--size", "20x15", "--tf", tf, "-o", "of_tf.exr"]);
    assert!(says("of_tf.exr", tf) && !says("of_tf.exr", "ensemble"));
    let eye = "pos=2,-5,1.5 focal=0,0,0 up=0,0,1 angle=30 near=0";
    let alone = ["render", "slab.zarr", "--field", "linear", "--camera", eye];
    place.ok(&[&alone[..], &options[..], &["alone.png"]].concat());
    assert_eq!(read_png(&place.path("of_tf.png")).unwrap(), read_png(&place.path("alone.png")).unwrap());
}

#[test]
fn levels_of_detail_are_not_ignored_by_renderers_that_have_none() {
    let place = Place::with_slab();
    let lod = "[[timeline.lod]]\ntime = 0.0\nvalue = 0.3\n";
    let good = animation().replace("backend = \"cpu\"", "backend = \"cpu\"\nmode = \"havs\"") + lod;
    for mode in ["raycast", "reference"] {
        write(&place, &good.replace("\"havs\"", &format!("\"{mode}\"")));
        let parts = ["case.toml", &format!("'{mode}' always draws all cells"), "[[timeline.lod]]"];
        place.refuses(&["render", "p/case.toml", "-o", "x_%d.exr"], &parts);
    }
    // Who says so on the command line means all frames.
    write(&place, &good);
    let [some, cells] = ["havs", "raycast"].map(|mode| {
        place.ok(&["render", "p/case.toml", "--steps", "2", "-o", "x.exr", "--mode", mode]);
        frame(&place.path("x.exr")).color.pixels
    });
    write(&place, &animation());
    place.ok(&["render", "p/case.toml", "--steps", "2", "-o", "x.exr", "--mode", "raycast"]);
    let all = frame(&place.path("x.exr")).color.pixels;
    assert!(cells == all && some != all);
}
