//! `import --resume`: the command killed, interrupted and failing, and going on.

use super::append::{PATIENCE, Running};
use super::{Place, files};
use std::path::PathBuf;
use std::time::Instant;

/// Steps of the series: the last ones follow the first checkpoint by half a second, so that a busy machine does not finish before the signal.
const STEPS: usize = 300;

/// A vector calculated with zeros in a divisor, so that notes count on.
const IMPORT: [&str; 8] = ["import", "run", "-o", "t.zarr", "--define", "q = dye/(dye-dye)", "--define", "w = 2*dye"];
const RESUME: &str = "--resume=0";

impl Place {
    /// A folder with a series of `.vtu` files as `run`, and the store of one import of it as `whole.zarr`.
    fn with_series() -> Self {
        let place = Self::empty();
        place.ok(&["synth", "jet", "-o", "run", "--cells", "4000", "--steps", &STEPS.to_string()]);
        let mut whole = IMPORT;
        whole[3] = "whole.zarr";
        place.ok(&whole);
        place
    }

    fn checkpoint(&self) -> PathBuf {
        self.path("t.zarr.partial/checkpoint")
    }

    /// Starts the import, and waits until it has something to go on from.
    fn start_import(&self) -> Running {
        let run = Running::start(self, &[&IMPORT[..], &[RESUME]].concat());
        let start = Instant::now();
        while !self.checkpoint().exists() && !self.path("t.zarr").exists() {
            assert!(start.elapsed() < PATIENCE);
        }
        run
    }

    /// Lets the import go on to its end; checks every file, and returns what was said.
    fn finish(&self) -> String {
        let run = self.run(&[&IMPORT[..], &[RESUME]].concat());
        assert_eq!(run.code, Some(0), "{}", run.err);
        let below = |store: &str| {
            let root = self.path(store);
            files(&root)
                .into_iter()
                .map(|(path, bytes)| (path.strip_prefix(&root).unwrap().to_owned(), bytes))
                .collect::<Vec<_>>()
        };
        let (found, expected) = (below("t.zarr"), below("whole.zarr"));
        assert_eq!(found.iter().map(|f| &f.0).collect::<Vec<_>>(), expected.iter().map(|f| &f.0).collect::<Vec<_>>());
        found.iter().zip(&expected).for_each(|(a, b)| assert!(a == b, "{:?} differs", a.0));
        assert!(!self.path("t.zarr.partial").exists());
        run.err
    }
}

#[test]
fn killed_again_and_again_it_goes_on_and_writes_the_store_of_one_import() {
    let place = Place::with_series();
    for _ in 0..3 {
        let mut run = place.start_import();
        run.0.kill().unwrap();
        run.0.wait().unwrap();
        assert!(!place.path("t.zarr").exists(), "killed too late");
    }
    let said = place.finish();
    assert!(said.contains("t.zarr.partial: goes on at step ") && said.contains(&format!(" of {STEPS}")), "{said}");
    let info = place.json(&["info", "t.zarr", "--json"]);
    let notes = info["version"]["notes"].to_string();
    assert!(notes.contains("division by zero") && notes.contains(&format!("in {STEPS} steps")), "{notes}");
}

#[cfg(unix)]
#[test]
fn ctrl_c_says_what_is_kept() {
    let place = Place::with_series();
    let (code, said) = place.start_import().interrupt();
    assert_eq!(code, Some(130), "{said}");
    assert!(said.contains("interrupted; t.zarr.partial has ") && said.contains("kept for --resume"), "{said}");
    place.finish();
}

#[test]
fn a_step_that_cannot_be_read_yet_is_no_loss() {
    let place = Place::with_tornado();
    let import = ["import", "run/tornado.pvd", "-o", "t.zarr", RESUME];
    let last = place.path("run/tornado_0007.vtu");
    let bytes = std::fs::read(&last).unwrap();
    std::fs::write(&last, &bytes[..bytes.len() / 2]).unwrap();
    let run = place.run(&import);
    assert_eq!(run.code, Some(2));
    assert!(run.err.contains("has 7 of 8 steps") && run.err.contains("tornado_0007.vtu"), "{}", run.err);
    std::fs::write(&last, &bytes).unwrap();
    place.refuses(
        &[&import[..], &["--codec", "vq"]].concat(),
        &["t.zarr.partial", "another codec", "leave --resume out"],
    );
    place.refuses(
        &[&import[..], &["--define", "k = 2*pressure"]].concat(),
        &["t.zarr.partial", "calculated k = 2*pressure"],
    );
    for other in ["--append", "--dry-run"] {
        place.refuses(&[&import[..], &[other]].concat(), &["--resume", other]);
    }
    place.refuses(&["import", "run/tornado.pvd", "-o", "t.zarr", "--resume=soon"], &["'soon' is no number of seconds"]);
    let run = place.run(&import);
    assert!(run.code == Some(0) && run.err.contains("goes on at step 8 of 8"), "{}", run.err);
    place.ok(&["import", "run/tornado.pvd", "-o", "whole.zarr"]);
    assert!(files(&place.path("t.zarr")).values().eq(files(&place.path("whole.zarr")).values()));
}
