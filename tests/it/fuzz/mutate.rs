//! Changes of inputs, each from a seed: what a fuzzer does, without one.

use crate::meshes::noise;

/// Numbers from a seed.
pub struct Random {
    seed: u64,
    drawn: u64,
}

impl Random {
    pub fn new(seed: u64) -> Self {
        Self { seed, drawn: 0 }
    }

    fn next(&mut self) -> u64 {
        self.drawn += 1;
        // 53 bits.
        ((noise(self.seed, self.drawn) + 1.0) * (1_u64 << 52) as f64) as u64
    }

    /// A number below `n`, which is not 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }
}

/// Bytes at which readers of numbers and of texts go astray.
const BYTES: [u8; 16] = [0, 1, 2, 4, 0x10, 0x40, 0x7f, 0x80, 0xfe, 0xff, b'0', b'9', b'-', b'"', b'<', b'\n'];

/// Integers at which lengths and offsets go astray, written in 1, 2, 4 or 8 bytes of either order.
const INTEGERS: [u64; 14] = [
    0,
    1,
    3,
    0x7f,
    0xff,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0001,
    u64::MAX / 8,
    u64::MAX >> 1,
    u64::MAX,
];

/// Numbers as texts have them.
const NUMBERS: [&str; 20] = [
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "7",
    "255",
    "65536",
    "2147483648",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "99999999999999999999999",
    "1e999",
    "-1e308",
    "1e-320",
    "nan",
    "inf",
    "0.1",
];

/// One input changed in one to four ways; `other` is a further input to take parts from.
pub fn mutated(input: &[u8], other: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for _ in 0..=random.below(4) {
        change(&mut bytes, other, random);
    }
    bytes
}

fn change(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    if bytes.is_empty() {
        bytes.extend(&other[..random.below(other.len() + 1)]);
        return;
    }
    let at = place(bytes, random);
    match random.below(12) {
        0 | 1 => bytes[at] ^= 1 << random.below(8),
        2 | 3 => bytes[at] = BYTES[random.below(BYTES.len())],
        4 => bytes.truncate(at),
        5 => drop(bytes.drain(at..(at + length(random)).min(bytes.len()))),
        6 => {
            let part = bytes[at..(at + length(random)).min(bytes.len())].to_vec();
            let to = random.below(bytes.len());
            bytes.splice(to..to, part);
        }
        7 => splice(bytes, at, other, random),
        8 | 9 => replace_number(bytes, at, random),
        _ => set_integer(bytes, at, random),
    }
}

/// Anywhere, or anywhere in one of the lines of a text: an input of a few long and many short parts is changed in all of them.
fn place(bytes: &[u8], random: &mut Random) -> usize {
    let at = random.below(bytes.len());
    if random.below(2) == 0 {
        return at;
    }
    // The files of an archive are as likely as each other.
    let marks: Vec<usize> = (0..bytes.len()).filter(|&i| bytes[i..].starts_with(b"@@@ ")).collect();
    if marks.is_empty() {
        return at;
    }
    let file = random.below(marks.len());
    let end = marks.get(file + 1).copied().unwrap_or(bytes.len());
    marks[file] + random.below(end - marks[file])
}

/// Mostly a few bytes, sometimes many.
fn length(random: &mut Random) -> usize {
    let most = [4, 16, 64, 1024][random.below(4)];
    1 + random.below(most)
}

fn splice(bytes: &mut Vec<u8>, at: usize, other: &[u8], random: &mut Random) {
    if other.is_empty() {
        return;
    }
    let from = random.below(other.len());
    let part = other[from..(from + length(random)).min(other.len())].to_vec();
    let end = if random.below(2) == 0 { at } else { (at + part.len()).min(bytes.len()) };
    bytes.splice(at..end, part);
}

/// Another number in place of the next one in a text.
fn replace_number(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let is_of_number = |b: u8| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+' | b'e');
    let Some(begin) = (at..bytes.len()).find(|&i| bytes[i].is_ascii_digit()) else {
        bytes[at] = BYTES[random.below(BYTES.len())];
        return;
    };
    let end = (begin..bytes.len()).find(|&i| !is_of_number(bytes[i])).unwrap_or(bytes.len());
    bytes.splice(begin..end, NUMBERS[random.below(NUMBERS.len())].bytes());
}

fn set_integer(bytes: &mut [u8], at: usize, random: &mut Random) {
    let value = INTEGERS[random.below(INTEGERS.len())];
    let width = [1, 2, 4, 8][random.below(4)].min(bytes.len() - at);
    let little = value.to_le_bytes();
    let big_endian = random.below(4) == 0;
    for i in 0..width {
        bytes[at + i] = if big_endian { little[width - 1 - i] } else { little[i] };
    }
}
