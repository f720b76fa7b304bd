//! EXR files as another implementation sees them: Python's `OpenEXR`, where it is installed.

use serde_json::json;
use std::path::Path;
use std::process::{Command, Output};
use tetreel::export::still::{FrameAttributes, OutputFrame, StillOptions, write_still};
use tetreel::image::{DepthImage, ExrColor, Planes, RgbaImage, read_exr};

const WIDTH: usize = 37;
const HEIGHT: usize = 21;

/// A frame with every kind of value that a plane may have.
fn frame() -> OutputFrame {
    let pixel = |i: usize| {
        let a = (i as f32 * 0.1).sin().abs();
        [a * 0.7, -0.0, 1e-40 * i as f32, a]
    };
    let depth = |i: usize| if i.is_multiple_of(4) { f32::INFINITY } else { i as f32 / 3.0 - 20.0 };
    let attributes = FrameAttributes {
        time: 0.1,
        step: 7,
        field: "θ:mag".to_owned(),
        camera: "pos=1,2,3 focal=0,0,0 up=0,0,1 angle=30 near=0".to_owned(),
        transfer_function: "viridis@0:0,1:0.5".to_owned(),
        software: FrameAttributes::SOFTWARE.to_owned(),
        extras: [("a long name of an extra attribute".to_owned(), "x".to_owned())].into(),
        ..Default::default()
    };
    let planes = Planes {
        color: RgbaImage { width: WIDTH, height: HEIGHT, pixels: (0..WIDTH * HEIGHT).map(pixel).collect() },
        depth: DepthImage { width: WIDTH, height: HEIGHT, pixels: (0..WIDTH * HEIGHT).map(depth).collect() },
        ..Planes::default()
    };
    OutputFrame { planes, attributes }
}

/// Runs the script over `a.exr` in `dir`.
fn python_reads(python: &str, dir: &Path, frame: &OutputFrame, color: &str) -> Output {
    let channel = |c: usize| frame.planes.color.pixels.iter().map(move |p| p[c]);
    let planes = [3, 2, 1, 0].into_iter().flat_map(channel).chain(frame.planes.depth.pixels.iter().copied());
    let bytes: Vec<u8> = planes.flat_map(f32::to_le_bytes).collect();
    std::fs::write(dir.join("planes.f32"), bytes).unwrap();
    let a = &frame.attributes;
    let expected = json!({
        "width": WIDTH,
        "height": HEIGHT,
        "attributes": {
            "software": a.software,
            "tetreel.color": color,
            "tetreel.time": a.time,
            "tetreel.step": 7.0,
            "tetreel.field": a.field,
            "tetreel.camera": a.camera,
            "tetreel.transferFunction": a.transfer_function,
            "tetreel.opacityKind": "alpha",
            "tetreel.extra.a long name of an extra attribute": "x",
        },
        "absent": ["capDate", "tetreel.units", "tetreel.range"],
    });
    std::fs::write(dir.join("expected.json"), expected.to_string()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interop/read_exr.py");
    Command::new(python).current_dir(dir).arg(script).args(["a.exr", "expected.json", "planes.f32"]).output().unwrap()
}

#[test]
fn python_reads_the_floats_that_were_written_and_what_they_show() {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
    match Command::new(&python).args(["-c", "import numpy, OpenEXR; OpenEXR.File"]).output() {
        Ok(output) if output.status.success() => {}
        Ok(output) => {
            let error = String::from_utf8_lossy(&output.stderr);
            return crate::common::skip("python", error.lines().last().unwrap_or("OpenEXR cannot be imported"));
        }
        Err(error) => return crate::common::skip("python", &error.to_string()),
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let mut frame = frame();
    let options = |color: ExrColor| StillOptions { exr: color.into(), ..Default::default() };
    write_still(&path, &frame, &options(ExrColor::Raw)).unwrap();
    let output = python_reads(&python, dir.path(), &frame, "raw");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8(output.stdout).unwrap().trim(), "ok 5 channels 9 attributes");
    // The last bit of one sample makes the script fail.
    frame.planes.depth.pixels[5] = f32::from_bits(frame.planes.depth.pixels[5].to_bits() ^ 1);
    assert!(!python_reads(&python, dir.path(), &frame, "raw").status.success());

    // Linear light: the bits that our own reader finds are those of the library, checked by it with straight 1.
    frame.planes.color.pixels.iter_mut().for_each(|p| *p = [p[3], 0.0, p[3], p[3]]);
    write_still(&path, &frame, &options(ExrColor::Linear)).unwrap();
    let output = python_reads(&python, dir.path(), &frame, "linear");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(read_exr(&path).unwrap().stored, ExrColor::Linear);
}
