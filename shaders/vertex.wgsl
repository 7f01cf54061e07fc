// Mesh space → morphs → skin or instance matrix → camera-relative space → clip space.

struct VertexIn {
    @location(0) position: vec3<f32>,
    @if(NORMAL) @location(1) normal: vec4<f32>,
    @if(TANGENT) @location(2) tangent: vec4<f32>,
    @if(UV0) @location(3) uv0: vec2<f32>,
    @if(UV1) @location(4) uv1: vec2<f32>,
    @if(VERTEX_COLOR) @location(5) color: vec4<f32>,
    @if(SKIN) @location(6) joints: vec4<u32>,
    @if(SKIN) @location(7) weights: vec4<f32>,
    @if(SKIN_8) @location(8) joints_high: vec4<u32>,
    @if(SKIN_8) @location(9) weights_high: vec4<f32>,
    @if(WIDE) @location(10) other: vec3<f32>,
    @if(WIDE) @location(11) corner: vec3<f32>,
    @builtin(vertex_index) index: u32,
    @builtin(instance_index) instance: u32,
}

struct VertexOut {
    @if(!PEELED) @builtin(position) position: vec4<f32>,
    // The same depths in the pass that finds a layer and in the one that shades it.
    @if(PEELED) @builtin(position) @invariant position: vec4<f32>,
    @if(PLACE) @location(0) relative: vec3<f32>,
    @if(NORMAL_OUT) @location(1) normal: vec3<f32>,
    @if(TANGENT) @location(2) tangent: vec4<f32>,
    @if(UV0) @location(3) uv0: vec2<f32>,
    @if(UV1) @location(4) uv1: vec2<f32>,
    @if(VERTEX_COLOR || TINT) @location(5) color: vec4<f32>,
    // How much longer the mesh's metres are here.
    @if(VOLUME || REFRACTION) @location(6) scale: f32,
    @if(SEEN_JOINTS) @location(7) joints: vec3<f32>,
    @if(TRIPLANAR) @location(8) model_at: vec3<f32>,
    @if(TRIPLANAR) @location(9) model_normal: vec3<f32>,
    @if(TRIPLANAR && TANGENT) @location(10) model_tangent: vec3<f32>,
}

@if(SKIN)
fn weigh(sum: Rows, joint: u32, weight: f32) -> Rows {
    let m = joints[joint];
    return Rows(sum.x + weight * m.x, sum.y + weight * m.y, sum.z + weight * m.z);
}
@end

@if(SKIN_DUAL)
// Twin of core/motion/src/dual_quaternion.rs: stretches are blended as matrices, then motions as dual quaternions.
struct DualSum {
    real: vec4<f32>,
    dual: vec4<f32>,
    stretch: Rows,
}

// All on the side of the heaviest influence.
fn weigh_dual(sum: DualSum, pivot: vec4<f32>, joint: u32, weight: f32) -> DualSum {
    let q = joints[joint].x;
    let signed = select(weight, -weight, dot(q, pivot) < 0.0);
    return DualSum(sum.real + signed * q, sum.dual + signed * joints[joint].y, weigh(sum.stretch, joint + 1u, weight));
}

// The rotation and translation of a dual quaternion of any length.
fn motion(q: vec4<f32>, d: vec4<f32>) -> Rows {
    let k = 2.0 / max(dot(q, q), 1e-30);
    let t = (d.xyz * q.w - q.xyz * d.w + cross(q.xyz, d.xyz)) * k;
    let s = q.xyz * k;
    return Rows(
        vec4(1.0 - (q.y * s.y + q.z * s.z), q.x * s.y - q.w * s.z, q.x * s.z + q.w * s.y, t.x),
        vec4(q.x * s.y + q.w * s.z, 1.0 - (q.x * s.x + q.z * s.z), q.y * s.z - q.w * s.x, t.y),
        vec4(q.x * s.z - q.w * s.y, q.y * s.z + q.w * s.x, 1.0 - (q.x * s.x + q.y * s.y), t.z),
    );
}

@end

@if(SKIN_DUAL || SKIN_PLACED)
// One row of a map after another.
fn row_after(outer: vec4<f32>, inner: Rows) -> vec4<f32> {
    return inner.x * outer.x + inner.y * outer.y + inner.z * outer.z + vec4(0.0, 0.0, 0.0, outer.w);
}

fn after(outer: Rows, inner: Rows) -> Rows {
    return Rows(row_after(outer.x, inner), row_after(outer.y, inner), row_after(outer.z, inner));
}
@end

