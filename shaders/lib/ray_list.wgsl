// List and progress of adaptively cast rays, in one buffer, since the walk has no binding left for two. The Rust twin is `RayLists`
// in src/render/gpu/layout.rs.
//
// A step tests the blocks of a stride, and appends rays at half of it to the list: step 1 has blocks of 16 pixels, all of which are
// split, 2 of 8, 3 of 4 and 4 of 2. The list holds the rays of all steps, one step behind the other; within a step their order depends
// on the scheduling of threads, and no result depends on it.

// Words of the head.
// Numbers of rays in the list, of rays counted by level, and of rays given to the walk.
const LISTED: u32 = 0u;
const COUNTED: u32 = 1u;
const CAST: u32 = 2u;
// The last step, and whether the walk has been given its rays.
const STEP: u32 = 3u;
const IS_DONE: u32 = 4u;
// The first ray of a dispatch of the walk.
const FIRST: u32 = 5u;
// Pairs of tile and item found, stored or not.
const PAIRS: u32 = 6u;
// Workgroups of the walk that the slice may still start, and those that it has started.
const GROUPS_LEFT: u32 = 7u;
const GROUPS_DONE: u32 = 8u;
// Rays by level (four words); blocks split, by reason (four words), and blocks filled.
const RAYS_BY_LEVEL: u32 = 9u;
const BLOCKS: u32 = 13u;
// Sums of the counters of the walk, each of two words, the lower one first.
const SUMS: u32 = 18u;

// Number of the last step.
const LAST_STEP: u32 = 4u;

// Rays per workgroup of the walk.
const GROUP_RAYS: u32 = 256u;
