//! Short vectors for the search, in tiles of 16, component by component.

/// Vectors of a tile: one instruction of the search works on the same component of several of them.
pub(super) const LANES: usize = 16;

/// `count` vectors of `dims` components: tile after tile, in a tile component after component, for each component the 16 vectors. Lanes
/// behind the last vector are zero.
#[derive(Clone, Debug)]
pub(super) struct Tiles {
    pub(super) dims: usize,
    pub(super) count: usize,
    pub(super) data: Vec<f32>,
}

impl Tiles {
    /// `count` zero vectors.
    pub(super) fn new(dims: usize, count: usize) -> Self {
        Self { dims, count, data: vec![0.0; count.div_ceil(LANES) * dims * LANES] }
    }

    /// Numbers in a tile.
    pub(super) fn tile_len(&self) -> usize {
        self.dims * LANES
    }

    /// Component `dim` of a vector.
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
