// Flow, last part: puts the splats of each tile in their order, which is that of depths, and writes their places; a workgroup is a tile.

// Splats up to which each finds its place by itself.
const SHORT: u32 = 1024u;
// Splats of a tile beyond which the host refuses the frame: systems reset a GPU that does not answer, and software drivers abort loops.
const LONGEST: u32 = 65536u;

// Where the tile's numbers begin, and how many they are.
var<workgroup> list: vec2<u32>;
var<workgroup> numbers: array<u32, SHORT>;

@compute @workgroup_size(256)
fn flow_sort(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let tile = group.x + group.y * groups.x;
    if tile >= tile_count() {
        return;
    }
    if thread == 0u {
        list = begin_list(tile);
    }
    let span = workgroupUniformLoad(&list);
    let first = BINS_HEAD + tile_count() + span.x;
    let count = span.y;
    if count > SHORT {
        sort_numbers(first, count, thread);
    } else {
        for (var i = thread; i < count; i += 256u) {
            numbers[i] = atomicLoad(&bins[first + i]);
        }
        workgroupBarrier();
    }
    let ray = ray_through(middle_of_tile(vec2(tile % params.tiles.x, tile / params.tiles.x)));
    for (var i = thread; i < count; i += 256u) {
        var at = i;
        var number = 0u;
        if count > SHORT {
            number = atomicLoad(&bins[first + i]);
        } else {
            number = numbers[i];
            at = 0u;
            for (var j = 0u; j < count; j++) {
                at += u32(numbers[j] < number);
            }
        }
        write_place(ray, number, span.x + at);
    }
}

// Writes the head of a tile's list. Returns where its numbers begin, and how many they are; of too many, none.
fn begin_list(tile: u32) -> vec2<u32> {
    var begin = 0u;
    if tile > 0u {
        begin = min(atomicLoad(&bins[tile - 1u]), flow_params.place_capacity);
    }
    let all = min(atomicLoad(&bins[tile]), flow_params.place_capacity) - begin;
    atomicMax(&bins[tile_count() + 1u], all);
    let count = select(all, 0u, all > LONGEST);
    textureStore(flow_plane, texel_place(FLOW_HEAD + tile), digits(vec2(texel_of_place(begin), count)));
    return vec2(begin, count);
}

// Sorts numbers where they lie: all rounds of a sorting network.
fn sort_numbers(first: u32, count: u32, thread: u32) {
    for (var level = 1u; (1u << (level - 1u)) < count; level++) {
        for (var round = 0u; round < level; round++) {
            // One sorted half against the other, reversed; then by single bits, the highest first.
            let mask = select(1u << (level - 1u - round), (1u << level) - 1u, round == 0u);
            for (var i = thread; near_place(i, mask) < count; i += 256u) {
                exchange(first, near_place(i, mask), near_place(i, mask) ^ mask, count);
            }
            storageBarrier();
        }
    }
}

// Puts the lesser number in the nearer place.
fn exchange(first: u32, near: u32, far: u32, count: u32) {
    if far >= count {
        return;
    }
    let a = atomicLoad(&bins[first + near]);
    let b = atomicLoad(&bins[first + far]);
    if b < a {
        atomicStore(&bins[first + near], b);
        atomicStore(&bins[first + far], a);
    }
}

fn texel_of_place(place: u32) -> u32 {
    let behind = texel_of_splat(flow_params.splat_count);
    return behind + behind % PLACE_TEXELS + PLACE_TEXELS * place;
}

// Where a ray is beside a splat's centre, per axis, as a sum of two: it keeps its digits however far the centre is.
fn way_from(center: vec2<f32>, depth: vec2<f32>, ray: vec2<f32>) -> vec2<f32> {
    return plus(times(two_sum(ray.x, ray.y), depth), -center) / PLANE_SCALE;
}

// Periods on a way to the right and down, from a place in the pattern on.
fn periods_on(gradient: vec4<f32>, right: vec2<f32>, down: vec2<f32>, phase: f32) -> f32 {
    let passed = plus(plus(times(gradient.xz, right), times(gradient.yw, down)), vec2(phase, 0.0));
    return fract(fract(passed.x) + passed.y);
}

// Writes where the middle of the tile is in a splat, through which the ray goes.
fn write_place(ray: Ray, number: u32, place: u32) {
    let record = record_of(number);
    var depth = vec2(1.0, 0.0);
    if (params.flags & PERSPECTIVE) != 0u {
        depth = double_depth(record.center);
    }
    let right = way_from(record.center.plane.xy, depth, ray.x);
    let down = -way_from(record.center.plane.zw, depth, ray.y);
    let u = record.root * (right.x - record.slope * down.x);
    let per_pixel = record.root * record.pixel;
    let periods = vec4(record.periods.xy, record.rests.xy);
    let along = periods_on(periods, right, down, record.phase.x);
    let across = periods_on(vec4(record.periods.zw, record.rests.zw), right, down, record.phase.y);
    let at = texel_of_place(place);
    textureStore(flow_plane, texel_place(at), vec4(u, record.down * down.x, per_pixel, -per_pixel * record.slope));
    textureStore(flow_plane, texel_place(at + 1u), vec4(record.down * record.pixel, along, across, f32(number)));
}
