//! Levels of detail: coarser versions of what is on stage so often that most of its copies must be small.
//!
//! A coarser version is a primitive of its own with some of the vertices (edge collapse by quadric error: M. Garland, P. Heckbert,
//! "Surface Simplification Using Quadric Error Metrics", SIGGRAPH 1997; by meshoptimizer), so that joints, morph targets and textures
//! work as they did. How far its surface is off is known in metres; the planner takes the coarsest that is off by no more than
//! [`TOLERANCE`] on the picture.

use crate::plan::Rows;
use crate::plan::build::Planner;
use crate::scene_resources::PrimitiveEntry;
use crate::scene_resources::bounds::Aabb;
use crate::scene_resources::hausdorff::{Surface, deviation};
use choreo_asset::{MorphTarget, Primitive, Topology};
use glam::Vec3;
use meshopt::{SimplifyOptions, VertexDataAdapter};

/// So many copies of a primitive make a crowd; fewer are always drawn as they are.
pub const CROWD: usize = 64;
/// What a coarser version may be off, in pixels.
pub const TOLERANCE: f32 = 1.0;
/// One in so many triangles is left at each level.
const SHARES: [usize; 6] = [2, 4, 8, 16, 32, 64];
/// How much farther a surface may be off than the places say that are looked at.
const SLACK: f32 = 1.1;
/// How much farther off a surface with its seams may be than one without.
const DEARER: f32 = 1.5;
/// Fewer triangles are not worth a draw of their own.
const LEAST: usize = 12;

/// A coarser version in the catalogue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// Index into `Catalog::primitives`.
    pub primitive: u32,
    /// How far its surface is from the primitive's own at most, metres in the mesh's space.
    pub error: f32,
}

/// Coarser versions and how far each is off, the finest first; none of lines and points and of what is coarse already.
/// Indices must be in range.
pub(crate) fn coarser(primitive: &Primitive) -> Vec<(Primitive, f32)> {
    let triangles = primitive.indices.len() / 3;
    let whole = primitive.indices.len() == 3 * triangles && primitive.positions.iter().all(|p| p.is_finite());
    if primitive.topology != Topology::Triangles || !whole {
        return Vec::new();
    }
    let bytes: &[u8] = bytemuck::cast_slice(&primitive.positions);
    let Ok(vertices) = VertexDataAdapter::new(bytes, size_of::<Vec3>(), 0) else { return Vec::new() };
    let mut levels = Vec::new();
    let mut before = triangles;
    for share in SHARES {
        let wanted = triangles / share;
        if wanted < LEAST {
            break;
        }
        let options = SimplifyOptions::ErrorAbsolute | SimplifyOptions::Prune;
        let simplified = |options| {
            let (indices, mut error) = (&primitive.indices, 0.0);
            let left = meshopt::simplify(indices, &vertices, 3 * wanted, f32::MAX, options, Some(&mut error));
            (left, error)
        };
        // Seams of normals and texture coordinates are kept where the surface keeps its shape with them: of what has a seam at
        // every edge nothing good is left.
        let (kept, free) = (simplified(options), simplified(options | SimplifyOptions::Permissive));
        let keeps = kept.0.len() <= 4 * wanted && kept.1 <= DEARER * free.1;
        let (indices, error) = if keeps { kept } else { free };
        let left = indices.len() / 3;
        if left == 0 || 4 * left > 3 * before || !error.is_finite() {
            continue;
        }
        before = left;
        // meshoptimizer's own error is a mean of distances to planes.
        let fine = Surface { positions: &primitive.positions, indices: &primitive.indices };
        let off = deviation(fine, Surface { positions: &primitive.positions, indices: &indices });
        levels.push((with_triangles(primitive, indices), SLACK * off));
    }
    levels
}

/// The same with these triangles and the vertices that they use, in the order of first use.
fn with_triangles(p: &Primitive, mut indices: Vec<u32>) -> Primitive {
    let mut places = vec![u32::MAX; p.positions.len()];
    let mut used: Vec<usize> = Vec::new();
    for index in &mut indices {
        let place = &mut places[*index as usize];
        if *place == u32::MAX {
            *place = used.len() as u32;
            used.push(*index as usize);
        }
        *index = *place;
    }
    fn of<T: Copy>(used: &[usize], all: &[T]) -> Vec<T> {
        if all.is_empty() { Vec::new() } else { used.iter().map(|v| all[*v]).collect() }
    }
    let influences = |v: &usize| v * p.influences..(v + 1) * p.influences;
    Primitive {
        topology: p.topology,
        indices,
        positions: of(&used, &p.positions),
        normals: of(&used, &p.normals),
        tangents: of(&used, &p.tangents),
        uvs: [of(&used, &p.uvs[0]), of(&used, &p.uvs[1])],
        colors: of(&used, &p.colors),
        influences: p.influences,
        joint_indices: used.iter().flat_map(|v| p.joint_indices[influences(v)].iter().copied()).collect(),
        joint_weights: used.iter().flat_map(|v| p.joint_weights[influences(v)].iter().copied()).collect(),
        morphs: (p.morphs.iter())
            .map(|m| MorphTarget {
                positions: of(&used, &m.positions),
                normals: of(&used, &m.normals),
                tangents: of(&used, &m.tangents),
            })
            .collect(),
        material: p.material,
    }
}

impl Planner<'_> {
    /// The coarsest version of a copy that is close enough on the picture.
    pub fn entry_by_size(
        &mut self,
        entry: &PrimitiveEntry,
        bounds: Aabb,
        skin: Option<usize>,
        rigid: &Rows,
    ) -> PrimitiveEntry {
        let levels = self.catalog.levels.get(entry.primitive as usize).map_or(&[][..], Vec::as_slice);
        if levels.is_empty() || self.options.full_detail {
            return *entry;
        }
        // Of what the copy shows of a metre of its mesh, in pixels, where it is nearest.
        let half = (bounds.max - bounds.min).length() * 0.5;
        let metre = self.view.pixels_per_metre(self.view.depth(bounds.center()) - half, self.options.size);
        let scale = match skin.map(|s| &self.skins[s]) {
            Some(skin) => {
                let place = if skin.placed { rigid.largest_stretch() } else { 1.0 };
                skin.rows.iter().map(Rows::largest_stretch).fold(0.0, f32::max) * place
            }
            None => rigid.largest_stretch(),
        };
        let close = |level: &&Level| level.error * scale * metre <= TOLERANCE;
        match levels.iter().rev().find(close) {
            Some(level) => {
                self.facts.coarse += 1;
                PrimitiveEntry { primitive: level.primitive, ..*entry }
            }
            None => *entry,
        }
    }
}
