//! Skin matrices and linear blend skinning on the CPU.

use crate::input_error::InputError;
use crate::simd::{
    Block, DeformedBlock, Deformer, Indexed, Lanes, Level, Rows, VertexKernel, VertexStreams, Vertices,
    as_arrays, as_arrays_mut, dispatch_vertices,
};
use glam::{Affine3A, Mat4, Vec3};

/// Skin matrices, model-from-mesh: `out[i] = model_from_joint[joints[i]] * inverse_bind[i]`.
pub struct SkinMatrices<'a> {
    /// Input: one per joint of the skeleton.
    pub model_from_joint: &'a [Affine3A],
    /// Skeleton joint of each skin joint.
    pub joints: &'a [u32],
    /// joint-from-mesh at bind time; the last row is taken as 0 0 0 1 (glTF 2.0 §3.7.3.1). Empty = identities.
    pub inverse_bind: &'a [Mat4],
    /// Output: one matrix per skin joint.
    pub out: &'a mut [Affine3A],
}

impl SkinMatrices<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        let (joints, bind) = (self.joints.len(), self.inverse_bind.len());
        InputError::check_lengths(&[
            ("SkinMatrices.inverse_bind", bind, if bind == 0 { 0 } else { joints }),
            ("SkinMatrices.out", self.out.len(), joints),
        ])?;
        let indices = self.joints.iter().map(|j| *j as usize);
        InputError::check_joints(indices, "SkinMatrices.joints", self.model_from_joint.len())
    }

    /// Computes the matrices; allocates nothing.
    pub fn run(&mut self) {
        for (i, (joint, out)) in self.joints.iter().zip(self.out.iter_mut()).enumerate() {
            let joint = self.model_from_joint[*joint as usize];
            *out = match self.inverse_bind.get(i) {
                Some(m) => joint * Affine3A::from_mat4(*m),
                None => joint,
            };
        }
    }
}

/// Checks the vertex data that every skinning method needs. The last argument: lengths of positions and normals, in and out.
pub(crate) fn check_vertices(
    joints: usize,
    influences: usize,
    joint_indices: &[u16],
    joint_weights: &[f32],
    [positions, normals, out_positions, out_normals]: [usize; 4],
) -> Result<(), InputError> {
    InputError::check_lengths(&[
        ("normals", normals, if normals == 0 { 0 } else { positions }),
        ("joint_indices", joint_indices.len(), positions * influences),
        ("joint_weights", joint_weights.len(), positions * influences),
        ("out_positions", out_positions, positions),
        ("out_normals", out_normals, normals),
    ])?;
    InputError::check_joints(joint_indices.iter().map(|j| usize::from(*j)), "joint_indices", joints)?;
    InputError::check_each(joint_weights, |w| w.is_finite(), "joint_weights", "finite")
}

/// Linear blend skinning of positions and normals.
///
/// Normals are transformed by the blended matrix's cofactors (the inverse transpose up to a positive factor, finite for singular
/// matrices and right for mirroring ones), then normalized; a normal that collapses is unchanged.
pub struct LinearSkinning<'a> {
    /// Skin matrices, model-from-mesh, one per skin joint (see [`SkinMatrices`]).
    pub matrices: &'a [Affine3A],
    /// Influences per vertex, any number; 4 and 8 are fast.
    pub influences: usize,
    /// Indices into `matrices`, `influences` per vertex.
    pub joint_indices: &'a [u16],
    /// Weights with sum 1, `influences` per vertex.
    pub joint_weights: &'a [f32],
    /// Positions in mesh space at bind time, metres.
    pub positions: &'a [Vec3],
    /// Normals, one per position, or none.
    pub normals: &'a [Vec3],
    /// Output: positions in model space, one per position.
    pub out_positions: &'a mut [Vec3],
    /// Output: unit normals in model space, one per normal.
    pub out_normals: &'a mut [Vec3],
}

impl LinearSkinning<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        let lengths =
            [self.positions.len(), self.normals.len(), self.out_positions.len(), self.out_normals.len()];
        check_vertices(self.matrices.len(), self.influences, self.joint_indices, self.joint_weights, lengths)
    }

    /// Skins the vertices. Panics if a joint index is out of range, which `check` finds.
    pub fn run(&mut self) {
        self.run_on(Level::best());
    }

    /// Runs at a SIMD level, for tests and benchmarks; the bits are the same at any.
    pub fn run_on(&mut self, level: Level) {
        dispatch_vertices(level, LinearKernel(self));
    }
}

