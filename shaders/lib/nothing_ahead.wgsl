// Twin of fragments_ahead.wgsl for frames without other layers.

fn ahead_begin(place: vec2<u32>) {}

fn pass_ahead(cell: u32, to: real2) {}

fn meet_rest() {}
