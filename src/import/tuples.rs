//! Arrays of tuples from files that have their components one after the other.

use super::numbers::{Number, Numbers};

/// Tuples that are filled component by component.
pub(super) struct Tuples {
    pub(super) numbers: Numbers,
    width: usize,
}

impl Tuples {
    /// Tuples of zeros, of this many components.
    pub(super) fn new(width: usize, tuples: usize, is_f32: bool) -> Self {
        let number = if is_f32 { Number::Float32 } else { Number::Float64 };
        let bytes = vec![0; number.size() * width * tuples];
        Self { numbers: Numbers { number, big_endian: false, bytes }, width }
    }

    /// Sets a component of the tuples from the first one on.
    pub(super) fn put(&mut self, component: usize, first: usize, values: impl IntoIterator<Item = f64>) {
        let size = self.numbers.number.size();
        let tuples = self.numbers.bytes.chunks_exact_mut(size * self.width).skip(first);
        for (tuple, value) in tuples.zip(values) {
            let place = &mut tuple[component * size..(component + 1) * size];
            match self.numbers.number {
                Number::Float32 => place.copy_from_slice(&(value as f32).to_le_bytes()),
                _ => place.copy_from_slice(&value.to_le_bytes()),
            }
        }
    }
}
