// The exact integrator for a transfer function of more than the scalar: segments are split at scalar nodes, rows, and diagonals
// of rectangles. CPU twin: optics/joint.rs.
//
// The ray's position in a rectangle is kept as shares of its two sides, not as scalars: a rectangle that is crossed from side to
// side keeps its exact width, however narrow, and a piece that ends at a line has exactly the line's values there.

// Offsets into `table`, in vectors. Intervals are (lo, hi, width, first column or row); the first and the last of an axis are
// unbounded and have width 0: there the values do not depend on the axis.
struct JointParams {
    scalar_intervals: u32,
    scalar_count: u32,
    row_intervals: u32,
    row_count: u32,
    values: u32,
    // Values per row, and per table layer.
    columns: u32,
    layer_values: u32,
    // Two numbers a cell: a table layer, and the share of the way to the next. Cells from `cell_count` on lie in the first layer.
    cells: u32,
    cell_count: u32,
}

// An interval of an axis.
struct Side {
    number: u32,
    range: vec4<f32>,
}

// The rectangle that the ray is in.
var<private> column: Side;
var<private> row: Side;
// The cell's two table layers, as places of their first values, and the share of the way from one to the other.
var<private> layers: vec2<u32>;
var<private> layer_share: f32;
// The value at vertices, interpolated at both ends of the segment.
var<private> values: vec2<f32>;

// Begins at a place with this value, after a gap.
fn medium_begin(value: f32) {
    values = vec2(value);
}

// Sets the next segment: through a cell, to a place with this value.
fn medium_pass(cell: u32, value: f32) {
    values = vec2(values.y, value);
    layers = vec2(joint.values);
    layer_share = 0.0;
    if cell < joint.cell_count {
        let pair = table[joint.cells + cell / 2u];
        let place = select(pair.zw, pair.xy, (cell & 1u) == 0u);
        let below = u32(place.x);
        layers = joint.values + joint.layer_values * vec2(below, below + u32(place.y > 0.0));
        layer_share = place.y;
    }
}

// Cuts off the segment in front of a share of it.
fn medium_cut(share: f32) {
    values.x += share * (values.y - values.x);
}

fn side_of(first: u32, number: u32) -> Side {
    return Side(number, table[first + number]);
}

