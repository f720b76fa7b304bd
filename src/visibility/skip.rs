//! Switches for work that may be skipped.

use serde::Serialize;
use std::fmt;
use std::str::FromStr;

/// Work that a frame may skip or reorder without changing the image: one switch each. Switched off, the frame only takes longer.
/// `docs/skipping.md` has what each saves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Skip {
    /// Cells in which the transfer function shows nothing at this step.
    pub transparent_cells: bool,
    /// Decoding of vertex chunks that no visible cell uses.
    pub transparent_chunks: bool,
    /// Samples behind an opaque pixel.
    pub opaque: bool,
    /// Cells outside of the view.
    pub outside: bool,
    /// Work whose result is known from the frames before.
    pub unchanged: bool,
    /// Begins with the tiles that took longest in the last frame, so that no thread waits for them at the end.
    pub costly_first: bool,
}

impl Default for Skip {
    /// All switches on.
    fn default() -> Self {
        Self::ALL
    }
}

/// A switch by its name.
type Switch = (&'static str, fn(&mut Skip) -> &mut bool);

impl Skip {
    /// All switches on.
    pub const ALL: Self = Self::same(true);
    /// All switches off: everything is done, every time.
    pub const NONE: Self = Self::same(false);

    const fn same(on: bool) -> Self {
        Self { transparent_cells: on, transparent_chunks: on, opaque: on, outside: on, unchanged: on, costly_first: on }
    }

    /// The switches by the names that [`FromStr`] reads.
    pub const SWITCHES: [Switch; 6] = [
        ("transparent-cells", |skip| &mut skip.transparent_cells),
        ("transparent-chunks", |skip| &mut skip.transparent_chunks),
        ("opaque", |skip| &mut skip.opaque),
        ("outside", |skip| &mut skip.outside),
        ("unchanged", |skip| &mut skip.unchanged),
        ("costly-first", |skip| &mut skip.costly_first),
    ];
}

impl FromStr for Skip {
    type Err = String;

    /// Reads `all`, `none`, or comma-separated names of switches; names after `all` are switched off, as in `all,-opaque`.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut skip = Self::NONE;
        for (at, word) in text.split(',').map(str::trim).enumerate() {
            match (word, at) {
                ("all", 0) => skip = Self::ALL,
                ("none", 0) => {}
                _ => {
                    // Requests of older versions use `clear-cells` and `clear-chunks`.
                    let name = word.strip_prefix('-').unwrap_or(word).replace("clear-", "transparent-");
                    let Some((_, switch)) = Self::SWITCHES.iter().find(|(known, _)| *known == name) else {
                        let names: Vec<&str> = Self::SWITCHES.iter().map(|(name, _)| *name).collect();
                        return Err(format!(
                            "'{word}' cannot be skipped; choose all, none, or of {}",
                            names.join(", ")
                        ));
                    };
                    *switch(&mut skip) = !word.starts_with('-');
                }
            }
        }
        Ok(skip)
    }
}

impl fmt::Display for Skip {
    /// Text that parses to the same switches.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::ALL => f.write_str("all"),
            Self::NONE => f.write_str("none"),
            mut skip => {
                let on = Self::SWITCHES.iter().filter(|(_, switch)| *switch(&mut skip)).map(|(name, _)| *name);
                f.write_str(&on.collect::<Vec<_>>().join(","))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_set_of_switches_is_text_and_back() {
        for bits in 0..1 << Skip::SWITCHES.len() {
            let mut skip = Skip::NONE;
            for (at, (_, switch)) in Skip::SWITCHES.iter().enumerate() {
                *switch(&mut skip) = bits >> at & 1 == 1;
            }
            assert_eq!(skip.to_string().parse(), Ok(skip), "{skip}");
        }
        assert_eq!((Skip::ALL.to_string(), Skip::NONE.to_string()), ("all".to_owned(), "none".to_owned()));
    }

    #[test]
    fn switches_are_taken_out_of_all_and_unknown_ones_named() {
        let parsed: Skip = "all, -opaque,-outside".parse().unwrap();
        assert_eq!(parsed, Skip { opaque: false, outside: false, ..Skip::ALL });
        assert_eq!("none,opaque".parse(), Ok(Skip { opaque: true, ..Skip::NONE }));
        assert_eq!("all,-clear-chunks".parse(), Ok(Skip { transparent_chunks: false, ..Skip::ALL }), "an older word");
        for (text, named) in [("", "''"), ("every", "'every'"), ("opaque,all", "'all'"), ("all,-x", "'-x'")] {
            let error = text.parse::<Skip>().unwrap_err();
            assert!(error.contains(named) && error.contains("transparent-cells"), "{text}: {error}");
        }
    }
}
