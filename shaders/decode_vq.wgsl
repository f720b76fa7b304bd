// Decode: a step of codec `vq` from its compressed block, which stays in the GPU's memory while its 64 steps are played.
// CPU twin: codec/vq/block.rs, `decode_finite`; the formula is in the documentation of `VqBlock`.
//
// Every operation is rounded as on the CPU: a product with a power of two is exact, and the sums are not to be merged.
//
// Non-finite values are not restored: cells that have one are inactive, so that no stage reads them.

// Offsets into `block`, in words.
struct VqStep {
    // Vertices or cells.
    count: u32,
    // The step's rows of the two codebooks.
    row_8: u32,
    row_64: u32,
    means: u32,
    // NONE if all exponents are zero.
    exponents: u32,
    // Indices into the first and into the second codebook.
    first: u32,
    second: u32,
    // Base-2 logarithm of the indices per word: four of 8 bits or two of 16.
    per_word_log2: u32,
    // Weight of the step in a mixture, as a sum of three.
    weight: vec3<f32>,
    // Zero, unknown to the compiler.
    zero: u32,
    // Weight of the step that has been decoded before this one.
    weight_before: vec3<f32>,
    unused: u32,
}

const NONE: u32 = 0xffffffffu;

fn index_at(list: u32, v: u32) -> u32 {
    let bits = 32u >> step.per_word_log2;
    let place = v & ((1u << step.per_word_log2) - 1u);
    return extractBits(block[list + (v >> step.per_word_log2)], place * bits, bits);
}

// 2^e for -64 <= e <= 63.
fn power(e: i32) -> f32 {
    return bitcast<f32>(u32(e + 127) << 23u);
}

@compute @workgroup_size(256)
fn decode_vq(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.x + id.y * groups.x * 256u;
    if i >= step.count {
        return;
    }
    let v = value_of(i);
    let from_8 = bitcast<f32>(block[step.row_8 + index_at(step.first, v)]);
    let from_64 = bitcast<f32>(block[step.row_64 + index_at(step.second, v)]);
    var difference = from_8 + from_64;
    if step.exponents != NONE {
        // Exponents have 8 bits: their powers reach into the denormals, which a GPU may not have; powers of half the exponent do not.
        let exponent = extractBits(i32(block[step.exponents + (v >> 2u)]), (v & 3u) * 8u, 8u);
        let half = exponent >> 1u;
        difference = difference * power(half) * power(exponent - half);
    }
    // Hidden from the compiler, which could add the mean before.
    difference = bitcast<f32>(bitcast<u32>(difference) ^ step.zero);
    scalars[i] = at_moment(i, bitcast<f32>(block[step.means + v]) + difference);
}
