// Isosurfaces between the pieces of a segment. CPU twin: render/surfaces/medium.rs.
//
// A ray meets a sheet where one end of a segment is above it and the other is not. Both cells at a face use the same scalar there
// (`light.last`), so that no ray slips through between them or meets a sheet twice. Scalars and isovalues are mapped: an isovalue is
// the least mapped scalar of a vertex above it, so that vertices are on the same sides as on the CPU.

struct Sheet {
    // Colour of the side towards lower scalars; the isovalue: scalars from it on are above.
    front: vec4<f32>,
    // Colour of the other side; opacity.
    back: vec4<f32>,
}

struct Surfaces {
    // Towards the light, view coordinates, of length 1.
    light: vec3<f32>,
    // Number of sheets, which ascend by isovalue.
    count: u32,
    normals: u32,
    // Whether light comes from the eye instead.
    is_headlight: u32,
    // Index of the first gradient component behind the view vertices; three per vertex, local coordinates.
    gradients: u32,
    // Whether the volume is visible.
    has_volume: u32,
    sheets: array<Sheet, 32>,
}

// Values of `normals`: none, or the gradients of the cell's vertices; any other is the gradient in the cell.
const NO_NORMALS: u32 = 0u;
const SMOOTH_NORMALS: u32 = 2u;

// The ray of the pixel, its depths counted as `Params` has it.
var<private> surface_ray: Ray;

// Sets the ray of the pixel, before its first segment.
fn medium_ray(ray: Ray) {
    surface_ray = ray;
}

// Composites a segment through the cell, with the sheets in it.
fn medium_segment(cell: u32, from_: real2, to: real2) {
    var below = vec2(0u);
    for (var i = 0u; i < surfaces.count; i++) {
        let value = real(surfaces.sheets[i].front.w);
        below += vec2(u32(value <= from_.y), u32(value <= to.y));
    }
    if below.x != below.y {
        pass_sheets(cell, from_, to, below);
    } else if surfaces.has_volume != 0u {
        volume_segment(from_, to);
    }
}

// Composites the sheets that a segment meets, and the volume before, between and behind them. `below` counts the sheets at or below
// each end's scalar.
fn pass_sheets(cell: u32, from_: real2, to: real2, below: vec2<u32>) {
    let ascends = below.x < below.y;
    let count = max(below.x, below.y) - min(below.x, below.y);
    let ends = medium_ends();
    var near = from_;
    for (var i = 0u; i < count; i++) {
        let sheet = surfaces.sheets[select(below.x - 1u - i, below.x + i, ascends)];
        let value = real(sheet.front.w);
        let share = (value - from_.y) / (to.y - from_.y);
        let place = real2(clamp(from_.x + share * (to.x - from_.x), near.x, to.x), value);
        pass_part(ends, from_.x, near, place, to.x);
        if optics.transmittance < OPAQUE {
            return;
        }
        meet(sheet, cell, place.x, ascends);
        near = place;
    }
    pass_part(ends, from_.x, near, to, to.x);
}

// Composites the volume from `near` to `far`, a part of the segment between depths `begin` and `end`.
fn pass_part(ends: vec2<f32>, begin: real, near: real2, far: real2, end: real) {
    if surfaces.has_volume == 0u || optics.transmittance < OPAQUE {
        return;
    }
    if far.x <= near.x {
        // The scalar may have changed.
        light.placed = false;
        medium_part(ends, vec2(1.0));
        return;
    }
    let shares = vec2(f32(near.x - begin), f32(far.x - begin)) / f32(end - begin);
    medium_part(ends, select(shares, vec2(1.0), vec2(near.x == end, far.x == end)));
    volume_segment(near, far);
}

// Composites a sheet.
fn meet(sheet: Sheet, cell: u32, depth: real, ascends: bool) {
    let opacity = sheet.back.w;
    if opacity <= 0.0 {
        return;
    }
    let lit = light_on(cell, depth) * opacity;
    let rgb = select(sheet.back.xyz, sheet.front.xyz, ascends);
    optics_add(rgb * lit, opacity);
    if !optics.visible {
        optics.visible = true;
        light.visible_from = f32(depth + light.behind);
    }
}

