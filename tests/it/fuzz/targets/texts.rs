//! What users type: texts of cameras, transfer functions, ranges and options, and whole command lines.

use super::Outcome;
use clap::Parser;
use glam::DVec3;
use std::fmt::{Debug, Display};
use std::str::FromStr;
use tetreel::camera::{Camera, Projection};
use tetreel::cli::Cli;
use tetreel::codec::vq::Search;
use tetreel::export::annotate::Annotations;
use tetreel::export::movie::FrameRate;
use tetreel::export::sequence::FramePattern;
use tetreel::export::still::Background;
use tetreel::field::FieldSelector;
use tetreel::image::{ExrColor, PngDepth};
use tetreel::ingest::{FieldUnits, StepRange};
use tetreel::optics::OpticsKind;
use tetreel::pipeline::{Backend, FrameRequest, RenderMode, Sampling};
use tetreel::synth::SeriesName;
use tetreel::transfer::{Lengths, MappedRange, OpacityKind, RangePolicy, TransferFunction, build_node_table};
use tetreel::visibility::Skip;

/// Tables of a transfer function over several ranges hold what a table promises. `build_node_table` checks that nodes are sorted
/// and finite; between them every renderer evaluates.
pub fn check_transfer_function(tf: &TransferFunction) {
    for (lo, hi, log) in [(0.0, 1.0, false), (-3e38, 3e38, false), (1e-40, 2e-40, false), (1e-6, 1e6, true)] {
        let range = MappedRange::new(lo, hi, log).expect("a range");
        for kind in [OpacityKind::Alpha, OpacityKind::Extinction] {
            for unit_distance in [0.01, 1e30] {
                let Ok(table) = build_node_table(tf, &range, kind, &Lengths::of_unit_distance(unit_distance)) else {
                    continue;
                };
                for i in 0..=8 {
                    let node = table.eval(range.scalar_at(f64::from(i) / 8.0));
                    assert!(node.tau >= 0.0 && node.tau.is_finite(), "{node:?}");
                    // A mix of two colours may leave 0..=1 by a rounding.
                    assert!(node.rgb.iter().all(|c| (-1e-12..=1.0 + 1e-12).contains(c)), "{node:?}");
                }
            }
        }
    }
}

/// Text, or as much of it as is text.
fn text_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A camera that parses can look, and its text is that camera.
pub fn camera(bytes: &[u8]) -> Outcome {
    let default = Camera {
        position: DVec3::new(0.0, 0.0, 3.0),
        focal_point: DVec3::ZERO,
        view_up: DVec3::Y,
        projection: Projection::Perspective { view_angle: 30.0 },
        near: 0.0,
    };
    let camera = Camera::parse(&text_of(bytes), &default).map_err(|e| e.to_string())?;
    let view = camera.view(64, 48).map_err(|e| e.to_string())?;
    let (x, y) = view.ray(5, 40);
    assert!(x.is_finite() && y.is_finite(), "{camera}");
    assert_eq!(Camera::parse(&camera.to_string(), &default), Ok(camera));
    Ok(())
}

/// A transfer function as on the command line.
pub fn tf_text(bytes: &[u8]) -> Outcome {
    let text = text_of(bytes);
    // The name of a file: the other targets read these. An absolute one could be a device.
    if text.contains(".json") {
        return Err("names a file".to_owned());
    }
    let tf = TransferFunction::parse(&text).map_err(|e| e.to_string())?;
    check_transfer_function(&tf);
    Ok(())
}

/// A frame's request; what is read is written as what is read as the same.
pub fn request(bytes: &[u8]) -> Outcome {
    let read = FrameRequest::from_text(&text_of(bytes)).map_err(|e| e.to_string())?;
    let text = read.to_text().map_err(|e| e.to_string())?;
    // As text, since a range that is not known is no number.
    assert_eq!(FrameRequest::from_text(&text).unwrap().to_text(), Ok(text));
    Ok(())
}

/// Every option's parser on the same text; `Ok` if any takes it.
pub fn options(bytes: &[u8]) -> Outcome {
    let text = text_of(bytes);
    let parsers = [
        there_and_back::<RangePolicy>,
        there_and_back::<FieldSelector>,
        there_and_back::<StepRange>,
        parses::<FieldUnits>,
        parses::<OpticsKind>,
        parses::<Backend>,
        parses::<Sampling>,
        parses::<RenderMode>,
        parses::<Annotations>,
        parses::<Background>,
        parses::<FrameRate>,
        parses::<FramePattern>,
        parses::<PngDepth>,
        parses::<ExrColor>,
        parses::<Skip>,
        parses::<SeriesName>,
        parses::<OpacityKind>,
        parses::<Search>,
    ];
    let mut problems = Vec::new();
    for parser in parsers {
        if let Err(problem) = parser(&text) {
            problems.push(problem);
        }
    }
    if let Ok(range) = text.parse::<StepRange>() {
        let steps = range.select(1000).unwrap_or_default();
        assert!(steps.iter().all(|&step| step < 1000) && steps.is_sorted_by(|a, b| a < b));
    }
    if let Ok(policy) = text.parse::<RangePolicy>()
        && let Ok(range) = policy.resolve((-1.0, 2.0), (0.0, 1.0))
    {
        assert!(range.lo() < range.hi());
    }
    if let Ok(pattern) = text.parse::<FramePattern>() {
        assert!(!pattern.path(7).as_os_str().is_empty());
    }
    // Every text is the name of a field.
    if problems.len() + 1 < parsers.len() { Ok(()) } else { Err(problems.concat()) }
}

fn parses<T: FromStr<Err: Display>>(text: &str) -> Outcome {
    text.parse::<T>().map(|_| ()).map_err(|error| {
        let message = error.to_string();
        assert!(!message.is_empty());
        message
    })
}

/// As [`parses`], and what was read is written as what is read as the same.
fn there_and_back<T: FromStr<Err: Display> + Display + PartialEq + Debug>(text: &str) -> Outcome {
    parses::<T>(text)?;
    let Ok(value) = text.parse::<T>() else { return Ok(()) };
    let again = value.to_string();
    match again.parse::<T>() {
        Ok(same) => assert_eq!(same, value, "'{text}' is written as '{again}'"),
        Err(error) => panic!("'{text}' is written as '{again}', which is not read: {error}"),
    }
    Ok(())
}

/// A command line, one word a line. Nothing is run.
pub fn command_line(bytes: &[u8]) -> Outcome {
    let text = text_of(bytes);
    let words = ["tetreel"].into_iter().chain(text.lines());
    // Help is an error to clap.
    Cli::try_parse_from(words).map(|_| ()).map_err(|error| error.to_string())
}
