//! The `tetreel` command as a user meets it: exit codes, files, what is on stdout and what on stderr.

mod append;
mod cloud;
mod connectivity;
mod export;
mod export_surfaces;
mod fit;
mod flow;
mod flow_cells;
mod flow_icons;
mod flow_motion;
mod flow_travel;
mod import;
mod movie;
mod places;
mod points;
mod project;
mod render;
mod resume;
mod sheets;
mod surfaces;

use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tetreel::image::read_png;

/// A folder with `slab.zarr` in it, in which commands run.
struct Place(tempfile::TempDir);

/// What a run said.
struct Run {
    code: Option<i32>,
    out: String,
    err: String,
}

/// Steps of `slab.zarr`.
const STEPS: usize = 5;

impl Place {
    fn with_slab() -> Self {
        let place = Self::empty();
        place.ok(&["synth", "slab", "-o", "slab.zarr", "--cells", "2000", "--steps", &STEPS.to_string()]);
        place
    }

    fn empty() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, args: &[&str]) -> Run {
        self.run_words(&args.iter().map(OsStr::new).collect::<Vec<_>>())
    }

    fn run_words(&self, args: &[&OsStr]) -> Run {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tetreel"));
        command.args(args).current_dir(self.0.path()).env("TETREEL_CACHE", self.path("cache"));
        // As on a server. Drivers that look for a display server must not say that there is none.
        command.env_remove("XDG_RUNTIME_DIR").env_remove("MESA_VK_DEVICE_SELECT");
        // No windows on the screen of whoever runs the tests.
        command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY");
        let output = command.output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        let run = Run { code: output.status.code(), out: text(output.stdout), err: text(output.stderr) };
        assert!(!run.err.contains("panicked") && !run.out.contains("panicked"), "{args:?}: {}", run.err);
        run
    }

    /// A run that must succeed; its stdout.
    fn ok(&self, args: &[&str]) -> String {
        let run = self.run(args);
        assert_eq!(run.code, Some(0), "{args:?}: {}", run.err);
        run.out
    }

    fn json(&self, args: &[&str]) -> Value {
        serde_json::from_str(&self.ok(args)).unwrap()
    }

    /// A run that must fail with one error that contains all `parts`, and leave every file as it was.
    fn refuses(&self, args: &[&str], parts: &[&str]) {
        let before = files(self.0.path());
        let run = self.run(args);
        assert_eq!((run.code, run.out.as_str()), (Some(2), ""), "{args:?}: {}", run.err);
        let errors: Vec<&str> = run.err.lines().filter(|line| line.starts_with("error: ")).collect();
        assert_eq!(errors.len(), 1, "{args:?}: {}", run.err);
        for part in parts {
            assert!(errors[0].contains(part), "{args:?}: '{part}' is missing in: {}", errors[0]);
        }
        assert!(files(self.0.path()) == before, "{args:?} changed files: {:?}", files(self.0.path()).keys());
    }
}

/// All files and folders (the latter without content) below a folder, sorted.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(files(&path));
            all.insert(path, Vec::new());
        } else {
            let bytes = std::fs::read(&path).unwrap();
            all.insert(path, bytes);
        }
    }
    all
}

fn keys(value: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = value.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

/// Options for a small picture of the field of the slab that changes with time.
const SMALL: [&str; 6] = ["--field", "linear", "--size", "64x64", "--tf", "viridis@0:0.01,1:0.2"];

fn render<'a>(rest: &[&'a str]) -> Vec<&'a str> {
    [&["render", "slab.zarr"], &SMALL[..], rest].concat()
}

