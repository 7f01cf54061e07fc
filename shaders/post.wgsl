// One full-screen pass: `effect` is the plugin's function, appended to this template.

struct Post {
    parameters: array<vec4<f32>, 2>,
    // Pixels.
    size: vec2<f32>,
    pad: vec2<f32>,
}

@group(0) @binding(0) var<uniform> post: Post;
@group(0) @binding(1) var post_input: texture_2d<f32>;

struct PostOut {
    @builtin(position) position: vec4<f32>,
}

@vertex
fn post_vs(@builtin(vertex_index) index: u32) -> PostOut {
    let x = f32(i32(index & 1u) * 4 - 1);
    let y = f32(i32(index >> 1u) * 4 - 1);
    return PostOut(vec4(x, y, 0.0, 1.0));
}

@fragment
fn post_fs(in: PostOut) -> @location(0) vec4<f32> {
    let color = textureLoad(post_input, vec2<i32>(in.position.xy), 0);
    let a = post.parameters[0];
    let b = post.parameters[1];
    let p = array<f32, 8>(a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w);
    return effect(color, in.position.xy / post.size, p);
}
