//! One-pass statistics of a series: ranges, mean and variance.
