// Layout of the numbers of splats by tiles: where those of each tile end, the total, the length of the longest list; then the numbers.

const BINS_HEAD: u32 = 2u;
