//! The grammar of `--tf`: `MAP`, `MAP@POSITION:OPACITY,...`, or a transfer function file.

use super::TransferError;
use super::file::find_map;
use super::function::{OpacityPoint, OpacityValues, PositionKind, TransferFunction};
use crate::error::FileError;
use crate::files;
use std::ffi::{OsStr, OsString};
use std::path::Path;

impl TransferFunction {
    /// Reads the text of `--tf`:
    /// - `MAP@0:0,0.4:0.2,1:0`: a colour map, then position as a fraction of the range : opacity;
    /// - `MAP` alone: the opacities of its file, else [`TransferFunction::ramp`];
    /// - `FILE.json` with a transfer function ([`TransferFunction::read`]).
    ///
    /// MAP is a built-in name, or a ParaView `FILE.json` or `FILE.json#NAME`; with the suffix `_r` it is reversed, together
    /// with the opacities of its file.
    ///
    /// # Errors
    /// They name the offending part; for an unknown map they list the known ones.
    pub fn parse(text: impl AsRef<OsStr>) -> Result<Self, TransferError> {
        let text = text.as_ref();
        let Some((map, points)) = map_and_points(text) else { return Self::without_points(text) };
        let map = find_map(&map, Path::new(""))?.map;
        let mut previous = [f64::NEG_INFINITY; 2];
        let mut opacity = Vec::new();
        for part in points.split(',') {
            let point = parse_point(part, previous)?;
            previous = [previous[1], point.position];
            opacity.push(point);
        }
        Self::new(map, opacity, PositionKind::Relative, OpacityValues::Opacity)
    }

    fn without_points(text: &OsStr) -> Result<Self, TransferError> {
        let path = Path::new(text);
        if text.as_encoded_bytes().ends_with(b".json") && holds_an_object(path)? {
            return Self::read(path);
        }
        let entry = find_map(text, Path::new(""))?;
        let Some(points) = entry.opacity else { return Ok(Self::ramp(entry.map)) };
        Self::new(entry.map, points, PositionKind::Relative, OpacityValues::Opacity)
    }
}

/// The text before and after the last '@'. A path may contain '@': the rest is a list of points only if it does not look like a path.
fn map_and_points(text: &OsStr) -> Option<(OsString, &str)> {
    let bytes = text.as_encoded_bytes();
    let at = bytes.iter().rposition(|&byte| byte == b'@')?;
    let points = std::str::from_utf8(&bytes[at + 1..]).ok().filter(|points| !points.contains(".json"))?;
    Some((files::os_string(bytes[..at].to_vec())?, points))
}

/// Whether a JSON file is a transfer function (an object), not a list of colour maps (an array).
fn holds_an_object(path: &Path) -> Result<bool, FileError> {
    let text = std::fs::read_to_string(path).map_err(|e| FileError::io(path, "read the transfer function", &e))?;
    Ok(text.trim_start().starts_with('{'))
}

/// Parses one `POSITION:OPACITY` that follows points at the two `previous` positions.
fn parse_point(part: &str, previous: [f64; 2]) -> Result<OpacityPoint, TransferError> {
    let bad = |problem: &str| TransferError::BadText { part: part.to_owned(), problem: problem.to_owned() };
    let (position, value) = part.split_once(':').ok_or_else(|| bad("is no POSITION:OPACITY, as in 0.4:0.2"))?;
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
    let position = number(position).ok_or_else(|| bad("the position is not a number"))?;
    let value = number(value).ok_or_else(|| bad("the opacity is not a number"))?;
    if !(0.0..=1.0).contains(&position) {
        return Err(bad("the position is a fraction of the range, 0..1"));
    }
    if value < 0.0 {
        return Err(bad("the opacity must not be negative"));
    }
    if position < previous[1] {
        return Err(bad("lies before the point in front of it; positions must increase"));
    }
    if position == previous[0] {
        return Err(bad("is the third point at one position; two make a step, more have no meaning"));
    }
    Ok(OpacityPoint { position, value })
}
