//! Colour maps in ParaView's JSON: an array of `{Name, ColorSpace, NanColor, RGBPoints: [x, r, g, b, ...], Points}`.

use super::color_map::{ColorMap, ColorPoint, outer_of_equal};
use super::color_space;
use super::function::OpacityPoint;
use crate::error::{FileError, FileResult};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// One entry of a ParaView colour map file.
#[derive(Clone, Debug, PartialEq)]
pub struct ColorMapEntry {
    /// The colours, refined to piecewise-linear RGB where the entry has another colour space.
    pub map: ColorMap,
    /// The entry's opacity points (`Points`), if any, stretched to 0..=1; linear in between.
    pub opacity: Option<Vec<OpacityPoint>>,
}

/// An entry as in the file. Other keys (creator, licence, annotations) are ignored.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "PascalCase")]
pub(super) struct JsonEntry {
    #[serde(default)]
    name: String,
    #[serde(default = "rgb")]
    color_space: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    nan_color: Option<[f64; 3]>,
    #[serde(rename = "RGBPoints", default)]
    rgb_points: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    points: Option<Vec<f64>>,
}

fn rgb() -> String {
    "RGB".to_owned()
}

/// Reads all maps of a file.
///
/// # Errors
/// If it cannot be read, is no ParaView JSON, or an entry is at fault, which the error names by number and name.
pub fn read_color_maps(path: &Path) -> FileResult<Vec<ColorMapEntry>> {
    let text = std::fs::read_to_string(path).map_err(|e| FileError::io(path, "read the colour maps", &e))?;
    parse(path, &text)
}

/// The text of a file with these entries, in RGB.
///
/// Reading it gives the same maps; opacities get midpoint 0.5 and sharpness 0.
pub fn color_maps_to_json(entries: &[ColorMapEntry]) -> String {
    let json: Vec<JsonEntry> = entries.iter().map(JsonEntry::of).collect();
    serde_json::to_string_pretty(&json).unwrap_or_default() // strings and finite numbers always have a JSON form
}

/// Parses the text of a file as [`read_color_maps`] does; `path` is for messages.
pub(super) fn parse(path: &Path, text: &str) -> FileResult<Vec<ColorMapEntry>> {
    let values: Vec<serde_json::Value> = serde_json::from_str(text).map_err(|e| {
        let place = format!("line {} column {}", e.line(), e.column());
        FileError::invalid(path, place, e.to_string())
            .remedy("a colour map file is a JSON array, as ParaView exports it")
    })?;
    if values.is_empty() {
        return Err(FileError::invalid(path, "", "has no colour map"));
    }
    let entry = |(i, value): (usize, serde_json::Value)| {
        let name = value.get("Name").and_then(|n| n.as_str()).unwrap_or("without a name").to_owned();
        let place = format!("colour map {i} ('{name}')");
        let json: JsonEntry =
            serde_json::from_value(value).map_err(|e| FileError::invalid(path, &place, e.to_string()))?;
        json.into_entry(path, &place)
    };
    values.into_iter().enumerate().map(entry).collect()
}

impl JsonEntry {
    /// The entry of a map, in RGB.
    pub(super) fn of(entry: &ColorMapEntry) -> Self {
        let rgb_points = entry.map.points().iter().flat_map(|p| [p.position, p.rgb[0], p.rgb[1], p.rgb[2]]).collect();
        let opacity =
            |points: &Vec<OpacityPoint>| points.iter().flat_map(|p| [p.position, p.value, 0.5, 0.0]).collect();
        Self {
            name: entry.map.name().to_owned(),
            color_space: rgb(),
            nan_color: entry.map.nan_color(),
            rgb_points,
            points: entry.opacity.as_ref().map(opacity),
        }
    }

    pub(super) fn into_entry(self, path: &Path, place: &str) -> FileResult<ColorMapEntry> {
        let invalid = |problem: String| FileError::invalid(path, place, problem);
        let space = color_space::from_name(&self.color_space).ok_or_else(|| {
            let problem = format!("colour space '{}' is not read", self.color_space);
            FileError::unsupported(path, place, problem).remedy("RGB, HSV, Lab and Diverging are")
        })?;
        if self.rgb_points.is_empty() {
            return Err(invalid("has no RGBPoints (maps of indexed colours do not describe a scalar)".into()));
        }
        let (quads, rest) = self.rgb_points.as_chunks::<4>();
        if !rest.is_empty() {
            return Err(invalid(format!(
                "RGBPoints has {} numbers, which is no multiple of four",
                self.rgb_points.len()
            )));
        }
        let mut points: Vec<ColorPoint> =
            quads.iter().map(|&[position, r, g, b]| ColorPoint { position, rgb: [r, g, b] }).collect();
        points.sort_by(|a, b| a.position.total_cmp(&b.position));
        let map = ColorMap::new(&self.name, points, self.nan_color).map_err(|e| invalid(e.to_string()))?;
        let refined = color_space::to_linear_rgb(space, map.points());
        let map = ColorMap::new(&self.name, refined, self.nan_color).map_err(|e| invalid(e.to_string()))?;
        let opacity = self.points.as_deref().map(opacity_points).transpose().map_err(invalid)?;
        Ok(ColorMapEntry { map, opacity })
    }
}

