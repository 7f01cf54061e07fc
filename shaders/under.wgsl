// Layers under the scene, pixel by pixel: linear, alpha not multiplied in.

@group(2) @binding(9) var under_picture: texture_2d<f32>;

@fragment
fn under_fs(in: BackgroundOut) -> @location(0) vec4<f32> {
    return textureLoad(under_picture, vec2<i32>(in.position.xy), 0);
}
