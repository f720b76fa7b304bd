//! Encoding of an EXR, with its blocks compressed on the threads of the caller's pool.

use super::ExrColor;
use crate::words::words;
use ::exr::block::writer::ChunksWriter as _;
use ::exr::block::{self, UncompressedBlock};
use ::exr::compression::Compression;
use ::exr::error::Result as ExrResult;
use ::exr::image::write::layers::{LayersWriter as _, WritableLayers};
use ::exr::image::{AnyChannels, FlatSamples, Image, Layer};
use rayon::prelude::*;
use std::io::Cursor;
use std::str::FromStr;

/// Encoding of an EXR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExrEncoding {
    /// Colour space.
    pub color: ExrColor,
    /// Number format of R, G, B and A. Depths and normals are always 32-bit floats.
    pub depth: ExrDepth,
    /// Lossless compression of blocks of scan lines.
    pub compression: ExrCompression,
}

impl From<ExrColor> for ExrEncoding {
    fn from(color: ExrColor) -> Self {
        Self { color, ..Self::default() }
    }
}

/// Number format of colours and opacities in an EXR.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrDepth {
    /// 16-bit floats: 11 significant bits, up to 65504.
    Half,
    /// 32-bit floats.
    #[default]
    Float,
}

impl FromStr for ExrDepth {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "16" => Ok(Self::Half),
            "32" => Ok(Self::Float),
            _ => Err("an EXR has 16 or 32 bits".to_owned()),
        }
    }
}

/// Compression of an EXR's blocks; all are lossless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ExrCompression {
    /// Deflate, 16 lines per block.
    #[default]
    Zip,
    /// Wavelets, 32 lines per block: small files of grainy images.
    Piz,
    /// Run-length encoding of bytes, one line per block: fast.
    Rle,
    /// Uncompressed.
    None,
}

words!(ExrCompression, "an EXR has no compression", ["zip" = Zip, "piz" = Piz, "rle" = Rle, "none" = None]);

impl ExrCompression {
    /// The library's equivalent.
    pub(super) fn of_library(self) -> Compression {
        match self {
            Self::Zip => Compression::ZIP16,
            Self::Piz => Compression::PIZ,
            Self::Rle => Compression::RLE,
            Self::None => Compression::Uncompressed,
        }
    }
}

/// Serialises a file. The library's own parallel writer starts a pool, which would ignore the user's number of threads; blocks are in line
/// order, whichever thread finishes first.
pub(super) fn bytes_of(image: &Image<Layer<AnyChannels<FlatSamples>>>) -> ExrResult<Vec<u8>> {
    let mut bytes = Vec::new();
    let headers = image.layer_data.infer_headers(&image.attributes);
    block::write(Cursor::new(&mut bytes), headers, true, |meta, chunks| {
        let writer = image.layer_data.create_writer(&meta.headers);
        let indices: Vec<_> = block::enumerate_ordered_header_block_indices(&meta.headers).collect();
        let compressed = indices.into_par_iter().map(|(at, index)| {
            let data = writer.extract_uncompressed_block(&meta.headers, index);
            Ok((at, UncompressedBlock { index, data }.compress_to_chunk(&meta.headers)?))
        });
        let compressed: Vec<_> = compressed.collect::<ExrResult<_>>()?;
        compressed.into_iter().try_for_each(|(at, chunk)| chunks.write_chunk(at, chunk))
    })?;
    Ok(bytes)
}
