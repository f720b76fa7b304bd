//! Importing the series that comes with tetreel, and damaged copies of it.

use super::Place;
use std::path::Path;
use tetreel::image::read_png;

const LAST: &str = "run/tornado_0007.vtu";

impl Place {
    /// A folder with a copy of `data/tornado` as `run`.
    pub(super) fn with_tornado() -> Self {
        let place = Self::empty();
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/tornado");
        std::fs::create_dir(place.path("run")).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            std::fs::copy(entry.path(), place.path("run").join(entry.file_name())).unwrap();
        }
        place
    }

    /// Replaces text in the head of a file; what follows the head is binary.
    pub(super) fn edit(&self, file: &str, from: &str, to: &str) {
        let bytes = std::fs::read(self.path(file)).unwrap();
        let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).expect("the text to replace");
        let edited = [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat();
        std::fs::write(self.path(file), edited).unwrap();
    }
}

#[test]
fn the_shipped_series_is_imported_with_its_times_and_played() {
    let place = Place::with_tornado();
    place.ok(&["import", "run/tornado.pvd", "-o", "t.zarr"]);
    let info = place.json(&["info", "t.zarr", "--json"]);
    assert_eq!(info["time"]["steps"], 8);
    let pvd = std::fs::read_to_string(place.path("run/tornado.pvd")).unwrap();
    let last = info["time"]["last"].as_f64().unwrap();
    assert!(pvd.contains(&format!("timestep=\"{last:?}\"")), "{last:?} is not in {pvd}");
    // From the store, and from the source through the cache: the same picture.
    let look = ["--field", "velocity", "--steps", "5", "--size", "80x60"];
    place.ok(&[&["render", "t.zarr", "-o", "a.png"], &look[..]].concat());
    place.ok(&[&["render", "run/tornado.pvd", "-o", "b.png"], &look[..]].concat());
    let image = read_png(&place.path("a.png")).unwrap();
    assert!(image.pixels.iter().any(|p| p[3] > 0.1) && image == read_png(&place.path("b.png")).unwrap());
    place.refuses(&["import", "run/tornado.pvd", "-o", "t.zarr"], &["t.zarr", "--overwrite"]);
    place.ok(&["import", "run/tornado.pvd", "-o", "t.zarr", "--overwrite", "--field", "pressure", "--steps", "0..7:7"]);
    assert_eq!(place.json(&["info", "t.zarr", "--json"])["time"]["steps"], 2);
}

#[test]
fn the_shipped_series_is_compressed_and_looks_the_same() {
    let place = Place::with_tornado();
    let field = ["import", "run/tornado.pvd", "--field", "pressure"];
    place.ok(&[&field[..], &["-o", "raw.zarr"]].concat());
    let options = ["-o", "vq.zarr", "--codec", "vq", "--entries", "700"];
    let text = place.ok(&[&field[..], &options].concat());
    assert!(text.contains("vq, 700 entries: 729 values a step") && text.contains("larger than the values"), "{text}");
    let info = place.json(&["info", "vq.zarr", "--json"]);
    let quality = &info["fields"][0]["quality"];
    let relative = quality["max_error"].as_f64().unwrap() / 782.0;
    // Nearly an entry for each vertex: what is left is below a thousandth of the range.
    assert!(relative < 1e-3, "{info}");
    for (store, image) in [("raw.zarr", "a.exr"), ("vq.zarr", "b.exr")] {
        place.ok(&["render", store, "-o", image, "--steps", "5", "--size", "80x60", "--exr", "raw"]);
    }
    let difference = place.json(&["compare", "a.exr", "b.exr", "--json"]);
    let largest = difference["max"].as_f64().unwrap();
    // The default opacity and colours change by no more than some ten times their range over that of the field.
    assert!(largest < 10.0 * relative && largest > 0.0, "{difference}");
    place.refuses(&[&field[..], &["-o", "new.zarr", "--entries", "64"]].concat(), &["--entries", "--codec vq"]);
    place.refuses(&[&field[..], &["-o", "new.zarr", "--dry-run", "--relative"]].concat(), &["--codec vq"]);
    // A damaged chunk: named, with the step, and nothing is written.
    let chunk = place.path("vq.zarr/fields/pressure/vq/cb64/c/0/0/0");
    let mut bytes = std::fs::read(&chunk).unwrap();
    bytes[100] ^= 1;
    std::fs::write(&chunk, bytes).unwrap();
    place.refuses(&["render", "vq.zarr", "-o", "c.png", "--steps", "5"], &["vq/cb64/c/0/0/0", "step 5", "CRC-32C"]);
}

