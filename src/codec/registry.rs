//! The codecs there are, and what each says of itself.

use super::{ArraySpec, BlockCache, Decoder, Encoder, ErrorTally, ReadRange, raw, vq};
use crate::error::FileResult;
use serde_json::Value;
use std::fmt::{Debug, Display};
use std::sync::Arc;

/// All codecs, the one of those who choose none first. Help and messages name what is in this list.
pub const CODECS: &[&dyn Codec] = &[&raw::Raw, &vq::Vq];

/// A codec: a folder beside this file, and a line of [`CODECS`].
pub trait Codec: Sync {
    /// Its name on the command line and in stores.
    fn name(&self) -> &'static str;

    /// What it does, for help.
    fn about(&self) -> &'static str;

    /// Names of the options that [`Codec::choose`] takes.
    fn options(&self) -> &'static [&'static str];

    /// Steps that are coded together: those of a block, or 1.
    fn block_steps(&self) -> usize;

    /// Whether decoding gives back every bit.
    fn is_exact(&self) -> bool;

    /// The codec with options, each with its value as text.
    ///
    /// # Errors
    /// What the user should read: an option is not one of [`Codec::options`], or a value not one of its own.
    fn choose(&self, options: &[(&str, &str)]) -> Result<CodecChoice, String>;

    /// How a field was coded that has these parameters in a store.
    ///
    /// # Errors
    /// What the user should read: the parameters are not of this codec, or of a later version of it.
    fn coding(&self, parameters: &Value) -> Result<Arc<dyn Coding>, String>;
}

/// The codec of that name.
pub fn codec_of(name: &str) -> Option<&'static dyn Codec> {
    CODECS.iter().find(|codec| codec.name() == name).copied()
}

/// What a user asks of a codec.
pub trait Encoding: Debug + Display + Send + Sync {
    /// Whose.
    fn codec(&self) -> &'static dyn Codec;

    /// An encoder of a field with so many values a step.
    fn encoder(&self, vertices: usize) -> Box<dyn Encoder>;

    /// Entries of each codebook; `None` without codebooks.
    fn entries(&self) -> Option<u64>;

    /// The bytes of a field by the dissertation's formula (6.2.2); `None` from codecs that it does not have.
    fn paper_bytes(&self, vertices: u64, steps: u64) -> Option<u64>;
}

/// The codec of the fields of a store to be, with its options.
#[derive(Clone, Debug)]
pub struct CodecChoice(Arc<dyn Encoding>);

impl CodecChoice {
    /// These options.
    pub fn new(encoding: impl Encoding + 'static) -> Self {
        Self(Arc::new(encoding))
    }

    /// What they are.
    pub fn encoding(&self) -> &dyn Encoding {
        &*self.0
    }
}

impl Default for CodecChoice {
    /// The values as they are.
    fn default() -> Self {
        Self::new(raw::Raw)
    }
}

impl PartialEq for CodecChoice {
    /// Compares what is written of them: the codec and all of its options.
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}

impl Display for CodecChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        Display::fmt(&self.0, f)
    }
}

/// Where the values of a field are.
pub struct StoredValues<'a> {
    /// The store.
    pub source: Arc<dyn ReadRange>,
    /// The group of the field in it.
    pub group_key: &'a str,
    /// Number of steps.
    pub steps: usize,
    /// Number of values of a step.
    pub vertices: usize,
}

/// How a field was coded.
pub trait Coding: Debug + Send + Sync {
    /// By which codec.
    fn codec(&self) -> &'static dyn Codec;

    /// What the codec was asked for; `None` if an older version did not write it down.
    fn choice(&self) -> Option<CodecChoice>;

    /// The arrays of a field with as many steps and vertices.
    fn arrays(&self, steps: u64, vertices: u64) -> Vec<ArraySpec>;

    /// A decoder, with its blocks in `cache` if there is one.
    fn decoder(&self, values: &StoredValues<'_>, cache: Option<Arc<BlockCache>>) -> Box<dyn Decoder>;

    /// Keys of the chunks that are replaced when steps are added, below the root of the store.
    fn unsettled_chunks(&self, values: &StoredValues<'_>) -> Vec<String>;

    /// An encoder that goes on behind the complete blocks, whose errors are `errors` (of no meaning to an exact codec). It must first be
    /// given again the steps behind them.
    ///
    /// # Errors
    /// If what it goes on from cannot be read, or there is no [`Coding::choice`].
    fn resume(&self, values: &StoredValues<'_>, errors: ErrorTally) -> FileResult<Box<dyn Encoder>>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codecs_are_found_by_names_of_their_own_and_options_are_read_or_refused() {
        for (i, codec) in CODECS.iter().enumerate() {
            assert!(codec_of(codec.name()).is_some() && !codec.about().is_empty());
            assert!(CODECS[..i].iter().all(|other| other.name() != codec.name()));
            assert!(codec.choose(&[("no such option", "1")]).is_err(), "{}", codec.name());
            let choice = codec.choose(&[]).unwrap();
            assert_eq!(choice.encoding().codec().name(), codec.name());
        }
        assert_eq!(CodecChoice::default(), CODECS[0].choose(&[]).unwrap());
        assert!(codec_of("fractal").is_none());
        let vq = |options: &[(&str, &str)]| codec_of("vq").unwrap().choose(options);
        assert_ne!(vq(&[("entries", "16")]).unwrap(), vq(&[]).unwrap());
        assert_eq!(
            vq(&[("relative", "true"), ("search", "exact")]).unwrap().to_string(),
            "vq with 256 entries, exact search, relative"
        );
        for bad in [("entries", "1"), ("entries", "x"), ("search", "slow"), ("relative", "2")] {
            assert!(vq(&[bad]).unwrap_err().contains(bad.1), "{bad:?}");
        }
    }
}
