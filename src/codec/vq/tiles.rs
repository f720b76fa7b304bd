//! Vectors for the search: many of few numbers, in tiles of 16, number by number.

/// Vectors that lie side by side: one instruction of the search works on the same number of several of them.
pub(super) const LANES: usize = 16;

/// `count` vectors of `dims` numbers: tile after tile, in a tile number after number, for each number the 16 vectors.
/// Lanes behind the last vector are zero.
#[derive(Clone, Debug)]
pub(super) struct Tiles {
    pub(super) dims: usize,
    pub(super) count: usize,
    pub(super) data: Vec<f32>,
}

impl Tiles {
    /// Vectors of zeros.
    pub(super) fn new(dims: usize, count: usize) -> Self {
        Self { dims, count, data: vec![0.0; count.div_ceil(LANES) * dims * LANES] }
    }

    /// Numbers of a tile.
    pub(super) fn tile_len(&self) -> usize {
        self.dims * LANES
    }

    /// Number `dim` of a vector.
    pub(super) fn get(&self, vector: usize, dim: usize) -> f32 {
        self.data[(vector / LANES * self.dims + dim) * LANES + vector % LANES]
    }

    /// The vectors `chosen`, in that order.
    pub(super) fn select(&self, chosen: &[u32]) -> Self {
        let mut out = Self::new(self.dims, chosen.len());
        for (i, &vector) in chosen.iter().enumerate() {
            for dim in 0..self.dims {
                out.data[(i / LANES * self.dims + dim) * LANES + i % LANES] = self.get(vector as usize, dim);
            }
        }
        out
    }
}
