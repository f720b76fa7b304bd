//! Checks that there is memory for images of a size, before rendering.

/// Bytes per pixel of a frame: accumulators and depth.
const FRAME: u64 = (size_of::<[f32; 4]>() + size_of::<f32>()) as u64;
/// Bytes per pixel of a file being written: an EXR has its planes once as numbers and once encoded; others take less.
const FILE: u64 = 2 * FRAME;
/// Largest number of frames being rendered, and of copies waiting to be written.
const IN_THE_MAKING: usize = 4;
const TO_BE_WRITTEN: usize = 3;

/// Checks that this many frames of a width and height in pixels fit into the free memory.
///
/// # Errors
/// If they do not.
#[cfg(feature = "cli")]
pub fn check_memory(size_px: (usize, usize), frames: usize) -> Result<(), String> {
    use sysinfo::{MemoryRefreshKind, RefreshKind, System};
    let of_memory = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    // If the system does not report its memory, allocation may fail later.
    let Ok(system) = System::new_with_specifics(of_memory) else { return Ok(()) };
    // The page cache in a control group's usage can be freed.
    let of_group = system.cgroup_limits().map_or(u64::MAX, |limits| limits.total_memory);
    check_against(size_px, frames, system.available_memory().min(of_group))
}

/// Checks nothing: without the command line there is nothing to ask for the free memory.
///
/// # Errors
/// None.
#[cfg(not(feature = "cli"))]
pub fn check_memory(size_px: (usize, usize), frames: usize) -> Result<(), String> {
    check_against(size_px, frames, u64::MAX)
}

/// Like [`check_memory`], with this many bytes free.
fn check_against((width, height): (usize, usize), frames: usize, free: u64) -> Result<(), String> {
    let per_pixel = FRAME * (frames.min(IN_THE_MAKING) + frames.min(TO_BE_WRITTEN)) as u64 + FILE;
    let needed = (width as u64).saturating_mul(height as u64).saturating_mul(per_pixel);
    let side = ((free / per_pixel) as f64).sqrt() as u64;
    if needed <= free {
        return Ok(());
    }
    Err(format!(
        "--size {width}x{height} takes {:.1} GB of memory, and {:.1} GB are free; with {side}x{side} pixels it fits",
        needed as f64 / 1e9,
        free as f64 / 1e9,
    ))
}

#[cfg(test)]
mod tests {
    use super::super::parse_size;
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_with_the_number_and_what_is_named_instead_fits() {
        const GB: u64 = 1_000_000_000;
        let error = check_against((20_000, 20_000), 1, 16 * GB).unwrap_err();
        assert!(error.contains("--size 20000x20000 takes 32.0 GB") && error.contains("16.0 GB are free"), "{error}");
        let fits = error.split("with ").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
        check_against(parse_size(fits).unwrap(), 1, 16 * GB).unwrap();
        check_against((20_000, 20_000), 1, 33 * GB).unwrap();
        check_against((20_000, 20_000), 2, 33 * GB).unwrap_err();
        check_against((1024, 768), 1_000_000, GB).unwrap();
        check_against((32_768, 32_768), usize::MAX, u64::MAX).unwrap();
        check_memory((16, 16), 1).unwrap();
    }
}
