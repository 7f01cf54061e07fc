// Mesh space → morphs → skin or instance matrix → camera-relative space → clip space.

struct VertexIn {
    @location(0) position: vec3<f32>,
    @if(LIT) @location(1) normal: vec4<f32>,
    @if(TANGENT) @location(2) tangent: vec4<f32>,
    @if(UV0) @location(3) uv0: vec2<f32>,
    @if(UV1) @location(4) uv1: vec2<f32>,
    @if(VERTEX_COLOR) @location(5) color: vec4<f32>,
    @if(SKIN) @location(6) joints: vec4<u32>,
    @if(SKIN) @location(7) weights: vec4<f32>,
    @if(SKIN_8) @location(8) joints_high: vec4<u32>,
    @if(SKIN_8) @location(9) weights_high: vec4<f32>,
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) instance: u32,
}

struct VertexOut {
    @builtin(position) position: vec4<f32>,
    @if(LIT) @location(0) relative: vec3<f32>,
    @if(LIT) @location(1) normal: vec3<f32>,
    @if(TANGENT) @location(2) tangent: vec4<f32>,
    @if(UV0) @location(3) uv0: vec2<f32>,
    @if(UV1) @location(4) uv1: vec2<f32>,
    @if(VERTEX_COLOR || TINT) @location(5) color: vec4<f32>,
    // How much longer the mesh's metres are here.
    @if(VOLUME) @location(6) scale: f32,
}

@if(SKIN)
fn weigh(sum: Rows, joint: u32, weight: f32) -> Rows {
    let m = joints[joint];
    return Rows(sum.x + weight * m.x, sum.y + weight * m.y, sum.z + weight * m.z);
}
@end

@vertex
fn vs(in: VertexIn) -> VertexOut {
    var position = in.position;
    @if(LIT) var normal = in.normal.xyz;
    @if(TANGENT) var tangent = in.tangent.xyz;

    @if(MORPH)
    let first_morph = instances[in.instance].first_morph;
    for (var i = 0u; i < instances[in.instance].morph_count; i++) {
        let active_morph = active_morphs[first_morph + i];
        let at = active_morph.target_index * morphs.stride * morphs.vertex_count + in.index;
        position += active_morph.weight * morphs.offsets[at].xyz;
        @if(LIT) normal += active_morph.weight * morphs.offsets[at + morphs.vertex_count].xyz;
        @if(TANGENT) tangent += active_morph.weight * morphs.offsets[at + 2u * morphs.vertex_count].xyz;
    }
    @end

    @if(SKIN)
    let first = instances[in.instance].first_joint;
    var m = Rows(vec4(0.0), vec4(0.0), vec4(0.0));
    m = weigh(m, first + in.joints.x, in.weights.x);
    m = weigh(m, first + in.joints.y, in.weights.y);
    m = weigh(m, first + in.joints.z, in.weights.z);
    m = weigh(m, first + in.joints.w, in.weights.w);
    @end
    @if(SKIN_8)
    m = weigh(m, first + in.joints_high.x, in.weights_high.x);
    m = weigh(m, first + in.joints_high.y, in.weights_high.y);
    m = weigh(m, first + in.joints_high.z, in.weights_high.z);
    m = weigh(m, first + in.joints_high.w, in.weights_high.w);
    @end
    @if(!SKIN) let m = instances[in.instance].relative_from_mesh;

    let p = vec4(position, 1.0);
    let relative = vec3(dot(m.x, p), dot(m.y, p), dot(m.z, p));

    var out: VertexOut;
    out.position = frame.clip_from_relative * vec4(relative, 1.0);
    @if(LIT)
    out.relative = relative;
    // Normals by the cofactor matrix: the inverse transpose times the determinant, whose sign is taken out again.
    let cofactor_x = cross(m.y.xyz, m.z.xyz);
    let cofactor_y = cross(m.z.xyz, m.x.xyz);
    let cofactor_z = cross(m.x.xyz, m.y.xyz);
    let handedness = select(1.0, -1.0, dot(m.x.xyz, cofactor_x) < 0.0);
    let turned = vec3(dot(cofactor_x, normal), dot(cofactor_y, normal), dot(cofactor_z, normal));
    out.normal = unit(turned * handedness);
    @end
    @if(TANGENT)
    let along = vec3(dot(m.x.xyz, tangent), dot(m.y.xyz, tangent), dot(m.z.xyz, tangent));
    out.tangent = vec4(unit(along), in.tangent.w * handedness);
    @end
    // The root mean square of the three axes.
    @if(VOLUME) out.scale = sqrt((dot(m.x.xyz, m.x.xyz) + dot(m.y.xyz, m.y.xyz) + dot(m.z.xyz, m.z.xyz)) / 3.0);
    @if(UV0) out.uv0 = in.uv0;
    @if(UV1) out.uv1 = in.uv1;
    @if(VERTEX_COLOR && TINT) out.color = in.color * instances[in.instance].tint;
    @if(VERTEX_COLOR && !TINT) out.color = in.color;
    @if(!VERTEX_COLOR && TINT) out.color = instances[in.instance].tint;
    return out;
}
