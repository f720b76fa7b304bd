// Present: copies the accumulators of a frame to the texture that a window samples: half precision, still premultiplied, so that
// any background can be put behind them. Its 11 significant bits are three more than a screen shows.

@compute @workgroup_size(8, 8)
fn present(@builtin(global_invocation_id) at: vec3<u32>) {
    if all(at.xy < textureDimensions(color)) {
        textureStore(screen, at.xy, textureLoad(color, at.xy, 0));
    }
}
