//! Decoding the bytes in the file to the bytes of an array: base64, block headers, blocks.
//!
//! Uncompressed data are a word that counts the bytes, then the bytes; in base64 both are one stream. Compressed data
//! are the words *number of blocks, size of a block, size of the last block if it is another* and the compressed size of
//! each block, then the blocks; in base64 the words are one stream and the blocks another. As some writers
//! other than VTK pad after each part, padding inside base64 is taken as the end of one stream and the start of the next.
//!
//! Every size is checked against the size of the array and the available bytes before memory is allocated.

use super::super::numbers::Decoded;
use super::compression::Compressor;
use super::header::Words;
use base64::Engine;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::borrow::Cow;

const BASE64: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_allow_trailing_bits(true)
        .with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Binary data in the file's encoding; more data may follow the array.
pub(crate) enum Stored<'a> {
    Raw(&'a [u8]),
    /// Base64 without whitespace.
    Base64(Cow<'a, [u8]>),
}

/// The layout of the data of one array.
pub(crate) struct Layout {
    /// Bytes of the array once decoded.
    pub(crate) size: usize,
    /// Offset of its bytes, or compressed blocks, in the raw data or in the base64 text.
    start: usize,
    /// Bytes of the byte count that precede the array in the decoded stream at `start`.
    lead: usize,
    /// Compressed and decoded size of each block; `None` if the bytes are not compressed.
    blocks: Option<Vec<(usize, usize)>>,
}

impl Layout {
    /// Reads the header words of the data.
    pub(crate) fn read(stored: &Stored<'_>, words: Words, compressor: Option<Compressor>) -> Result<Self, String> {
        let (first, after) = read_words(stored, words, 1)?;
        let count = first.first().copied().unwrap_or(0);
        if compressor.is_none() {
            let size = usize::try_from(count).map_err(|_| format!("claims {count} bytes"))?;
            return Ok(match stored {
                Stored::Raw(_) => Self { size, start: after, lead: 0, blocks: None },
                Stored::Base64(_) => Self { size, start: 0, lead: words.size, blocks: None },
            });
        }
        let n = usize::try_from(count)
            .ok()
            .and_then(|n| n.checked_add(3))
            .ok_or_else(|| format!("claims {count} blocks"))?;
        let (header, start) = read_words(stored, words, n)?;
        let &[count, block_size, last_size, ref sizes @ ..] = header.as_slice() else {
            return Err("the block header is cut".to_owned());
        };
        let mut blocks = Vec::with_capacity(sizes.len());
        let mut total = 0_usize;
        for (i, &stored_size) in sizes.iter().enumerate() {
            let is_last = i as u64 + 1 == count;
            let size = if is_last && last_size != 0 { last_size } else { block_size };
            let pair = usize::try_from(stored_size).ok().zip(usize::try_from(size).ok());
            let (stored_size, size) = pair.ok_or_else(|| format!("block {i} claims {size} bytes"))?;
            total =
                total.checked_add(size).ok_or_else(|| format!("{count} blocks claim more bytes than there can be"))?;
            blocks.push((stored_size, size));
        }
        Ok(Self { size: total, start, lead: 0, blocks: Some(blocks) })
    }

    /// The part of the stored data that belongs to this array, plus at most a few bytes.
    pub(crate) fn extent<'s>(&self, stored: &'s Stored<'_>) -> &'s [u8] {
        let bytes = stored.bytes();
        let units = |size: usize| match stored {
            Stored::Raw(_) => size,
            // Each part may be padded separately; one more group for a padded count.
            Stored::Base64(_) => size.div_ceil(3).saturating_mul(4),
        };
        let length = match &self.blocks {
            None => units(self.size).saturating_add(units(self.lead)),
            Some(blocks) => {
                blocks.iter().fold(0_usize, |sum, &(stored_size, _)| sum.saturating_add(units(stored_size)))
            }
        };
        &bytes[..self.start.saturating_add(length).min(bytes.len())]
    }
}

impl Stored<'_> {
    fn bytes(&self) -> &[u8] {
        match self {
            Stored::Raw(bytes) => bytes,
            Stored::Base64(text) => text,
        }
    }

    /// Decodes `size` bytes from `start` on; also returns the offset behind them.
    fn take(&self, start: usize, size: usize) -> Result<(Cow<'_, [u8]>, usize), String> {
        match self {
            Stored::Raw(bytes) => {
                let rest = bytes.get(start..).unwrap_or(&[]);
                let taken = rest.get(..size).ok_or_else(|| ends_early(rest.len(), size))?;
                Ok((Cow::Borrowed(taken), start + size))
            }
            Stored::Base64(text) => {
                let rest = text.get(start..).unwrap_or(&[]);
                let (decoded, length) = decode_base64(rest, size)?;
                Ok((Cow::Owned(decoded), start + length))
            }
        }
    }
}

fn ends_early(got: usize, wanted: usize) -> String {
    format!("ends after {got} of {wanted} bytes")
}

fn read_words(stored: &Stored<'_>, words: Words, n: usize) -> Result<(Vec<u64>, usize), String> {
    let size = n.checked_mul(words.size).ok_or_else(|| format!("claims {n} words"))?;
    let (bytes, after) = stored.take(0, size).map_err(|e| format!("the header of the data {e}"))?;
    let value = |word: &[u8]| {
        let push = |value: u64, &byte: &u8| value << 8 | u64::from(byte);
        if words.big_endian { word.iter().fold(0, push) } else { word.iter().rev().fold(0, push) }
    };
    Ok((bytes.chunks_exact(words.size).map(value).collect(), after))
}

