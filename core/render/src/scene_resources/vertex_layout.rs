//! Vertex and index buffers: interleaved, with only the attributes that a draw's features read.
//!
//! Positions and texture coordinates stay f32. Normals and tangents are 16-bit signed fractions (angular error below
//! 0.003°), colors and weights 16-bit unsigned fractions (error ≤ 1/131070; the rounded weights of a vertex still sum to 1).

use crate::scene_resources::morph_buffers;
use crate::scene_resources::thick_lines::thick_mesh;
use choreo_asset::Primitive;
use glam::{Vec3, Vec4};

/// Set of vertex attributes, one bit for each location of vertex.wgsl; the upper bits select the order of vertices and indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VertexLayout(pub u16);

/// (location, size in bytes, format) of every attribute.
const ATTRIBUTES: [(u32, u32, Format); 12] = [
    (0, 12, Format::F32x3),
    (1, 8, Format::Snorm16x4),
    (2, 8, Format::Snorm16x4),
    (3, 8, Format::F32x2),
    (4, 8, Format::F32x2),
    (5, 8, Format::Unorm16x4),
    (6, 8, Format::Uint16x4),
    (7, 8, Format::Unorm16x4),
    (8, 8, Format::Uint16x4),
    (9, 8, Format::Unorm16x4),
    (10, 12, Format::F32x3),
    (11, 12, Format::F32x3),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    F32x2,
    F32x3,
    Snorm16x4,
    Unorm16x4,
    Uint16x4,
}

impl VertexLayout {
    /// Thick lines have round ends, and points are discs.
    pub(crate) const ROUND: u16 = 1 << 12;
    /// Triangles of watertight surfaces come first; see [`crate::scene_resources::watertight`].
    pub(crate) const WATERTIGHT_FIRST: u16 = 1 << 13;
    /// Indices are those of [`unique_edges`], two for each line.
    pub const EDGES: u16 = 1 << 14;
    /// Normals are those of [`welded_normals`].
    pub(crate) const WELDED: u16 = 1 << 15;

    pub fn has(self, location: u32) -> bool {
        self.0 & (1 << location) != 0
    }

    /// (location, byte offset, format) of each attribute in the set, and the stride.
    pub fn attributes(self) -> (Vec<(u32, u32, Format)>, u32) {
        let mut offset = 0;
        let mut list = Vec::new();
        for (location, size, format) in ATTRIBUTES {
            if self.has(location) {
                list.push((location, offset, format));
                offset += size;
            }
        }
        (list, offset)
    }
}

/// Vertex and index buffers of one primitive.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedMesh {
    pub vertices: Vec<u8>,
    pub vertex_count: u32,
    /// Indices of 16 bits if all fit, else of 32.
    pub indices: Vec<u8>,
    pub index_count: u32,
    pub wide_indices: bool,
}

fn snorm16(v: f32) -> i16 {
    // Ties away from zero; NaN becomes 0.
    libm::roundf(v.clamp(-1.0, 1.0) * 32767.0) as i16
}

fn unorm16(v: f32) -> u16 {
    libm::roundf(v.clamp(0.0, 1.0) * 65535.0) as u16
}

/// Four or eight weights in units of 1/65535 that sum to 65535. The largest weight absorbs the rounding of the others.
fn weights16(weights: &[f32]) -> [u16; 8] {
    let mut out = [0u16; 8];
    let mut largest = 0;
    for (i, w) in weights.iter().take(8).enumerate() {
        out[i] = unorm16(*w);
        if out[i] > out[largest] {
            largest = i;
        }
    }
    let others: i32 = (0..8).filter(|i| *i != largest).map(|i| out[i] as i32).sum();
    out[largest] = (65535 - others).clamp(0, 65535) as u16;
    out
}