// The interval that contains `at`: the first one whose end lies beyond.
fn find_side(first: u32, count: u32, at: f32) -> Side {
    var low = 0u;
    var high = count - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if table[first + middle].y <= at {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return side_of(first, low);
}

// Enters the table at this scalar, after a gap.
fn optics_enter(scalar: f32) {
    column = find_side(joint.scalar_intervals, joint.scalar_count, scalar);
    row = find_side(joint.row_intervals, joint.row_count, values.x);
}

// The interval at a line: that in the ray's direction; the upper one if the coordinate is constant.
fn turn(side: Side, first: u32, at: f32, up: bool) -> Side {
    var turned = side;
    while select((at <= turned.range.x), (at >= turned.range.y), up) {
        turned = side_of(first, select(turned.number - 1u, turned.number + 1u, up));
    }
    return turned;
}

// The share of a side at which `at` lies; `outside` beyond the ends of the axis.
fn place_in(side: Side, at: f32, outside: f32) -> f32 {
    if side.range.z == 0.0 {
        return outside;
    }
    return clamp((at - side.range.x) / side.range.z, 0.0, 1.0);
}

// Progress of a segment along one axis.
struct Way {
    // Coordinates of both ends of the segment, and their distance.
    ends: vec2<f32>,
    span: f32,
    up: bool,
    // Position as a share of the present side.
    place: f32,
}

// The share of the segment from where `rest` of it remains to where it leaves a side; more than 1 if it does not.
fn share_to_end(way: Way, side: Side, rest: f32) -> f32 {
    let end = select(side.range.x, side.range.y, way.up);
    let leaves = select((way.ends.y < end), (way.ends.y > end), way.up);
    if !leaves {
        return 2.0;
    }
    if side.range.z == 0.0 {
        return max(abs(end - way.ends.x) / way.span - (1.0 - rest), 0.0);
    }
    return select(way.place, 1.0 - way.place, way.up) * side.range.z / way.span;
}

// The position in a side after another share of the segment.
fn place_after(way: Way, side: Side, share: f32, leaves: bool, is_end: bool, outside: f32) -> f32 {
    if side.range.z == 0.0 {
        return outside;
    }
    if leaves {
        return select(0.0, 1.0, way.up);
    }
    if is_end {
        return clamp((way.ends.y - side.range.x) / side.range.z, 0.0, 1.0);
    }
    let gone = share * way.span / side.range.z;
    return clamp(way.place + select(-gone, gone, way.up), 0.0, 1.0);
}

fn corner(x: u32, y: u32) -> vec4<f32> {
    let at = joint.columns * y + x;
    let below = table[layers.x + at];
    if layers.y == layers.x {
        return below;
    }
    return below * (1.0 - layer_share) + table[layers.y + at] * layer_share;
}

// Composites a piece that runs through one triangle.
fn joint_piece(near: vec2<f32>, far: vec2<f32>, is_below: bool, length: f32, share: f32) {
    if length <= 0.0 {
        return;
    }
    let first = vec2(u32(column.range.w), u32(row.range.w));
    let last = first + vec2(u32(column.range.z > 0.0), u32(row.range.z > 0.0));
    let lower = corner(first.x, first.y);
    let beside = corner(select(first.x, last.x, is_below), select(last.y, first.y, is_below));
    let upper = corner(last.x, last.y);
    if lower.w == 0.0 && beside.w == 0.0 && upper.w == 0.0 {
        return;
    }
    let more = select(vec2(near.y, far.y), vec2(near.x, far.x), is_below);
    let less = select(vec2(near.x, far.x), vec2(near.y, far.y), is_below);
    // No weight is negative: a piece between transparent corners stays transparent.
    let middle = max(more - less, vec2(0.0));
    let at_near = lower * (1.0 - more.x) + beside * middle.x + upper * less.x;
    let at_far = lower * (1.0 - more.y) + beside * middle.y + upper * less.y;
    if at_near.w == 0.0 && at_far.w == 0.0 {
        return;
    }
    // Optical depths beyond 1e9 are opaque; larger products would overflow.
    let weights = piece_weights(min(at_near.w * length, 1e9), min(at_far.w * length, 1e9));
    optics_add_piece(at_near.xyz, at_far.xyz, weights, share);
}

// Composites the segment along which the scalar goes linearly from s0 to s1. One loop for all lines that it meets, as in
// optics_exact.wgsl.
fn optics_segment(s0: f32, s1: f32, length: f32) {
    var x = Way(vec2(s0, s1), abs(s1 - s0), s1 >= s0, 0.0);
    var y = Way(values, abs(values.y - values.x), values.y >= values.x, 0.0);
    column = turn(column, joint.scalar_intervals, s0, x.up);
    row = turn(row, joint.row_intervals, values.x, y.up);
    // Beyond the ends of an axis the coordinate is that of corner (1, 0), so that the position is below the diagonal.
    x.place = place_in(column, s0, 1.0);
    y.place = place_in(row, values.x, 0.0);
    var rest = 1.0;
    loop {
        let x_share = share_to_end(x, column, rest);
        let y_share = share_to_end(y, row, rest);
        let is_end = x_share > 1.0 && y_share > 1.0;
        var share = min(min(x_share, y_share), rest);
        var leaves_x = !is_end && x_share <= y_share;
        var leaves_y = !is_end && y_share <= x_share;
        let near = vec2(x.place, y.place);
        var far = vec2(
            place_after(x, column, share, leaves_x, is_end, 1.0),
            place_after(y, row, share, leaves_y, is_end, 0.0),
        );
        let at_near = near.x - near.y;
        let at_far = far.x - far.y;
        var goes_on = !is_end;
        var is_below = at_near + at_far >= 0.0;
        if at_near * at_far < 0.0 {
            // The piece ends at the diagonal.
            let part = at_near / (at_near - at_far);
            far = vec2(clamp(near.x + part * (far.x - near.x), 0.0, 1.0));
            share *= part;
            is_below = at_near > 0.0;
            leaves_x = false;
            leaves_y = false;
            goes_on = true;
        }
        joint_piece(near, far, is_below, share * length, 1.0 - rest);
        if !goes_on {
            break;
        }
        rest = max(rest - share, 0.0);
        x.place = far.x;
        y.place = far.y;
        if leaves_x {
            column = side_of(joint.scalar_intervals, select(column.number - 1u, column.number + 1u, x.up));
            x.place = select(select(1.0, 0.0, x.up), 1.0, column.range.z == 0.0);
        }
        if leaves_y {
            row = side_of(joint.row_intervals, select(row.number - 1u, row.number + 1u, y.up));
            y.place = select(select(1.0, 0.0, y.up), 0.0, row.range.z == 0.0);
        }
    }
}
