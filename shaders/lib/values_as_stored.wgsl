// Twin of values_of_parts.wgsl where each vertex or cell has its own value.

fn value_of(i: u32) -> u32 {
    return i;
}