struct LinearKernel<'a, 'b>(&'b mut LinearSkinning<'a>);

impl VertexKernel for LinearKernel<'_, '_> {
    #[inline(always)]
    fn run<F: Vertices>(self) {
        let job = self.0;
        VertexStreams {
            influences: job.influences,
            joint_indices: job.joint_indices,
            joint_weights: job.joint_weights,
            positions: as_arrays(job.positions),
            normals: as_arrays(job.normals),
            out_positions: as_arrays_mut(job.out_positions),
            out_normals: as_arrays_mut(job.out_normals),
        }
        .run::<F, _>(&LinearDeformer(AlignedMatrices::new().align(job.matrices, job.positions.len())));
    }
}

/// Matrices aligned to cache lines: one that straddles two lines takes two loads (2.6 ns per vertex instead of 1.9, once
/// measured).
#[repr(C, align(64))]
pub(crate) struct AlignedMatrices([Affine3A; AlignedMatrices::MAX_MATRICES]);

impl AlignedMatrices {
    /// 128 matrices take 8 kB, which the L1 cache holds beside the vertices. Larger palettes are not copied.
    const MAX_MATRICES: usize = 128;

    #[inline(always)]
    pub(crate) fn new() -> AlignedMatrices {
        AlignedMatrices([Affine3A::IDENTITY; AlignedMatrices::MAX_MATRICES])
    }

    /// The matrices, copied if there are enough vertices for that to pay.
    #[inline(always)]
    pub(crate) fn align<'a>(&'a mut self, matrices: &'a [Affine3A], vertices: usize) -> &'a [Affine3A] {
        match self.0.get_mut(..matrices.len()) {
            Some(copy) if vertices > 4 * AlignedMatrices::MAX_MATRICES => {
                copy.copy_from_slice(matrices);
                copy
            }
            _ => matrices,
        }
    }
}

struct LinearDeformer<'a>(&'a [Affine3A]);

impl Deformer for LinearDeformer<'_> {
    #[inline(always)]
    fn deform<F: Vertices, const N: usize>(&self, block: Block) -> DeformedBlock<F> {
        let matrices = blend_matrices::<F, N>(self.0, &block);
        let points = transform_points(&matrices, F::load_point_rows(block.points));
        match block.normals {
            Some(normals) => (points, Some(transform_normals(&matrices, F::load_point_rows(normals)))),
            None => (points, None),
        }
    }
}

/// Weighted sums of matrices, for as many vertices as there are lanes, or fewer; N influences, or any number where N is 0.
#[inline(always)]
pub(crate) fn blend_matrices<F: Vertices, const N: usize>(
    matrices: &[Affine3A],
    &Block { influences, joints, weights, .. }: &Block,
) -> Rows<F> {
    if N == 0 {
        let mut fours = [F::interleave_four([F::zero_matrix(); 4]); 4];
        // A chunk must not have 0 elements: without influences there are no vertices here, and all matrices are zero.
        let mut vertices =
            joints.as_slice().chunks_exact(influences.max(1)).zip(weights.chunks_exact(influences.max(1)));
        for four in fours.iter_mut().take(F::COUNT / 4) {
            let mut sums = [F::zero_matrix(); 4];
            for (sum, (joints, weights)) in sums.iter_mut().zip(vertices.by_ref()) {
                *sum = weighted_sum::<F>(matrices, joints, weights);
            }
            *four = F::interleave_four(sums);
        }
        return F::join_columns(fours);
    }
    let (joints, weights) = (joints.subrange(0..F::COUNT * N), &weights[..F::COUNT * N]);
    let (matrices, weights) = (Indexed::new(matrices, joints), weights.as_chunks::<N>().0);
    // A loop's results would go through memory.
    let [a, b] = [
        weighted_sums_of_four::<F, N>(&matrices, 0, weights),
        weighted_sums_of_four::<F, N>(&matrices, 1, weights),
    ];
    F::join_columns(match F::COUNT {
        8 => [a, b, a, b],
        _ => [
            a,
            b,
            weighted_sums_of_four::<F, N>(&matrices, 2, weights),
            weighted_sums_of_four::<F, N>(&matrices, 3, weights),
        ],
    })
}

