// Textures of effects, all in one buffer; functions with the textures' names are appended for each effect.
// CPU reference: core/plugin/src/effect_texture.rs.

fn effect_texel(first: u32, size: vec2<u32>, at: vec2<i32>) -> vec4<f32> {
    // Coordinates may be one texel before the first or after the last, and wrap around; NaN may read any texel.
    let wrapped = vec2<u32>(clamp(at + vec2<i32>(size), vec2(0), vec2<i32>(size) * 2)) % size;
    let t = effect_texels[first + wrapped.y * size.x + wrapped.x];
    return vec4(unpack2x16float(t.x), unpack2x16float(t.y));
}

// Bilinear sample, repeating.
fn effect_texture(first: u32, size: vec2<u32>, uv: vec2<f32>) -> vec4<f32> {
    let at = (uv - floor(uv)) * vec2<f32>(size) - 0.5;
    let corner = floor(at);
    let f = at - corner;
    let c = vec2<i32>(corner);
    let above = mix(effect_texel(first, size, c), effect_texel(first, size, c + vec2(1, 0)), f.x);
    let below = mix(effect_texel(first, size, c + vec2(0, 1)), effect_texel(first, size, c + vec2(1, 1)), f.x);
    return mix(above, below, f.y);
}
