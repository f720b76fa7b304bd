//! Isosurfaces as text: `VALUE[:COLOR[/BACK]][:OPACITY]`.

use super::{Isosurface, Light, Normals};
use crate::field::FieldSelector;
use crate::short::Short;
use crate::words::{numbers, words};
use std::fmt;
use std::str::FromStr;

/// Another field of the store, and the colour map over its range: `NAME[@MAP]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ByField {
    /// The field.
    pub field: FieldSelector,
    /// The colour map, or a file with one; `None`: the map of the transfer function.
    pub map: Option<String>,
}

impl FromStr for ByField {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (field, map) = text.split_once('@').map_or((text, None), |(field, map)| (field, Some(map)));
        if field.is_empty() || map.is_some_and(str::is_empty) {
            return Err(format!("'{text}' names no field; write NAME or NAME@MAP, as in pressure@viridis"));
        }
        let field = field.parse().map_err(|error| format!("'{field}': {error}"))?;
        Ok(Self { field, map: map.map(str::to_owned) })
    }
}

/// An isosurface in the syntax of command-line options: `0.5`, `-2e3:#ff8800`, `0.5:#9ecbff/#2a4d9b:0.4`, `0.5::0.3`, `0.5:by=pressure`,
/// `0.5:by=velocity:mag@viridis:0.5`.
#[derive(Clone, Debug, PartialEq)]
pub struct IsosurfaceText {
    /// The surface.
    pub surface: Isosurface,
    /// The field whose colours it has.
    pub by: Option<ByField>,
}

impl FromStr for IsosurfaceText {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (value, rest) = text.split_once(':').map_or((text, ""), |(value, rest)| (value, rest));
        if let Some(by) = rest.strip_prefix("by=") {
            // Component names contain a colon: an opacity may only follow a colour map.
            let (by, opacity) = match by.split_once('@').and_then(|(field, map)| Some((field, map.split_once(':')?))) {
                Some((field, (map, opacity))) => (format!("{field}@{map}"), opacity),
                None => (by.to_owned(), ""),
            };
            let Self { surface, .. } = format!("{value}::{opacity}").trim_end_matches(':').parse()?;
            return Ok(Self { surface, by: Some(by.parse()?) });
        }
        let mut parts = text.split(':');
        let value = number(parts.next().unwrap_or_default(), "isovalue")?;
        let (front, back) = match parts.next().unwrap_or_default() {
            "" => (None, None),
            colors => match colors.split_once('/') {
                Some((front, back)) => (Some(color(front)?), Some(color(back)?)),
                None => (Some(color(colors)?), None),
            },
        };
        let opacity = match parts.next() {
            None => 1.0,
            Some(opacity) => number(opacity, "opacity")?,
        };
        if !(0.0..=1.0).contains(&opacity) {
            return Err(format!("an opacity of {}; it lies between 0 and 1", Short(opacity)));
        }
        match parts.next() {
            Some(more) => Err(format!("'{more}' behind the opacity; write VALUE[:COLOR[/BACK]][:OPACITY]")),
            None => Ok(Self { surface: Isosurface { front, back, opacity, ..Isosurface::new(value) }, by: None }),
        }
    }
}

/// Parses a finite number.
fn number(text: &str, what: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("'{text}' is no {what}; write a number, as in 0.5:#ff8800:0.4")),
    }
}

/// Parses a colour of three bytes in hexadecimal digits.
fn color(text: &str) -> Result<[f64; 3], String> {
    let digits =
        text.strip_prefix('#').filter(|digits| digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_hexdigit()));
    let number = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let number = number.ok_or_else(|| format!("'{text}' is no colour; write #rrggbb, as in #ff8800"))?;
    Ok([16, 8, 0].map(|shift| f64::from(number >> shift & 0xff) / 255.0))
}

impl fmt::Display for ByField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { field, map } = self;
        write!(f, "{field}{}", map.as_ref().map_or_else(String::new, |map| format!("@{map}")))
    }
}

impl fmt::Display for IsosurfaceText {
    /// In the syntax that is read; colours to the nearest of 256 levels.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Isosurface { value, front, back, opacity, .. } = self.surface;
        let color = |rgb: [f64; 3]| {
            let [r, g, b] = rgb.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8);
            format!("#{r:02x}{g:02x}{b:02x}")
        };
        write!(f, "{}", Short(value))?;
        let colors = match (&self.by, front, back) {
            (Some(by), ..) => format!("by={by}"),
            (None, None, _) => String::new(),
            (None, Some(front), None) => color(front),
            (None, Some(front), Some(back)) => format!("{}/{}", color(front), color(back)),
        };
        match (colors.is_empty(), opacity == 1.0) {
            (true, true) => Ok(()),
            (false, true) => write!(f, ":{colors}"),
            (_, false) => write!(f, ":{colors}:{}", Short(opacity)),
        }
    }
}

words!(
    Normals,
    "there are no normals",
    ["cell" = Cell, "vertex" = Vertex, "screen" = Screen, "depth" = Depth, "none" = None]
);

impl FromStr for Light {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "headlight" {
            return Ok(Self::Headlight);
        }
        let wrong = || format!("'{text}' is no light; write headlight, or a direction x,y,z that is not 0,0,0");
        numbers(text).filter(|direction| *direction != [0.0; 3]).map(Self::From).ok_or_else(wrong)
    }
}

