//! Where things are: names that are no Unicode, what is no file, what others have left.
#![cfg(unix)]

use super::{Place, Run, keys};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;
use tetreel::image::read_png;

/// Longer than anything here takes on the slowest machine; who hangs does so for ever.
const PATIENCE: Duration = Duration::from_secs(120);

/// A line of words, in which `?` stands for a byte that is in no Unicode.
fn words(line: &str) -> Vec<OsString> {
    let word = |word: &str| {
        let parts: Vec<&[u8]> = word.split('?').map(str::as_bytes).collect();
        OsStr::from_bytes(&parts.join(&0xff)).to_owned()
    };
    line.split_whitespace().map(word).collect()
}

fn run(place: &Place, line: &str) -> Run {
    let words = words(line);
    let run = place.run_words(&words.iter().map(OsString::as_os_str).collect::<Vec<_>>());
    assert_eq!(run.code, Some(0), "{line}: {}", run.err);
    run
}

#[cfg(target_os = "linux")]
#[test]
fn names_that_are_no_unicode_work_wherever_a_path_is_given() {
    let place = Place::empty();
    let path = |name: &str| place.0.path().join(&words(name)[0]);
    let run = |line: &str| run(&place, line);
    run("synth slab -o a?.zarr --cells 600 --steps 3 --json");
    run("info a?.zarr --json");
    run("export a?.zarr -o b?.pvd --json");
    run("synth slab -o folder? --cells 600 --steps 2");
    let report = run("import b?.pvd -o c?.zarr --field linear --steps 0..1 --json").out;
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!(keys(&report).contains(&"output"));
    run("import b?.pvd -o c?.zarr --append --json");
    fs::write(
        path("map?.json"),
        r#"[{"Name": "m", "RGBPoints": [0, 0, 0, 1, 1, 1, 0, 0]}, {"Name": "n", "RGBPoints": [0, 0, 1, 0, 1, 1, 0, 0]}]"#,
    )
    .unwrap();
    let look = "--field linear --size 24x24 --tf map?.json#m_r@0:0.2,1:0.5 --backend cpu";
    run(&format!("render c?.zarr -o d?/f_%02d?.png --stats s?.json --trace t?.json {look}"));
    run(&format!("render c?.zarr -o d?/f_%02d?.png --resume {look}"));
    run(&format!("render b?.pvd -o e?.png --steps 1 {look}"));
    run(&format!("render b?.pvd -o e?.exr --steps 1 {look}"));
    let [stored, cached] = ["d?/f_01?.png", "e?.png"].map(|name| read_png(&path(name)).unwrap());
    assert_eq!(stored, cached);
    assert!(stored.pixels.iter().any(|pixel| pixel[3] > 0.0));
    run("compare d?/f_01?.png e?.png --fail-above 0 --sheet g?.png");
    let project = "version = 1\n[data]\nsource = \"c.zarr\"\n[output]\noutput = \"p_%02d.png\"\nsize = \"24x24\"\n";
    fs::create_dir(path("100%?")).unwrap();
    fs::rename(path("c?.zarr"), path("100%?/c.zarr")).unwrap();
    fs::write(path("100%?/p?.toml"), project).unwrap();
    run("render 100%?/p?.toml --backend cpu");
    assert!(path("100%?/p_02.png").is_file());
    run("manual --man man?");
    assert!(fs::read_dir(path("man?")).unwrap().count() > 5);
}

/// What a command says that must fail at once; `None` if it hangs.
fn error_of(place: &Place, args: &[&str]) -> Option<String> {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_tetreel"));
    command.args(args).current_dir(place.0.path()).env("TETREEL_CACHE", place.path("cache"));
    command.stdin(std::process::Stdio::null()).stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped());
    let child = command.spawn().unwrap();
    let id = child.id();
    let (say, heard) = mpsc::channel();
    std::thread::spawn(move || _ = say.send(child.wait_with_output().unwrap()));
    let Ok(output) = heard.recv_timeout(PATIENCE) else {
        std::process::Command::new("kill").args(["-9", &id.to_string()]).status().unwrap();
        return None;
    };
    assert_eq!(output.status.code(), Some(2), "{args:?}");
    Some(String::from_utf8(output.stderr).unwrap())
}

