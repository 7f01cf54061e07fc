//! Skinning of vertices in blocks of as many as a register has lanes.

use super::{Indices, Vertices};

/// Skinning method for a block of vertices.
pub(crate) trait Deformer {
    /// Positions and unit normals of as many vertices as there are lanes, with N influences each. N = 0: any number of
    /// influences, and possibly joints for fewer vertices.
    fn deform<F: Vertices, const N: usize>(&self, block: Block) -> DeformedBlock<F>;
}

/// The vertices of a block.
#[derive(Clone, Copy)]
pub(crate) struct Block<'a> {
    pub influences: usize,
    pub joints: Indices<'a>,
    pub weights: &'a [f32],
    pub points: &'a [[f32; 3]],
    pub normals: Option<&'a [[f32; 3]]>,
}

/// Positions and, where there are any, normals.
pub(crate) type DeformedBlock<F> = ([F; 3], Option<[F; 3]>);

/// Input and output of skinning. There are `influences` joints and weights per vertex, and as many normals as positions, or none.
pub(crate) struct VertexStreams<'a> {
    pub influences: usize,
    pub joint_indices: &'a [u16],
    pub joint_weights: &'a [f32],
    pub positions: &'a [[f32; 3]],
    pub normals: &'a [[f32; 3]],
    pub out_positions: &'a mut [[f32; 3]],
    pub out_normals: &'a mut [[f32; 3]],
}

/// Largest number of lanes of a register.
const MAX_LANES: usize = 16;

impl VertexStreams<'_> {
    #[inline(always)]
    pub(crate) fn run<F: Vertices, D: Deformer>(mut self, deformer: &D) {
        // Whole blocks have their own loop: a call in it, even if only for the last vertices, would put all registers on the
        // stack (2.8 ns per vertex instead of 1.9, once measured). Known numbers of influences are unrolled.
        let whole = self.positions.len() / F::COUNT * F::COUNT;
        // Whether there are normals is also known: a branch between positions and normals would spill matrices.
        let joints = Indices::new(self.joint_indices);
        match (self.influences, self.normals.is_empty()) {
            (4, false) => self.deform_blocks::<F, D, 4, true>(deformer, joints, whole),
            (4, true) => self.deform_blocks::<F, D, 4, false>(deformer, joints, whole),
            (8, false) => self.deform_blocks::<F, D, 8, true>(deformer, joints, whole),
            (8, true) => self.deform_blocks::<F, D, 8, false>(deformer, joints, whole),
            (_, false) => self.deform_blocks::<F, D, 0, true>(deformer, joints, whole),
            (_, true) => self.deform_blocks::<F, D, 0, false>(deformer, joints, whole),
        }
        self.deform_last::<F, D>(deformer, joints, whole);
    }

    #[inline(always)]
    fn deform_blocks<F: Vertices, D: Deformer, const N: usize, const NORMALS: bool>(
        &mut self,
        deformer: &D,
        joints: Indices,
        end: usize,
    ) {
        for first in (0..end).step_by(F::COUNT) {
            self.deform_block::<F, D, N, NORMALS>(deformer, joints, first);
        }
    }

    #[inline(always)]
    fn deform_block<F: Vertices, D: Deformer, const N: usize, const NORMALS: bool>(
        &mut self,
        deformer: &D,
        joints: Indices,
        first: usize,
    ) {
        let influences = if N == 0 { self.influences } else { N };
        let range = first * influences..(first + F::COUNT) * influences;
        // All bounds checks come first: the compiler moves sums behind a branch that lies between them and their use, and
        // products, which stay, then go through memory.
        let end = first + F::COUNT;
        let block = Block {
            influences,
            joints: joints.subrange(range.clone()),
            weights: &self.joint_weights[range],
            points: &self.positions[first..end],
            normals: if NORMALS { Some(&self.normals[first..end]) } else { None },
        };
        let out_points = &mut self.out_positions[first..end];
        let out_normals = if NORMALS { &mut self.out_normals[first..end] } else { &mut [] };
        let (points, normals) = deformer.deform::<F, N>(block);
        F::store_point_rows(points, out_points);
        if let Some(normals) = normals {
            F::store_point_rows(normals, out_normals);
        }
    }

    /// Skins the last vertices, fewer than lanes, padded with zeros.
    #[inline(always)]
    fn deform_last<F: Vertices, D: Deformer>(&mut self, deformer: &D, joints: Indices, first: usize) {
        let count = self.positions.len() - first;
        if count == 0 {
            return;
        }
        let range = first * self.influences..self.positions.len() * self.influences;
        let (mut points, mut normals) = ([[0.0; 3]; MAX_LANES], [[0.0; 3]; MAX_LANES]);
        points[..count].copy_from_slice(&self.positions[first..]);
        let has_normals = !self.normals.is_empty();
        if has_normals {
            normals[..count].copy_from_slice(&self.normals[first..]);
        }
        let (out_points, out_normals) = deformer.deform::<F, 0>(Block {
            influences: self.influences,
            joints: joints.subrange(range.clone()),
            weights: &self.joint_weights[range],
            points: &points,
            normals: if has_normals { Some(&normals) } else { None },
        });
        F::store_point_rows(out_points, &mut points);
        self.out_positions[first..].copy_from_slice(&points[..count]);
        if let Some(out_normals) = out_normals {
            F::store_point_rows(out_normals, &mut normals);
            self.out_normals[first..].copy_from_slice(&normals[..count]);
        }
    }
}