// Diffuse factor of a sheet's colour: the cosine between its normal, turned towards the eye, and the light, at least 0; 1 without a normal.
fn light_on(cell: u32, depth: real) -> f32 {
    if surfaces.normals == NO_NORMALS {
        return 1.0;
    }
    let ray = ray_from(surface_ray, light.behind);
    let ids = cell_vertices(cell);
    let tet = array<real4, 4>(
        shear(ray, vertices[ids.x]),
        shear(ray, vertices[ids.y]),
        shear(ray, vertices[ids.z]),
        shear(ray, vertices[ids.w]),
    );
    var slope = vec2(0.0);
    if (params.flags & PERSPECTIVE) != 0u {
        slope = on_plane(ray) / PLANE_SCALE;
    }
    var normal: vec3<f32>;
    if surfaces.normals == SMOOTH_NORMALS {
        normal = smooth_normal(tet, ids, depth);
    } else {
        let sheared = cell_normal(tet);
        // In view coordinates: a plane that is sheared back.
        normal = vec3(sheared.xy, sheared.z - dot(slope, sheared.xy));
    }
    let largest = max(max(abs(normal.x), abs(normal.y)), abs(normal.z));
    if !(largest > 0.0) {
        return 1.0;
    }
    normal = normalize(normal / largest);
    let facing = -dot(normal, normalize(vec3(slope, 1.0)));
    if surfaces.is_headlight != 0u {
        return abs(facing);
    }
    let towards = dot(normal, surfaces.light);
    return max(select(-towards, towards, facing >= 0.0), 0.0);
}

fn cross_real(a: real3, b: real3) -> real3 {
    return a.yzx * b.zxy - a.zxy * b.yzx;
}

fn dot_real(a: real3, b: real3) -> real {
    return (a.x * b.x + a.y * b.y) + a.z * b.z;
}

// A vector along the gradient of the scalar in a cell, or against it, from its corners sheared along a ray; in sheared coordinates.
fn cell_normal(tet: array<real4, 4>) -> vec3<f32> {
    let to_unit = real4(real2(real(1.0 / PLANE_SCALE)), real2(real(1.0)));
    let a = (tet[1] - tet[0]) * to_unit;
    let b = (tet[2] - tet[0]) * to_unit;
    let c = (tet[3] - tet[0]) * to_unit;
    let reaches = max(max(abs(a), abs(b)), abs(c));
    let size = max(max(reaches.x, reaches.y), reaches.z);
    // Scaled first: products of small numbers would leave f32's range.
    let p = a.xyz / size;
    let q = b.xyz / size;
    let r = c.xyz / size;
    let rise = real3(a.w, b.w, c.w) / reaches.w;
    return vec3<f32>(rise.x * cross_real(q, r) + rise.y * cross_real(r, p) + rise.z * cross_real(p, q));
}

// The gradients of a cell's vertices, interpolated on the ray at a depth; view coordinates.
fn smooth_normal(tet: array<real4, 4>, ids: vec4<u32>, depth: real) -> vec3<f32> {
    // Relative to the place on the ray. Ratios of volumes are the same in sheared coordinates.
    let here = real3(real2(real(0.0)), depth);
    let o = tet[0].xyz - here;
    let a = tet[1].xyz - here;
    let b = tet[2].xyz - here;
    let c = tet[3].xyz - here;
    let of_b_c = cross_real(b, c);
    let of_o_a = cross_real(o, a);
    let volumes = real4(dot_real(a, of_b_c), -dot_real(o, of_b_c), dot_real(c, of_o_a), -dot_real(b, of_o_a));
    let volume = ((volumes.x + volumes.y) + volumes.z) + volumes.w;
    if volume == real(0.0) {
        return vec3(0.0);
    }
    let others = clamp(vec3<f32>(volumes.yzw / volume), vec3(0.0), vec3(1.0));
    let first = max(((1.0 - others.x) - others.y) - others.z, 0.0);
    let gradient = first * gradient_at(ids.x) + others.x * gradient_at(ids.y) + others.y * gradient_at(ids.z) + others.z * gradient_at(ids.w);
    return vec3(in_view(gradient, 0u), in_view(gradient, 1u), in_view(gradient, 2u));
}

fn gradient_at(vertex: u32) -> vec3<f32> {
    let at = surfaces.gradients + 3u * vertex;
    return vec3(number_behind_vertices(at), number_behind_vertices(at + 1u), number_behind_vertices(at + 2u));
}

// Component of a vector along an axis of the view.
fn in_view(v: vec3<f32>, axis: u32) -> f32 {
    return dot(v, params.axes[3u * axis].xyz + (params.axes[3u * axis + 1u].xyz + params.axes[3u * axis + 2u].xyz));
}
