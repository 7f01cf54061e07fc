// Pre-skinning: deforms vertices once for all passes that draw them. Writes the positions of a deformed mesh, then its normals,
// then its tangents. Invocations along x are vertices of one mesh, those along y its deformations. CPU reference:
// core/render/src/cpu/preskin.rs.

struct Job {
    // relative-from-model of dual-quaternion skins and of copies, relative-from-mesh without a skin
    relative_from_mesh: Rows,
    first_joint: u32,
    first_morph: u32,
    morph_count: u32,
    // Index of the deformed mesh's first number in `posed_vertices`
    first: u32,
}

struct Posing {
    first_job: u32,
    vertex_count: u32,
}

var<immediate> posing: Posing;
// Vertices as vertex_layout.rs packs them, in words: positions as floats, other attributes in halves of words.
@group(2) @binding(0) var<storage, read> vertices: array<u32>;
@group(3) @binding(0) var<storage, read> jobs: array<Job>;
@group(3) @binding(1) var<storage, read_write> posed_vertices: array<f32>;

const NORMAL_AT: u32 = 3u;
@if(NORMAL) const TANGENT_AT: u32 = NORMAL_AT + 2u;
@if(!NORMAL) const TANGENT_AT: u32 = NORMAL_AT;
@if(TANGENT) const JOINTS_AT: u32 = TANGENT_AT + 2u;
@if(!TANGENT) const JOINTS_AT: u32 = TANGENT_AT;
@if(SKIN_8) const STRIDE: u32 = JOINTS_AT + 8u;
@if(SKIN && !SKIN_8) const STRIDE: u32 = JOINTS_AT + 4u;
@if(!SKIN) const STRIDE: u32 = JOINTS_AT;

fn signed_fractions(at: u32) -> vec4<f32> {
    return vec4(unpack2x16snorm(vertices[at]), unpack2x16snorm(vertices[at + 1u]));
}

fn fractions(at: u32) -> vec4<f32> {
    return vec4(unpack2x16unorm(vertices[at]), unpack2x16unorm(vertices[at + 1u]));
}

fn numbers(at: u32) -> vec4<u32> {
    let low = vertices[at];
    let high = vertices[at + 1u];
    return vec4(low & 0xffffu, low >> 16u, high & 0xffffu, high >> 16u);
}

fn put(at: u32, v: vec3<f32>) {
    posed_vertices[at] = v.x;
    posed_vertices[at + 1u] = v.y;
    posed_vertices[at + 2u] = v.z;
}

@compute @workgroup_size(64)
fn pose(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= posing.vertex_count { return; }
    let job = posing.first_job + id.y;
    let at = index * STRIDE;

    var shape: Shape;
    shape.position = bitcast<vec3<f32>>(vec3(vertices[at], vertices[at + 1u], vertices[at + 2u]));
    @if(NORMAL) shape.normal = signed_fractions(at + NORMAL_AT).xyz;
    @if(TANGENT) let tangent = signed_fractions(at + TANGENT_AT);
    @if(TANGENT) shape.tangent = tangent.xyz;
    @if(MORPH) shape = morphed(shape, jobs[job].first_morph, jobs[job].morph_count, index);

    @if(SKIN && !SKIN_8) let by = Influences(numbers(at + JOINTS_AT), fractions(at + JOINTS_AT + 2u));
    @if(SKIN_8) let by = Influences(numbers(at + JOINTS_AT), fractions(at + JOINTS_AT + 2u), numbers(at + JOINTS_AT + 4u), fractions(at + JOINTS_AT + 6u));
    @if(SKIN && !DUAL_QUATERNIONS && !SKIN_INSTANCED) let m = skinned(jobs[job].first_joint, by);
    @if(DUAL_QUATERNIONS || SKIN_INSTANCED) let m = after(jobs[job].relative_from_mesh, skinned(jobs[job].first_joint, by));
    @if(!SKIN) let m = jobs[job].relative_from_mesh;

    let first = jobs[job].first;
    put(first + 3u * index, placed(m, shape.position));
    @if(NORMAL) let turned = turned_normal(m, shape.normal);
    @if(NORMAL) put(first + 3u * (posing.vertex_count + index), turned.xyz);
    @if(TANGENT)
    let way = turned_tangent(m, shape.tangent, tangent.w * turned.w);
    let at_tangent = first + 6u * posing.vertex_count + 4u * index;
    put(at_tangent, way.xyz);
    posed_vertices[at_tangent + 3u] = way.w;
    @end
}