/// Opacity points of VTK (`x, value, midpoint, sharpness`), stretched to 0..=1 and refined to straight pieces.
fn opacity_points(numbers: &[f64]) -> Result<Vec<OpacityPoint>, String> {
    let (quads, rest) = numbers.as_chunks::<4>();
    if quads.is_empty() || !rest.is_empty() {
        return Err(format!("Points has {} numbers, which is no positive multiple of four", numbers.len()));
    }
    let mut nodes = quads.to_vec();
    nodes.sort_by(|a, b| a[0].total_cmp(&b[0]));
    if let Some(bad) = nodes.iter().find(|n| !n.iter().all(|x| x.is_finite()) || n[1] < 0.0) {
        return Err(format!("opacity point {bad:?} is not finite, or negative"));
    }
    let (first, last) = (nodes[0][0], nodes[nodes.len() - 1][0]);
    let width = 0.5 * last - 0.5 * first;
    let place = |x: f64| if width > 0.0 { (0.5 * x - 0.5 * first) / width } else { 0.0 };
    let mut points = vec![OpacityPoint { position: 0.0, value: nodes[0][1] }];
    for pair in nodes.windows(2) {
        let (a, b) = (place(pair[0][0]), place(pair[1][0]));
        let inner = between(&pair[0], pair[1][1]).into_iter();
        points.extend(inner.map(|(f, value)| OpacityPoint { position: a * (1.0 - f) + b * f, value }));
        points.push(OpacityPoint { position: b, value: pair[1][1] });
    }
    Ok(outer_of_equal(&points, |p| p.position))
}

/// Sharpness below this is linear, above one minus this a step; VTK's.
const SHARPNESS_MARGIN: f64 = 0.01;

/// Linear pieces per curved piece: the curvature at sharpness 0.99, a power of 10.9, keeps them within 5e-5 of the curve.
const PIECES: u32 = 1024;

/// Fractions (0..1) and values from a node (x, value, midpoint, sharpness) to the next value, linear in between.
fn between(node: &[f64; 4], to: f64) -> Vec<(f64, f64)> {
    let &[_, from, midpoint, sharpness] = node;
    let middle = clamp_midpoint(midpoint);
    if from == to {
        return Vec::new();
    }
    if sharpness > 1.0 - SHARPNESS_MARGIN {
        return vec![(middle, from), (middle, to)];
    }
    if sharpness < SHARPNESS_MARGIN {
        return if middle == 0.5 { Vec::new() } else { vec![(middle, hermite(node, to, middle))] };
    }
    let half = f64::from(PIECES / 2);
    let left = (1..PIECES / 2).map(|i| middle * f64::from(i) / half);
    let right = (0..PIECES / 2).map(|i| middle + (1.0 - middle) * f64::from(i) / half);
    left.chain(right).map(|f| (f, hermite(node, to, f))).collect()
}

fn clamp_midpoint(midpoint: f64) -> f64 {
    midpoint.clamp(0.00001, 0.99999)
}

/// `vtkPiecewiseFunction`'s curve from a node (x, value, midpoint, sharpness) to the next value, `f` in 0..=1.
fn hermite(&[_, from, midpoint, sharpness]: &[f64; 4], to: f64, f: f64) -> f64 {
    let middle = clamp_midpoint(midpoint);
    let s = if f < middle { 0.5 * f / middle } else { 0.5 + 0.5 * (f - middle) / (1.0 - middle) };
    if sharpness > 1.0 - SHARPNESS_MARGIN {
        return if s < 0.5 { from } else { to };
    }
    if sharpness < SHARPNESS_MARGIN {
        return from * (1.0 - s) + to * s;
    }
    let power = 1.0 + 10.0 * sharpness;
    let s = if s < 0.5 { 0.5 * (2.0 * s).powf(power) } else { 1.0 - 0.5 * (2.0 * (1.0 - s)).powf(power) };
    let (s2, s3) = (s * s, s * s * s);
    let tangent = (1.0 - sharpness) * (to - from);
    let value = (2.0 * s3 - 3.0 * s2 + 1.0) * from
        + (3.0 * s2 - 2.0 * s3) * to
        + (s3 - 2.0 * s2 + s) * tangent
        + (s3 - s2) * tangent;
    value.clamp(from.min(to), from.max(to))
}
