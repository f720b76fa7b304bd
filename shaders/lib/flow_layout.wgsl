// Splats of flow by tiles, as texels: the head, for each tile where its list begins and how many places it has, the splats, and the places of
// all tiles, nearest first.
//
// head    what kernels are, whether splats are cut at the cells, whether there are fragments of other layers
// splat   periods along and across per pixel to the right and down
//         depth as `Params` counts as a sum of two, length of the pattern's box in texels, opacity of the kernel
//         colour, and opacity of the icon
//         contrast, share of the next icon, number of the icon times 8 and level, what the pattern is without contrast
//         colour of the kernel, and its optical depth
// place   in the middle of the tile: distances from the centre in widths along two axes of the kernel; of the first per pixel to the right and
//         down
//         of the second per pixel down, place in the pattern along and across, number of the splat

const FLOW_HEAD: u32 = 1u;
const SPLAT_TEXELS: u32 = 5u;
const PLACE_TEXELS: u32 = 2u;
// Rows of an icon, and levels of a row.
const ICON_ROWS: u32 = 64u;
const ICON_LEVELS: u32 = 7u;

fn texel_of_splat(number: u32) -> u32 {
    return FLOW_HEAD + params.tiles.x * params.tiles.y + SPLAT_TEXELS * number;
}

// The place in the plane whose pixel is the middle of a tile.
fn middle_of_tile(tile: vec2<u32>) -> vec2<u32> {
    return tile * TILE_PX + vec2(TILE_PX / 2u);
}