#[test]
fn a_fifo_a_socket_or_a_device_is_refused_by_name_wherever_a_series_is_named() {
    let place = Place::empty();
    place.ok(&["synth", "slab", "-o", "good.zarr", "--cells", "600", "--steps", "1"]);
    let fifo = |path: &Path| assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
    let mut kinds = Vec::new();
    for ending in ["pvd", "vtu", "xdmf", "toml", "zarr"] {
        let names = ["fifo", "socket", "device"].map(|kind| format!("{kind}.{ending}"));
        fifo(&place.path(&names[0]));
        std::os::unix::net::UnixListener::bind(place.path(&names[1])).unwrap();
        std::os::unix::fs::symlink("/dev/zero", place.path(&names[2])).unwrap();
        kinds.extend(names.into_iter().zip(["a FIFO", "a socket", "a device"]));
    }
    // Inside of what is named.
    fs::write(
        place.path("names.pvd"),
        r#"<VTKFile type="Collection"><Collection><DataSet timestep="0" file="fifo.vtu"/></Collection></VTKFile>"#,
    )
    .unwrap();
    fs::create_dir(place.path("inside.zarr")).unwrap();
    fifo(&place.path("inside.zarr/zarr.json"));
    let mut commands = Vec::new();
    for (name, kind) in &kinds {
        commands.push((vec!["render", name, "-o", "x.png"], name.clone(), *kind));
        if !name.ends_with(".toml") && !name.ends_with(".zarr") {
            commands.push((vec!["import", name, "-o", "x.zarr"], name.clone(), *kind));
        }
    }
    commands.push((vec!["import", "names.pvd", "-o", "x.zarr"], "fifo.vtu".to_owned(), "a FIFO"));
    commands.push((vec!["info", "inside.zarr"], "inside.zarr/zarr.json".to_owned(), "a FIFO"));
    commands.push((vec!["render", "inside.zarr", "-o", "x.png"], "inside.zarr/zarr.json".to_owned(), "a FIFO"));
    commands.push((vec!["synth", "decay", "--from", "fifo.vtu", "-o", "x.zarr"], "fifo.vtu".to_owned(), "a FIFO"));
    // As the place of a store.
    let place_of = |args: &[&'static str]| [&["import", "good.pvd", "-o"], args].concat();
    place.ok(&["export", "good.zarr", "-o", "good.pvd"]);
    for args in [place_of(&["fifo.zarr", "--append"]), place_of(&["fifo.zarr", "--overwrite"])] {
        commands.push((args, "fifo.zarr".to_owned(), ""));
    }
    for (args, name, kind) in commands {
        let error = error_of(&place, &args).unwrap_or_else(|| panic!("{args:?} hangs"));
        assert!(error.contains(&name) && error.contains(kind), "{args:?}: {error}");
    }
    assert!(!place.path("x.zarr").exists() && !place.path("x.png").exists());
}

#[test]
fn what_killed_runs_have_left_is_removed_by_the_next_run_and_live_files_are_not() {
    let place = Place::with_slab();
    let out = place.path("frames");
    fs::create_dir(&out).unwrap();
    let live = tetreel::files::sibling_file(&out.join("other.png")).unwrap();
    for name in [".tetreel-aB3xYz.png", ".tetreel-qwerty.exr", ".tetreel-mine.png", "f_7.png"] {
        fs::write(out.join(name), "half").unwrap();
    }
    place.ok(&super::render(&["-o", "frames/f_%d.png", "--steps", "0..1"]));
    let mut left: Vec<OsString> = fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name()).collect();
    left.sort();
    let live = live.path().file_name().unwrap().to_owned();
    let mut expected = [".tetreel-mine.png", "f_0.png", "f_1.png", "f_7.png"].map(OsString::from).to_vec();
    expected.push(live);
    expected.sort();
    assert_eq!(left, expected);
}

#[test]
fn an_image_for_which_there_is_no_memory_is_refused_with_the_number() {
    let place = Place::with_slab();
    let mut system = sysinfo::System::new().unwrap();
    system.refresh_memory();
    // 32768 x 32768 pixels, of which each takes 80 bytes.
    if system.available_memory() > 85_000_000_000 {
        eprintln!("left out: this machine has memory enough");
        return;
    }
    let size = "--size 32768x32768";
    let args = ["render", "slab.zarr", "-o", "x.png", "--size", "32768x32768"];
    place.refuses(&args, &[size, "takes 85.9 GB", "GB are free"]);
}