/// Decodes the first `size` bytes of `text`; also returns the number of characters consumed (whole groups of four).
fn decode_base64(text: &[u8], size: usize) -> Result<(Vec<u8>, usize), String> {
    // Sizes beyond the text are refused before memory is allocated.
    if size / 3 > text.len() / 4 {
        return Err(ends_early(text.len() / 4 * 3, size));
    }
    let mut out = Vec::with_capacity(size + 2);
    let mut at = 0;
    while out.len() < size {
        let wanted = (size - out.len()).div_ceil(3) * 4;
        let chunk = &text[at..text.len().min(at + wanted)];
        // A padded stream ends with the group of its first `=`.
        let end = chunk.iter().position(|&c| c == b'=').map_or(chunk.len(), |pad| chunk.len().min((pad / 4 + 1) * 4));
        let before = out.len();
        BASE64.decode_vec(&chunk[..end], &mut out).map_err(|e| format!("damaged base64: {e}"))?;
        if out.len() == before {
            return Err(ends_early(out.len(), size));
        }
        at += end;
    }
    out.truncate(size);
    Ok((out, at))
}

/// Decodes the data that `layout` describes; their size must be `expected`.
pub(crate) fn decode(
    stored: &Stored<'_>,
    layout: &Layout,
    compressor: Option<Compressor>,
    expected: usize,
) -> Result<Decoded, String> {
    if layout.size != expected {
        return Err(format!("has {} bytes, but {expected} are needed", layout.size));
    }
    let (Some(blocks), Some(compressor)) = (&layout.blocks, compressor) else {
        let size = layout.lead.checked_add(expected).ok_or("claims more bytes than there can be")?;
        let (bytes, end) = stored.take(layout.start, size)?;
        return Ok(match bytes {
            Cow::Borrowed(_) => Decoded::InPlace(layout.start..end),
            Cow::Owned(mut bytes) => {
                bytes.drain(..layout.lead.min(bytes.len()));
                Decoded::Own(bytes)
            }
        });
    };
    let total = blocks.iter().try_fold(0_usize, |sum, &(stored_size, _)| sum.checked_add(stored_size));
    let (data, _) = stored.take(layout.start, total.ok_or("claims more bytes than there can be")?)?;
    let mut out = Vec::new();
    let mut rest = data.as_ref();
    for (i, &(stored_size, size)) in blocks.iter().enumerate() {
        let (block, behind) = rest.split_at_checked(stored_size).ok_or_else(|| ends_early(rest.len(), stored_size))?;
        compressor.decompress(block, size, &mut out).map_err(|e| format!("block {i} of {}: {e}", blocks.len()))?;
        rest = behind;
    }
    Ok(Decoded::Own(out))
}

#[cfg(test)]
mod tests {
    use super::*;
    use base64::prelude::BASE64_STANDARD;

    fn text(parts: &[&[u8]]) -> String {
        parts.iter().map(|part| BASE64_STANDARD.encode(part)).collect()
    }

    fn own(stored: &Stored<'_>, compressor: Option<Compressor>, expected: usize) -> Result<Vec<u8>, String> {
        let layout = Layout::read(stored, Words::default(), compressor)?;
        match decode(stored, &layout, compressor, expected)? {
            Decoded::Own(bytes) => Ok(bytes),
            Decoded::InPlace(range) => Ok(stored.bytes()[range].to_vec()),
        }
    }

    #[test]
    fn base64_is_read_whether_count_and_data_are_one_stream_or_two() {
        for n in 0..9_u8 {
            let data: Vec<u8> = (1..=n).collect();
            let count = u32::from(n).to_le_bytes();
            for parts in [vec![[&count[..], &data].concat()], vec![count.to_vec(), data.clone()]] {
                let encoded = parts.iter().map(|part| BASE64_STANDARD.encode(part)).collect::<String>() + "AAAA";
                let stored = Stored::Base64(Cow::Owned(encoded.into_bytes()));
                assert_eq!(own(&stored, None, data.len()), Ok(data.clone()), "{n} bytes in {} parts", parts.len());
            }
        }
    }

    #[test]
    fn claims_beyond_the_data_are_refused_before_memory_is_asked_for() {
        let huge = u32::MAX.to_le_bytes();
        let refuse = |bytes: &[u8], compressor, expected| {
            for stored in [Stored::Raw(bytes), Stored::Base64(Cow::Owned(text(&[bytes]).into_bytes()))] {
                own(&stored, compressor, expected).expect_err("must be refused");
            }
        };
        refuse(&huge, None, u32::MAX as usize);
        refuse(&huge, Some(Compressor::ZLib), u32::MAX as usize);
        refuse(&[], None, 0);
        refuse(&[1, 0], None, 1);
        // One block that claims 4 GiB in four bytes, with any compressor.
        let block = [&1u32.to_le_bytes()[..], &huge, &[0; 4], &4u32.to_le_bytes(), &[0x78, 0x9c, 0, 0]].concat();
        for compressor in [Compressor::ZLib, Compressor::Lz4, Compressor::Lzma] {
            refuse(&block, Some(compressor), u32::MAX as usize);
        }
    }
}
