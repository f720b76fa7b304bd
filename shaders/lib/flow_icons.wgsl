// Means of an icon over boxes. CPU twin: `IconSums::means` in render/flow/icon.rs.
//
// For each icon, level and row the sums of the texels before each, from half a period before the period to half of one behind it, so that
// a box has a place for either end: the sum and the texel of the row, then of the next one.

const ICON_COLUMNS: u32 = 129u;
// Columns before the period.
const ICON_BEFORE: f32 = 32.0;

// The sums before the texel of a place, of a row and of the next one, and what the place has of the texel.
fn icon_sums(first: u32, at: f32) -> vec4<f32> {
    let column = clamp(floor(at), -ICON_BEFORE, ICON_BEFORE * 3.0);
    let sums = textureLoad(flow_icons, texel_place(first + u32(column + ICON_BEFORE)), 0);
    return vec4(sums.xz, (at - column) * sums.yw);
}

// The mean over a box around a place in periods, so many texels long and 2^level across. `icon` is the icon's number times 8, and the level.
fn icon_mean(icon: u32, at: vec2<f32>, wide: f32) -> f32 {
    let level = icon & 7u;
    let texel = fract(at) * f32(ICON_ROWS) - 0.5 * vec2(wide, f32(1u << level));
    let row = floor(texel.y);
    let rows = ((icon >> 3u) * ICON_LEVELS + level) * ICON_ROWS;
    let first = (rows + (u32(i32(row)) & (ICON_ROWS - 1u))) * ICON_COLUMNS;
    let sums = icon_sums(first, texel.x + wide) - icon_sums(first, texel.x);
    let both = sums.xy + sums.zw;
    return (both.x + (texel.y - row) * (both.y - both.x)) / wide;
}
