//! The number types of files, and typed views of byte buffers.

use crate::words::words;
use std::ops::Range;

/// A number type as the `type` attribute of a `DataArray` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Number {
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Float32,
    Float64,
}

words!(
    Number,
    "there is no type of numbers",
    [
        "Int8" = Int8,
        "UInt8" = UInt8,
        "Int16" = Int16,
        "UInt16" = UInt16,
        "Int32" = Int32,
        "UInt32" = UInt32,
        "Int64" = Int64,
        "UInt64" = UInt64,
        "Float32" = Float32,
        "Float64" = Float64
    ]
);

/// Runs `$body` with `$T` being the Rust type of `$number`, so that the match stays outside of the loops.
macro_rules! with_type {
    ($number:expr, $T:ident => $body:expr) => {
        with_type!(@arms $number, $T, $body,
            (Int8, i8), (UInt8, u8), (Int16, i16), (UInt16, u16), (Int32, i32), (UInt32, u32),
            (Int64, i64), (UInt64, u64), (Float32, f32), (Float64, f64))
    };
    (@arms $number:expr, $T:ident, $body:expr, $(($name:ident, $rust:ty)),*) => {
        match $number { $(Number::$name => { type $T = $rust; $body })* }
    };
}
pub(super) use with_type;

impl Number {
    /// The integer type of this many bytes.
    pub(super) fn integer(bytes: u8, signed: bool) -> Option<Self> {
        Some(match (bytes, signed) {
            (1, true) => Self::Int8,
            (1, false) => Self::UInt8,
            (2, true) => Self::Int16,
            (2, false) => Self::UInt16,
            (4, true) => Self::Int32,
            (4, false) => Self::UInt32,
            (8, true) => Self::Int64,
            (8, false) => Self::UInt64,
            _ => return None,
        })
    }

    /// The float type of this many bytes.
    pub(super) fn float(bytes: u8) -> Option<Self> {
        match bytes {
            4 => Some(Self::Float32),
            8 => Some(Self::Float64),
            _ => None,
        }
    }

    /// Bytes of one number.
    pub(super) fn size(self) -> usize {
        with_type!(self, T => size_of::<T>())
    }
}

/// Conversions of a number type.
trait Scalar: Copy {
    /// From exactly `size_of::<Self>()` bytes.
    fn from_bytes(bytes: &[u8], big_endian: bool) -> Self;
    /// From a word of an ASCII array.
    fn from_word(word: &str) -> Option<Self>;
    fn extend_le(self, out: &mut Vec<u8>);
    fn to_f64(self) -> f64;
    fn to_f32(self) -> f32;
    /// The number as an index; `None` for negative numbers and for floats.
    fn to_index(self) -> Option<u64>;
}

macro_rules! scalar {
    ($($T:ty: $word:expr, $index:expr;)*) => { $(
        impl Scalar for $T {
            fn from_bytes(bytes: &[u8], big_endian: bool) -> Self {
                let mut array = [0; size_of::<$T>()];
                array.copy_from_slice(bytes);
                if big_endian { <$T>::from_be_bytes(array) } else { <$T>::from_le_bytes(array) }
            }
            fn from_word(word: &str) -> Option<Self> {
                let parse: fn(&str) -> Option<$T> = $word;
                parse(word)
            }
            fn extend_le(self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
            fn to_f64(self) -> f64 {
                self as f64
            }
            fn to_f32(self) -> f32 {
                self as f32
            }
            fn to_index(self) -> Option<u64> {
                let index: fn($T) -> Option<u64> = $index;
                index(self)
            }
        }
    )* };
}

scalar! {
    i8: |w| w.parse().ok(), |v| v.try_into().ok();
    u8: |w| w.parse().ok(), |v| Some(v.into());
    i16: |w| w.parse().ok(), |v| v.try_into().ok();
    u16: |w| w.parse().ok(), |v| Some(v.into());
    i32: |w| w.parse().ok(), |v| v.try_into().ok();
    u32: |w| w.parse().ok(), |v| Some(v.into());
    i64: |w| w.parse().ok(), |v| v.try_into().ok();
    u64: |w| w.parse().ok(), Some;
    f32: |w| w.parse().ok().or_else(|| is_decorated_nan(w).then_some(f32::NAN)), |_| None;
    f64: |w| w.parse().ok().or_else(|| is_decorated_nan(w).then_some(f64::NAN)), |_| None;
}

/// Whether a word is NaN with a payload, as C libraries print it (`-nan(ind)`); Rust reads only the plain word.
fn is_decorated_nan(word: &str) -> bool {
    let word = word.trim_start_matches(['+', '-']);
    word.get(..4).is_some_and(|head| head.eq_ignore_ascii_case("nan("))
}

/// The bytes of an array and their type.
pub(super) struct Numbers {
    pub(super) number: Number,
    pub(super) big_endian: bool,
    pub(super) bytes: Vec<u8>,
}

impl Numbers {
    pub(super) fn values(&self) -> Values<'_> {
        Values { number: self.number, big_endian: self.big_endian, bytes: &self.bytes }
    }
}

