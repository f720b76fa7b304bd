//! Icons of the user's: grey pictures that are periodic both ways.

use super::icon::{IconSums, TEXELS};
use crate::error::{FileError, FileResult};
use crate::image::read_grey_png;
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::path::Path;
use std::sync::OnceLock;

/// A grey picture as a pattern of splats, of 64 x 64 texels. Two are the same if their texels are, wherever they come from.
#[derive(Debug, Deserialize)]
#[serde(try_from = "Vec<Vec<u16>>")]
pub struct Picture {
    /// Rows across the flow, in each the texels along: levels of which 65,535 is 1.
    texels: Vec<Vec<u16>>,
    sums: OnceLock<IconSums>,
}

impl PartialEq for Picture {
    fn eq(&self, other: &Self) -> bool {
        self.texels == other.texels
    }
}

impl Eq for Picture {}

impl Serialize for Picture {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.texels.serialize(serializer)
    }
}

impl TryFrom<Vec<Vec<u16>>> for Picture {
    type Error = Unfit;

    fn try_from(texels: Vec<Vec<u16>>) -> Result<Self, Unfit> {
        if texels.len() != TEXELS || texels.iter().any(|row| row.len() != TEXELS) {
            let problem = format!("a picture is no {TEXELS} rows of {TEXELS} texels");
            return Err(Unfit { place: "texels", problem, remedy: "read it from its file" });
        }
        if texels.iter().flatten().all(|&level| level == 0) {
            let problem = "the picture is black: no pattern would be seen".to_owned();
            return Err(Unfit { place: "all pixels", problem, remedy: "draw the pattern in white on black" });
        }
        let columns = (0..TEXELS).map(|column| texels.iter().map(|row| row[column]).collect()).collect::<Vec<_>>();
        check_seam("left and right edges", &texels)?;
        check_seam("top and bottom edges", &columns)?;
        Ok(Self { texels, sums: OnceLock::new() })
    }
}

/// Refuses lines of texels whose largest step from their ends to their beginnings is larger than any inside.
fn check_seam(place: &'static str, lines: &[Vec<u16>]) -> Result<(), Unfit> {
    let steps = |texels: &[u16]| texels.windows(2).map(|pair| pair[0].abs_diff(pair[1])).max();
    let inside = lines.iter().filter_map(|line| steps(line)).max().unwrap_or(0);
    let across = lines.iter().map(|line| line[line.len() - 1].abs_diff(line[0])).max().unwrap_or(0);
    if across <= inside {
        return Ok(());
    }
    let [across, inside] = [across, inside].map(|step| f64::from(step) / f64::from(u16::MAX));
    let problem = format!(
        "the picture is not periodic: from one edge to the other it steps by {across:.3} of white, and by {inside:.3} at most inside"
    );
    Err(Unfit { place, problem, remedy: "draw it as a tile that goes on where it ends" })
}

/// Why texels are no picture.
#[derive(Debug)]
pub struct Unfit {
    place: &'static str,
    problem: String,
    remedy: &'static str,
}

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}; {}", self.place, self.problem, self.remedy)
    }
}

impl Picture {
    /// Reads a grey PNG, as it is seen where the flow goes to the right: of 64 x 64 pixels, or of multiples of these, which are averaged.
    ///
    /// # Errors
    /// If the file is no such PNG, has colours or alpha, is black, or is not periodic: its largest step across the border, to the right or
    /// downwards, must be no larger than its largest step inside.
    pub fn read(path: &Path) -> FileResult<Self> {
        let image = read_grey_png(path)?;
        let (width, height) = (image.width, image.height);
        if [width, height].iter().any(|&pixels| pixels == 0 || pixels % TEXELS != 0) {
            let problem = format!("{width} x {height} pixels are no whole number for each texel of an icon");
            let remedy = format!("scale it to {TEXELS} x {TEXELS} pixels, or to multiples of these");
            return Err(FileError::unsupported(path, "header", problem).remedy(remedy));
        }
        let (wide, high) = (width / TEXELS, height / TEXELS);
        let texel = |row: usize, column: usize| {
            let rows = image.pixels.chunks_exact(width).skip(row * high).take(high);
            let sum: u64 = rows.flat_map(|row| &row[column * wide..][..wide]).map(|&level| u64::from(level)).sum();
            let count = (wide * high) as u64;
            // The nearest level, which is no larger than the largest one.
            ((sum + count / 2) / count) as u16
        };
        // Across the flow is upwards where it goes to the right.
        let texels = (0..TEXELS).rev().map(|row| (0..TEXELS).map(|column| texel(row, column)).collect());
        let unfit = |Unfit { place, problem, remedy }| FileError::invalid(path, place, problem).remedy(remedy);
        Self::try_from(texels.collect::<Vec<_>>()).map_err(unfit)
    }

    /// The texels, 0 to 1: rows across, in each the texels along.
    pub(in crate::render) fn texels(&self) -> Vec<[f64; TEXELS]> {
        let row = |row: &Vec<u16>| std::array::from_fn(|column| f64::from(row[column]) / f64::from(u16::MAX));
        self.texels.iter().map(row).collect()
    }

