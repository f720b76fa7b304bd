//! Requests as text: versioned JSON, to be sent, stored and compared.
//!
//! Input is checked while it is parsed: tables by their constructors, sizes and shares by their bounds, so that every error has a line and
//! a column. Output can be read back: a number that JSON cannot hold is an error that names its place.

use super::{FaceDetail, FrameRequest, FrameTime, Layer, RequestError, Upsampling};
use crate::camera::check_size;
use crate::short::Short;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::ser::Formatter;
use std::io::{self, Write};

/// The text as it is written.
#[derive(Serialize)]
struct Written<'a> {
    version: u32,
    frame: &'a FrameRequest,
}

/// The text as it is read.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Read {
    #[serde(rename = "version")]
    _version: u32,
    frame: FrameRequest,
}

/// Read first: a later version may have other fields.
#[derive(Deserialize)]
struct Head {
    version: u32,
}

impl FrameRequest {
    /// Version that is written; others are refused.
    pub const TEXT_VERSION: u32 = 2;

    /// The request as text, which [`Self::from_text`] reads back as the same request. `for_window` is left out: the window is local.
    ///
    /// # Errors
    /// If a number is not finite, or the request could not be read back.
    pub fn to_text(&self) -> Result<String, RequestError> {
        let no_text = |problem: String| RequestError::NoText(problem);
        check_size(self.size_px).map_err(|error| no_text(error.to_string()))?;
        self.samples.samples(self.size_px).map_err(|error| no_text(error.to_string()))?;
        self.upsampling.iter().try_for_each(Upsampling::check).map_err(no_text)?;
        self.layers.iter().try_for_each(Layer::check).map_err(no_text)?;
        let mut text = Vec::new();
        let mut serializer = serde_json::Serializer::with_formatter(&mut text, Places::default());
        let written = Written { version: Self::TEXT_VERSION, frame: self };
        written.serialize(&mut serializer).map_err(|error| no_text(error.to_string()))?;
        String::from_utf8(text).map_err(|error| no_text(error.to_string()))
    }

    /// Reads a request from its text.
    ///
    /// # Errors
    /// If the text has another version, is not JSON, or holds an invalid request: with line and column, pixels with their index in the
    /// list.
    pub fn from_text(text: &str) -> Result<Self, RequestError> {
        let bad_text = |error: serde_json::Error| RequestError::BadText(error.to_string());
        let Head { version } = serde_json::from_str(text).map_err(bad_text)?;
        if version != Self::TEXT_VERSION {
            return Err(RequestError::Version(version));
        }
        let Read { frame, .. } = serde_json::from_str(text).map_err(bad_text)?;
        // Only now is the size of their image known.
        frame.samples.samples(frame.size_px)?;
        frame.layers.iter().try_for_each(Layer::check).map_err(RequestError::BadText)?;
        Ok(frame)
    }
}

/// The writer's place in the text. No value of a request is null: `None` is left out, so serde_json writes null only for numbers that are
/// not finite.
#[derive(Default)]
struct Places {
    path: Vec<Place>,
    is_in_key: bool,
}

enum Place {
    Key(String),
    Element(usize),
}

impl Places {
    fn name(&self) -> String {
        let name = |place: &Place| match place {
            Place::Key(key) => format!(".{key}"),
            Place::Element(index) => format!("[{index}]"),
        };
        self.path.iter().map(name).collect::<String>().trim_start_matches('.').to_owned()
    }
}

impl Formatter for Places {
    fn write_null<W: ?Sized + Write>(&mut self, _: &mut W) -> io::Result<()> {
        Err(io::Error::new(io::ErrorKind::InvalidData, format!("{} is not finite", self.name())))
    }

    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.path.push(Place::Element(0));
        writer.write_all(b"[")
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, is_first: bool) -> io::Result<()> {
        if is_first {
            return Ok(());
        }
        if let Some(Place::Element(index)) = self.path.last_mut() {
            *index += 1;
        }
        writer.write_all(b",")
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.path.pop();
        writer.write_all(b"]")
    }

    fn begin_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.path.push(Place::Key(String::new()));
        writer.write_all(b"{")
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, writer: &mut W, is_first: bool) -> io::Result<()> {
        self.is_in_key = true;
        if let Some(Place::Key(key)) = self.path.last_mut() {
            key.clear();
        }
        if is_first { Ok(()) } else { writer.write_all(b",") }
    }

    fn write_string_fragment<W: ?Sized + Write>(&mut self, writer: &mut W, fragment: &str) -> io::Result<()> {
        if let (true, Some(Place::Key(key))) = (self.is_in_key, self.path.last_mut()) {
            key.push_str(fragment);
        }
        writer.write_all(fragment.as_bytes())
    }

    fn end_object_key<W: ?Sized + Write>(&mut self, _: &mut W) -> io::Result<()> {
        self.is_in_key = false;
        Ok(())
    }

    fn end_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.path.pop();
        writer.write_all(b"}")
    }
}

/// Reads a size, which must be positive.
pub(super) fn size_px<'de, D: Deserializer<'de>>(data: D) -> Result<(usize, usize), D::Error> {
    let size = <(usize, usize)>::deserialize(data)?;
    check_size(size).map(|()| size).map_err(D::Error::custom)
}

/// Serializes a value by its text.
pub(super) mod as_text {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};
    use std::fmt::Display;
    use std::str::FromStr;

    pub(in crate::pipeline) fn serialize<T: Display, S: Serializer>(
        value: &T,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_str(value)
    }

    pub(in crate::pipeline) fn deserialize<'de, T, D>(data: D) -> Result<T, D::Error>
    where
        T: FromStr<Err: Display>,
        D: Deserializer<'de>,
    {
        String::deserialize(data)?.parse().map_err(D::Error::custom)
    }
}

/// A time as it is read.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TimeText {
    step: usize,
    #[serde(default)]
    toward: Option<(usize, f64)>,
}

impl TryFrom<TimeText> for FrameTime {
    type Error = String;

    fn try_from(TimeText { step, toward }: TimeText) -> Result<Self, String> {
        let Some((next, weight)) = toward else { return Ok(step.into()) };
        let between = Self::between(step, next, weight);
        let problem = || format!("no moment lies between steps {step} and {next} at {}; 0.5 is halfway", Short(weight));
        if between.toward() == toward { Ok(between) } else { Err(problem()) }
    }
}

/// Face details as they are read.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FaceText {
    lod: f64,
    #[serde(default)]
    sampling: super::Sampling,
    #[serde(default)]
    k_buffer: crate::render::KBuffer,
}

impl TryFrom<FaceText> for FaceDetail {
    type Error = String;

    fn try_from(FaceText { lod, sampling, k_buffer }: FaceText) -> Result<Self, String> {
        let detail = Self { lod, sampling, k_buffer };
        detail.check().map(|()| detail)
    }
}

#[cfg(test)]
#[path = "text_tests.rs"]
mod tests;
