// The colours of a frame as a window samples them: its accumulators in half precision, still premultiplied, so that any
// background can be put behind them. 11 bits count, three more than a screen shows.

@compute @workgroup_size(8, 8)
fn present(@builtin(global_invocation_id) at: vec3<u32>) {
    if all(at.xy < textureDimensions(color)) {
        textureStore(screen, at.xy, textureLoad(color, at.xy, 0));
    }
}