#[test]
fn every_command_has_a_help_with_an_example() {
    let place = Place::empty();
    let overview = place.ok(&["--help"]);
    let listed = overview.split("Commands:\n").nth(1).unwrap().lines().take_while(|line| !line.is_empty());
    let commands: Vec<&str> =
        listed.filter_map(|line| line.split_whitespace().next()).filter(|&c| c != "help").collect();
    assert!(["demo", "import", "info", "render", "compare", "bench", "synth"].iter().all(|c| commands.contains(c)));
    for command in commands {
        let help = place.ok(&[command, "--help"]);
        assert!(help.contains(&format!("Example:\n  tetreel {command}")), "{help}");
        // Documents that a help names must be there.
        for word in help.split(|c: char| c.is_whitespace() || "()".contains(c)).filter(|w| w.starts_with("docs/")) {
            assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(word).is_file(), "{command} --help names {word}");
        }
    }
}

#[test]
fn n_steps_asked_make_n_files_of_which_first_and_last_are_the_right_ones() {
    let place = Place::with_slab();
    place.ok(&render(&["-o", "frames/f_%03d.png", "--steps", "0..4:2", "--stats", "stats.json"]));
    let written: Vec<PathBuf> = files(&place.path("frames")).into_keys().collect();
    assert_eq!(written, [0, 1, 2].map(|i| place.path(&format!("frames/f_{i:03}.png"))));
    for (frame, step) in [(0, "0"), (2, "4")] {
        place.ok(&render(&["-o", "single.png", "--steps", step]));
        assert_eq!(read_png(&place.path("single.png")).unwrap(), read_png(&written[frame]).unwrap(), "frame {frame}");
    }
    assert_ne!(read_png(&written[0]).unwrap(), read_png(&written[2]).unwrap(), "the steps look the same");

    let stats: Value = serde_json::from_slice(&std::fs::read(place.path("stats.json")).unwrap()).unwrap();
    let of = |key: &str| stats.as_array().unwrap().iter().map(|record| record[key].clone()).collect::<Vec<_>>();
    assert_eq!((of("frame"), of("step")), (vec![0.into(), 1.into(), 2.into()], vec![0.into(), 2.into(), 4.into()]));
    let info = place.json(&["info", "slab.zarr", "--json"]);
    assert_eq!((&of("time")[0], &of("time")[2]), (&info["time"]["first"], &info["time"]["last"]));
    for record in of("stats") {
        assert!(record["rays_hit"].as_u64() > Some(0) && record["ms_frame"].as_f64() > Some(0.0), "{record}");
    }
}

// Long: the suite of accuracy measures all paths that there are.
#[test]
fn json_is_alone_on_stdout_and_has_the_keys_that_the_help_names() {
    let place = Place::empty();
    let report = place.json(&["synth", "slab", "-o", "slab.zarr", "--cells", "2000", "--steps", "5", "--json"]);
    assert_eq!(report["steps"], STEPS);
    let info = place.json(&["-v", "info", "slab.zarr", "--json"]);
    assert_eq!(keys(&info), ["bytes", "fields", "mesh", "time", "version"]);
    assert_eq!(info["time"]["steps"], STEPS);
    assert_eq!(place.ok(&render(&["-v", "-o", "a.png", "--steps", "0"])), "", "progress belongs on stderr");
    place.ok(&render(&["-o", "b.png", "--steps", "0", "--mode", "reference"]));
    let metrics = place.json(&["compare", "a.png", "b.png", "--json"]);
    assert_eq!(keys(&metrics), ["flip", "max", "psnr", "rmse", "ssim"]);
    // Pixels are rounded to 1/255; both renderers are far closer to each other than that.
    assert!(metrics["max"].as_f64().unwrap() <= 1.5 / 255.0, "{metrics}");
    place.ok(&[
        "bench",
        "slab.zarr",
        "--size",
        "32x32",
        "--frames",
        "2",
        "--suite",
        "accuracy",
        "--json",
        "bench.json",
    ]);
    let bench: Value = serde_json::from_slice(&std::fs::read(place.path("bench.json")).unwrap()).unwrap();
    assert_eq!(keys(&bench), ["integration", "machine", "runs"]);
    assert!(bench["integration"][0]["opacity_max"].as_f64().unwrap() <= 1e-6, "{}", bench["integration"][0]);
    let runs = bench["runs"].as_array().unwrap();
    let (judge, rays) = (&runs[0], runs.iter().find(|run| run["mode"] == "raycast").unwrap());
    assert_eq!((judge["mode"].as_str(), judge["error"].is_null()), (Some("reference"), true));
    // The bounds of the fast renderers against the reference.
    let error = &rays["error"];
    assert!(error["rmse"].as_f64().unwrap() <= 1e-5 && error["max"].as_f64().unwrap() <= 1e-3, "{error}");
}

