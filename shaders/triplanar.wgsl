// Triplanar mapping: textures from three sides, mixed by where the surface faces. CPU reference: core/render/src/cpu/triplanar.rs.

@if(TRIPLANAR)
// Mesh space: position from the center in widths of the image; unit normal; sign of each of its components; weights with the sum
// 1.
struct Planes {
    at: vec3<f32>,
    normal: vec3<f32>,
    signs: vec3<f32>,
    weights: vec3<f32>,
}

var<private> planes: Planes;

// The weights are powers of the normal (Golus, "Normal Mapping for a Triplanar Shader", 2017): the higher, the narrower the seams.
fn read_planes(in: VertexOut) {
    let n = unit(in.model_normal);
    let away = abs(n);
    let shares = pow(away / max(max(away.x, max(away.y, away.z)), 1e-6), vec3(material.triplanar_sharpness));
    planes.at = (in.model_at - material.triplanar_middle) * material.triplanar_scale;
    planes.normal = n;
    planes.signs = select(vec3(1.0), vec3(-1.0), n < vec3(0.0));
    planes.weights = shares / (shares.x + shares.y + shares.z);
}

// Texture coordinates of the sides that face x, y and z: u to the right as seen from there, v down.
fn plane_uv(side: u32, slot: u32) -> vec2<f32> {
    let at = planes.at;
    var uv = vec2(0.5 - at.z * planes.signs.x, 0.5 - at.y);
    if (side == 1u) { uv = vec2(0.5 + at.x, 0.5 + at.z * planes.signs.y); }
    if (side == 2u) { uv = vec2(0.5 + at.x * planes.signs.z, 0.5 - at.y); }
    let t = material.uv[slot];
    return vec2(dot(t.x.xy, uv) + t.x.z, dot(t.y.xy, uv) + t.y.z);
}

fn from_three_sides(texture: texture_2d<f32>, how: sampler, slot: u32) -> vec4<f32> {
    let w = planes.weights;
    return w.x * textureSample(texture, how, plane_uv(0u, slot)) + w.y * textureSample(texture, how, plane_uv(1u, slot))
        + w.z * textureSample(texture, how, plane_uv(2u, slot));
}
@end

@if(TRIPLANAR && NORMAL_TEXTURE)
// Each side bends the surface's own normal ("Whiteout Blend" of the same article); then from the mesh's space to the world by
// the surface's frame, which is known in both.
fn triplanar_normal(in: VertexOut) -> vec3<f32> {
    let scale = vec3(material.normal_scale, material.normal_scale, 1.0);
    let x = (textureSample(normal_texture, normal_sampler, plane_uv(0u, 2u)).xyz * 2.0 - 1.0) * scale;
    let y = (textureSample(normal_texture, normal_sampler, plane_uv(1u, 2u)).xyz * 2.0 - 1.0) * scale;
    let z = (textureSample(normal_texture, normal_sampler, plane_uv(2u, 2u)).xyz * 2.0 - 1.0) * scale;
    let n = planes.normal;
    let s = planes.signs;
    let of_x = vec3(n.x * x.z, n.y + x.y, n.z - s.x * x.x);
    let of_y = vec3(n.x + y.x, n.y * y.z, n.z - s.y * y.y);
    let of_z = vec3(n.x + s.z * z.x, n.y + z.y, n.z * z.z);
    let bent = unit(of_x * planes.weights.x + of_y * planes.weights.y + of_z * planes.weights.z);
    let along = unit(in.model_tangent);
    let b = cross(in.normal, in.tangent.xyz) * in.tangent.w;
    return unit(dot(bent, along) * in.tangent.xyz + dot(bent, cross(n, along)) * b + dot(bent, n) * in.normal);
}
@end
