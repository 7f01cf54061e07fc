//! Dual-quaternion skinning on the CPU; the formulas are those of [`crate::skinning::dual_quaternion`].

use crate::input_error::InputError;
use crate::simd::{
    Block, DeformedBlock, Deformer, F8, Indexed, Lanes, Level, VertexKernel, VertexStreams, Vertices,
    as_arrays, as_arrays_mut, dispatch_vertices,
};
use crate::skinning::dual_quaternion::StretchedDualQuaternion;
use crate::skinning::linear::{
    AlignedMatrices, blend_matrices, check_vertices, cross, dot3, transform_normals, transform_points,
};
use glam::{Affine3A, DQuat, Mat3A, Vec3, Vec3A};

/// A rigid motion in f32: the real and the dual part, x y z w each.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct DualQuaternion(pub [[f32; 4]; 2]);

impl DualQuaternion {
    /// The identity.
    pub const IDENTITY: DualQuaternion = DualQuaternion([[0.0, 0.0, 0.0, 1.0], [0.0; 4]]);
}

impl From<&StretchedDualQuaternion> for DualQuaternion {
    fn from(carrier: &StretchedDualQuaternion) -> Self {
        let narrow = |q: DQuat| q.to_array().map(|v| v as f32);
        DualQuaternion([narrow(carrier.real), narrow(carrier.dual)])
    }
}

/// Dual-quaternion skinning of positions and normals: stretches are blended first, as matrices, then rigid motions.
///
/// Quaternions are summed in the hemisphere of a vertex's heaviest influence, the first of equals. Normals are transformed by the
/// cofactors of the blended stretch and by the blended rotation, then normalized. A vertex without weight is transformed by the
/// blended stretch.
pub struct DualQuaternionSkinning<'a> {
    /// Rigid motions model-from-mesh, one per skin joint.
    pub motions: &'a [DualQuaternion],
    /// Scale and shear before the motion, one per skin joint (translations are ignored); empty if there is none.
    pub stretches: &'a [Affine3A],
    /// Influences per vertex, any number.
    pub influences: usize,
    /// Indices into `motions`, `influences` per vertex.
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

impl DualQuaternionSkinning<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        let (joints, stretches) = (self.motions.len(), self.stretches.len());
        InputError::check_lengths(&[("stretches", stretches, if stretches == 0 { 0 } else { joints })])?;
        let lengths =
            [self.positions.len(), self.normals.len(), self.out_positions.len(), self.out_normals.len()];
        check_vertices(joints, self.influences, self.joint_indices, self.joint_weights, lengths)
    }

    /// Skins the vertices. Panics if a joint index is out of range, which `check` finds.
    pub fn run(&mut self) {
        self.run_on(Level::best());
    }

    /// Runs at a SIMD level, for tests and benchmarks; the bits are the same at any.
    pub fn run_on(&mut self, level: Level) {
        dispatch_vertices(level, DualQuaternionKernel(self));
    }
}

/// Converts a stretch to an element of [`DualQuaternionSkinning::stretches`].
pub fn stretch_matrix(carrier: &StretchedDualQuaternion) -> Affine3A {
    Affine3A { matrix3: Mat3A::from(carrier.stretch.as_mat3()), translation: Vec3A::ZERO }
}

struct DualQuaternionKernel<'a, 'b>(&'b mut DualQuaternionSkinning<'a>);

impl VertexKernel for DualQuaternionKernel<'_, '_> {
    #[inline(always)]
    fn run<F: Vertices>(self) {
        let job = self.0;
        let streams = VertexStreams {
            influences: job.influences,
            joint_indices: job.joint_indices,
            joint_weights: job.joint_weights,
            positions: as_arrays(job.positions),
            normals: as_arrays(job.normals),
            out_positions: as_arrays_mut(job.out_positions),
            out_normals: as_arrays_mut(job.out_normals),
        };
        if job.stretches.is_empty() {
            streams.run::<F, _>(&RigidDeformer(job.motions));
        } else {
            let mut palette = AlignedMatrices::new();
            let stretches = palette.align(job.stretches, job.positions.len());
            streams.run::<F, _>(&StretchedDeformer { motions: job.motions, stretches });
        }
    }
}

