//! Registration of codec `vq`.

use super::layout::{MAX_ENTRIES, NAME, VqParameters, paper_bytes};
use super::{STEPS, VqDecoder, VqEncoder, VqOptions};
use crate::codec::{
    ArraySpec, BlockCache, Codec, CodecChoice, Coding, Decoder, Encoder, EncoderState, Encoding, ErrorTally,
    OptionText, PaperSize, StoredValues,
};
use crate::error::FileResult;
use std::fmt;
use std::sync::Arc;

/// Vector quantisation along time.
pub static CODEC: Codec = Codec {
    name: NAME,
    about: "vector quantisation along time, lossy (docs/compression.md)",
    options: &["entries", "search", "relative"],
    block_steps: STEPS,
    is_exact: false,
    choose,
    coding: |parameters| Ok(Arc::new(VqParameters::read(parameters)?)),
};

fn choose(options: &[OptionText<'_>]) -> Result<CodecChoice, String> {
    let mut chosen = VqOptions::default();
    for (name, value) in options {
        match *name {
            "entries" => {
                let entries = value.parse().ok().filter(|entries| (2..=MAX_ENTRIES).contains(entries));
                chosen.entries =
                    entries.ok_or_else(|| format!("'{value}' is no number of entries; give 2 to {MAX_ENTRIES}"))?;
            }
            "search" => chosen.search = value.parse()?,
            "relative" => {
                let parsed = value.parse();
                chosen.own_scales = parsed.map_err(|_| format!("relative is true or false, not '{value}'"))?;
            }
            _ => return Err(format!("codec {NAME} has no option '{name}'")),
        }
    }
    Ok(CodecChoice::new(chosen))
}

impl fmt::Display for VqOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let relative = if self.own_scales { ", relative" } else { "" };
        write!(f, "{NAME} with {} entries, {} search{relative}", self.entries, self.search.as_str())
    }
}

impl Encoding for VqOptions {
    fn codec(&self) -> &'static Codec {
        &CODEC
    }

    fn encoder(&self, vertices: usize) -> Box<dyn Encoder> {
        Box::new(VqEncoder::new(vertices, *self))
    }

    fn resume(&self, vertices: usize, steps: usize, state: EncoderState) -> Option<Box<dyn Encoder>> {
        Some(Box::new(VqEncoder::from_state(vertices, *self, steps, state)?))
    }

    fn by_the_paper(&self, vertices: u64, steps: u64) -> Option<PaperSize> {
        let entries = self.entries as u64;
        Some(PaperSize { entries, bytes: paper_bytes(vertices, steps, entries) })
    }
}

impl Coding for VqParameters {
    fn codec(&self) -> &'static Codec {
        &CODEC
    }

    fn choice(&self) -> Option<CodecChoice> {
        self.options().map(CodecChoice::new)
    }

    fn arrays(&self, steps: u64, vertices: u64) -> Vec<ArraySpec> {
        Self::arrays(self, steps, vertices)
    }

    fn decoder(&self, values: &StoredValues<'_>, cache: Option<Arc<BlockCache>>) -> Box<dyn Decoder> {
        let StoredValues { source, group_key, steps, vertices } = values;
        let decoder = VqDecoder::new(source.clone(), group_key, self.clone(), *steps, *vertices);
        Box::new(match cache {
            Some(cache) => decoder.with_cache(cache),
            None => decoder,
        })
    }

    fn unsettled_chunks(&self, values: &StoredValues<'_>) -> Vec<String> {
        Self::unsettled_chunks(self, &*values.source, values.group_key, values.steps as u64)
    }

    fn resume(&self, values: &StoredValues<'_>, errors: ErrorTally) -> FileResult<Box<dyn Encoder>> {
        Ok(Box::new(VqEncoder::resume(values, self, errors)?))
    }
}
