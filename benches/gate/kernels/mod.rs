//! The kernels whose instructions are counted: set-up and counted work of each.
//!
//! Everything runs on the main thread, since callgrind's switch is per thread: rayon has one thread, the main one, and kernels use no part
//! of the library that starts threads (`counts.rs` checks for others).

mod codec;
mod files;
mod render;
mod transfer;
mod visibility;

pub use codec::vq_block;

use crate::{Trouble, Verdict};
use std::error::Error;
use std::hint::black_box;
use std::path::Path;

/// The counted work of a kernel.
type Work = Box<dyn FnMut() -> Result<(), Box<dyn Error>>>;

/// A kernel.
pub struct Kernel {
    /// Name in the baseline, and of the place that slows it down.
    pub name: &'static str,
    /// Prepares the work, in an empty folder.
    set_up: fn(&Path) -> Result<Work, Box<dyn Error>>,
}

/// All kernels, slowest first.
pub const KERNELS: [Kernel; 16] = [
    Kernel { name: "lod_selection", set_up: visibility::lod_selection },
    Kernel { name: "radix_sort", set_up: visibility::radix_sort },
    Kernel { name: "active_cells", set_up: visibility::active_cells },
    Kernel { name: "faces", set_up: render::faces },
    Kernel { name: "raster", set_up: render::raster },
    Kernel { name: "entries", set_up: render::entries },
    Kernel { name: "walk", set_up: render::walk },
    Kernel { name: "walk_portable", set_up: render::walk_portable },
    Kernel { name: "decode_vq", set_up: codec::decode_vq },
    Kernel { name: "encode_vq", set_up: codec::encode_vq },
    Kernel { name: "read_vtu", set_up: files::read_vtu },
    Kernel { name: "read_xdmf", set_up: files::read_xdmf },
    Kernel { name: "store_chunk", set_up: codec::store_chunk },
    Kernel { name: "decode_raw", set_up: codec::decode_raw },
    Kernel { name: "node_table", set_up: transfer::node_table },
    Kernel { name: "ensemble", set_up: transfer::ensemble },
];

/// The names of all kernels.
pub fn names() -> Vec<&'static str> {
    KERNELS.iter().map(|kernel| kernel.name).collect()
}

/// Whether pulp selects AVX2 as the widest vectors on this processor.
fn widest_is_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return matches!(pulp::Arch::new(), pulp::Arch::V3(_));
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Runs a kernel once, under valgrind.
///
/// # Errors
/// If there is no such kernel or it fails, or valgrind's processor has no AVX2.
pub fn run(name: &str, folder: &Path) -> Verdict {
    if !widest_is_avx2() {
        return Err(Trouble(
            "counts are those of AVX2, which this processor does not have (or valgrind does not know)".to_owned(),
        ));
    }
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    let kernel = KERNELS.iter().find(|kernel| kernel.name == name).ok_or(format!("there is no kernel '{name}'"))?;
    let mut work = (kernel.set_up)(folder)?;
    let mut result = Ok(());
    counted_by_callgrind(&mut || result = work());
    result?;
    Ok(true)
}

/// The function whose instructions are counted, with its callees. Its name is also in `counts.rs`. It is not generic: its name is unique,
/// and callgrind's switch turns on and off once.
#[inline(never)]
fn counted_by_callgrind(work: &mut dyn FnMut()) {
    work();
    // Prevents a tail call.
    black_box(());
}
