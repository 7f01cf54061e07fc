//! Local-to-model: transforms of joints from their parents' spaces to model space.

use crate::input_error::InputError;
use crate::pose::blend::{CorrectedNlerp, Mix, dot, lerp};
use crate::pose::{Pose, PoseBlock};
use crate::simd::lane::{LANES, Lane};
use crate::simd::{F8, Kernel, Level, dispatch, load3, load4};
use crate::skeleton::Skeleton;
use glam::Affine3A;

/// Computes the model-space matrix of each joint: `model_from_joint[i] = model_from_joint[parent(i)] * pose[i]`.
pub struct LocalToModel<'a> {
    /// Parents of the joints.
    pub skeleton: &'a Skeleton,
    /// Input: local transforms of as many joints as the skeleton has.
    pub pose: &'a Pose,
    /// Output: one per joint.
    pub model_from_joint: &'a mut [Affine3A],
}

impl LocalToModel<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        let joints = self.skeleton.len();
        InputError::check_lengths(&[
            ("LocalToModel.pose", self.pose.len(), joints),
            ("LocalToModel.model_from_joint", self.model_from_joint.len(), joints),
        ])
    }

    /// Computes the matrices; allocates nothing.
    pub fn run(&mut self) {
        self.run_on(Level::best());
    }

    /// Runs at a SIMD level, for tests and benchmarks; the bits are the same at any.
    pub fn run_on(&mut self, level: Level) {
        dispatch(
            level,
            ComputeMatrices {
                by_depth: self.skeleton.by_depth(),
                locals: UnblendedPose(self.pose.blocks()),
                out: self.model_from_joint,
            },
        );
    }
}

/// Source of the local transforms of eight joints for a kernel.
pub(crate) trait LocalTransforms {
    /// Translation, rotation (of any length but zero), scale (`None` = exactly 1).
    fn get<F: F8>(&self, block: usize) -> ([F; 3], [F; 4], Option<[F; 3]>);
    fn blocks(&self) -> usize;
}

/// One pose, unchanged.
pub(crate) struct UnblendedPose<'a>(pub &'a [PoseBlock]);

impl LocalTransforms for UnblendedPose<'_> {
    #[inline(always)]
    fn get<F: F8>(&self, block: usize) -> ([F; 3], [F; 4], Option<[F; 3]>) {
        let a = &self.0[block];
        (load3(&a.translation), load4(&a.rotation), Some(load3(&a.scale)))
    }
    #[inline(always)]
    fn blocks(&self) -> usize {
        self.0.len()
    }
}

/// Two poses that are blended as they are read, like [`crate::Blend`] does.
pub(crate) struct BlendedPoses<'a> {
    pub a: &'a [PoseBlock],
    pub b: &'a [PoseBlock],
    pub weight: f32,
    /// Whether all scales are 1, so that they are not read.
    pub unit_scale: bool,
}

impl LocalTransforms for BlendedPoses<'_> {
    #[inline(always)]
    fn get<F: F8>(&self, block: usize) -> ([F; 3], [F; 4], Option<[F; 3]>) {
        let (a, b, w) = (&self.a[block], &self.b[block], F::splat(self.weight));
        let translation = lerp3(&a.translation, &b.translation, w);
        let rotation = CorrectedNlerp::mix(load4(&a.rotation), load4(&b.rotation), w);
        let scale = if self.unit_scale { None } else { Some(lerp3(&a.scale, &b.scale, w)) };
        (translation, rotation, scale)
    }
    #[inline(always)]
    fn blocks(&self) -> usize {
        self.a.len().min(self.b.len())
    }
}

/// The kernel of [`LocalToModel`].
pub(crate) struct ComputeMatrices<'a, L> {
    /// See [`Skeleton::by_depth`].
    pub by_depth: &'a [[u32; 2]],
    pub locals: L,
    /// Matrices, one per joint; missing or superfluous ones are left out.
    pub out: &'a mut [Affine3A],
}

impl<L: LocalTransforms> Kernel for ComputeMatrices<'_, L> {
    #[inline(always)]
    fn run<F: F8>(self) {
        self.compute::<F>();
    }
}

