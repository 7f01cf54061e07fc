// Deforms a vertex: morph targets, then the skin. The vertex stage and pre-skinning (preskin.wgsl) call the same functions.
// CPU reference: core/render/src/cpu/vertex.rs.

struct Shape {
    position: vec3<f32>,
    @if(NORMAL) normal: vec3<f32>,
    @if(TANGENT) tangent: vec3<f32>,
}

@if(MORPH)
// Applies morph targets. `first`, `count`: range of active morphs; `index`: index of the vertex.
fn morphed(rest: Shape, first: u32, count: u32, index: u32) -> Shape {
    var shape = rest;
    for (var i = 0u; i < count; i++) {
        let active_morph = active_morphs[first + i];
        // First vertex that the target moves, number of vertices, start of their offsets.
        let moved = morphs[active_morph.target_index];
        let own = index - moved.x;
        if own < moved.y {
            let at = moved.z + own;
            shape.position += active_morph.weight * bitcast<vec3<f32>>(morphs[at].xyz);
            @if(NORMAL) shape.normal += active_morph.weight * bitcast<vec3<f32>>(morphs[at + moved.y].xyz);
            @if(TANGENT) shape.tangent += active_morph.weight * bitcast<vec3<f32>>(morphs[at + 2u * moved.y].xyz);
        }
    }
    return shape;
}
@end

@if(SKIN)
fn weigh(sum: Rows, joint: u32, weight: f32) -> Rows {
    let m = joints[joint];
    return Rows(sum.x + weight * m.x, sum.y + weight * m.y, sum.z + weight * m.z);
}
@end

@if(DUAL_QUATERNIONS)
// CPU reference: core/motion/src/skinning/dual_quaternion.rs. Stretches are blended as matrices, then motions as dual
// quaternions.
struct DualSum {
    real: vec4<f32>,
    dual: vec4<f32>,
    stretch: Rows,
}

// Adds a joint, with the sign that brings it nearer to the heaviest influence.
fn weigh_dual(sum: DualSum, pivot: vec4<f32>, joint: u32, weight: f32) -> DualSum {
    let q = joints[joint].x;
    let signed = select(weight, -weight, dot(q, pivot) < 0.0);
    return DualSum(sum.real + signed * q, sum.dual + signed * joints[joint].y, weigh(sum.stretch, joint + 1u, weight));
}

// The rotation and translation of a dual quaternion, which need not be normalized.
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

@if(DUAL_QUATERNIONS || SKIN_INSTANCED)
// Row of a product of transforms: `outer` is a row of the one applied last.
fn row_after(outer: vec4<f32>, inner: Rows) -> vec4<f32> {
    return inner.x * outer.x + inner.y * outer.y + inner.z * outer.z + vec4(0.0, 0.0, 0.0, outer.w);
}

fn after(outer: Rows, inner: Rows) -> Rows {
    return Rows(row_after(outer.x, inner), row_after(outer.y, inner), row_after(outer.z, inner));
}
@end

@if(SKIN)
struct Influences {
    joints: vec4<u32>,
    weights: vec4<f32>,
    @if(SKIN_8) joints_high: vec4<u32>,
    @if(SKIN_8) weights_high: vec4<f32>,
}
@end

@if(SKIN && !DUAL_QUATERNIONS)
// Blended matrix, relative-from-mesh. `first`: index of the skin's first joint.
fn skinned(first: u32, by: Influences) -> Rows {
    var m = Rows(vec4(0.0), vec4(0.0), vec4(0.0));
    m = weigh(m, first + by.joints.x, by.weights.x);
    m = weigh(m, first + by.joints.y, by.weights.y);
    m = weigh(m, first + by.joints.z, by.weights.z);
    m = weigh(m, first + by.joints.w, by.weights.w);
    @if(SKIN_8)
    m = weigh(m, first + by.joints_high.x, by.weights_high.x);
    m = weigh(m, first + by.joints_high.y, by.weights_high.y);
    m = weigh(m, first + by.joints_high.z, by.weights_high.z);
    m = weigh(m, first + by.joints_high.w, by.weights_high.w);
    @end
    return m;
}
@end

