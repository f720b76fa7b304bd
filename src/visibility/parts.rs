//! Work on lists in chunks of a fixed size, so that no result depends on the number of threads.

/// Ids per task; a multiple of 64, the ids in a word of a set.
pub(super) const CHUNK: usize = 1 << 16;

/// Fills chunks of `out` in parallel: chunk i ends at `ends[i]`, and begins where the one before it ends. `first` is the number of the
/// first chunk and `begin` its start; both are 0 for the whole list.
pub(super) fn fill_parts<T: Send>(out: &mut [T], ends: &[u32], fill: &(impl Fn(usize, &mut [T]) + Sync)) {
    fill_from(out, ends, [0, 0], fill);
}

fn fill_from<T: Send>(
    out: &mut [T],
    ends: &[u32],
    [first, begin]: [usize; 2],
    fill: &(impl Fn(usize, &mut [T]) + Sync),
) {
    match ends {
        [] => {}
        [_] => fill(first, out),
        _ => {
            let (left, right) = ends.split_at(ends.len() / 2);
            let middle = left.last().map_or(begin, |&end| end as usize);
            let (start, rest) = out.split_at_mut(middle - begin);
            rayon::join(
                || fill_from(start, left, [first, begin], fill),
                || fill_from(rest, right, [first + left.len(), middle], fill),
            );
        }
    }
}
