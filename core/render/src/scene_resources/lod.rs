//! Levels of detail (LOD) of crowds: simplified versions of primitives that are drawn so often that most copies must be small.
//!
//! A level is a primitive of its own with some of the vertices (edge collapse by quadric error: M. Garland, P. Heckbert,
//! "Surface Simplification Using Quadric Error Metrics", SIGGRAPH 1997; by meshoptimizer), so that joints, morph targets and
//! textures work as before. Its geometric error is known in meters; a plan takes the coarsest level whose error is at most
//! [`TOLERANCE`] on the screen.

use crate::scene_resources::hausdorff::{Surface, hausdorff_distance};
use choreo_asset::{MorphTarget, Primitive, Topology};
use glam::Vec3;
use meshopt::{SimplifyOptions, VertexDataAdapter};

/// Number of copies from which a primitive is a crowd. Others are always drawn in full detail.
pub const CROWD: usize = 64;
/// Geometric error that a level may show, in pixels.
pub const TOLERANCE: f32 = 1.0;
/// Each level keeps one triangle in 2, 4, ….
const SHARES: [usize; 6] = [2, 4, 8, 16, 32, 64];
/// Factor for the error between the sampled points of the Hausdorff distance.
const SLACK: f32 = 1.1;
/// Factor by which the error may grow to keep the seams of normals and texture coordinates.
const SEAM_FACTOR: f32 = 1.5;
/// Levels with fewer triangles are not worth a draw of their own.
const LEAST: usize = 12;

/// A simplified version of a primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LodLevel {
    /// Index into `SceneResources::primitives`.
    pub primitive: u32,
    /// Largest distance between its surface and the original one, meters in mesh space.
    pub error: f32,
}

/// Simplified versions and the geometric error of each, the finest first; none for lines, points and meshes that are coarse
/// already. Indices must be in range.
pub(crate) fn simplified(primitive: &Primitive) -> Vec<(Primitive, f32)> {
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
        let simplify = |options| {
            let (indices, mut error) = (&primitive.indices, 0.0);
            let left = meshopt::simplify(indices, &vertices, 3 * wanted, f32::MAX, options, Some(&mut error));
            (left, error)
        };
        // Seams are kept where the surface keeps its shape with them: a mesh with a seam at every edge cannot be simplified well.
        let (kept, free) = (simplify(options), simplify(options | SimplifyOptions::Permissive));
        let keeps = kept.0.len() <= 4 * wanted && kept.1 <= SEAM_FACTOR * free.1;
        let (indices, error) = if keeps { kept } else { free };
        let left = indices.len() / 3;
        if left == 0 || 4 * left > 3 * before || !error.is_finite() {
            continue;
        }
        before = left;
        // meshoptimizer's own error is a mean of distances to planes.
        let fine = Surface { positions: &primitive.positions, indices: &primitive.indices };
        let off = hausdorff_distance(fine, Surface { positions: &primitive.positions, indices: &indices });
        levels.push((with_triangles(primitive, indices), SLACK * off));
    }
    levels
}

/// The primitive with these triangles and the vertices that they use, in order of first use.
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