impl<L: LocalTransforms> ComputeMatrices<'_, L> {
    #[inline(always)]
    pub(crate) fn compute<F: F8>(self) {
        let ComputeMatrices { by_depth, locals, out } = self;
        let out = as_columns_mut(out);
        // Local matrices come first, eight at a time; then each is multiplied by its parent's. Taking the joints by depth made
        // the whole a fifth faster than going down chain by chain in one pass.
        let (full, rest) = out.as_chunks_mut::<LANES>();
        let blocks = locals.blocks();
        for (block, out) in full.iter_mut().enumerate().take(blocks) {
            let ([c0, c1, c2], translation) = local_columns::<F>(&locals, block);
            let pairs = F::column_pairs(c0, c1);
            for i in 0..LANES {
                pairs[i].store_halves(&mut out[i].0);
            }
            let pairs = F::column_pairs(c2, translation);
            for i in 0..LANES {
                pairs[i].store_halves(&mut out[i].1);
            }
        }
        if full.len() < blocks {
            let ([c0, c1, c2], translation) = local_columns::<F>(&locals, full.len());
            let (low, high) = (F::column_pairs(c0, c1), F::column_pairs(c2, translation));
            for (i, out) in rest.iter_mut().enumerate() {
                low[i].store_halves(&mut out.0);
                high[i].store_halves(&mut out.1);
            }
        }
        for [joint, parent] in by_depth {
            let Some(ColumnPairs([c0, c1], [c2, translation])) = out.get(*parent as usize) else { return };
            let parent = [F::load_twice(c0), F::load_twice(c1), F::load_twice(c2)];
            let translation = F::load_upper_half(translation);
            let Some(own) = out.get_mut(*joint as usize) else { return };
            mul_columns(parent, F::load_halves(&own.0)).store_halves(&mut own.0);
            mul_columns(parent, F::load_halves(&own.1)).add(translation).store_halves(&mut own.1);
        }
    }
}

/// The columns of R·S and the translation of eight joints, one row per component.
#[inline(always)]
fn local_columns<F: F8>(locals: &impl LocalTransforms, block: usize) -> ([[F; 3]; 3], [F; 3]) {
    let (translation, rotation, scale) = locals.get::<F>(block);
    (rotation_columns(rotation, scale), translation)
}

/// A matrix as two pairs of columns of four floats.
#[repr(C)]
struct ColumnPairs([[f32; 4]; 2], [[f32; 4]; 2]);

#[inline(always)]
fn lerp3<F: F8>(a: &[Lane; 3], b: &[Lane; 3], w: F) -> [F; 3] {
    let (a, b) = (load3(a), load3(b));
    [lerp(a[0], b[0], w), lerp(a[1], b[1], w), lerp(a[2], b[2], w)]
}

/// The columns of R·S, one row per component, from a quaternion of any length: 2/|q|² takes the place of normalizing.
#[inline(always)]
fn rotation_columns<F: F8>(q: [F; 4], scale: Option<[F; 3]>) -> [[F; 3]; 3] {
    let one = F::splat(1.0);
    let [x, y, z, w] = q;
    let k = F::splat(2.0).div(dot(q, q));
    let (x2, y2, z2) = (x.mul(k), y.mul(k), z.mul(k));
    let (xx, xy, xz) = (x.mul(x2), x.mul(y2), x.mul(z2));
    let (yy, yz, zz) = (y.mul(y2), y.mul(z2), z.mul(z2));
    let (wx, wy, wz) = (w.mul(x2), w.mul(y2), w.mul(z2));
    let columns = [
        [one.sub(yy.add(zz)), xy.add(wz), xz.sub(wy)],
        [xy.sub(wz), one.sub(xx.add(zz)), yz.add(wx)],
        [xz.add(wy), yz.sub(wx), one.sub(xx.add(yy))],
    ];
    match scale {
        None => columns,
        Some([sx, sy, sz]) => {
            let [a, b, c] = columns;
            [
                [a[0].mul(sx), a[1].mul(sx), a[2].mul(sx)],
                [b[0].mul(sy), b[1].mul(sy), b[2].mul(sy)],
                [c[0].mul(sz), c[1].mul(sz), c[2].mul(sz)],
            ]
        }
    }
}

/// Product of a 3×3 matrix, whose columns are in both halves, and two columns.
#[inline(always)]
fn mul_columns<F: F8>([x, y, z]: [F; 3], columns: F) -> F {
    let first = x.mul(columns.broadcast_component::<0>()).add(y.mul(columns.broadcast_component::<1>()));
    first.add(z.mul(columns.broadcast_component::<2>()))
}

const _: () = assert!(size_of::<Affine3A>() == 64 && align_of::<Affine3A>() == 16);
const _: () = assert!(size_of::<ColumnPairs>() == 64 && std::mem::offset_of!(Affine3A, translation) == 48);

#[allow(unsafe_code, reason = "a view of the same bytes, which bytemuck cannot give: they may hold padding")]
#[inline(always)]
fn as_columns_mut(matrices: &mut [Affine3A]) -> &mut [ColumnPairs] {
    // SAFETY: `Affine3A` is `repr(C)`: three `Vec3A` columns and a translation, 64 bytes as asserted above, and a
    // `Vec3A` is three floats in 16 bytes. The fourth may be padding where glam runs without SSE: any bits may be
    // written there, and the kernel reads only columns that it wrote itself.
    unsafe { std::slice::from_raw_parts_mut(matrices.as_mut_ptr().cast(), matrices.len()) }
}
