// Mesh space → morphs → skin or instance matrix (pose.wgsl, or read from pre-skinned vertices) → camera-relative space → clip
// space.
// CPU reference: core/render/src/cpu/vertex.rs.

struct VertexIn {
    @if(!PRE_SKINNED) @location(0) position: vec3<f32>,
    @if(NORMAL && !PRE_SKINNED) @location(1) normal: vec4<f32>,
    @if(TANGENT && !PRE_SKINNED) @location(2) tangent: vec4<f32>,
    @if(UV0) @location(3) uv0: vec2<f32>,
    @if(UV1) @location(4) uv1: vec2<f32>,
    @if(VERTEX_COLOR) @location(5) color: vec4<f32>,
    @if(SKIN) @location(6) joints: vec4<u32>,
    @if(SKIN) @location(7) weights: vec4<f32>,
    @if(SKIN_8) @location(8) joints_high: vec4<u32>,
    @if(SKIN_8) @location(9) weights_high: vec4<f32>,
    @if(THICK_LINES) @location(10) other: vec3<f32>,
    @if(THICK_LINES) @location(11) corner: vec3<f32>,
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) instance: u32,
}

struct VertexOut {
    @if(!PEELED) @builtin(position) position: vec4<f32>,
    // Invariant, so that the pass that finds a layer and the one that shades it compute the same depths.
    @if(PEELED) @builtin(position) @invariant position: vec4<f32>,
    @if(POSITION_OUT) @location(0) relative: vec3<f32>,
    @if(NORMAL_OUT) @location(1) normal: vec3<f32>,
    @if(TANGENT) @location(2) tangent: vec4<f32>,
    @if(UV0) @location(3) uv0: vec2<f32>,
    @if(UV1) @location(4) uv1: vec2<f32>,
    @if(VERTEX_COLOR || TINT) @location(5) color: vec4<f32>,
    // Scale from mesh to world.
    @if(VOLUME || REFRACTION) @location(6) scale: f32,
    @if(EFFECT_JOINTS) @location(7) joints: vec3<f32>,
    @if(TRIPLANAR) @location(8) model_at: vec3<f32>,
    @if(TRIPLANAR) @location(9) model_normal: vec3<f32>,
    @if(TRIPLANAR && TANGENT) @location(10) model_tangent: vec3<f32>,
    @if(MOTION) @location(11) clip_before: vec4<f32>,
    // Numbers of actor and material.
    @if(MOTION) @location(12) @interpolate(flat) numbers: vec2<f32>,
}

@if(EFFECT_JOINTS)
// Distinct color of a joint: hues of consecutive joints are a golden ratio of the circle apart.
fn joint_color(joint: u32) -> vec3<f32> {
    let hue = fract(f32(joint) * 0.61803399) * 6.0;
    return clamp(vec3(abs(hue - 3.0) - 1.0, 2.0 - abs(hue - 2.0), 2.0 - abs(hue - 4.0)), vec3(0.05), vec3(1.0));
}
@end

@if(OUTLINE_WIDTH_TEXTURE)
fn outline_uv(in: VertexIn) -> vec2<f32> {
    @if(UV0 && !UV1) let uv = in.uv0;
    @if(UV1 && !UV0) let uv = in.uv1;
    @if(UV0 && UV1) let uv = select(in.uv0, in.uv1, material.uv[7].x.w > 0.5);
    let t = material.uv[7];
    return vec2(dot(t.x.xy, uv) + t.x.z, dot(t.y.xy, uv) + t.y.z);
}
@end

