// Counters of a workgroup, in this order; the face renderer has neither steps nor entries.

const STEPS: u32 = 0u;
const SEGMENTS: u32 = 1u;
const ENTRIES: u32 = 2u;
const RAYS_HIT: u32 = 3u;
const STOPPED_EARLY: u32 = 4u;
const OUT_OF_ORDER: u32 = 5u;
const BROKEN: u32 = 6u;
const FLOW_DRAWN: u32 = 7u;
const FLOW_OUTSIDE: u32 = 8u;
const COUNTERS: u32 = 9u;
var<workgroup> counts: array<atomic<u32>, COUNTERS>;