/// The weighted matrices of four vertices, which stay in registers.
#[inline(always)]
fn weighted_sums_of_four<F: Vertices, const N: usize>(
    matrices: &Indexed<Affine3A>,
    at: usize,
    weights: &[[f32; N]],
) -> F::Four {
    let mut sums = [F::zero_matrix(); 4];
    for (i, sum) in sums.iter_mut().enumerate() {
        let vertex = 4 * at + i;
        *sum = weighted_sum_of_fours::<F, N>(matrices, vertex * N / 4, &weights[vertex]);
    }
    F::interleave_four(sums)
}

/// The weighted sum of one vertex's matrices.
#[inline(always)]
fn weighted_sum<F: Vertices>(matrices: &[Affine3A], joints: &[u16], weights: &[f32]) -> F::Matrix {
    let mut sum = F::zero_matrix();
    for (i, (joint, weight)) in joints.iter().zip(weights).enumerate() {
        let matrix = &matrices[usize::from(*joint)];
        sum = if i == 0 {
            F::scaled_matrix(matrix, *weight)
        } else {
            F::add_scaled_matrix(sum, matrix, *weight)
        };
    }
    sum
}

/// Like [`weighted_sum`], for a known number of influences that is a multiple of four. `first`: index of the first four.
#[inline(always)]
fn weighted_sum_of_fours<F: Vertices, const N: usize>(
    matrices: &Indexed<Affine3A>,
    first: usize,
    weights: &[f32; N],
) -> F::Matrix {
    let mut sum = F::zero_matrix();
    for (i, weights) in weights.as_chunks::<4>().0.iter().enumerate() {
        let matrices = matrices.get_four(first + i);
        for j in 0..4 {
            let (matrix, weight) = (matrices[j], weights[j]);
            sum = if i + j == 0 {
                F::scaled_matrix(matrix, weight)
            } else {
                F::add_scaled_matrix(sum, matrix, weight)
            };
        }
    }
    sum
}

#[inline(always)]
pub(crate) fn transform_points<F: Lanes>([c0, c1, c2, c3]: &Rows<F>, [x, y, z]: [F; 3]) -> [F; 3] {
    let mut out = [x; 3];
    for i in 0..3 {
        out[i] = c0[i].fused_add(x, c1[i].fused_add(y, c2[i].fused_add(z, c3[i])));
    }
    out
}

/// Transforms normals by the cofactors and normalizes them; unchanged if they collapse.
#[inline(always)]
pub(crate) fn transform_normals<F: Lanes>([c0, c1, c2, _]: &Rows<F>, normals: [F; 3]) -> [F; 3] {
    let [x, y, z] = normals;
    // The cofactors times n: x c1 × c2 + y c2 × c0 + z c0 × c1 = x c1 × c2 + c0 × (z c1 - y c2), which saves three of eight
    // multiplications.
    let a = cross(c1, c2);
    let mut inner = normals;
    for i in 0..3 {
        inner[i] = z.fused_sub(c1[i], y.mul(c2[i]));
    }
    let mut n = cross(c0, &inner);
    for i in 0..3 {
        n[i] = x.fused_add(a[i], n[i]);
    }
    let square = dot3(&n, &n);
    // The inverse transpose is cofactors / determinant: a mirroring matrix reverses the cofactors.
    let determinant = dot3(c0, &a);
    let k = F::splat(1.0).div(square.sqrt()).flip_sign_by(determinant);
    n = [n[0].mul(k), n[1].mul(k), n[2].mul(k)];
    let good = F::splat(0.0).less(square).and(square.less(F::splat(f32::MAX)));
    if !F::all(good) {
        for i in 0..3 {
            n[i] = F::select(good, n[i], normals[i]);
        }
    }
    n
}

#[inline(always)]
pub(crate) fn cross<F: Lanes>(a: &[F; 3], b: &[F; 3]) -> [F; 3] {
    [
        a[1].fused_sub(b[2], a[2].mul(b[1])),
        a[2].fused_sub(b[0], a[0].mul(b[2])),
        a[0].fused_sub(b[1], a[1].mul(b[0])),
    ]
}

#[inline(always)]
pub(crate) fn dot3<F: Lanes>(a: &[F; 3], b: &[F; 3]) -> F {
    a[0].fused_add(b[0], a[1].fused_add(b[1], a[2].mul(b[2])))
}