#[test]
fn compare_exits_with_0_1_or_2() {
    let place = Place::with_slab();
    for (name, step) in [("a.png", "0"), ("b.png", "4")] {
        place.ok(&render(&["-o", name, "--steps", step]));
    }
    place.ok(&["compare", "a.png", "a.png", "--fail-above", "0"]);
    place.ok(&["compare", "a.png", "b.png"]);
    let run = place.run(&["compare", "a.png", "b.png", "--json", "--fail-above", "1e-3"]);
    assert_eq!(run.code, Some(1));
    let metrics: Value = serde_json::from_str(&run.out).unwrap();
    assert!(metrics["max"].as_f64() > Some(1e-3), "{metrics}");
    place.ok(&["compare", "a.png", "b.png", "--sheet", "sheet.png"]);
    let sheet = read_png(&place.path("sheet.png")).unwrap();
    assert_eq!((sheet.width, sheet.height), (3 * 64 + 4 * 2, 64 + 2 * 2));
    assert!(sheet.pixels.iter().any(|p| p[0] > 0.1), "the difference is visible");
    place.ok(&["render", "slab.zarr", "-o", "c.png", "--steps", "0", "--size", "8x8"]);
    place.refuses(&["compare", "a.png", "c.png"], &["a.png", "c.png", "64 x 64", "8 x 8"]);
    place.refuses(&["compare", "a.png", "missing.png"], &["missing.png"]);
    place.refuses(&["compare", "a.png", "slab.zarr/zarr.json"], &["slab.zarr/zarr.json"]);
}

#[test]
fn exr_files_keep_what_png_files_round() {
    let place = Place::with_slab();
    let make = |rest: &[&str]| place.ok(&render(&[&["--steps", "2", "-o"], rest].concat()));
    make(&["raw.exr", "--exr", "raw"]);
    make(&["linear.exr"]);
    make(&["reference.exr", "--exr", "raw", "--mode", "reference"]);
    make(&["half.exr", "--bit-depth", "16"]);
    for compression in ["piz", "rle", "none"] {
        make(&["other.exr", "--exr-compression", compression]);
        assert!(place.ok(&["compare", "linear.exr", "other.exr"]).contains("max 0"), "{compression}");
    }
    make(&["8.png"]);
    make(&["16.png", "--bit-depth", "16"]);
    let max = |a: &str, b: &str| place.json(&["compare", a, b, "--json"])["max"].as_f64().unwrap();
    assert_eq!(max("raw.exr", "raw.exr"), 0.0);
    // Linear light rounds colours of at most 1 to f32 twice: in the file and when it is read.
    let linear = max("raw.exr", "linear.exr");
    assert!(linear <= 2.1 * 2.0_f64.powi(-24), "{linear}");
    // Halves have 11 digits: linear light is off by 2^-12 of itself, and a straight colour c by at most c / 2.4 + 0.06 of that, the slope of
    // sRGB's curve, so premultiplied by less than an opacity.
    let half = max("linear.exr", "half.exr");
    assert!(half > 2.0_f64.powi(-20) && half <= 2.0_f64.powi(-12), "{half}");
    // A straight colour and an opacity are off by half a step each.
    for (file, steps) in [("8.png", 255.0), ("16.png", 65535.0)] {
        let rounded = max("raw.exr", file);
        assert!(rounded > linear && rounded <= 1.01 / steps, "{file}: {rounded}");
    }
    // The bounds of the fast renderer against the reference, which a PNG would hide.
    let metrics = place.json(&["compare", "raw.exr", "reference.exr", "--json"]);
    assert!(metrics["max"].as_f64() <= Some(1e-3) && metrics["rmse"].as_f64() <= Some(1e-5), "{metrics}");
    assert_eq!(keys(&metrics["depth"]), ["compared", "max", "rmse", "unmatched"]);
    assert!(metrics["depth"]["compared"].as_u64() > Some(0), "{metrics}");
    assert!(place.ok(&["compare", "raw.exr", "linear.exr"]).contains("depth: max 0"));
    assert!(place.json(&["compare", "raw.exr", "8.png", "--json"]).get("depth").is_none());

    place.refuses(&render(&["-o", "a.png", "--steps", "0", "--exr", "raw"]), &["--exr", "a.png"]);
    place.refuses(&render(&["-o", "a.exr", "--steps", "0", "--bit-depth", "8"]), &["--bit-depth 8", "16 or 32"]);
    place.refuses(&render(&["-o", "a.mp4", "--steps", "0", "--bit-depth", "8"]), &["--bit-depth", "a.mp4"]);
    place.refuses(
        &render(&["-o", "a.png", "--steps", "0", "--exr-compression", "zip"]),
        &["--exr-compression", "a.png"],
    );
    place.refuses(
        &render(&["-o", "a.exr", "--steps", "0", "--exr-compression", "dwa"]),
        &["dwa", "zip, piz, rle or none"],
    );
    place.refuses(&render(&["-o", "a.exr", "--steps", "0", "--background", "white"]), &["--background", "a.exr"]);
    place.refuses(&render(&["-o", "a.png", "--steps", "0", "--bit-depth", "12"]), &["12", "8 or 16"]);
}