/// Packs a primitive. `indices` are in the layout's order ([`crate::scene_resources::PrimitiveResource::indices`]).
pub fn pack(p: &Primitive, indices: &[u32], layout: VertexLayout) -> PackedMesh {
    let wide = layout.has(10).then(|| thick_mesh(p, layout.0 & VertexLayout::ROUND != 0));
    let (order, indices) = match &wide {
        Some(wide) => (wide.source_vertices.clone(), wide.indices.clone()),
        None => first_use_order(p, indices),
    };
    let stride = layout.attributes().1 as usize;
    let mut bytes = Vec::with_capacity(order.len() * stride);
    let welded = if layout.0 & VertexLayout::WELDED != 0 { welded_normals(p) } else { Vec::new() };
    let normals = if welded.is_empty() { &p.normals } else { &welded };
    let snorm4 = |v: Vec4| [v.x, v.y, v.z, v.w].map(snorm16);
    for (at, &v) in order.iter().enumerate() {
        let v = v as usize;
        if layout.has(0) {
            bytes.extend_from_slice(bytemuck::bytes_of(&p.positions[v]));
        }
        if layout.has(1) {
            // Lines and points without normals may be lit; their normals point up.
            let n = normals.get(v).copied().unwrap_or(Vec3::Y);
            bytes.extend_from_slice(bytemuck::cast_slice(&snorm4(n.extend(0.0))));
        }
        if layout.has(2) {
            let t = p.tangents.get(v).copied().unwrap_or(Vec4::ZERO);
            bytes.extend_from_slice(bytemuck::cast_slice(&snorm4(t)));
        }
        for set in 0..2 {
            if layout.has(3 + set as u32) {
                let uv = p.uvs[set].get(v).copied().unwrap_or_default();
                bytes.extend_from_slice(bytemuck::bytes_of(&uv));
            }
        }
        if layout.has(5) {
            let c = p.colors.get(v).copied().unwrap_or(Vec4::ONE);
            bytes.extend_from_slice(bytemuck::cast_slice(&[c.x, c.y, c.z, c.w].map(unorm16)));
        }
        if layout.has(6) {
            let at = v * p.influences..(v + 1) * p.influences;
            let mut joints = [0u16; 8];
            let given = p.joint_indices.get(at.clone()).unwrap_or(&[]);
            joints[..given.len().min(8)].copy_from_slice(&given[..given.len().min(8)]);
            let weights = weights16(p.joint_weights.get(at).unwrap_or(&[1.0]));
            bytes.extend_from_slice(bytemuck::cast_slice(&joints[..4]));
            bytes.extend_from_slice(bytemuck::cast_slice(&weights[..4]));
            if layout.has(8) {
                bytes.extend_from_slice(bytemuck::cast_slice(&joints[4..]));
                bytes.extend_from_slice(bytemuck::cast_slice(&weights[4..]));
            }
        }
        if let Some(wide) = &wide {
            bytes.extend_from_slice(bytemuck::bytes_of(&p.positions[wide.other_ends[at] as usize]));
            bytes.extend_from_slice(bytemuck::bytes_of(&wide.offsets[at]));
        }
    }
    let indices = if layout.0 & VertexLayout::EDGES != 0 { unique_edges(&indices) } else { indices };
    let wide_indices = order.len() > 0xffff;
    let index_count = indices.len() as u32;
    let indices = if wide_indices {
        bytemuck::cast_slice(&indices).to_vec()
    } else {
        indices.iter().flat_map(|i| (*i as u16).to_ne_bytes()).collect()
    };
    PackedMesh { vertices: bytes, vertex_count: order.len() as u32, indices, index_count, wide_indices }
}

/// Offsets of all morph targets for the vertices of [`pack`]; see `morph_buffers::pack_morphs`.
pub fn pack_morphs(p: &Primitive, indices: &[u32], layout: VertexLayout) -> Vec<u8> {
    let order = match layout.has(10) {
        true => thick_mesh(p, layout.0 & VertexLayout::ROUND != 0).source_vertices,
        false => first_use_order(p, indices).0,
    };
    morph_buffers::pack_morphs(p, &order, 1 + usize::from(layout.has(1)) + usize::from(layout.has(2)))
}

/// Each edge of the triangles once, as two indices, in the order of their first triangle.
pub fn unique_edges(triangles: &[u32]) -> Vec<u32> {
    let mut all: Vec<([u32; 2], u32)> = Vec::with_capacity(triangles.len());
    for t in triangles.chunks_exact(3) {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            all.push(([a.min(b), a.max(b)], all.len() as u32));
        }
    }
    all.sort_unstable();
    all.dedup_by_key(|(edge, _)| *edge);
    all.sort_unstable_by_key(|(_, first)| *first);
    all.into_iter().flat_map(|(edge, _)| edge).collect()
}

/// One normal for all vertices at a position, the mean of theirs, so that an inverted hull pushed out along the normals has no
/// gaps at hard edges.
pub(crate) fn welded_normals(p: &Primitive) -> Vec<Vec3> {
    if p.normals.len() != p.positions.len() {
        return Vec::new();
    }
    // -0 and 0 are the same position.
    let key = |i: &u32| (p.positions[*i as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..p.positions.len() as u32).collect();
    order.sort_by_key(|i| (key(i), *i));
    let mut out = p.normals.clone();
    for vertices in order.chunk_by(|a, b| key(a) == key(b)).filter(|vertices| vertices.len() > 1) {
        let own: Vec<Vec3> = vertices.iter().map(|i| p.normals[*i as usize]).collect();
        // Each distinct direction counts once, however many triangles share it.
        let mut sum = Vec3::ZERO;
        for (i, n) in own.iter().enumerate() {
            if !own[..i].iter().any(|m| m.dot(*n) > 0.999) {
                sum += *n;
            }
        }
        if let Some(mean) = sum.try_normalize() {
            vertices.iter().for_each(|i| out[*i as usize] = mean);
        }
    }
    out
}

/// Vertices renumbered in the order in which the indices first use them, without unused ones: fetches are sequential, and the
/// small post-transform cache hits more often. Vertices that morph targets move are then grouped.
fn first_use_order(p: &Primitive, indices: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut is_used = vec![false; p.positions.len()];
    let first_use = |i: &&u32| !std::mem::replace(&mut is_used[**i as usize], true);
    let mut order: Vec<u32> = indices.iter().filter(first_use).copied().collect();
    morph_buffers::group_morphed(p, &mut order);
    let mut new_of_old = vec![0; p.positions.len()];
    for (new, old) in (0..).zip(&order) {
        new_of_old[*old as usize] = new;
    }
    let indices = indices.iter().map(|i| new_of_old[*i as usize]).collect();
    (order, indices)
}
