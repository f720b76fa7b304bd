//! Tuples of numbers, one for each point or cell, or one for all.

/// Tuples of `components` numbers one after the other.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Values {
    pub(super) components: usize,
    pub(super) data: Vec<f64>,
    /// Whether there is one tuple, for all points or cells.
    pub(super) is_constant: bool,
}

impl Values {
    pub(super) fn constant(value: f64) -> Self {
        Self { components: 1, data: vec![value], is_constant: true }
    }

    pub(super) fn of(components: usize, data: Vec<f64>) -> Self {
        Self { components, data, is_constant: false }
    }

    /// Tuple `i`, or that of all.
    pub(super) fn tuple(&self, i: usize) -> &[f64] {
        let i = if self.is_constant { 0 } else { i };
        &self.data[i * self.components..][..self.components]
    }

    fn tuples(&self) -> usize {
        self.data.len() / self.components
    }

    /// A function of each number.
    pub(super) fn map(mut self, f: impl Fn(f64) -> f64) -> Self {
        self.data.iter_mut().for_each(|value| *value = f(*value));
        self
    }

    /// A function of each tuple, which appends `components` numbers.
    pub(super) fn map_tuples(&self, components: usize, f: impl Fn(&[f64], &mut Vec<f64>)) -> Self {
        let mut data = Vec::with_capacity(self.tuples() * components);
        self.data.chunks_exact(self.components).for_each(|tuple| f(tuple, &mut data));
        Self { components, data, is_constant: self.is_constant }
    }

    /// A function of the tuples of several, which appends `components` numbers.
    pub(super) fn join<const N: usize>(
        of: [&Self; N],
        components: usize,
        f: impl Fn([&[f64]; N], &mut Vec<f64>),
    ) -> Self {
        let is_constant = of.iter().all(|values| values.is_constant);
        let tuples =
            of.iter().filter(|values| is_constant || !values.is_constant).map(|v| v.tuples()).min().unwrap_or(0);
        let mut data = Vec::with_capacity(tuples * components);
        (0..tuples).for_each(|i| f(of.map(|values| values.tuple(i)), &mut data));
        Self { components, data, is_constant }
    }

    /// A function of each number of one with that of the other; a single one is paired with all of a tuple.
    pub(super) fn pair(&self, other: &Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let components = self.components.max(other.components);
        Self::join([self, other], components, |[a, b], out| {
            out.extend((0..components).map(|c| f(a[c % a.len()], b[c % b.len()])));
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_is_paired_with_all_of_a_tuple_and_one_tuple_with_all() {
        let vectors = Values::of(2, vec![1.0, 2.0, 3.0, 4.0]);
        let scalars = Values::of(1, vec![10.0, 20.0]);
        let product = scalars.pair(&vectors, |a, b| a * b);
        assert_eq!(product, Values::of(2, vec![10.0, 20.0, 60.0, 80.0]));
        assert_eq!(Values::constant(2.0).pair(&scalars, |a, b| a - b), Values::of(1, vec![-8.0, -18.0]));
        assert!(Values::constant(2.0).pair(&Values::constant(3.0), |a, b| a + b).is_constant);
        let norm = vectors.map_tuples(1, |t, out| out.push(t[0].hypot(t[1])));
        assert_eq!((norm.components, norm.data[1]), (1, 5.0));
        assert_eq!(vectors.map(|v| -v).tuple(1), [-3.0, -4.0]);
    }
}
