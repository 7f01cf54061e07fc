// 2D layers behind the scene, pixel by pixel: linear, straight alpha. CPU reference: core/render/src/cpu/mod.rs.

@group(2) @binding(9) var layers_behind: texture_2d<f32>;

@fragment
fn layers_behind_fs(in: BackgroundOut) -> @location(0) vec4<f32> {
    return textureLoad(layers_behind, vec2<i32>(in.position.xy), 0);
}
