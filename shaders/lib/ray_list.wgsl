// The rays that contrast asks for, and how far they are: one buffer, since the walk has no binding left for two. The Rust twin is
// `RayLists` in src/render/gpu/layout.rs.
//
// A step looks at the blocks of a stride, and appends rays at half of it to the list: 1 is about blocks of 16 pixels, all of which are
// split, 2 of 8, 3 of 4 and 4 of 2. The list holds the rays of all steps, one step behind the other; within a step their order depends
// on the scheduling of threads, and nothing depends on it.

// Words of the head.
// Rays in the list, those of them that have been counted by level, and those that the walk has been given.
const LISTED: u32 = 0u;
const COUNTED: u32 = 1u;
const CAST: u32 = 2u;
// The last step, and whether the walk has been given its rays.
const STEP: u32 = 3u;
const IS_DONE: u32 = 4u;
// The first ray of a dispatch of the walk.
const FIRST: u32 = 5u;
// Pairs of tile and item that there should be room for.
const PAIRS: u32 = 6u;
// Workgroups of the walk that a slice may still start, and those that it has started.
const GROUPS_LEFT: u32 = 7u;
const GROUPS_DONE: u32 = 8u;
// Rays by level; blocks that are split by their reasons, and those that are filled.
const RAYS_BY_LEVEL: u32 = 9u;
const BLOCKS: u32 = 13u;
// Sums of the counters of the walk, each of two words, the lower one first.
const SUMS: u32 = 18u;

// Steps that there are.
const LAST_STEP: u32 = 4u;

// Rays of a workgroup of the walk.
const GROUP_RAYS: u32 = 256u;
