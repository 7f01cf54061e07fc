// Depth peeling from the back: the depth test keeps the farthest of the transparent surfaces that are nearer than the layer
// before, at each sample. CPU reference: core/render/src/cpu/peel.rs.

@if(PEEL_PASS && !MULTISAMPLED)
@group(2) @binding(10) var layer_before: texture_depth_2d;

@fragment
fn peel_fs(in: VertexOut) {
    if (in.position.z <= textureLoad(layer_before, vec2<i32>(in.position.xy), 0)) { discard; }
}
@end

@if(PEEL_PASS && MULTISAMPLED)
@group(2) @binding(10) var layer_before: texture_depth_multisampled_2d;

@fragment
fn peel_fs(in: VertexOut, @builtin(sample_index) index: u32) {
    if (in.position.z <= textureLoad(layer_before, vec2<i32>(in.position.xy), index)) { discard; }
}
@end
