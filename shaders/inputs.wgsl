// The inputs of effects on images from the scene: one pass over opaque surfaces, with one sample per pixel. The names are those
// of `SceneImages` (core/plugin/src/scene_inputs.rs). CPU reference: core/render/src/cpu/scene_inputs.rs.

@if(INPUT_PASS)
struct Inputs {
    // World-space normal, and depth in metres in front of the camera.
    @location(0) surface: vec4<f32>,
    // Motion in pixels since the frame before, and the numbers of actor and material.
    @if(MOTION) @location(1) motion: vec4<f32>,
}

@if(MOTION)
// Position of a vertex in the clip space of the frame before, by the same steps with the instance of that frame.
fn clip_before(in: VertexIn) -> vec4<f32> {
    let then = u32(instances[in.instance].tint.y);
    var shape: Shape;
    shape.position = in.position;
    @if(NORMAL) shape.normal = in.normal.xyz;
    @if(MORPH) shape = morphed(shape, instances[then].first_morph, instances[then].morph_count, in.index);
    @if(SKIN && !SKIN_8) let skin = skinned(instances[then].first_joint, Influences(in.joints, in.weights));
    @if(SKIN_8) let skin = skinned(instances[then].first_joint, Influences(in.joints, in.weights, in.joints_high, in.weights_high));
    @if(SKIN && !DUAL_QUATERNIONS && !SKIN_INSTANCED) let m = skin;
    @if(DUAL_QUATERNIONS || SKIN_INSTANCED) let m = after(instances[then].relative_from_mesh, skin);
    @if(!SKIN) let m = instances[then].relative_from_mesh;
    var relative = placed(m, shape.position);
    @if(DISPLACED)
    var vertex: VertexSample;
    vertex.world = relative + frame.camera_before.xyz;
    vertex.model = shape.position;
    @if(NORMAL) vertex.normal = turned_normal(m, shape.normal).xyz;
    @if(UV0) vertex.uv = in.uv0;
    relative += vertex_effects(vertex, m);
    @end
    return frame.clip_before * vec4(relative, 1.0);
}
@end

@fragment
fn inputs_fs(in: VertexOut, @builtin(front_facing) front: bool) -> Inputs {
    @if(!NORMAL_OUT)
    // A mesh without normals gets the normals of its triangles.
    let across = dpdx(in.relative);
    let down = dpdy(in.relative);
    let flat_n = unit(cross(across, down));
    let v = frame.eye.xyz - in.relative * frame.eye.w;
    let n = select(flat_n, -flat_n, dot(flat_n, v) < 0.0);
    @end
    @if(NORMAL_OUT && !DOUBLE_SIDED) let n = unit(in.normal);
    @if(NORMAL_OUT && DOUBLE_SIDED) let n = select(-unit(in.normal), unit(in.normal), front);
    @if(ALPHA_MASK)
    @if(UV_MOTION_MASK) read_uv_mask(in);
    var alpha = material.base_color.a;
    @if(VERTEX_COLOR) alpha *= in.color.a;
    @if(TRIPLANAR) read_planes(in);
    @if(BASE_COLOR_TEXTURE && TRIPLANAR) alpha *= from_three_sides(base_color_texture, base_color_sampler, 0u).a;
    @if(BASE_COLOR_TEXTURE && !TRIPLANAR) alpha *= textureSample(base_color_texture, base_color_sampler, texture_uv(in, 0u)).a;
    if (alpha < material.alpha_cutoff) { discard; }
    @end
    var depth = -dot(in.relative, frame.eye.xyz);
    if (frame.eye.w > 0.5) { depth = (frame.clip_from_relative * vec4(in.relative, 1.0)).w; }
    var out: Inputs;
    out.surface = vec4(n, depth);
    @if(MOTION)
    let before = in.clip_before;
    // The motion of a point that was behind the camera is zero.
    var moved = vec2(0.0);
    if (before.w > 0.0) { moved = in.position.xy - (before.xy / before.w * 0.5 + 0.5) * frame.size; }
    out.motion = vec4(moved, in.numbers);
    @end
    return out;
}
@end
