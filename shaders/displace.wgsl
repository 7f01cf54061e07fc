// Effects that displace the vertices of surfaces. Their functions are appended, and `vertex_effects`, which calls them.
// CPU reference: core/render/src/cpu/displace.rs.

@if(DISPLACED)
struct VertexSample {
    world: vec3<f32>,
    normal: vec3<f32>,
    uv: vec2<f32>,
    model: vec3<f32>,
}

// Rotates and scales a direction from mesh space to world axes.
fn turned_by(m: Rows, way: vec3<f32>) -> vec3<f32> {
    return vec3(dot(m.x.xyz, way), dot(m.y.xyz, way), dot(m.z.xyz, way));
}

// Limits an offset to the largest displacement of the effect with this index.
fn within_reach(offset: vec3<f32>, index: u32) -> vec3<f32> {
    let reach = surface_parameters[index / 4u][index % 4u];
    return offset * min(1.0, reach / max(length(offset), 1e-20));
}
@end

@if(DISPLACED && NORMAL)
// Step of the finite differences in metres: a power of two, so that adding it rounds little.
const DISPLACED_STEP: f32 = 0.00390625;

fn shifted(vertex: VertexSample, m: Rows, way: vec3<f32>) -> VertexSample {
    var there = vertex;
    there.world += way * DISPLACED_STEP;
    // Inverse of the transform's linear part, by cofactors.
    let x = cross(m.y.xyz, m.z.xyz);
    let y = cross(m.z.xyz, m.x.xyz);
    let z = cross(m.x.xyz, m.y.xyz);
    let determinant = dot(m.x.xyz, x);
    if (abs(determinant) > 1e-30) {
        there.model += (x * way.x + y * way.y + z * way.z) * (DISPLACED_STEP / determinant);
    }
    return there;
}

// Normal of the displaced surface: the cross product of the displaced steps along two tangents.
fn displaced_normal(vertex: VertexSample, m: Rows, offset: vec3<f32>) -> vec3<f32> {
    // Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
    let n = vertex.normal;
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    let t = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    let u = vec3(b, s + n.y * n.y * a, -n.y);
    let along = t * DISPLACED_STEP + (vertex_effects(shifted(vertex, m, t), m) - offset);
    let across = u * DISPLACED_STEP + (vertex_effects(shifted(vertex, m, u), m) - offset);
    // Both steps are normalized first, so that the product of two small steps does not vanish.
    return unit(cross(unit(along), unit(across)));
}
@end