/// The bytes of an array of a file in memory.
pub(super) enum Decoded {
    /// A range of the file's bytes, which needs no decoding.
    InPlace(Range<usize>),
    Own(Vec<u8>),
}

/// The bytes of an array of a file in memory, and their type.
pub(super) struct ArrayBytes {
    pub(super) number: Number,
    pub(super) big_endian: bool,
    pub(super) data: Decoded,
}

impl ArrayBytes {
    /// The numbers, `file` being all bytes of the file.
    pub(super) fn values<'a>(&'a self, file: &'a [u8]) -> Values<'a> {
        let bytes = match &self.data {
            Decoded::InPlace(range) => &file[range.clone()],
            Decoded::Own(bytes) => bytes,
        };
        Values { number: self.number, big_endian: self.big_endian, bytes }
    }
}

/// Numbers in a byte buffer.
#[derive(Clone, Copy)]
pub(super) struct Values<'a> {
    pub(super) number: Number,
    pub(super) big_endian: bool,
    /// Bytes of a whole number of elements.
    pub(super) bytes: &'a [u8],
}

impl Values<'_> {
    /// All numbers as f64.
    pub(super) fn to_f64(self) -> Vec<f64> {
        with_type!(self.number, T => self.map(T::to_f64).collect())
    }

    /// All numbers as indices; the error is the position of the first that is negative or not an integer.
    pub(super) fn to_indices(self) -> Result<Vec<u64>, usize> {
        with_type!(self.number, T => self.map(T::to_index).enumerate().map(|(i, v)| v.ok_or(i)).collect())
    }

    fn map<T: Scalar, U>(self, f: impl Fn(T) -> U) -> impl Iterator<Item = U> {
        self.bytes.chunks_exact(size_of::<T>()).map(move |bytes| f(T::from_bytes(bytes, self.big_endian)))
    }

    /// Appends component `component` of tuples of `components` numbers to `out` as f32. Returns the number of finite values beyond the
    /// range of f32, which become infinite.
    pub(super) fn component(self, components: usize, component: usize, out: &mut Vec<f32>) -> u64 {
        fn run<T: Scalar>(values: Values<'_>, components: usize, component: usize, out: &mut Vec<f32>) -> u64 {
            let size = size_of::<T>();
            let mut overflows = 0;
            out.extend(values.bytes.chunks_exact(size * components).map(|tuple| {
                let value = T::from_bytes(&tuple[component * size..(component + 1) * size], values.big_endian);
                let narrow = value.to_f32();
                overflows += u64::from(narrow.is_infinite() && value.to_f64().is_finite());
                narrow
            }));
            overflows
        }
        with_type!(self.number, T => run::<T>(self, components, component, out))
    }

    /// Appends component `component` of tuples of `components` numbers to `out`.
    pub(super) fn component_f64(self, components: usize, component: usize, out: &mut Vec<f64>) {
        fn run<T: Scalar>(values: Values<'_>, components: usize, component: usize, out: &mut Vec<f64>) {
            let size = size_of::<T>();
            let of_tuple = |tuple: &[u8]| {
                T::from_bytes(&tuple[component * size..(component + 1) * size], values.big_endian).to_f64()
            };
            out.extend(values.bytes.chunks_exact(size * components).map(of_tuple));
        }
        with_type!(self.number, T => run::<T>(self, components, component, out));
    }

    /// As [`Values::component`] for the Euclidean norm of each tuple, computed in f64.
    pub(super) fn magnitude(self, components: usize, out: &mut Vec<f32>) -> u64 {
        fn run<T: Scalar>(values: Values<'_>, components: usize, out: &mut Vec<f32>) -> u64 {
            let size = size_of::<T>();
            let mut overflows = 0;
            out.extend(values.bytes.chunks_exact(size * components).map(|tuple| {
                let numbers = tuple.chunks_exact(size).map(|bytes| T::from_bytes(bytes, values.big_endian).to_f64());
                let (squares, finite) =
                    numbers.fold((0.0, true), |(squares, finite), v| (squares + v * v, finite && v.is_finite()));
                let norm = squares.sqrt() as f32;
                overflows += u64::from(norm.is_infinite() && finite);
                norm
            }));
            overflows
        }
        with_type!(self.number, T => run::<T>(self, components, out))
    }
}

