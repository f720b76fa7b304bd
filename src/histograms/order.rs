//! An order of steps from coarse to fine.

/// Steps that are read first, wherever they are: both ends and an even division of the series into 32 parts.
const COARSE: usize = 33;

/// At most `most` of `count` steps, spread over all: both ends, the middle, the quarters, and so on (van der Corput's sequence), so that each
/// prefix of 2^k + 1 steps divides the series evenly. Of a codec with `block` steps in a block, those after the first 33 are grouped by
/// blocks, each of which is then read once more; blocks come in the order of their first steps.
pub fn spread(count: usize, block: usize, most: usize) -> Vec<usize> {
    let mut order = divisions(count);
    order.truncate(most);
    let fine = order.split_off(COARSE.min(order.len()));
    let block = block.max(1);
    let (mut places, mut blocks) = (vec![None; count.div_ceil(block)], Vec::<Vec<usize>>::new());
    for step in fine {
        let place = *places[step / block].get_or_insert(blocks.len());
        if place == blocks.len() {
            blocks.push(Vec::new());
        }
        blocks[place].push(step);
    }
    blocks.iter_mut().for_each(|steps| steps.sort_unstable());
    order.extend(blocks.into_iter().flatten());
    order
}

/// Whether this many steps, the first ones of [`spread`], divide a series evenly: 3, 5, 9, 17 ...
pub fn divides_evenly(steps: usize) -> bool {
    steps > 2 && (steps - 1).is_power_of_two()
}

/// All numbers below `count`: the ends, then the points that halve all intervals, again and again; those of one round in bit-reversed order.
fn divisions(count: usize) -> Vec<usize> {
    let Some(last) = count.checked_sub(1) else { return Vec::new() };
    let parts = last.max(1).next_power_of_two();
    let bits = parts.trailing_zeros();
    let reversed = |i: usize| if bits == 0 { i } else { i.reverse_bits() >> (usize::BITS - bits) };
    // Below the number of steps: wider numbers only for the product.
    let point = |i: usize| ((reversed(i) as u128 * last as u128) >> bits) as usize;
    let mut is_seen = vec![false; count];
    let all = [0, last].into_iter().chain((1..parts).map(point));
    all.filter(|&step| !std::mem::replace(&mut is_seen[step], true)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_step_is_there_once_and_of_very_many_an_even_choice() {
        for steps in [1, 2, 3, 31, 32, 33, 34, 64, 65, 500, 513, 1000, 1024] {
            for block in [1, 64] {
                let all: BTreeSet<usize> = spread(steps, block, 1024).into_iter().collect();
                let found = (spread(steps, block, 1024).len(), all.len(), all.last().copied());
                assert_eq!(found, (steps, steps, Some(steps - 1)));
            }
        }
        for steps in [1025, 5000, 100_000] {
            let all: BTreeSet<usize> = spread(steps, 64, 1024).into_iter().collect();
            assert_eq!((spread(steps, 64, 1024).len(), all.len()), (1024, 1024));
            let all: Vec<usize> = all.into_iter().collect();
            let widest = all.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
            // One point is missing to intervals of (steps - 1) / 1024, rounded.
            assert!((all[0], all[1023]) == (0, steps - 1) && widest <= 2 * steps.div_ceil(1024), "{steps}: {widest}");
        }
        assert!(spread(0, 64, 1024).is_empty() && spread(9, 0, 0).is_empty());
    }

    #[test]
    fn the_first_are_both_ends_the_middle_and_the_quarters() {
        assert_eq!(spread(9, 1, 9), [0, 8, 4, 2, 6, 1, 5, 3, 7]);
        assert_eq!(spread(5, 1, 5), [0, 4, 2, 1, 3]);
        assert_eq!(spread(2, 1, 2), [0, 1]);
        for steps in [514, 1000, 1025] {
            for parts in [2, 4, 8, 16, 32] {
                let mut first = spread(steps, 64, steps)[..=parts].to_vec();
                first.sort_unstable();
                let even: Vec<usize> = (0..=parts).map(|i| i * (steps - 1) / parts).collect();
                assert_eq!(first, even);
                assert!(divides_evenly(first.len()));
            }
        }
    }

    #[test]
    fn after_the_first_each_block_is_read_once() {
        let order = spread(1000, 64, 1000);
        let changes = order[COARSE..].windows(2).filter(|pair| pair[0] / 64 != pair[1] / 64).count();
        assert_eq!(changes + 1, 1000_usize.div_ceil(64));
        let changes = spread(1000, 1, 1000).windows(2).filter(|pair| pair[0] / 64 != pair[1] / 64).count();
        assert!(changes > 900, "the test can fail");
    }
}