@if(SEEN_JOINTS)
// Neighbouring numbers get colours far apart: hues a golden ratio of the circle from each other.
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
    var position = in.position;
    @if(NORMAL) var normal = in.normal.xyz;
    @if(TANGENT) var tangent = in.tangent.xyz;

    @if(MORPH)
    let first_morph = instances[in.instance].first_morph;
    for (var i = 0u; i < instances[in.instance].morph_count; i++) {
        let active_morph = active_morphs[first_morph + i];
        let at = active_morph.target_index * morphs.stride * morphs.vertex_count + in.index;
        position += active_morph.weight * morphs.offsets[at].xyz;
        @if(NORMAL) normal += active_morph.weight * morphs.offsets[at + morphs.vertex_count].xyz;
        @if(TANGENT) tangent += active_morph.weight * morphs.offsets[at + 2u * morphs.vertex_count].xyz;
    }
    @end

    @if(SKIN) let first = instances[in.instance].first_joint;
    @if(SKIN && !SKIN_DUAL)
    var m = Rows(vec4(0.0), vec4(0.0), vec4(0.0));
    m = weigh(m, first + in.joints.x, in.weights.x);
    m = weigh(m, first + in.joints.y, in.weights.y);
    m = weigh(m, first + in.joints.z, in.weights.z);
    m = weigh(m, first + in.joints.w, in.weights.w);
    @end
    @if(SKIN_8 && !SKIN_DUAL)
    m = weigh(m, first + in.joints_high.x, in.weights_high.x);
    m = weigh(m, first + in.joints_high.y, in.weights_high.y);
    m = weigh(m, first + in.joints_high.z, in.weights_high.z);
    m = weigh(m, first + in.joints_high.w, in.weights_high.w);
    @end
    @if(SKIN_DUAL)
    var heaviest = vec2<f32>(in.weights.x, f32(in.joints.x));
    if in.weights.y > heaviest.x { heaviest = vec2(in.weights.y, f32(in.joints.y)); }
    if in.weights.z > heaviest.x { heaviest = vec2(in.weights.z, f32(in.joints.z)); }
    if in.weights.w > heaviest.x { heaviest = vec2(in.weights.w, f32(in.joints.w)); }
    @end
    @if(SKIN_DUAL && SKIN_8)
    if in.weights_high.x > heaviest.x { heaviest = vec2(in.weights_high.x, f32(in.joints_high.x)); }
    if in.weights_high.y > heaviest.x { heaviest = vec2(in.weights_high.y, f32(in.joints_high.y)); }
    if in.weights_high.z > heaviest.x { heaviest = vec2(in.weights_high.z, f32(in.joints_high.z)); }
    if in.weights_high.w > heaviest.x { heaviest = vec2(in.weights_high.w, f32(in.joints_high.w)); }
    @end
    @if(SKIN_DUAL)
    let pivot = joints[first + 2u * u32(heaviest.y)].x;
    let nothing = vec4<f32>(0.0);
    var sum = DualSum(nothing, nothing, Rows(nothing, nothing, nothing));
    sum = weigh_dual(sum, pivot, first + 2u * in.joints.x, in.weights.x);
    sum = weigh_dual(sum, pivot, first + 2u * in.joints.y, in.weights.y);
    sum = weigh_dual(sum, pivot, first + 2u * in.joints.z, in.weights.z);
    sum = weigh_dual(sum, pivot, first + 2u * in.joints.w, in.weights.w);
    @end
    @if(SKIN_DUAL && SKIN_8)
    sum = weigh_dual(sum, pivot, first + 2u * in.joints_high.x, in.weights_high.x);
    sum = weigh_dual(sum, pivot, first + 2u * in.joints_high.y, in.weights_high.y);
    sum = weigh_dual(sum, pivot, first + 2u * in.joints_high.z, in.weights_high.z);
    sum = weigh_dual(sum, pivot, first + 2u * in.joints_high.w, in.weights_high.w);
    @end
    @if(SKIN_PLACED && !SKIN_DUAL) m = after(instances[in.instance].relative_from_mesh, m);
    @if(SKIN_DUAL) let m = after(instances[in.instance].relative_from_mesh, after(motion(sum.real, sum.dual), sum.stretch));
    @if(!SKIN) let m = instances[in.instance].relative_from_mesh;

    let p = vec4(position, 1.0);
    var relative = vec3(dot(m.x, p), dot(m.y, p), dot(m.z, p));

    var out: VertexOut;
    @if(NORMAL)
    // Normals by the cofactor matrix: the inverse transpose times the determinant, whose sign is taken out again.
    let cofactor_x = cross(m.y.xyz, m.z.xyz);
    let cofactor_y = cross(m.z.xyz, m.x.xyz);
    let cofactor_z = cross(m.x.xyz, m.y.xyz);
    let handedness = select(1.0, -1.0, dot(m.x.xyz, cofactor_x) < 0.0);
    let turned = vec3(dot(cofactor_x, normal), dot(cofactor_y, normal), dot(cofactor_z, normal));
    var unit_normal = unit(turned * handedness);
    @end
    @if(DISPLACED)
    var place: Place;
    place.world = relative + frame.camera.xyz;
    place.model = position;
    @if(NORMAL) place.normal = unit_normal;
    @if(UV0) place.uv = in.uv0;
    let moved = vertex_effects(place, m);
    @if(NORMAL) unit_normal = displaced_normal(place, m, moved);
    relative += moved;
    @end
    @if(SHELL)
    var width = material.outline_width;
    @if(OUTLINE_WIDTH_TEXTURE) width *= textureSampleLevel(outline_width_texture, outline_width_sampler, outline_uv(in), 0.0).g;
    if (material.outline_on_screen < 0.5) { relative += unit_normal * width; }
    @end
    out.position = frame.clip_from_relative * vec4(relative, 1.0);
    @if(WIDE)
    let at_other = vec4(in.other, 1.0);
    var relative_other = vec3(dot(m.x, at_other), dot(m.y, at_other), dot(m.z, at_other));
    @end
    @if(WIDE && DISPLACED)
    place.world = relative_other + frame.camera.xyz;
    place.model = in.other;
    relative_other += vertex_effects(place, m);
    @end
    @if(WIDE)
    let other = frame.clip_from_relative * vec4(relative_other, 1.0);
    out.position = spread(out.position, other, in.corner, instances[in.instance].width);
    @end
    @if(SHELL)
    if (material.outline_on_screen > 0.5) {
        // Where the normal goes in the picture, in pixels: d(xy/w) is proportional to this.
        let way = frame.clip_from_relative * vec4(unit_normal, 0.0);
        let pixels = (way.xy * out.position.w - out.position.xy * way.w) * frame.size;
        let step = unit(vec3(pixels, 0.0)).xy * (2.0 * width * frame.size.y) / frame.size;
        out.position = vec4(out.position.xy + step * out.position.w, out.position.zw);
    }
    @end
    @if(EDGES)
    // An edge lies in its surface, and its line is a pixel wide: nearer by two pixels' sizes it is seen on what slopes by
    // up to two. In clip space that is a share of z where what is far is small, a distance where it is not.
    let rows = transpose(frame.clip_from_relative);
    let pixel = 2.0 / (frame.size.y * tall(rows));
    out.position.z += 2.0 * pixel * (abs(out.position.z) * length(rows[3].xyz) + length(rows[2].xyz));
    @end
    @if(PLACE) out.relative = relative;
    @if(NORMAL_OUT) out.normal = unit_normal;
    @if(SEEN_JOINTS)
    out.joints = joint_color(in.joints.x) * in.weights.x + joint_color(in.joints.y) * in.weights.y
        + joint_color(in.joints.z) * in.weights.z + joint_color(in.joints.w) * in.weights.w;
    @end
    @if(SEEN_JOINTS && SKIN_8)
    out.joints += joint_color(in.joints_high.x) * in.weights_high.x + joint_color(in.joints_high.y) * in.weights_high.y
        + joint_color(in.joints_high.z) * in.weights_high.z + joint_color(in.joints_high.w) * in.weights_high.w;
    @end
    @if(TANGENT)
    let along = vec3(dot(m.x.xyz, tangent), dot(m.y.xyz, tangent), dot(m.z.xyz, tangent));
    out.tangent = vec4(unit(along), in.tangent.w * handedness);
    @end
    // The root mean square of the three axes.
    @if(VOLUME || REFRACTION) out.scale = sqrt((dot(m.x.xyz, m.x.xyz) + dot(m.y.xyz, m.y.xyz) + dot(m.z.xyz, m.z.xyz)) / 3.0);
    @if(TRIPLANAR) out.model_at = in.position;
    @if(TRIPLANAR) out.model_normal = in.normal.xyz;
    @if(TRIPLANAR && TANGENT) out.model_tangent = in.tangent.xyz;
    @if(UV0) out.uv0 = in.uv0;
    @if(UV1) out.uv1 = in.uv1;
    @if(VERTEX_COLOR && TINT) out.color = in.color * instances[in.instance].tint;
    @if(VERTEX_COLOR && !TINT) out.color = in.color;
    @if(!VERTEX_COLOR && TINT) out.color = instances[in.instance].tint;
    return out;
}
