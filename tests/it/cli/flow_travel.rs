//! The sums of the way that the flow has travelled, kept in the store.

use super::{Place, files};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use tetreel::image::{Planes, read_exr};
use tetreel::store::{FieldReader, Store, StoredTravel};

/// Steps of the series: two sums are kept of them.
const STEPS: usize = 20;

const KEPT: &str = "t.zarr/flow/velocity/travel";

/// A generated tornado, as files.
fn run() -> Place {
    let place = Place::empty();
    let steps = STEPS.to_string();
    place.ok(&["synth", "tornado", "--cells", "1500", "--steps", &steps, "-o", "run", "--quiet"]);
    place
}

fn import(place: &Place, options: &[&str]) {
    place.ok(&[&["import", "run/run.pvd", "-o", "t.zarr", "--quiet"], options].concat());
}

/// The flow of a step alone, and how many values were decoded for it.
fn frame(place: &Place, step: usize) -> (Planes, u64) {
    let step = step.to_string();
    let words = ["render", "t.zarr", "--field", "pressure", "--size", "48x36", "--exr", "raw", "-o", "f.exr"];
    let run = place.run(&[&words[..], &["--steps", &step, "--flow", "velocity", "--stats", "s.json"]].concat());
    assert!(run.code == Some(0) && !run.err.contains("error") && !run.err.contains("warning"), "{}", run.err);
    let stats: serde_json::Value = serde_json::from_slice(&fs::read(place.path("s.json")).unwrap()).unwrap();
    (read_exr(&place.path("f.exr")).unwrap().planes, stats[0]["stats"]["vertices_decoded"].as_u64().unwrap())
}

/// Values that a frame decodes whose way is summed over so many steps, the first among them: their vectors, and a step's scalars.
fn decoded(place: &Place, steps: usize) -> u64 {
    let store = Store::open(place.path("t.zarr")).unwrap();
    let vertices = store.mesh().unwrap().positions.local.len() as u64;
    vertices * (3 * steps as u64 + 1)
}

fn kept(place: &Place) -> BTreeMap<PathBuf, Vec<u8>> {
    files(&place.path(KEPT))
}

fn readers(store: &Store) -> [FieldReader; 3] {
    [0, 1, 2].map(|axis| store.field(&format!("velocity:{axis}").parse().unwrap()).unwrap())
}

fn rows(place: &Place) -> Option<Vec<Vec<f32>>> {
    let store = Store::open(place.path("t.zarr")).unwrap();
    let travel = StoredTravel::of(readers(&store).each_ref(), store.times()).unwrap();
    (0..travel.rows()).map(|row| travel.row(row)).collect()
}

/// By the formula: f32(f64(the row before) + 8 trapezoids in f64).
fn by_formula(place: &Place) -> Vec<Vec<f32>> {
    let store = Store::open(place.path("t.zarr")).unwrap();
    let readers = readers(&store);
    let speeds = |step: usize| -> Vec<f64> {
        let components = readers.each_ref().map(|reader| {
            let mut out = vec![0.0; reader.value_count()];
            reader.decode_step(step, &mut out).unwrap();
            out
        });
        let [x, y, z] = components.map(|of| of.into_iter().map(f64::from).collect::<Vec<_>>());
        (0..x.len()).map(|i| (x[i].powi(2) + y[i].powi(2) + z[i].powi(2)).sqrt()).collect()
    };
    let times = &store.times().values;
    let (mut rows, mut sums) = (Vec::new(), vec![0.0f64; readers[0].value_count()]);
    for step in 1..times.len() {
        let half = 0.5 * (times[step] - times[step - 1]);
        let (a, b) = (speeds(step - 1), speeds(step));
        sums.iter_mut().zip(a.iter().zip(&b)).for_each(|(sum, (a, b))| *sum += half * (a + b));
        if step % 8 == 0 {
            let row: Vec<f32> = sums.iter().map(|sum| *sum as f32).collect();
            sums = row.iter().map(|way| f64::from(*way)).collect();
            rows.push(row);
        }
    }
    rows
}

#[test]
fn the_first_frame_leaves_its_sums_and_a_seek_then_decodes_at_most_eight_steps() {
    let place = run();
    import(&place, &[]);
    let (first, all) = frame(&place, 19);
    assert_eq!(all, decoded(&place, 20));
    let (found, expected) = (rows(&place).unwrap(), by_formula(&place));
    assert!(found == expected && found.len() == 2 && found[1].iter().any(|way| *way > 0.0));
    let left = kept(&place);
    for (step, steps) in [(19, 4), (16, 1), (15, 8), (7, 8)] {
        assert_eq!(frame(&place, step).1, decoded(&place, steps), "{step}");
    }
    assert!(frame(&place, 19).0 == first && kept(&place) == left);
    // Whoever plays leaves the same.
    fs::remove_dir_all(place.path("t.zarr/flow")).unwrap();
    place.ok(&[
        "render",
        "t.zarr",
        "-o",
        "p_%02d.exr",
        "--exr",
        "raw",
        "--flow",
        "velocity",
        "--size",
        "48x36",
        "--quiet",
    ]);
    assert!(kept(&place) == left && frame(&place, 19) == (first, decoded(&place, 4)));
}

