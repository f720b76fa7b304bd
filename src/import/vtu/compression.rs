//! Decompression of single blocks, at most to a size known beforehand.

use std::io::Read;

/// The compressors that VTK's XML writers offer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Compressor {
    ZLib,
    Lz4,
    Lzma,
}

/// Memory limit of an xz stream, in KiB: xz's strongest preset needs 65 MiB.
const LZMA_LIMIT_KIB: u32 = 80 << 10;

/// An LZ4 block grows by less than this factor (a match of 255 more bytes per input byte).
const LZ4_MAX_RATIO: usize = 256;

impl Compressor {
    /// The compressor of a VTK class name.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        match name {
            "vtkZLibDataCompressor" => Some(Self::ZLib),
            "vtkLZ4DataCompressor" => Some(Self::Lz4),
            "vtkLZMADataCompressor" => Some(Self::Lzma),
            _ => None,
        }
    }

    /// Decompresses `block` into `size` bytes, which are appended to `out`.
    ///
    /// # Errors
    /// If the block is damaged or holds another number of bytes.
    pub(crate) fn decompress(self, block: &[u8], size: usize, out: &mut Vec<u8>) -> Result<(), String> {
        match self {
            Self::ZLib => read_exactly(flate2::read::ZlibDecoder::new(block), size, out),
            Self::Lzma => read_exactly(lzma_rust2::XzReader::new_mem_limit(block, false, LZMA_LIMIT_KIB), size, out),
            Self::Lz4 => {
                if size / LZ4_MAX_RATIO > block.len() {
                    return Err(format!("{} bytes of LZ4 cannot hold {size}", block.len()));
                }
                let start = out.len();
                out.resize(start + size, 0);
                let got = lz4_flex::block::decompress_into(block, &mut out[start..]).map_err(|e| e.to_string())?;
                if got != size { Err(format!("holds {got} bytes instead of {size}")) } else { Ok(()) }
            }
        }
    }
}

/// Memory grows with the decoder's output, not with the claimed size.
fn read_exactly(decoder: impl Read, size: usize, out: &mut Vec<u8>) -> Result<(), String> {
    let limit = (size as u64).saturating_add(1);
    let got = decoder.take(limit).read_to_end(out).map_err(|e| e.to_string())?;
    match got.cmp(&size) {
        std::cmp::Ordering::Less => Err(format!("holds {got} bytes instead of {size}")),
        std::cmp::Ordering::Equal => Ok(()),
        std::cmp::Ordering::Greater => Err(format!("holds more than {size} bytes")),
    }
}