struct RigidDeformer<'a>(&'a [DualQuaternion]);

impl Deformer for RigidDeformer<'_> {
    #[inline(always)]
    fn deform<F: Vertices, const N: usize>(&self, block: Block) -> DeformedBlock<F> {
        let motion = BlendedMotion::<F>::blend::<N>(self.0, &block);
        let points = motion.transform_points(F::load_point_rows(block.points));
        match block.normals {
            Some(normals) => (points, Some(normalize_or_keep(motion.rotate(F::load_point_rows(normals))))),
            None => (points, None),
        }
    }
}

/// Applies the stretches, blended as matrices, and then the rigid motions.
struct StretchedDeformer<'a> {
    motions: &'a [DualQuaternion],
    stretches: &'a [Affine3A],
}

impl Deformer for StretchedDeformer<'_> {
    #[inline(always)]
    fn deform<F: Vertices, const N: usize>(&self, block: Block) -> DeformedBlock<F> {
        let mut stretch = blend_matrices::<F, N>(self.stretches, &block);
        stretch[3] = [F::splat(0.0); 3];
        let points = transform_points(&stretch, F::load_point_rows(block.points));
        let normals = match block.normals {
            Some(normals) => Some(transform_normals(&stretch, F::load_point_rows(normals))),
            None => None,
        };
        let motion = BlendedMotion::<F>::blend::<N>(self.motions, &block);
        let points = motion.transform_points(points);
        match normals {
            Some(normals) => (points, Some(normalize_or_keep(motion.rotate(normals)))),
            None => (points, None),
        }
    }
}

/// Blended rigid motions of the vertices, as component rows.
struct BlendedMotion<F> {
    vector: [F; 3],
    w: F,
    /// 2 / |real|²
    scale: F,
    /// The translation.
    translation: [F; 3],
}

impl<F: Vertices> BlendedMotion<F> {
    #[inline(always)]
    fn blend<const N: usize>(motions: &[DualQuaternion], block: &Block) -> Self {
        let zero = F::splat(0.0);
        let fours = weighted_sums::<F, N>(motions, block);
        let [[x, y, z, w], [dx, dy, dz, dw]] = F::join_halves(fours);
        let square = x.fused_add(x, y.fused_add(y, z.fused_add(z, w.mul(w))));
        let is_nonzero = F::splat(0.0).less(square);
        let scale = F::select(is_nonzero, F::splat(2.0).div(square), zero);
        // The vector part of 2 dual · conjugate(real) / |real|².
        let vector = [x, y, z];
        let dual = [dx, dy, dz];
        let across = cross(&vector, &dual);
        let mut translation = across;
        for i in 0..3 {
            translation[i] = w.fused_add(dual[i], across[i].sub(dw.mul(vector[i]))).mul(scale);
        }
        BlendedMotion { vector, w, scale, translation }
    }

    /// R v = v + 2 r × (r × v + w v) / |real|².
    #[inline(always)]
    fn rotate(&self, v: [F; 3]) -> [F; 3] {
        let mut inner = cross(&self.vector, &v);
        for i in 0..3 {
            inner[i] = self.w.fused_add(v[i], inner[i]);
        }
        let outer = cross(&self.vector, &inner);
        let mut out = v;
        for i in 0..3 {
            out[i] = self.scale.fused_add(outer[i], v[i]);
        }
        out
    }

    #[inline(always)]
    fn transform_points(&self, point: [F; 3]) -> [F; 3] {
        let turned = self.rotate(point);
        [0, 1, 2].map(|i| turned[i].add(self.translation[i]))
    }
}