/// Parses an ASCII array into little-endian bytes. The error names the invalid word.
pub(super) fn parse_ascii(number: Number, text: &[u8]) -> Result<Vec<u8>, String> {
    fn run<T: Scalar>(number: Number, text: &[u8]) -> Result<Vec<u8>, String> {
        let mut out = Vec::new();
        for word in text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()) {
            let value = std::str::from_utf8(word).ok().and_then(T::from_word).ok_or_else(|| {
                format!("'{}' is no {number:?}", String::from_utf8_lossy(&word[..word.len().min(40)]))
            })?;
            value.extend_le(&mut out);
        }
        Ok(out)
    }
    with_type!(number, T => run::<T>(number, text))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn floats(numbers: &[f64]) -> Vec<u8> {
        numbers.iter().flat_map(|v| v.to_be_bytes()).collect()
    }

    fn view(bytes: &[u8]) -> Values<'_> {
        Values { number: Number::Float64, big_endian: true, bytes }
    }

    #[test]
    fn finite_numbers_beyond_f32_become_infinite_and_are_counted_while_infinities_and_nans_are_kept() {
        let bytes = floats(&[1e300, -1e39, f64::INFINITY, f64::NAN, 3.5, f64::from(f32::MAX)]);
        let mut out = Vec::new();
        assert_eq!(view(&bytes).component(1, 0, &mut out), 2);
        assert_eq!(out[..3], [f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY]);
        assert!(out[3].is_nan());
        assert_eq!(out[4..], [3.5, f32::MAX]);
    }

    #[test]
    fn the_magnitude_is_taken_before_rounding() {
        let bytes = floats(&[3.0, 4.0, 0.0, 3e38, 3e38, 3e38, f64::INFINITY, 1.0, 1.0]);
        let mut out = Vec::new();
        assert_eq!(view(&bytes).magnitude(3, &mut out), 1, "sqrt(3) * 3e38 is beyond f32");
        assert_eq!(out, [5.0, f32::INFINITY, f32::INFINITY]);
    }

    #[test]
    fn words_of_ascii_arrays_are_read_by_type() {
        assert_eq!(parse_ascii(Number::Int8, b" 1 -128\n127 ").as_deref(), Ok(&[1, 0x80, 0x7f][..]));
        assert!(parse_ascii(Number::Int8, b"128").is_err());
        assert!(parse_ascii(Number::UInt64, b"-1").is_err());
        assert!(parse_ascii(Number::Float32, b"1.5abc").is_err_and(|e| e.contains("1.5abc")));
        let bytes = parse_ascii(Number::Float32, b"nan -NaN -nan(ind) inf -inf 1e-45").expect("all are numbers");
        let mut out = Vec::new();
        Values { number: Number::Float32, big_endian: false, bytes: &bytes }.component(1, 0, &mut out);
        assert!(out[..3].iter().all(|v| v.is_nan()));
        assert_eq!(out[3..], [f32::INFINITY, f32::NEG_INFINITY, f32::from_bits(1)]);
    }

    #[test]
    fn negative_numbers_and_floats_are_no_indices() {
        let bytes = [1i16.to_le_bytes(), (-2i16).to_le_bytes()].concat();
        assert_eq!(Values { number: Number::Int16, big_endian: false, bytes: &bytes }.to_indices(), Err(1));
        assert_eq!(view(&floats(&[1.0])).to_indices(), Err(0));
        assert_eq!(Values { number: Number::UInt16, big_endian: true, bytes: &[1, 2] }.to_indices(), Ok(vec![258]));
    }
}
