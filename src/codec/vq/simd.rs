//! Loops compiled for several instruction sets; the widest that the processor has is chosen at run time.
//!
//! All versions have one source: wider registers only hold more of the same lanes, and no compiler here contracts a multiplication and an
//! addition to one. The bits are the same on every machine; a test compares.

use pulp::NullaryFnOnce;
#[cfg(test)]
use pulp::Simd;

/// Runs `work` compiled for the widest registers. Only what is inlined into its `call` is compiled for them.
#[inline(always)]
pub(super) fn widest<W: NullaryFnOnce>(work: W) -> W::Output {
    pulp::Arch::new().dispatch(work)
}

/// Runs `work` compiled for every processor.
#[cfg(test)]
pub(super) fn portable<W: NullaryFnOnce>(work: W) -> W::Output {
    pulp::Scalar.vectorize(work)
}
