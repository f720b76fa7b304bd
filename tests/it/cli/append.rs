//! `import --append` and `--follow`: a store beside a simulation that is still running.

use super::{Place, files};
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Long enough for a busy machine; nothing waits so long unless it fails.
pub(super) const PATIENCE: Duration = Duration::from_secs(60);

impl Place {
    /// A collection of the first `steps` steps of the tornado, whose files are all there.
    fn list_steps(&self, steps: usize) {
        let pvd = std::fs::read_to_string(self.path("run/tornado.pvd")).unwrap();
        let (mut text, mut count) = (String::new(), 0);
        for line in pvd.lines() {
            let is_step = line.contains("<DataSet");
            if !is_step || count < steps {
                text.push_str(&format!("{line}\n"));
            }
            count += usize::from(is_step);
        }
        assert_eq!(count, 8);
        std::fs::write(self.path("run/case.pvd"), text).unwrap();
    }

    fn steps(&self, store: &str) -> Option<u64> {
        let run = self.run(&["info", store, "--json"]);
        let json: serde_json::Value = serde_json::from_str(&run.out).ok()?;
        json["time"]["steps"].as_u64()
    }

    fn wait_for_steps(&self, store: &str, steps: u64) {
        let start = Instant::now();
        while !self.path(store).is_dir() || self.steps(store) != Some(steps) {
            assert!(start.elapsed() < PATIENCE, "{store} has no {steps} steps");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

const APPEND: [&str; 5] = ["import", "run/case.pvd", "-o", "t.zarr", "--append"];

fn with<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&APPEND[..], more].concat()
}

#[test]
fn one_command_line_writes_a_store_and_then_adds_to_it() {
    let place = Place::with_tornado();
    for codec in [&[][..], &["--codec", "vq", "--entries", "16"]] {
        place.list_steps(3);
        let text = place.ok(&with(&[codec, &["--dry-run"]].concat()));
        assert!(text.contains("steps: 3") && !place.path("t.zarr").exists(), "{text}");
        assert!(place.ok(&with(codec)).contains("steps: 3"));
        place.list_steps(7);
        let text = place.ok(&with(&[codec, &["--dry-run"]].concat()));
        assert!(text.contains("the store has 3 steps") && text.contains("new: 4 steps"), "{text}");
        assert_eq!(place.steps("t.zarr"), Some(3));
        let report = place.json(&with(&[codec, &["--json"]].concat()));
        assert_eq!((&report["steps_added"], &report["steps_before"]), (&4.into(), &3.into()));
        assert_eq!(report["steps_coded_again"], if codec.is_empty() { 0 } else { 3 });
        place.list_steps(8);
        place.ok(&with(&[]));
        let before = files(&place.path("t.zarr"));
        let text = place.ok(&with(codec));
        assert!(text.contains("nothing new: the source ends at") && text.contains("nothing was written"), "{text}");
        assert!(files(&place.path("t.zarr")) == before);
        // The same pictures as from one import.
        place.ok(&[&["import", "run/tornado.pvd", "-o", "whole.zarr", "--overwrite"], codec].concat());
        let look = ["--field", "velocity", "--steps", "0..7:7", "--size", "80x60"];
        place.ok(&[&["render", "t.zarr", "-o", "a_%d.png"], &look[..]].concat());
        place.ok(&[&["render", "whole.zarr", "-o", "b_%d.png"], &look[..]].concat());
        let pictures =
            |name: &str| [0, 1].map(|i| tetreel::image::read_png(&place.path(&format!("{name}_{i}.png"))).unwrap());
        assert!(pictures("a") == pictures("b"));
        assert!(pictures("a")[0] != pictures("a")[1], "another step would be seen");
        std::fs::remove_dir_all(place.path("t.zarr")).unwrap();
    }
}

#[test]
fn what_does_not_fit_is_refused_and_the_store_stays() {
    let place = Place::with_tornado();
    place.list_steps(3);
    place.ok(&with(&["--field", "pressure", "--units", "pressure=Pa"]));
    place.list_steps(8);
    for (more, parts) in [
        (&["--overwrite"][..], &["--append", "--overwrite"][..]),
        (&["--field", "velocity"], &["t.zarr", "no field 'velocity:0'", "pressure"]),
        (&["--codec", "vq"], &["t.zarr", "coded as raw", "vq with 256 entries", "keeps its codec"]),
        (&["--units", "pressure=bar"], &["'Pa'", "'bar'"]),
        (&["--steps", "8..9"], &["8..9", "beyond the series"]),
        (&["--follow", "soon"], &["--follow", "'soon' is no number of seconds"]),
        (&["--follow", "--dry-run"], &["--follow", "--dry-run"]),
    ] {
        place.refuses(&with(more), parts);
    }
    place.refuses(&["import", "run/case.pvd", "-o", "t.zarr", "--follow"], &["required arguments"]);
    place.refuses(&["import", "run/case.pvd", "--append", "--dry-run"], &["required arguments"]);
    std::fs::create_dir(place.path("other.zarr")).unwrap();
    place.refuses(&["import", "run/case.pvd", "-o", "other.zarr", "--append"], &["other.zarr", "tetreel store"]);
    // Damage in the last of the new steps.
    let last = place.path("run/tornado_0007.vtu");
    let bytes = std::fs::read(&last).unwrap();
    std::fs::write(&last, &bytes[..bytes.len() / 2]).unwrap();
    place.refuses(&with(&[]), &["tornado_0007.vtu"]);
    std::fs::remove_file(&last).unwrap();
    place.refuses(&with(&[]), &["case.pvd", "tornado_0007.vtu is missing"]);
    std::fs::write(&last, &bytes).unwrap();
    // The fields and the unit of the store, without naming them again.
    place.ok(&with(&[]));
    let info = place.json(&["info", "t.zarr", "--json"]);
    assert_eq!((&info["time"]["steps"], &info["fields"][0]["units"]), (&8.into(), &"Pa".into()));
    assert_eq!(info["fields"].as_array().unwrap().len(), 1);
}

/// The command running, and ended with the test.
pub(super) struct Running(pub(super) Child);

impl Running {
    pub(super) fn start(place: &Place, args: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tetreel"));
        command.args(args).current_dir(place.path("")).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(command.spawn().unwrap())
    }

