//! Names of enum values on the command line and in files.

/// Gives an enum without data its names: `ALL`, `as_str`, `Display`, and a `FromStr` whose error lists all names.
///
/// `words!(Kind, "there is no kind", ["one" = One, "other" = Other])`
macro_rules! words {
    ($kind:ident, $none:literal, [$($word:literal = $variant:ident),+]) => {
        impl $kind {
            /// All values.
            pub const ALL: [Self; [$($word),+].len()] = [$(Self::$variant),+];

            /// The name on the command line and in files.
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$variant => $word),+
                }
            }
        }

        impl std::fmt::Display for $kind {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.as_str())
            }
        }

        impl std::str::FromStr for $kind {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                let known = Self::ALL.into_iter().find(|kind| kind.as_str() == text);
                known.ok_or_else(|| format!("{} '{text}'; choose {}", $none, $crate::words::choice(&[$($word),+])))
            }
        }
    };
}
pub(crate) use words;

/// Joins words as in a sentence: "one, two or three".
pub(crate) fn choice(words: &[&str]) -> String {
    match words {
        [] => String::new(),
        [word] => (*word).to_owned(),
        [words @ .., last] => format!("{} or {last}", words.join(", ")),
    }
}

/// Parses `N` comma-separated finite numbers, as `1,0.5,-2`; `None` for another count or an invalid number.
pub(crate) fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let parts: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    parts?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Kind {
        One,
        Other,
    }
    words!(Kind, "there is no kind", ["one" = One, "other" = Other]);

    #[test]
    fn words_are_read_as_they_are_written_and_others_are_told_which_there_are() {
        assert!(Kind::ALL.iter().all(|kind| kind.to_string().parse() == Ok(*kind)));
        assert_eq!("One".parse::<Kind>(), Err("there is no kind 'One'; choose one or other".to_owned()));
        assert_eq!(numbers("1, 0.5,-2e3"), Some([1.0, 0.5, -2e3]));
        assert!(["", "1", "1,2,3,4", "1,,2", "1,2,nan", "1,2,inf"].iter().all(|text| numbers::<3>(text).is_none()));
        assert_eq!(["", "a", "a or b", "a, b or c"], [&[][..], &["a"], &["a", "b"], &["a", "b", "c"]].map(choice));
    }
}