@vertex
fn vs(in: VertexIn) -> VertexOut {
    @if(!PRE_SKINNED)
    var shape: Shape;
    shape.position = in.position;
    @if(NORMAL) shape.normal = in.normal.xyz;
    @if(TANGENT) shape.tangent = in.tangent.xyz;
    @if(MORPH) shape = morphed(shape, instances[in.instance].first_morph, instances[in.instance].morph_count, in.index);
    @if(SKIN && !SKIN_8) let skin = skinned(instances[in.instance].first_joint, Influences(in.joints, in.weights));
    @if(SKIN_8) let skin = skinned(instances[in.instance].first_joint, Influences(in.joints, in.weights, in.joints_high, in.weights_high));
    @if(SKIN && !DUAL_QUATERNIONS && !SKIN_INSTANCED) let m = skin;
    @if(DUAL_QUATERNIONS || SKIN_INSTANCED) let m = after(instances[in.instance].relative_from_mesh, skin);
    @if(!SKIN) let m = instances[in.instance].relative_from_mesh;
    let position = shape.position;
    var relative = placed(m, position);
    @end
    @if(PRE_SKINNED)
    // Vertices are stored in the order of preskin.wgsl: all positions of the mesh, then all normals, then all tangents.
    let count = instances[in.instance].first_morph;
    let at = instances[in.instance].first_joint + 3u * in.index;
    var relative = vec3(posed[at], posed[at + 1u], posed[at + 2u]);
    @end

    var out: VertexOut;
    @if(NORMAL && !PRE_SKINNED)
    let turned = turned_normal(m, shape.normal);
    var unit_normal = turned.xyz;
    @end
    @if(NORMAL && PRE_SKINNED)
    let at_normal = at + 3u * count;
    let unit_normal = vec3(posed[at_normal], posed[at_normal + 1u], posed[at_normal + 2u]);
    @end
    @if(DISPLACED)
    var vertex: VertexSample;
    vertex.world = relative + frame.camera.xyz;
    vertex.model = position;
    @if(NORMAL) vertex.normal = unit_normal;
    @if(UV0) vertex.uv = in.uv0;
    let moved = vertex_effects(vertex, m);
    @if(NORMAL) unit_normal = displaced_normal(vertex, m, moved);
    relative += moved;
    @end
    @if(OUTLINE)
    var width = material.outline.width;
    @if(OUTLINE_WIDTH_TEXTURE) width *= textureSampleLevel(outline_width_texture, outline_width_sampler, outline_uv(in), 0.0).g;
    if (material.outline.on_screen < 0.5) { relative += unit_normal * width; }
    @end
    out.position = frame.clip_from_relative * vec4(relative, 1.0);
    @if(THICK_LINES)
    let at_other = vec4(in.other, 1.0);
    var relative_other = vec3(dot(m.x, at_other), dot(m.y, at_other), dot(m.z, at_other));
    @end
    @if(THICK_LINES && DISPLACED)
    vertex.world = relative_other + frame.camera.xyz;
    vertex.model = in.other;
    relative_other += vertex_effects(vertex, m);
    @end
    @if(THICK_LINES)
    let other = frame.clip_from_relative * vec4(relative_other, 1.0);
    out.position = spread(out.position, other, in.corner, instances[in.instance].width);
    @end
    @if(OUTLINE)
    if (material.outline.on_screen > 0.5) {
        // Direction of the normal on screen, in pixels: d(xy/w) is proportional to this.
        let way = frame.clip_from_relative * vec4(unit_normal, 0.0);
        let pixels = (way.xy * out.position.w - out.position.xy * way.w) * frame.size;
        let step = unit(vec3(pixels, 0.0)).xy * (2.0 * width * frame.size.y) / frame.size;
        out.position = vec4(out.position.xy + step * out.position.w, out.position.zw);
    }
    @end
    @if(WIREFRAME)
    // Depth bias of wireframes: an edge lies in its surface and is drawn one pixel wide; moved nearer by the size of two pixels
    // it stays visible on slopes of up to two. In clip space the bias is proportional to z in perspective, and constant in
    // orthographic views.
    let rows = transpose(frame.clip_from_relative);
    let pixel = 2.0 / (frame.size.y * tall(rows));
    out.position.z += 2.0 * pixel * (abs(out.position.z) * length(rows[3].xyz) + length(rows[2].xyz));
    @end
    @if(POSITION_OUT) out.relative = relative;
    @if(NORMAL_OUT) out.normal = unit_normal;
    @if(EFFECT_JOINTS)
    out.joints = joint_color(in.joints.x) * in.weights.x + joint_color(in.joints.y) * in.weights.y
        + joint_color(in.joints.z) * in.weights.z + joint_color(in.joints.w) * in.weights.w;
    @end
    @if(EFFECT_JOINTS && SKIN_8)
    out.joints += joint_color(in.joints_high.x) * in.weights_high.x + joint_color(in.joints_high.y) * in.weights_high.y
        + joint_color(in.joints_high.z) * in.weights_high.z + joint_color(in.joints_high.w) * in.weights_high.w;
    @end
    @if(TANGENT && !PRE_SKINNED) out.tangent = turned_tangent(m, shape.tangent, in.tangent.w * turned.w);
    @if(TANGENT && PRE_SKINNED)
    let at_tangent = instances[in.instance].first_joint + 6u * count + 4u * in.index;
    out.tangent = vec4(posed[at_tangent], posed[at_tangent + 1u], posed[at_tangent + 2u], posed[at_tangent + 3u]);
    @end
    // Root mean square of the scales along the three axes.
    @if(VOLUME || REFRACTION) out.scale = sqrt((dot(m.x.xyz, m.x.xyz) + dot(m.y.xyz, m.y.xyz) + dot(m.z.xyz, m.z.xyz)) / 3.0);
    @if(TRIPLANAR) out.model_at = in.position;
    @if(TRIPLANAR) out.model_normal = in.normal.xyz;
    @if(TRIPLANAR && TANGENT) out.model_tangent = in.tangent.xyz;
    @if(MOTION) out.clip_before = clip_before(in);
    @if(MOTION) out.numbers = instances[in.instance].tint.xz;
    @if(UV0) out.uv0 = in.uv0;
    @if(UV1) out.uv1 = in.uv1;
    @if(VERTEX_COLOR && TINT) out.color = in.color * instances[in.instance].tint;
    @if(VERTEX_COLOR && !TINT) out.color = in.color;
    @if(!VERTEX_COLOR && TINT) out.color = instances[in.instance].tint;
    return out;
}
