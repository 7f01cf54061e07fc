// Deferred shading (S. Deering et al., "The Triangle Processor and Normal Vector Shader", SIGGRAPH 1988; T. Saito and T. Takahashi,
// "Comprehensible Rendering of 3-D Shapes", SIGGRAPH 1990): surfaces are drawn once without light into the G-buffer, which
// holds the nearest one at each pixel; then each pixel is lit once, by the same text as forward (scene.wgsl).
// The CPU renderer shades forward: its image is the reference of both.

@if(GEOMETRY)
// G-buffer of nine words: two octahedral normals with 16 bits per component; roughness and occlusion; F90 and red of the
// emission; diffuse color, F0 and the rest of the emission as 16-bit floats; depth as f32.
struct GBuffer {
    @location(0) normals: vec4<u32>,
    @location(1) colors: vec4<u32>,
    @location(2) depth: f32,
}

fn pack_gbuffer(depth: f32, n: vec3<f32>, own_n: vec3<f32>, s: Surface, occlusion: f32, emitted: vec3<f32>) -> GBuffer {
    // Clamped to the largest 16-bit float.
    let e = min(emitted, vec3(65504.0));
    let d = min(s.diffuse, vec3(65504.0));
    let f = min(s.f0, vec3(65504.0));
    return GBuffer(
        vec4(
            octahedron(n),
            octahedron(own_n),
            pack2x16unorm(vec2(s.roughness, occlusion)),
            (pack2x16unorm(vec2(s.f90, 0.0)) & 0xffffu) | (pack2x16float(vec2(0.0, e.x)) & 0xffff0000u),
        ),
        vec4(
            pack2x16float(d.xy),
            pack2x16float(vec2(d.z, f.x)),
            pack2x16float(f.yz),
            pack2x16float(e.yz),
        ),
        depth,
    );
}

// Octahedral normal (Z. Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014). A zero
// vector (a degenerate normal) has a reserved word, which no other vector rounds to.
fn octahedron(v: vec3<f32>) -> u32 {
    let sum = abs(v.x) + abs(v.y) + abs(v.z);
    let p = v.xy / max(sum, 1e-20);
    let folded = (vec2(1.0) - abs(p.yx)) * select(vec2(-1.0), vec2(1.0), p >= vec2(0.0));
    let word = pack2x16snorm(select(folded, p, v.z >= 0.0));
    return select(word, 0x80008000u, sum < 0.5);
}
@end

@if(LIGHT_PASS)
struct Rebuilt {
    relative_from_clip: mat4x4<f32>,
}

@group(3) @binding(0) var<uniform> rebuilt: Rebuilt;
@group(3) @binding(1) var gbuffer_normals: texture_2d<u32>;
@group(3) @binding(2) var gbuffer_colors: texture_2d<u32>;
@group(3) @binding(3) var gbuffer_depth: texture_2d<f32>;

struct GBufferSample {
    place: VertexOut,
    normal: vec3<f32>,
    surface: Surface,
    occlusion: f32,
    emitted: vec3<f32>,
}

struct LightOut {
    @builtin(position) position: vec4<f32>,
}

// One triangle over the whole image at depth 0; the depth test keeps the pixels that have a surface.
@vertex
fn light_vs(@builtin(vertex_index) index: u32) -> LightOut {
    let x = f32(i32(index & 1u) * 4 - 1);
    let y = f32(i32(index >> 1u) * 4 - 1);
    return LightOut(vec4(x, y, 0.0, 1.0));
}

fn from_octahedron(word: u32) -> vec3<f32> {
    let p = unpack2x16snorm(word);
    let z = 1.0 - abs(p.x) - abs(p.y);
    let folded = (vec2(1.0) - abs(p.yx)) * select(vec2(-1.0), vec2(1.0), p >= vec2(0.0));
    let v = unit(vec3(select(folded, p, z >= 0.0), z));
    return select(v, vec3(0.0), word == 0x80008000u);
}

fn gbuffer_at(position: vec4<f32>) -> GBufferSample {
    let pixel = vec2<i32>(position.xy);
    let normals = textureLoad(gbuffer_normals, pixel, 0);
    let colors = textureLoad(gbuffer_colors, pixel, 0);
    let clip = vec4(position.xy / frame.size * 2.0 - 1.0, textureLoad(gbuffer_depth, pixel, 0).x, 1.0);
    let relative = rebuilt.relative_from_clip * clip;
    var at: GBufferSample;
    at.place.position = position;
    at.place.relative = relative.xyz / relative.w;
    at.place.normal = from_octahedron(normals.y);
    at.normal = from_octahedron(normals.x);
    let rough = unpack2x16unorm(normals.z);
    at.surface.roughness = rough.x;
    at.occlusion = rough.y;
    at.surface.f90 = unpack2x16unorm(normals.w & 0xffffu).x;
    let middle = unpack2x16float(colors.y);
    at.surface.diffuse = vec3(unpack2x16float(colors.x), middle.x);
    at.surface.f0 = vec3(middle.y, unpack2x16float(colors.z));
    at.emitted = vec3(unpack2x16float(normals.w).y, unpack2x16float(colors.w));
    return at;
}
@end