impl fmt::Display for Light {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Headlight => f.write_str("headlight"),
            Self::From([x, y, z]) => write!(f, "{},{},{}", Short(*x), Short(*y), Short(*z)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read(text: &str) -> Result<Isosurface, String> {
        text.parse().map(|IsosurfaceText { surface, .. }| surface)
    }

    fn written(surface: Isosurface) -> String {
        IsosurfaceText { surface, by: None }.to_string()
    }

    #[test]
    fn surfaces_have_colours_of_other_fields() {
        for (text, field, map, opacity) in [
            ("0.5:by=pressure", "pressure", None, 1.0),
            ("-2:by=velocity:mag", "velocity:mag", None, 1.0),
            ("0.5:by=u:0@viridis", "u:0", Some("viridis"), 1.0),
            ("0.5:by=velocity:mag@viridis:0.25", "velocity:mag", Some("viridis"), 0.25),
        ] {
            let read: IsosurfaceText = text.parse().unwrap();
            let by = read.by.clone().unwrap();
            assert_eq!((by.field.to_string().as_str(), by.map.as_deref()), (field, map));
            assert_eq!((read.surface.opacity, read.to_string().as_str()), (opacity, text));
        }
        for (text, words) in [
            ("0.5:by=", "names no field"),
            ("0.5:by=@viridis", "names no field"),
            ("0.5:by=p@", "names no field"),
            ("x:by=p", "'x' is no isovalue"),
            ("0.5:by=p@viridis:2", "an opacity of 2"),
            ("0.5:by=p@viridis:x", "'x' is no opacity"),
        ] {
            let said = text.parse::<IsosurfaceText>().unwrap_err();
            assert!(said.contains(words), "{text}: {said}");
        }
    }

    #[test]
    fn values_colours_and_opacities_are_read_and_written_as_they_were() {
        for (text, expected) in [
            ("0.5", Isosurface::new(0.5)),
            ("-2000:#ff0000", Isosurface { front: Some([1.0, 0.0, 0.0]), ..Isosurface::new(-2000.0) }),
            ("0.5::0.25", Isosurface { opacity: 0.25, ..Isosurface::new(0.5) }),
            (
                "0.1:#00ff00/#0000ff:0.5",
                Isosurface {
                    front: Some([0.0, 1.0, 0.0]),
                    back: Some([0.0, 0.0, 1.0]),
                    opacity: 0.5,
                    ..Isosurface::new(0.1)
                },
            ),
        ] {
            assert_eq!(read(text).unwrap(), expected);
            assert_eq!(written(expected), text);
        }
        assert_eq!(read("-2e3:#FF8800:1").unwrap().front, Some([1.0, 136.0 / 255.0, 0.0]));
    }

    #[test]
    fn what_is_no_surface_is_refused_by_what_is_wrong() {
        for (text, words) in [
            ("", "'' is no isovalue"),
            ("warm", "'warm' is no isovalue"),
            ("nan", "'nan' is no isovalue"),
            ("inf", "'inf' is no isovalue"),
            ("0.5:red", "'red' is no colour"),
            ("0.5:#ff88", "'#ff88' is no colour"),
            ("0.5:#ff880g", "is no colour"),
            ("0.5:#+f8800", "is no colour"),
            ("0.5:#ff8800/", "'' is no colour"),
            ("0.5:#ff8800:x", "'x' is no opacity"),
            ("0.5:#ff8800:1.5", "an opacity of 1.5"),
            ("0.5:#ff8800:-1", "an opacity of -1"),
            ("0.5:#ff8800:1:1", "'1' behind the opacity"),
        ] {
            let said = read(text).unwrap_err();
            assert!(said.contains(words), "{text}: {said}");
        }
    }

    #[test]
    fn normals_and_lights_are_read_as_they_are_written() {
        for text in Normals::ALL.map(Normals::as_str) {
            assert_eq!(text.parse::<Normals>().unwrap().to_string(), text);
        }
        for text in ["headlight", "0,0,1", "-1,2.5,1e-300"] {
            assert_eq!(text.parse::<Light>().unwrap().to_string(), text);
        }
        assert!("smooth".parse::<Normals>().unwrap_err().contains("cell, vertex, screen, depth or none"));
        for text in ["", "0,0,0", "1,2", "1,2,3,4", "nan,0,1", "inf,0,0", "up"] {
            assert!(text.parse::<Light>().unwrap_err().contains("is no light"), "{text}");
        }
    }

    proptest! {
        #[test]
        fn texts_come_back(
            value in -1e30..1e30_f64, front in prop::option::of(any::<[u8; 3]>()), back in prop::option::of(any::<[u8; 3]>()),
            opacity in 0.0..=1.0_f64,
        ) {
            let shares = |rgb: [u8; 3]| rgb.map(|c| f64::from(c) / 255.0);
            let (front, back) = (front.map(shares), back.map(shares).filter(|_| front.is_some()));
            let surface = Isosurface { front, back, opacity, ..Isosurface::new(value) };
            prop_assert_eq!(read(&written(surface)).unwrap(), surface);
        }
    }
}
