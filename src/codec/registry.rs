//! The list of codecs, and the interface of each.

use super::{ArraySpec, BlockCache, Decoder, Encoder, EncoderState, ErrorTally, ReadRange, raw, vq};
use crate::error::FileResult;
use serde_json::Value;
use std::fmt::{Debug, Display};
use std::sync::Arc;

/// All codecs, the default one first. Help and messages list them from here.
pub static CODECS: &[&Codec] = &[&raw::CODEC, &vq::CODEC];

/// Name and value of an option.
pub type OptionText<'a> = (&'a str, &'a str);

/// A codec: a folder beside this file, and a line of [`CODECS`].
#[derive(Debug)]
pub struct Codec {
    /// Name on the command line and in stores.
    pub name: &'static str,
    /// Description for help.
    pub about: &'static str,
    /// Names of the options that `choose` takes.
    pub options: &'static [&'static str],
    /// Steps that are coded together: the length of a block, or 1.
    pub block_steps: usize,
    /// Whether decoding gives back every bit.
    pub is_exact: bool,
    /// The codec with options, given as names and values in text.
    ///
    /// # Errors
    /// A message for the user: an option is not one of `options`, or a value is not valid for it.
    pub choose: fn(options: &[OptionText<'_>]) -> Result<CodecChoice, String>,
    /// The coding of a field with these parameters in a store.
    ///
    /// # Errors
    /// A message for the user: the parameters are not of this codec, or of a later version of it.
    pub coding: fn(parameters: &Value) -> Result<Arc<dyn Coding>, String>,
}

/// The codec called `name`.
pub fn codec_of(name: &str) -> Option<&'static Codec> {
    CODECS.iter().copied().find(|codec| codec.name == name)
}

/// A codec with its options, as chosen by a user.
pub trait Encoding: Debug + Display + Send + Sync {
    /// The codec that the options belong to.
    fn codec(&self) -> &'static Codec;

    /// An encoder of a field with `vertices` values a step.
    fn encoder(&self, vertices: usize) -> Box<dyn Encoder>;

    /// The encoder whose [`Encoder::state`] after `steps` steps this was; `None` if it is no such state.
    fn resume(&self, vertices: usize, steps: usize, state: EncoderState) -> Option<Box<dyn Encoder>>;

    /// The size of a field by the dissertation's formula (6.2.2); `None` from codecs that it does not cover.
    fn by_the_paper(&self, vertices: u64, steps: u64) -> Option<PaperSize>;
}

/// Size of a field by the dissertation's formula.
pub struct PaperSize {
    /// Entries of each codebook.
    pub entries: u64,
    /// Bytes of codebooks and indices.
    pub bytes: u64,
}

/// The codec and options for the fields of a new store.
#[derive(Clone, Debug)]
pub struct CodecChoice(Arc<dyn Encoding>);

impl CodecChoice {
    /// The choice of this encoding.
    pub fn new(encoding: impl Encoding + 'static) -> Self {
        Self(Arc::new(encoding))
    }

    /// The chosen encoding.
    pub fn encoding(&self) -> &dyn Encoding {
        &*self.0
    }
}

impl Default for CodecChoice {
    /// The codec `raw`.
    fn default() -> Self {
        Self::new(raw::Raw)
    }
}

impl PartialEq for CodecChoice {
    /// Compares the text of both: the codec and all of its options.
    fn eq(&self, other: &Self) -> bool {
        self.to_string() == other.to_string()
    }
}

impl Display for CodecChoice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        Display::fmt(&self.0, f)
    }
}

/// Location and size of a field's values in a store.
pub struct StoredValues<'a> {
    /// The store.
    pub source: Arc<dyn ReadRange>,
    /// The field's group in the store.
    pub group_key: &'a str,
    /// Number of steps.
    pub steps: usize,
    /// Number of values of a step.
    pub vertices: usize,
}

/// How a field of a store was coded.
pub trait Coding: Debug + Send + Sync {
    /// The field's codec.
    fn codec(&self) -> &'static Codec;

    /// The options that the codec was given; `None` if an older version did not record them.
    fn choice(&self) -> Option<CodecChoice>;

    /// The arrays of a field with this many steps and vertices.
    fn arrays(&self, steps: u64, vertices: u64) -> Vec<ArraySpec>;

    /// A decoder, which keeps its blocks in `cache` if there is one.
    fn decoder(&self, values: &StoredValues<'_>, cache: Option<Arc<BlockCache>>) -> Box<dyn Decoder>;

    /// Keys, below the root of the store, of the chunks that are replaced when steps are added.
    fn unsettled_chunks(&self, values: &StoredValues<'_>) -> Vec<String>;

    /// An encoder that continues after the complete blocks, whose errors are `errors` (ignored by an exact codec). The steps after these
    /// blocks must be pushed again first.
    ///
    /// # Errors
    /// If the stored data that it continues cannot be read, or there is no [`Coding::choice`].
    fn resume(&self, values: &StoredValues<'_>, errors: ErrorTally) -> FileResult<Box<dyn Encoder>>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codecs_are_found_by_names_of_their_own_and_options_are_read_or_refused() {
        for (i, codec) in CODECS.iter().enumerate() {
            assert!(codec_of(codec.name).is_some() && !codec.about.is_empty());
            assert!(CODECS[..i].iter().all(|other| other.name != codec.name));
            assert!((codec.choose)(&[("no such option", "1")]).is_err(), "{}", codec.name);
            let choice = (codec.choose)(&[]).unwrap();
            assert_eq!(choice.encoding().codec().name, codec.name);
        }
        assert_eq!(CodecChoice::default(), (CODECS[0].choose)(&[]).unwrap());
        assert!(codec_of("fractal").is_none());
        let vq = |options: &[(&str, &str)]| (vq::CODEC.choose)(options);
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