@if(DUAL_QUATERNIONS)
// Blended transform, model-from-mesh. `first`: index of the skin's first entry in `joints`; each joint has two.
fn skinned(first: u32, by: Influences) -> Rows {
    var heaviest = vec2<f32>(by.weights.x, f32(by.joints.x));
    if by.weights.y > heaviest.x { heaviest = vec2(by.weights.y, f32(by.joints.y)); }
    if by.weights.z > heaviest.x { heaviest = vec2(by.weights.z, f32(by.joints.z)); }
    if by.weights.w > heaviest.x { heaviest = vec2(by.weights.w, f32(by.joints.w)); }
    @if(SKIN_8)
    if by.weights_high.x > heaviest.x { heaviest = vec2(by.weights_high.x, f32(by.joints_high.x)); }
    if by.weights_high.y > heaviest.x { heaviest = vec2(by.weights_high.y, f32(by.joints_high.y)); }
    if by.weights_high.z > heaviest.x { heaviest = vec2(by.weights_high.z, f32(by.joints_high.z)); }
    if by.weights_high.w > heaviest.x { heaviest = vec2(by.weights_high.w, f32(by.joints_high.w)); }
    @end
    let pivot = joints[first + 2u * u32(heaviest.y)].x;
    let nothing = vec4<f32>(0.0);
    var sum = DualSum(nothing, nothing, Rows(nothing, nothing, nothing));
    sum = weigh_dual(sum, pivot, first + 2u * by.joints.x, by.weights.x);
    sum = weigh_dual(sum, pivot, first + 2u * by.joints.y, by.weights.y);
    sum = weigh_dual(sum, pivot, first + 2u * by.joints.z, by.weights.z);
    sum = weigh_dual(sum, pivot, first + 2u * by.joints.w, by.weights.w);
    @if(SKIN_8)
    sum = weigh_dual(sum, pivot, first + 2u * by.joints_high.x, by.weights_high.x);
    sum = weigh_dual(sum, pivot, first + 2u * by.joints_high.y, by.weights_high.y);
    sum = weigh_dual(sum, pivot, first + 2u * by.joints_high.z, by.weights_high.z);
    sum = weigh_dual(sum, pivot, first + 2u * by.joints_high.w, by.weights_high.w);
    @end
    return after(motion(sum.real, sum.dual), sum.stretch);
}
@end

fn placed(m: Rows, position: vec3<f32>) -> vec3<f32> {
    let p = vec4(position, 1.0);
    return vec3(dot(m.x, p), dot(m.y, p), dot(m.z, p));
}

// Transformed normal, not normalized; w: −1 if the transform mirrors.
fn turned_normal(m: Rows, normal: vec3<f32>) -> vec4<f32> {
    // Normals are transformed by the cofactor matrix: the inverse transpose times the determinant, whose sign is removed again.
    let cofactor_x = cross(m.y.xyz, m.z.xyz);
    let cofactor_y = cross(m.z.xyz, m.x.xyz);
    let cofactor_z = cross(m.x.xyz, m.y.xyz);
    let handedness = select(1.0, -1.0, dot(m.x.xyz, cofactor_x) < 0.0);
    let turned = vec3(dot(cofactor_x, normal), dot(cofactor_y, normal), dot(cofactor_z, normal));
    return vec4(unit(turned * handedness), handedness);
}

fn turned_tangent(m: Rows, tangent: vec3<f32>, sign: f32) -> vec4<f32> {
    let along = vec3(dot(m.x.xyz, tangent), dot(m.y.xyz, tangent), dot(m.z.xyz, tangent));
    return vec4(unit(along), sign);
}
