//! The surface of the domain or of regions as text: `STYLE[:FIELD=VALUES][:COLOR][:OPACITY]`.

use super::{DomainStyle, DomainSurface};
use crate::field::Regions;
use crate::render::surfaces::{Isosurface, IsosurfaceText};
use crate::words::words;
use std::fmt;
use std::str::FromStr;

words!(DomainStyle, "there is no surface", ["solid" = Solid, "wireframe" = Wireframe, "edges" = Edges]);

/// Default colour of feature edges: visible on light and dark.
const GRAY: [f64; 3] = [128.0 / 255.0; 3];

impl DomainSurface {
    /// A surface of the domain of this style in its default colour, opaque or not.
    pub fn of_style(style: DomainStyle, is_translucent: bool) -> Self {
        let color = (style == DomainStyle::Edges).then_some(GRAY);
        Self { style, regions: None, color, opacity: if is_translucent { 0.3 } else { 1.0 } }
    }
}

impl FromStr for DomainSurface {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (style, rest) = text.split_once(':').map_or((text, ""), |(style, rest)| (style, rest));
        let style: DomainStyle = style.parse()?;
        if rest.starts_with("by=") {
            return Err(format!("'{text}': the surface of the domain has the colours of the field that is shown"));
        }
        let (regions, rest) = regions(rest)?;
        // Colour and opacity are written as for an isosurface.
        let IsosurfaceText { surface: of, .. } = format!("0:{rest}").parse()?;
        if of.back.is_some() {
            return Err(format!("'{text}' has two colours; the surface of the domain has one"));
        }
        let usual = Self::of_style(style, false);
        Ok(Self { regions, color: of.front.or(usual.color), opacity: of.opacity, ..usual })
    }
}

/// The regions at the beginning of a text, if it has some, and what follows them. Names of fields may contain colons, values do not.
fn regions(text: &str) -> Result<(Option<Regions>, &str), String> {
    let Some((field, rest)) = text.rsplit_once('=') else { return Ok((None, text)) };
    let (values, rest) = rest.split_once(':').unwrap_or((rest, ""));
    Ok((Some(format!("{field}={values}").parse()?), rest))
}

impl fmt::Display for DomainSurface {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { style, ref regions, color, opacity } = *self;
        let color = color.filter(|color| style != DomainStyle::Edges || *color != GRAY);
        let surface = Isosurface { front: color, opacity, ..Isosurface::new(0.0) };
        let of = IsosurfaceText { surface, by: None }.to_string();
        write!(f, "{style}")?;
        regions.iter().try_for_each(|regions| write!(f, ":{regions}"))?;
        f.write_str(of.trim_start_matches('0'))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_written_as_they_are_read() {
        for text in ["solid", "solid:#ff8000", "solid::0.3", "wireframe:#00ff00:0.5", "edges", "edges:#ffffff"] {
            assert_eq!(text.parse::<DomainSurface>().unwrap().to_string(), text);
        }
        for text in
            ["solid:block=1,3..5", "solid:u:mag=-1..2:#ff8000:0.25", "edges:a=b=2::0.5", "wireframe:block=0:#000000"]
        {
            let surface = text.parse::<DomainSurface>().unwrap();
            assert_eq!((surface.to_string().as_str(), surface.regions.is_some()), (text, true));
        }
        let gray = "edges".parse::<DomainSurface>().unwrap();
        assert_eq!((gray.color, gray.opacity), (Some(GRAY), 1.0));
        for (text, words) in [
            ("skin", "choose solid, wireframe or edges"),
            ("solid:red", "'red' is no colour"),
            ("solid:#ff0000/#00ff00", "two colours"),
            ("edges::2", "an opacity of 2"),
            ("solid:by=T", "the colours of the field that is shown"),
            ("solid:block=x", "write VALUE,FROM..TO"),
            ("solid:=1:#ff0000", "write FIELD=VALUE"),
            ("solid:block=1:red", "'red' is no colour"),
        ] {
            assert!(text.parse::<DomainSurface>().unwrap_err().contains(words), "{text}");
        }
    }
}