    /// Its running sums, made when it is first drawn.
    pub(super) fn sums(&self) -> &IconSums {
        self.sums.get_or_init(|| {
            let texels = self.texels();
            let whole = texels.iter().flatten().sum::<f64>() / (TEXELS * TEXELS) as f64;
            IconSums::make(&texels, whole)
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::lanes::LANES;
    use super::*;
    use png::{BitDepth, ColorType};

    /// Writes a grey PNG by the levels of its pixels, columns and rows from the top left.
    fn write(path: &Path, size: [u32; 2], depth: BitDepth, level: impl Fn(u32, u32) -> u16) {
        let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), size[0], size[1]);
        encoder.set_color(ColorType::Grayscale);
        encoder.set_depth(depth);
        let levels = (0..size[1]).flat_map(|row| (0..size[0]).map(move |column| (column, row)));
        let levels = levels.map(|(column, row)| level(column, row));
        let bytes: Vec<u8> = match depth {
            BitDepth::Sixteen => levels.flat_map(u16::to_be_bytes).collect(),
            _ => levels.map(|level| level as u8).collect(),
        };
        encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
    }

    /// Waves that go on over both borders, different to the right and downwards.
    pub(in crate::render::flow) fn waves() -> Picture {
        let level = |row: usize, column: usize| ((3 * column + 5 * row) % 16 * 4000) as u16;
        Picture::try_from((0..64).map(|row| (0..64).map(|column| level(row, column)).collect()).collect::<Vec<_>>())
            .unwrap()
    }

    fn wave(column: u32, row: u32) -> u16 {
        ((column + 2 * row) % 16 * 15) as u16
    }

    #[test]
    fn a_picture_is_read_as_it_is_seen_where_the_flow_goes_to_the_right() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("icon.png");
        write(&path, [64, 64], BitDepth::Eight, wave);
        let small = Picture::read(&path).unwrap();
        let texels = small.texels();
        for (row, column) in [(0, 0), (1, 0), (0, 5), (63, 63)] {
            let seen = f64::from(wave(column, 63 - row)) / 255.0;
            assert!((texels[row as usize][column as usize] - seen).abs() < 1e-15);
        }
        let mean = texels.iter().flatten().sum::<f64>() / 4096.0;
        assert!((small.sums().whole() - mean).abs() < 1e-15 && mean > 0.1, "{mean}");
        // A sum of 64 means below 1, rounded to f32: 2^-19 at most, over 64 texels.
        let all = small.sums().means(&[0.3; LANES], &[0.7; LANES], 1.0, 6)[0];
        assert!((f64::from(all) - mean).abs() < 3e-8 + 2.0 * f64::from(f32::EPSILON) * mean, "{all} {mean}");
        // Larger ones are averaged over boxes of pixels: 2 x 3 of them here, of which each has its own level.
        write(&path, [128, 192], BitDepth::Sixteen, |column, row| {
            257 * wave(column / 2, row / 3) + (column % 2 * 300 + row % 3 * 100) as u16
        });
        let large = Picture::read(&path).unwrap();
        let level = |of: &Picture, row: usize, column: usize| i32::from(of.texels[row][column]);
        let places = (0..64).flat_map(|row| (0..64).map(move |column| (row, column)));
        assert!(places.clone().all(|(row, column)| level(&large, row, column) - level(&small, row, column) == 250));
        assert!(large != small && large == Picture::read(&path).unwrap());
    }

    #[test]
    fn what_is_no_tile_is_refused_with_place_and_remedy() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("icon.png");
        let refused = |parts: &[&str]| {
            let error = Picture::read(&path).unwrap_err().to_string();
            assert!(parts.iter().all(|part| error.contains(part)) && error.contains("icon.png"), "{error}");
        };
        write(&path, [64, 96], BitDepth::Eight, wave);
        refused(&["64 x 96", "64 x 64"]);
        write(&path, [64, 64], BitDepth::Eight, |_, _| 0);
        refused(&["black", "white on black"]);
        // A ramp to the right, then one downwards: only one step is larger than those inside.
        write(&path, [64, 64], BitDepth::Eight, |column, _| 2 * column as u16);
        refused(&["left and right edges", "0.494", "0.008", "tile"]);
        write(&path, [64, 64], BitDepth::Eight, |_, row| 2 * row as u16);
        refused(&["top and bottom edges", "0.494", "tile"]);
        // A step of 100 levels inside, and one as large at the border; then one that is larger by a level.
        write(&path, [64, 64], BitDepth::Eight, |column, _| 100 * u16::from(column > 31));
        assert!(Picture::read(&path).is_ok());
        write(&path, [64, 64], BitDepth::Eight, |column, _| if column > 31 { 101 } else { u16::from(column > 0) });
        refused(&["left and right edges", "0.396", "0.392"]);
    }

    #[test]
    fn the_text_of_a_picture_is_that_of_its_texels_and_bad_ones_are_refused() {
        let waves = waves();
        let text = serde_json::to_string(&waves).unwrap();
        assert!(serde_json::from_str::<Picture>(&text).unwrap() == waves);
        let ramp = serde_json::to_string(&vec![(0..64).collect::<Vec<u16>>(); 64]).unwrap();
        let small = serde_json::to_string(&[[7; 32]; 32]).unwrap();
        for bad in ["[]".to_owned(), text.replacen("[0,", "[", 1), small, ramp] {
            assert!(serde_json::from_str::<Picture>(&bad).is_err(), "{}", &bad[..bad.len().min(40)]);
        }
    }
}
