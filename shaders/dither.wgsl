// Dithering of what is behind everything and of images after effects; `dither_ranks` is made by core/render/src/dither.rs, its CPU
// reference.

@if(DITHER)
// The color with each channel at one of the two 8-bit codes around it, the upper one at its share of the pixels; within a margin of a
// code, in codes, at that one.
fn to_dithered_codes(color: vec4<f32>, pixel: vec2<f32>, margin: f32) -> vec4<f32> {
    var ranks = dither_ranks;
    let at = vec2<u32>(pixel) % dither_side;
    let index = at.y * dither_side + at.x;
    let rank = (ranks[index >> 2u] >> (8u * (index & 3u))) & 255u;
    let even = (f32(rank) + 0.5) / f32(dither_side * dither_side);
    let threshold = (even - 0.5) * (1.0 - 2.0 * margin) + 0.5;
    let linear = clamp(color.rgb, vec3(0.0), vec3(1.0));
    let curve = 1.055 * pow(max(linear, vec3(1e-10)), vec3(1.0 / 2.4)) - 0.055;
    let codes = 255.0 * select(curve, 12.92 * linear, linear <= vec3(0.0031308));
    let code = floor(codes + threshold) / 255.0;
    let back = pow((code + 0.055) / 1.055, vec3(2.4));
    return vec4(select(back, code / 12.92, code <= vec3(0.04045)), color.a);
}
@end