#[test]
fn bad_input_gives_one_error_that_names_it_and_changes_nothing() {
    let place = Place::with_slab();
    // Outputs from before, which must survive.
    place.ok(&render(&["-o", "f_%d.png"]));
    std::fs::write(place.path("blocked"), "a file where a folder is wanted").unwrap();
    let out = ["-o", "f_%d.png"];
    place.refuses(&["render", "none.zarr", "-o", "f_%d.png"], &["none.zarr"]);
    place.refuses(&["info", "none.zarr", "--json"], &["none.zarr"]);
    place.refuses(&render(&["-o", "one.png"]), &["5 frames", "frame_%04d.png"]);
    place.refuses(&render(&["-o", "f.jpg"]), &["f.jpg", ".png"]);
    place.refuses(&render(&["-o", "blocked/f_%d.png"]), &["blocked"]);
    place
        .refuses(&["render", "slab.zarr", "-o", "f_%d.png", "--field", "q"], &["slab.zarr", "'q'", "constant, linear"]);
    for (option, value, parts) in [
        ("--steps", "5..9", ["5..9", "0..4"]),
        ("--steps", "x", ["'x'", "--steps"]),
        ("--steps", "0..4:0", ["0..4:0", "--steps"]),
        ("--times", "7..8", ["7..8", "0 to 1"]),
        ("--camera", "pos=1,2", ["pos", "three"]),
        ("--range", "3,1", ["3..1", "--range"]),
        ("--unit-distance", "0", ["unit-distance", "0"]),
        ("--mode", "fast", ["'fast'", "raycast"]),
        ("--optics", "fast", ["'fast'", "table3d"]),
        ("--background", "pink", ["pink", "#rrggbb"]),
    ] {
        place.refuses(&render(&[&out[..], &[option, value]].concat()), &parts);
    }
    for (tf, part) in
        [("viridis@0:2", "0:2"), ("nomap", "nomap"), ("none.json", "none.json"), ("viridis@", "POSITION:OPACITY")]
    {
        place.refuses(&["render", "slab.zarr", "-o", "f_%d.png", "--size", "8x8", "--tf", tf], &[part]);
    }
    for size in ["0x8", "8", "8x", "-1x8", "99999x99999", "8x8x8"] {
        place.refuses(&["render", "slab.zarr", "-o", "f_%d.png", &format!("--size={size}")], &["--size"]);
    }
    place.refuses(&["synth", "slab", "-o", "slab.zarr"], &["slab.zarr", "exists"]);
    place.refuses(&["synth", "slab", "-o", "new.zarr", "--cells", "0"], &["0 cells"]);
    place.refuses(&["synth", "slab", "-o", "blocked/new.zarr", "--cells", "2000"], &["blocked"]);
    place.refuses(&["synth", "shelf", "-o", "new.zarr"], &["'shelf'", "slab"]);
}