/// The weighted sums of the vertices' dual quaternions, four at a time; N influences, or any number where N is 0.
#[inline(always)]
fn weighted_sums<F: Vertices, const N: usize>(
    motions: &[DualQuaternion],
    &Block { influences, joints, weights, .. }: &Block,
) -> [[F::Eight; 4]; 4] {
    if N == 0 {
        let mut fours = [[F::Eight::splat(0.0); 4]; 4];
        let mut vertices =
            joints.as_slice().chunks_exact(influences.max(1)).zip(weights.chunks_exact(influences.max(1)));
        for four in fours.iter_mut().take(F::COUNT / 4) {
            let mut sums = [F::Eight::splat(0.0); 4];
            for (sum, (joints, weights)) in sums.iter_mut().zip(vertices.by_ref()) {
                *sum = weighted_sum(motions, joints, weights);
            }
            *four = F::Eight::half_rows4(sums);
        }
        return fours;
    }
    let (joints, weights) = (joints.subrange(0..F::COUNT * N), &weights[..F::COUNT * N]);
    let (motions, weights) = (Indexed::new(motions, joints), weights.as_chunks::<N>().0);
    let [a, b] = [
        weighted_sums_of_four::<F::Eight, N>(&motions, 0, weights),
        weighted_sums_of_four::<F::Eight, N>(&motions, 1, weights),
    ];
    match F::COUNT {
        8 => [a, b, a, b],
        _ => [a, b, weighted_sums_of_four(&motions, 2, weights), weighted_sums_of_four(&motions, 3, weights)],
    }
}

#[inline(always)]
fn weighted_sums_of_four<F: F8, const N: usize>(
    motions: &Indexed<DualQuaternion>,
    at: usize,
    weights: &[[f32; N]],
) -> [F; 4] {
    let mut sums = [F::splat(0.0); 4];
    for (i, sum) in sums.iter_mut().enumerate() {
        let vertex = 4 * at + i;
        *sum = weighted_sum_of_fours(motions, vertex * N / 4, &weights[vertex]);
    }
    F::half_rows4(sums)
}

/// Index of the largest weight, the first of equals.
#[inline(always)]
fn largest_weight_index(weights: &[f32]) -> usize {
    let (mut at, mut largest) = (0, weights[0]);
    for (i, weight) in weights.iter().enumerate() {
        (at, largest) = if *weight > largest { (i, *weight) } else { (at, largest) };
    }
    at
}

/// The weighted sum of one vertex's dual quaternions, all in the hemisphere of the heaviest; there is at least one.
#[inline(always)]
fn weighted_sum<F: F8>(motions: &[DualQuaternion], joints: &[u16], weights: &[f32]) -> F {
    let pivot = &motions[usize::from(joints[largest_weight_index(weights)])].0[0];
    let mut sum = F::splat(0.0);
    for (joint, weight) in joints.iter().zip(weights) {
        let motion = &motions[usize::from(*joint)].0;
        let [weight, ..] = F::flip_weights_to_hemisphere([&motion[0]; 4], pivot, &[*weight; 4]);
        sum = F::load_halves(motion).fused_add(F::splat(weight), sum);
    }
    sum
}

/// Like [`weighted_sum`], for a known number of influences that is a multiple of four. `first`: index of the first four.
#[inline(always)]
fn weighted_sum_of_fours<F: F8, const N: usize>(
    motions: &Indexed<DualQuaternion>,
    first: usize,
    weights: &[f32; N],
) -> F {
    let pivot = &motions.get(4 * first + largest_weight_index(weights)).0[0];
    let mut sum = F::splat(0.0);
    for (i, weights) in weights.as_chunks().0.iter().enumerate() {
        let motions = motions.get_four(first + i);
        let reals = [&motions[0].0[0], &motions[1].0[0], &motions[2].0[0], &motions[3].0[0]];
        let weights = F::flip_weights_to_hemisphere(reals, pivot, weights);
        for j in 0..4 {
            sum = F::load_halves(&motions[j].0).fused_add(F::splat(weights[j]), sum);
        }
    }
    sum
}

#[inline(always)]
fn normalize_or_keep<F: Lanes>(n: [F; 3]) -> [F; 3] {
    let square = dot3(&n, &n);
    let k = F::splat(1.0).div(square.sqrt());
    let is_nonzero = F::splat(0.0).less(square);
    let mut out = n;
    for i in 0..3 {
        out[i] = F::select(is_nonzero, n[i].mul(k), n[i]);
    }
    out
}