    /// Presses Ctrl-C; the exit code and what was said on stderr.
    #[cfg(unix)]
    pub(super) fn interrupt(mut self) -> (Option<i32>, String) {
        let kill = Command::new("kill").args(["-INT", &self.0.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let mut text = String::new();
        self.0.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        (self.0.wait().unwrap().code(), text)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[cfg(unix)]
#[test]
fn following_adds_what_comes_waits_for_what_is_half_written_and_ends_by_ctrl_c() {
    let place = Place::with_tornado();
    let follow = with(&["--field", "pressure", "--follow", "0.05"]);
    // Not even the collection is there yet.
    let run = Running::start(&place, &follow);
    place.list_steps(2);
    place.wait_for_steps("t.zarr", 2);
    let last = place.path("run/tornado_0007.vtu");
    let bytes = std::fs::read(&last).unwrap();
    std::fs::write(&last, &bytes[..bytes.len() / 2]).unwrap();
    place.list_steps(5);
    place.wait_for_steps("t.zarr", 5);
    place.list_steps(8);
    std::thread::sleep(Duration::from_millis(400));
    assert_eq!(place.steps("t.zarr"), Some(5));
    std::fs::write(&last, &bytes).unwrap();
    place.wait_for_steps("t.zarr", 8);
    let before = files(&place.path("t.zarr"));
    let (code, text) = run.interrupt();
    assert_eq!(code, Some(130), "{text}");
    let of_last = text.lines().filter(|l| l.contains("not yet: ") && l.contains("tornado_0007.vtu")).count();
    assert_eq!(of_last, 1, "said once: {text}");
    assert!(files(&place.path("t.zarr")) == before);
    let names: Vec<_> = std::fs::read_dir(place.path("")).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(names.iter().all(|n| !n.to_string_lossy().starts_with(".t.zarr")), "{names:?}");
}

#[cfg(unix)]
#[test]
fn following_a_mesh_that_changes_is_an_error() {
    let place = Place::with_tornado();
    place.list_steps(2);
    let mut run = Running::start(&place, &with(&["--field", "pressure", "--follow", "0.05"]));
    place.wait_for_steps("t.zarr", 2);
    place.edit("run/tornado_0003.vtu", "NumberOfPoints=\"729\"", "NumberOfPoints=\"728\"");
    place.list_steps(4);
    let start = Instant::now();
    let code = loop {
        if let Some(status) = run.0.try_wait().unwrap() {
            break status.code();
        }
        assert!(start.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_millis(20));
    };
    let mut text = String::new();
    run.0.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    assert!(code == Some(2) && text.contains("the mesh changes between steps 0 and 3"), "{code:?} {text}");
    assert_eq!(place.steps("t.zarr"), Some(2));
}

#[cfg(target_os = "linux")]
#[test]
fn killed_at_any_moment_it_leaves_the_old_store_or_the_new_one() {
    let place = Place::with_tornado();
    place.list_steps(3);
    place.ok(&with(&["--field", "pressure"]));
    place.list_steps(8);
    let start = Instant::now();
    place.ok(&with(&["--dry-run"]));
    let whole = start.elapsed();
    for i in 0..12 {
        let mut run = Running::start(&place, &APPEND);
        std::thread::sleep(whole * i / 6);
        run.0.kill().unwrap();
        run.0.wait().unwrap();
        let steps = place.steps("t.zarr");
        assert!(matches!(steps, Some(3 | 8)), "{steps:?}");
    }
    place.ok(&APPEND);
    assert_eq!(place.steps("t.zarr"), Some(8));
}