#[test]
fn a_damaged_chunk_is_named_and_what_was_rendered_before_stays() {
    let place = Place::with_slab();
    place.ok(&render(&["-o", "f_%d.png"]));
    let chunk = "slab.zarr/fields/linear/raw/c/2/0";
    let whole = std::fs::read(place.path(chunk)).unwrap();
    let mut flipped = whole.clone();
    flipped[17] ^= 0x40;
    for damaged in [&whole[..whole.len() / 2], &flipped, &[]] {
        std::fs::write(place.path(chunk), damaged).unwrap();
        place.refuses(&render(&["-o", "f_%d.png", "--steps", "2"]), &[chunk, "step 2"]);
        place.refuses(&render(&["-o", "new_%d.png", "--steps", "0..4"]), &[chunk, "step 2"]);
    }
    std::fs::remove_file(place.path(chunk)).unwrap();
    place.refuses(&render(&["-o", "new.png", "--steps", "2"]), &[chunk]);
    // The other steps still play.
    place.ok(&render(&["-o", "new.png", "--steps", "3"]));
    assert_eq!(read_png(&place.path("new.png")).unwrap(), read_png(&place.path("f_3.png")).unwrap());
}

// Long: 24 frames of the size that the demo has.
#[test]
fn the_demo_leaves_frames_and_a_contact_sheet_on_which_something_shines() {
    let place = Place::empty();
    place.ok(&["demo", "--cells", "2000", "--out", "here"]);
    let frames: Vec<PathBuf> = files(&place.path("here/frames")).into_keys().collect();
    assert_eq!(frames.len(), 24);
    let sheet = read_png(&place.path("here/contact_sheet.png")).unwrap();
    let frame = read_png(&frames[23]).unwrap();
    assert!(sheet.width >= 3 * frame.width && sheet.height >= 4 * frame.height, "{} x {}", sheet.width, sheet.height);
    // Brighter than the background and the haze (0.15 at most) by far more than rounding.
    let bright = |pixels: &[[f32; 4]]| pixels.iter().filter(|p| p[0] > 0.25).count();
    assert!(bright(&sheet.pixels) > 0 && bright(&frame.pixels) > 0, "nothing shines");
    place.refuses(&["info", "here/frames/frame_0000.png"], &["frame_0000.png"]);
}

#[test]
fn man_pages_and_completions_know_every_command() {
    let place = Place::empty();
    place.ok(&["manual", "--man", "man"]);
    for command in ["demo", "import", "info", "render", "compare", "bench", "synth"] {
        let page = std::fs::read_to_string(place.path(&format!("man/tetreel-{command}.1"))).unwrap();
        assert!(page.contains("Example"), "{command}");
    }
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = place.ok(&["manual", "--completions", shell]);
        assert!(script.contains("compare") && script.contains("unit-distance"), "{shell}");
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_run_with_130_and_leaves_no_half_file() {
    let place = Place::empty();
    // Long enough never to be done before it is interrupted.
    let args = ["synth", "jet", "-o", "jet.zarr", "--cells", "20000", "--steps", "100000"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_tetreel"));
    let mut child = command.args(args).current_dir(place.0.path()).stderr(Stdio::null()).spawn().unwrap();
    while files(place.0.path()).is_empty() {
        assert_eq!(child.try_wait().unwrap(), None, "ended before it wrote anything");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(files(place.0.path()).is_empty(), "{:?}", files(place.0.path()).keys());
}