#[test]
fn units_are_stored_for_every_component_and_shown() {
    let place = Place::with_tornado();
    let import = ["import", "run/tornado.pvd", "--units", "velocity=m/s"];
    place.ok(&[&import[..], &["--units", "pressure=Pa", "-o", "t.zarr"]].concat());
    place.ok(&["import", "run/tornado.pvd", "-o", "bare.zarr"]);
    let info = place.json(&["info", "t.zarr", "--json"]);
    let fields = info["fields"].as_array().unwrap();
    let units: Vec<_> = fields.iter().map(|f| (f["name"].as_str().unwrap(), f["units"].as_str().unwrap())).collect();
    let expected = [("velocity:0", "m/s"), ("velocity:1", "m/s"), ("velocity:2", "m/s"), ("velocity:mag", "m/s")];
    assert!(expected.iter().all(|e| units.contains(e)) && units.contains(&("pressure", "Pa")), "{units:?}");
    assert!(place.ok(&["info", "t.zarr"]).lines().any(|l| l.contains("pressure (raw)") && l.ends_with(" Pa")));
    // On the legend, and nowhere else.
    let draw = |store: &str, out: &str, annotate: &[&str]| {
        let options = ["--field", "velocity", "--steps", "5", "--size", "320x240"];
        place.ok(&[&["render", store, "-o", out], &options[..], annotate].concat());
        read_png(&place.path(out)).unwrap()
    };
    assert!(
        draw("t.zarr", "a.png", &["--annotate", "legend"]) != draw("bare.zarr", "b.png", &["--annotate", "legend"])
    );
    assert!(draw("t.zarr", "c.png", &[]) == draw("bare.zarr", "d.png", &[]));
    // A frame says its unit, so one without it is not the frame that is asked for.
    let kept = |store: &str| {
        let options = ["-o", "e.png", "--steps", "5", "--size", "32x24", "--resume", "--stats", "s.json"];
        place.ok(&[&["render", store], &options[..]].concat());
        std::fs::read_to_string(place.path("s.json")).unwrap().contains("\"kept\"")
    };
    assert_eq!(["bare.zarr", "bare.zarr", "t.zarr", "t.zarr"].map(kept), [false, true, false, true]);
    let out = ["-o", "new.zarr"];
    for (more, parts) in [
        (&["--units", "speed=m/s"][..], &["tornado.pvd", "'speed'", "the fields are: ", "velocity"][..]),
        (&["--field", "pressure"], &["'velocity'", "not imported"]),
        (&["--units", "pressure"], &["--units", "FIELD=UNIT"]),
    ] {
        place.refuses(&[&import[..], more, &out].concat(), parts);
        place.refuses(&[&import[..], more, &["--dry-run"]].concat(), parts);
    }
}