#[test]
fn what_is_damaged_or_of_something_else_is_made_anew_and_changes_no_bit() {
    let place = run();
    import(&place, &[]);
    let first = frame(&place, 19).0;
    let left = kept(&place);
    let metadata = place.path(KEPT).join("zarr.json");
    let text = fs::read_to_string(&metadata).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let of = |row: usize, part: usize| json["attributes"]["rows"][row][part].to_string();
    let other = |before: String, after: &str| {
        assert!(text.contains(&before), "{before}");
        text.replace(&before, after)
    };
    // From where on the way is summed, in steps before the nineteenth.
    for (changed, steps) in [
        (other("\"derived_version\": 1".to_owned(), "\"derived_version\": 2"), 20),
        (other("\"rows\"".to_owned(), "\"columns\""), 20),
        (other(of(0, 0), "1"), 20),
        (other(of(1, 0), "1"), 12),
        (other(of(1, 1), "1"), 12),
        (other("float32".to_owned(), "float64"), 20),
        ("{".to_owned(), 20),
    ] {
        fs::write(&metadata, &changed).unwrap();
        assert!(frame(&place, 19) == (first.clone(), decoded(&place, steps)), "{changed}");
        assert!(kept(&place) == left, "it is there again: {changed}");
    }
    for (row, steps) in [(0, 4), (1, 12)] {
        let chunk = place.path(KEPT).join(format!("c/{row}/0"));
        let whole = fs::read(&chunk).unwrap();
        let mut flipped = whole.clone();
        flipped[10] ^= 1;
        // A row of another series, whose own checksum is right.
        let mut foreign = vec![0; whole.len() - 4];
        foreign.extend(tetreel::codec::seal(&foreign));
        for bytes in [Some(&flipped[..]), Some(&whole[..8]), Some(&foreign), None] {
            match bytes {
                Some(bytes) => fs::write(&chunk, bytes).unwrap(),
                None => fs::remove_file(&chunk).unwrap(),
            }
            assert!(frame(&place, 19) == (first.clone(), decoded(&place, steps)), "{row}");
            // What is not needed is not looked at.
            assert_eq!(kept(&place) == left, row == 1);
        }
        // Until it is.
        frame(&place, 15);
        assert!(frame(&place, 15).1 == decoded(&place, 8) && kept(&place) == left, "{row}");
    }
}

#[test]
fn a_store_that_cannot_keep_the_sums_has_the_same_frames() {
    let place = run();
    import(&place, &[]);
    fs::write(place.path("t.zarr/flow"), "no folder").unwrap();
    let first = frame(&place, 19);
    assert_eq!(fs::read(place.path("t.zarr/flow")).unwrap(), b"no folder");
    fs::remove_file(place.path("t.zarr/flow")).unwrap();
    #[cfg(unix)]
    {
        use tetreel::store::StoreLock;
        let lock = StoreLock::wait(&place.path("t.zarr"), &tetreel::task::Cancel::new());
        assert!(lock.is_some() && frame(&place, 19) == first && !place.path("t.zarr/flow").exists());
    }
    assert!(frame(&place, 19) == first && place.path(KEPT).exists());
}

#[test]
fn a_store_that_grew_goes_on_with_its_sums_and_has_those_of_one_import() {
    let place = run();
    for (codec, left) in [(&[][..], 1), (&["--codec", "vq", "--entries", "16"], 0)] {
        import(&place, &[codec, &["--steps", "0..11"]].concat());
        frame(&place, 11);
        assert_eq!(rows(&place).unwrap().len(), 1);
        import(&place, &[codec, &["--append"]].concat());
        // A last short block is coded anew, and so its sums are others.
        assert_eq!(rows(&place).unwrap().len(), left, "{codec:?}");
        let (grown, count) = frame(&place, 19);
        assert_eq!(count, decoded(&place, 20 - 8 * left));
        let sums = rows(&place).unwrap();
        assert_eq!(sums, by_formula(&place));
        import(&place, &[codec, &["--overwrite"]].concat());
        assert_eq!(rows(&place).unwrap().len(), 0);
        assert!(frame(&place, 19).0 == grown && rows(&place).unwrap() == sums);
        fs::remove_dir_all(place.path("t.zarr")).unwrap();
    }
}
