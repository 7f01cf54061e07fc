// One full-screen pass: `effect` is the plugin's function, appended to this template with `post_parameters`.
// CPU reference: core/render/src/cpu/image_passes.rs.

struct Post {
    // Size of the output in pixels.
    size: vec2<f32>,
    // Index of the pass among those of its effect.
    number: u32,
    // Factor by which the smaller one of the input and the output is smaller than the whole image.
    shrink: u32,
    // Size of the output of the pass before, and of the whole image, in pixels.
    input: vec2<f32>,
    whole: vec2<f32>,
    // Factors by which the textures of passes that it reads are smaller than the whole image.
    textures: array<vec4<f32>, 2>,
    // `EffectFrame::rows`: time, frame number, sun and camera matrices.
    scene: array<vec4<f32>, 19>,
    // Rows of four numbers.
    parameters: array<vec4<f32>, post_rows>,
}

@group(0) @binding(0) var<uniform> post: Post;
@group(0) @binding(1) var post_input: texture_2d<f32>;
@if(PICTURE) @group(0) @binding(2) var post_original: texture_2d<f32>;
@if(SURFACE_INPUT) @group(0) @binding(5) var post_surface: texture_2d<f32>;
@if(MOTION_INPUT) @group(0) @binding(6) var post_motion: texture_2d<f32>;
@if(TEXTURES) @group(0) @binding(3) var<storage, read> effect_texels: array<vec2<u32>>;
@if(FAULT_RECORDS) @group(0) @binding(4) var<storage, read_write> effect_faults: array<atomic<u32>>;

struct PostOut {
    @builtin(position) position: vec4<f32>,
}

@vertex
fn post_vs(@builtin(vertex_index) index: u32) -> PostOut {
    let x = f32(i32(index & 1u) * 4 - 1);
    let y = f32(i32(index >> 1u) * 4 - 1);
    return PostOut(vec4(x, y, 0.0, 1.0));
}

@if(PICTURE)
// Size in pixels of the image that `picture` reads.
fn picture_size() -> vec2<i32> {
    return vec2<i32>(post.input);
}

fn original_size() -> vec2<i32> {
    return vec2<i32>(post.whole);
}

fn shrink_factor() -> i32 {
    return i32(post.shrink);
}

// Reads a pixel; positions beyond the border are clamped to it.
fn picture(at: vec2<i32>) -> vec4<f32> {
    return textureLoad(post_input, clamp(at, vec2(0), vec2<i32>(post.input) - 1), 0);
}

fn original(at: vec2<i32>) -> vec4<f32> {
    return textureLoad(post_original, clamp(at, vec2(0), vec2<i32>(post.whole) - 1), 0);
}

// Position `uv` of the whole image, 0 to 1, in texels of a texture that is smaller by `scale`, relative to the center of its
// first texel.
fn post_place(uv: vec2<f32>, scale: f32, size: vec2<i32>) -> vec2<f32> {
    return clamp(uv * (post.whole / scale) - 0.5, vec2(-1.0), vec2<f32>(size));
}

// Frames with a history are assembled on the host. A plan of a single time has none, so the image stands for earlier ones.
fn previous(frames: u32, at: vec2<i32>) -> vec4<f32> {
    return original(at);
}
@end

// Scene inputs, at pixels of the whole image.
@if(SURFACE_INPUT)
fn scene_surface(at: vec2<i32>) -> vec4<f32> {
    return textureLoad(post_surface, clamp(at, vec2(0), vec2<i32>(post.whole) - 1), 0);
}
@end

@if(MOTION_INPUT)
fn scene_motion(at: vec2<i32>) -> vec4<f32> {
    return textureLoad(post_motion, clamp(at, vec2(0), vec2<i32>(post.whole) - 1), 0);
}
@end

@if(PICTURE)
fn scene_row_0() -> vec4<f32> { return post.scene[0]; }
fn scene_row_1() -> vec4<f32> { return post.scene[1]; }
fn scene_row_2() -> vec4<f32> { return post.scene[2]; }
fn scene_row_3() -> vec4<f32> { return post.scene[3]; }
fn scene_row_4() -> vec4<f32> { return post.scene[4]; }
fn scene_row_5() -> vec4<f32> { return post.scene[5]; }
fn scene_row_6() -> vec4<f32> { return post.scene[6]; }
fn scene_row_7() -> vec4<f32> { return post.scene[7]; }
fn scene_row_8() -> vec4<f32> { return post.scene[8]; }
fn scene_row_9() -> vec4<f32> { return post.scene[9]; }
fn scene_row_10() -> vec4<f32> { return post.scene[10]; }
fn scene_row_11() -> vec4<f32> { return post.scene[11]; }
fn scene_row_12() -> vec4<f32> { return post.scene[12]; }
fn scene_row_13() -> vec4<f32> { return post.scene[13]; }
fn scene_row_14() -> vec4<f32> { return post.scene[14]; }
fn scene_row_15() -> vec4<f32> { return post.scene[15]; }
fn scene_row_16() -> vec4<f32> { return post.scene[16]; }
fn scene_row_17() -> vec4<f32> { return post.scene[17]; }
fn scene_row_18() -> vec4<f32> { return post.scene[18]; }
@end

@fragment
fn post_fs(in: PostOut) -> @location(0) vec4<f32> {
    let p = post_parameters();
    effect_at(in.position.xy);
    @if(PICTURE) let made = effect(vec2<i32>(in.position.xy), post_run, p);
    @if(!PICTURE) let color = textureLoad(post_input, vec2<i32>(in.position.xy), 0);
    @if(!PICTURE) let made = effect(color, in.position.xy / post.size, p);
    let shown = effect_color(made, post_faults);
    @if(!DITHER) return shown;
    @if(DITHER) return to_dithered_codes(shown, in.position.xy, dither_margin);
}