#[test]
fn damaged_series_are_refused_and_leave_no_output_and_the_old_one_untouched() {
    type Damage = (&'static str, fn(&Place), &'static [&'static str]);
    let damages: [Damage; 7] = [
        ("missing collection", |p| std::fs::remove_file(p.path("run/tornado.pvd")).unwrap(), &["tornado.pvd"]),
        ("missing step", |p| std::fs::remove_file(p.path(LAST)).unwrap(), &["tornado.pvd", "tornado_0007.vtu"]),
        (
            "cut file",
            |p| {
                let bytes = std::fs::read(p.path(LAST)).unwrap();
                std::fs::write(p.path(LAST), &bytes[..5000]).unwrap();
            },
            &["tornado_0007.vtu"],
        ),
        ("wrong size", |p| p.edit(LAST, "offset=\"2940\"", "offset=\"2936\""), &["tornado_0007.vtu", "velocity"]),
        (
            "unknown cell type",
            |p| {
                for step in 0..8 {
                    let file = format!("run/tornado_{step:04}.vtu");
                    let mut bytes = std::fs::read(p.path(&file)).unwrap();
                    let tail = bytes.windows(8).rposition(|w| w == [10; 8]).unwrap();
                    bytes[tail] = 41;
                    std::fs::write(p.path(&file), bytes).unwrap();
                }
            },
            &["tornado_0000.vtu", "41", "convex point set"],
        ),
        (
            "other vertex count",
            |p| p.edit(LAST, "NumberOfPoints=\"729\"", "NumberOfPoints=\"728\""),
            &["tornado_0007.vtu", "728"],
        ),
        (
            "two equal times",
            |p| p.edit("run/tornado.pvd", "timestep=\"0.0\"", "timestep=\"9.031793516813595\""),
            &["pvd", "9.03"],
        ),
    ];
    for (name, damage, parts) in damages {
        let place = Place::with_tornado();
        place.ok(&["import", "run/tornado.pvd", "-o", "old.zarr", "--field", "pressure"]);
        damage(&place);
        eprintln!("{name}");
        place.refuses(&["import", "run/tornado.pvd", "-o", "new.zarr"], parts);
        place.refuses(&["import", "run/tornado.pvd", "-o", "old.zarr", "--overwrite"], parts);
    }
}

#[test]
fn fields_are_calculated_and_added_to_a_store_again() {
    let place = Place::with_tornado();
    let define = ["--define", "excess = pressure - 101325", "--define", "head = excess / 9.81 + 0.5*mag(velocity)^2"];
    let fields =
        ["--field", "head", "--field", "velocity:vorticity", "--field", "velocity:q", "--units", "velocity=m/s"];
    let import = ["import", "run/tornado.pvd", "-o", "t.zarr"];
    place.refuses(&[&import[..], &fields].concat(), &["there is no field 'head'"]);
    let all = [&define[..], &fields, &["--field", "velocity"]].concat();
    place.ok(&[&import[..], &all, &["--steps", "0..5"]].concat());
    let info = place.json(&["info", "t.zarr", "--json"]);
    let names: Vec<&str> = info["fields"].as_array().unwrap().iter().map(|f| f["name"].as_str().unwrap()).collect();
    for name in ["head", "velocity:vorticity:0", "velocity:vorticity:mag", "velocity:q", "velocity:2"] {
        assert!(names.contains(&name), "{names:?}");
    }
    // The vorticity of a tornado stands along its axis.
    let range = |name: &str| {
        let field = info["fields"].as_array().unwrap().iter().find(|f| f["name"] == name).unwrap();
        field["range"][1].as_f64().unwrap() - field["range"][0].as_f64().unwrap()
    };
    assert!(range("velocity:vorticity:2") > range("velocity:vorticity:0"), "{info}");
    // Quantities are known by their names; definitions are given again.
    place.refuses(&[&import[..], &["--append"]].concat(), &["'head'", "--define"]);
    place.ok(&[&import[..], &["--append"], &define].concat());
    assert_eq!(place.json(&["info", "t.zarr", "--json"])["time"]["steps"], 8);
    for (text, expected) in [
        ("a = pressure +", "column 15"),
        ("a", "'='"),
        ("a = b", "there is no field 'b'"),
        ("a = pressure / 0", "division by zero"),
    ] {
        place.refuses(&["import", "run/tornado.pvd", "-o", "u.zarr", "--define", text], &[expected, text]);
    }
}

#[test]
fn units_that_files_say_are_taken_unless_the_user_says_others() {
    let place = Place::with_tornado();
    let key = "<InformationKey name=\"UNITS_LABEL\" location=\"vtkDataArray\"> m/s&#xB2; </InformationKey>";
    place.edit("run/tornado_0000.vtu", "offset=\"2940\"/>", &format!("offset=\"2940\">{key}</DataArray>"));
    let text = place.ok(&["info", "run/tornado.pvd"]);
    assert!(text.contains("velocity (of points, 3 components, m/s²)"), "{text}");
    let info = place.json(&["info", "run/tornado.pvd", "--json"]);
    let of = |field: &serde_json::Value| {
        (field["name"].as_str().unwrap().to_owned(), field["units"].as_str().map(str::to_owned))
    };
    let units = |info: &serde_json::Value| info["fields"].as_array().unwrap().iter().map(of).collect::<Vec<_>>();
    let with = |name: &str, unit: Option<&str>| (name.to_owned(), unit.map(str::to_owned));
    assert_eq!(units(&info), [with("pressure", None), with("velocity", Some("m/s²"))]);
    let import = ["import", "run/tornado.pvd", "--field", "velocity:mag", "--field", "pressure"];
    for (more, expected) in [(&[][..], "m/s²"), (&["--units", "velocity=kn"], "kn")] {
        place.ok(&[&import[..], more, &["-o", "t.zarr", "--steps", "0..5", "--overwrite"]].concat());
        let stored = units(&place.json(&["info", "t.zarr", "--json"]));
        assert!(stored.contains(&with("velocity:mag", Some(expected))), "{stored:?}");
        assert!(stored.contains(&with("pressure", None)), "{stored:?}");
    }
    // The store keeps its unit, whatever the files say.
    place.ok(&["import", "run/tornado.pvd", "-o", "t.zarr", "--append"]);
    let info = place.json(&["info", "t.zarr", "--json"]);
    assert_eq!(info["time"]["steps"], 8);
    assert!(units(&info).contains(&with("velocity:mag", Some("kn"))), "{info}");
}

#[test]
fn info_looks_at_files_without_importing_them_and_a_dry_run_reads_every_step() {
    let place = Place::with_tornado();
    let text = place.ok(&["info", "run/tornado.pvd"]);
    assert!(text.contains("8 steps") && text.contains("velocity (of points, 3 components)"), "{text}");
    let info = place.json(&["info", "run", "--json"]);
    assert_eq!(
        (info["time"]["steps"].as_u64(), info["mesh"]["points"].as_u64()),
        (Some(8), Some(729)),
        "the folder is the series"
    );
    assert_eq!(info["fields"].as_array().unwrap().len(), 2);
    // A step without a field, and one with another mesh: only who reads all steps sees it.
    place.edit(LAST, "Name=\"pressure\"", "Name=\"pressurE\"");
    let dry = ["import", "run/tornado.pvd", "--dry-run"];
    let text = place.ok(&dry);
    assert!(text.contains("field 'pressure' is missing in 1 step (7): holes"), "{text}");
    assert!(!place.ok(&["info", "run/tornado.pvd"]).contains("missing"));
    std::fs::remove_file(place.path(LAST)).unwrap();
    std::fs::copy(place.path("run/tornado_0000.vtu"), place.path(LAST)).unwrap();
    place.edit(LAST, "NumberOfPoints=\"729\"", "NumberOfPoints=\"728\"");
    place.refuses(&dry, &["tornado_0007.vtu"]);
}
