//! Icons as text: `ICON[,ICON@FROM..]`, an icon being the word of a generated one or a file.

use super::icon::Icon;
use super::mixture::{Pattern, Thresholds};
use super::picture::Picture;
use crate::error::FileResult;
use crate::words;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

/// An icon by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum IconName {
    /// A generated one.
    Icon(Icon),
    /// A grey PNG.
    File(PathBuf),
}

impl IconName {
    /// Reads the icon.
    ///
    /// # Errors
    /// As [`Picture::read`].
    pub fn read(&self) -> FileResult<Pattern> {
        Ok(match self {
            Self::Icon(icon) => Pattern::Icon(*icon),
            Self::File(path) => Pattern::Picture(Arc::new(Picture::read(path)?)),
        })
    }

    fn parse(text: &str) -> Option<Self> {
        let is_png = Path::new(text).extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
        let file = || is_png.then(|| Self::File(text.into()));
        text.parse().ok().map(Self::Icon).or_else(file)
    }
}

impl fmt::Display for IconName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Icon(icon) => icon.fmt(f),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

impl From<Icon> for Thresholds<IconName> {
    /// That icon alone.
    fn from(icon: Icon) -> Self {
        Self { first: IconName::Icon(icon), further: Vec::new() }
    }
}

impl Thresholds<IconName> {
    /// The icon, if it is a generated one alone.
    pub fn generated(&self) -> Option<Icon> {
        match self.first {
            IconName::Icon(icon) if self.further.is_empty() => Some(icon),
            _ => None,
        }
    }

    /// The same with other paths of files.
    #[must_use]
    pub fn with_paths(self, path: impl Fn(PathBuf) -> PathBuf) -> Self {
        let of = |name: IconName| match name {
            IconName::File(file) => IconName::File(path(file)),
            icon => icon,
        };
        Self { first: of(self.first), further: self.further.into_iter().map(|(from, name)| (from, of(name))).collect() }
    }
}

impl fmt::Display for Thresholds<IconName> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.first.fmt(f)?;
        self.further.iter().try_for_each(|(from, icon)| write!(f, ",{icon}@{from}"))
    }
}

impl FromStr for Thresholds<IconName> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (first, mut rest) = begun(text, IconName::parse).ok_or_else(|| no_first(text))?;
        let mut further = Vec::new();
        while let Some(text) = rest {
            let of = |text: &str| {
                text.rsplit_once('@').and_then(|(name, from)| Some((IconName::parse(name)?, from.to_owned())))
            };
            let ((name, from), after) = begun(text, of).ok_or_else(|| no_further(text))?;
            let number = || format!("'{from}' is no threshold of {name}; write a number, as in {name}@3");
            further.push((from.trim().parse().map_err(|_| number())?, name));
            rest = after;
        }
        let icons = Self { first, further };
        icons.check().map(|()| icons)
    }
}

/// The shortest beginning of a list, up to a comma, that can be read, and what follows the comma: names of files may have commas.
fn begun<T>(text: &str, read: impl Fn(&str) -> Option<T>) -> Option<(T, Option<&str>)> {
    let mut ends = text.match_indices(',').map(|(at, _)| at).chain([text.len()]);
    ends.find_map(|end| Some((read(&text[..end])?, text.get(end + 1..))))
}

/// Why a list of icons has no first one.
fn no_first(text: &str) -> String {
    let name = text.split(',').next().unwrap_or(text);
    match name.rsplit_once('@') {
        Some((icon, _)) if IconName::parse(icon).is_some() => {
            format!("'{name}' is the first icon, which is shown from below; write it without a threshold, as {icon}")
        }
        _ => no_icon(name),
    }
}

/// Why a list of icons does not go on.
fn no_further(text: &str) -> String {
    let name = text.split(',').next().unwrap_or(text);
    match name.rsplit_once('@') {
        Some((icon, _)) => no_icon(icon),
        None if IconName::parse(name).is_some() => {
            format!(
                "the further icon '{name}' has no threshold; write the value from which it is shown, as in {name}@3"
            )
        }
        None => no_icon(name),
    }
}

fn no_icon(name: &str) -> String {
    let icons = words::choice(&Icon::ALL.map(Icon::as_str));
    format!("there is no icon '{name}'; choose {icons}, or name a grey picture of your own, as in tile.png")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Thresholds<IconName>, String> {
        text.parse()
    }

    #[test]
    fn icons_are_read_as_they_are_written() {
        for text in [
            "lines",
            "tile.png",
            "strokes,lines@-2.5,arrows@30",
            "a,b@3/of, two.PNG,particles@0.5",
            "lines,/home/a,b/c@2.png@1000000000",
        ] {
            assert_eq!(parse(text).unwrap().to_string(), text);
        }
        let two = parse("a,b/tile.png,arrows@3").unwrap();
        assert_eq!((&two.first, two.further.len()), (&IconName::File("a,b/tile.png".into()), 1));
        assert_eq!((two.generated(), parse("arrows").unwrap().generated()), (None, Some(Icon::Arrows)));
        let within = two.with_paths(|path| Path::new("folder").join(path));
        assert_eq!(within.to_string(), "folder/a,b/tile.png,arrows@3");
    }

    #[test]
    fn what_is_no_icon_and_no_threshold_is_refused_with_the_remedy() {
        for (text, parts) in [
            ("", &["''", "strokes, lines, particles or arrows"][..]),
            ("fish", &["'fish'", "strokes, lines, particles or arrows", "tile.png"]),
            ("fish,lines@3", &["'fish'"]),
            ("tile.jpg", &["'tile.jpg'", "tile.png"]),
            ("lines@3,arrows", &["'lines@3'", "without a threshold"]),
            ("lines,arrows", &["'arrows' has no threshold", "arrows@3"]),
            ("lines,fish@3", &["'fish'"]),
            ("lines,", &["''"]),
            ("lines,arrows@fast", &["'fast'", "arrows@3"]),
            ("lines,arrows@inf", &["from inf", "finite"]),
            ("lines,arrows@nan", &["from NaN", "finite"]),
            ("lines,arrows@3,strokes@2", &["from 2", "from 3", "order"]),
            ("lines,arrows@3,strokes@3", &["order"]),
        ] {
            let error = parse(text).unwrap_err();
            assert!(parts.iter().all(|part| error.contains(part)), "{text}: {error}");
        }
    }
}
