//! Blending two poses.
//!
//! Translations and scales: lerp. Rotations: shortest-arc nlerp at a corrected weight, within 0.01° of slerp for rotations up to
//! 135° apart and within 0.05° at 180° (`tests/motion/jobs.rs` measures it), for about a fifth more time than plain nlerp, which is 0.9° off
//! at 90° and 8.1° at 180° (`cargo xtask report crossfade`); see [`RotationBlend`].

use crate::input_error::InputError;
use crate::pose::{Pose, PoseBlock};
use crate::simd::lane::{LANES, Lane};
use crate::simd::{F8, Kernel, Level, dispatch, load4};
use crate::slerp_series::{MAX_TERMS, slerp_weights};
use std::marker::PhantomData;

/// Blends two poses joint by joint: `out` is `from` at weight 0 and `to` at weight 1, exactly. All poses have equally many
/// joints.
pub struct Blend<'a> {
    /// Pose at weight 0.
    pub from: &'a Pose,
    /// Pose at weight 1.
    pub to: &'a Pose,
    /// Blend weight, 0..=1.
    pub weight: f32,
    /// Factors of the weight, one per joint, 0..=1; `None` = 1.
    pub mask: Option<&'a [f32]>,
    /// Output: the blended pose.
    pub out: &'a mut Pose,
}

impl Blend<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        check_blend(
            &["Blend.to", "Blend.mask", "Blend.weight"],
            self.from.len(),
            self.to.len(),
            self.weight,
            self.mask,
        )
    }

    /// Blends the poses. Allocates only if `out` has held fewer joints so far.
    pub fn run(&mut self) {
        self.out.copy_from(self.from);
        BlendOnto { pose: self.out, to: self.to, weight: self.weight, mask: self.mask }.run();
    }
}

/// Blends in place: `pose` moves towards `to` by the weight.
pub struct BlendOnto<'a> {
    /// The pose that moves, input and output.
    pub pose: &'a mut Pose,
    /// Pose at weight 1.
    pub to: &'a Pose,
    /// Blend weight, 0..=1.
    pub weight: f32,
    /// Factors of the weight, one per joint, 0..=1; `None` = 1.
    pub mask: Option<&'a [f32]>,
}

impl BlendOnto<'_> {
    /// Names the first field that does not fit.
    pub fn check(&self) -> Result<(), InputError> {
        check_blend(
            &["BlendOnto.to", "BlendOnto.mask", "BlendOnto.weight"],
            self.pose.len(),
            self.to.len(),
            self.weight,
            self.mask,
        )
    }

    /// Blends in place; allocates nothing.
    pub fn run(&mut self) {
        self.run_on(Level::best());
    }

    /// Runs at a SIMD level, for tests and benchmarks; the bits are the same at any.
    pub fn run_on(&mut self, level: Level) {
        self.run_kernel(level, CorrectedNlerp);
    }

    /// Blends rotations by another method, for benchmarks.
    pub fn run_as(&mut self, rotations: RotationBlend) {
        match rotations {
            RotationBlend::Nlerp => self.run_kernel(Level::best(), Nlerp),
            RotationBlend::CorrectedNlerp => self.run_kernel(Level::best(), CorrectedNlerp),
            RotationBlend::Slerp => self.run_kernel(Level::best(), Slerp),
        }
    }

    fn run_kernel<M: Mix>(&mut self, level: Level, _: M) {
        let (onto, to) = (self.pose.blocks_mut(), self.to.blocks());
        let rotations = PhantomData::<M>;
        dispatch(level, BlendBlocks { onto, to, weight: self.weight, mask: self.mask, rotations });
    }
}

/// Method to blend rotations, along the shorter arc. All agree at weights 0, ½ and 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RotationBlend {
    /// Normalized linear interpolation (nlerp) of two quaternions.
    Nlerp,
    /// Nlerp at a corrected weight: the method that blends use.
    CorrectedNlerp,
    /// Slerp, exact up to f32 rounding, by a series of 26 terms, since two poses may be any angle apart.
    Slerp,
}

pub(crate) trait Mix {
    /// Mixes quaternions along the shorter arc. The result is not normalized (its length is at least √½), and exact at weights 0
    /// and 1 once it is.
    fn mix<F: F8>(p: [F; 4], q: [F; 4], w: F) -> [F; 4];
}

struct Nlerp;
pub(crate) struct CorrectedNlerp;
struct Slerp;

fn check_blend(
    [to_field, mask_field, weight_field]: &[&'static str; 3],
    from: usize,
    to: usize,
    weight: f32,
    mask: Option<&[f32]>,
) -> Result<(), InputError> {
    let in_range = |w: &f32| (0.0..=1.0).contains(w);
    let mask_len = mask.map_or(from, <[f32]>::len);
    InputError::check_lengths(&[(to_field, to, from), (mask_field, mask_len, from)])?;
    InputError::check_value(in_range(&weight), weight_field, weight, "0..=1")?;
    InputError::check_each(mask.unwrap_or_default(), in_range, mask_field, "0..=1")
}

struct BlendBlocks<'a, M> {
    onto: &'a mut [PoseBlock],
    to: &'a [PoseBlock],
    weight: f32,
    mask: Option<&'a [f32]>,
    rotations: PhantomData<M>,
}

impl<M: Mix> Kernel for BlendBlocks<'_, M> {
    #[inline(always)]
    fn run<F: F8>(self) {
        for (i, (a, b)) in self.onto.iter_mut().zip(self.to).enumerate() {
            let mut weights = Lane::splat(self.weight);
            if let Some(mask) = self.mask {
                let mask = mask.get(i * LANES..).unwrap_or_default();
                for (lane, weight) in weights.0.iter_mut().enumerate() {
                    *weight *= mask.get(lane).copied().unwrap_or(0.0);
                }
            }
            blend_block::<F, M>(a, b, F::load(&weights));
        }
    }
}

#[inline(always)]
fn blend_block<F: F8, M: Mix>(a: &mut PoseBlock, b: &PoseBlock, w: F) {
    let (keeps_from, takes_to) = (w.equals(F::splat(0.0)), w.equals(F::splat(1.0)));
    for i in 0..3 {
        let (x, y) = (F::load(&a.translation[i]), F::load(&b.translation[i]));
        F::select(keeps_from, x, F::select(takes_to, y, lerp(x, y, w))).store(&mut a.translation[i]);
        let (x, y) = (F::load(&a.scale[i]), F::load(&b.scale[i]));
        F::select(keeps_from, x, F::select(takes_to, y, lerp(x, y, w))).store(&mut a.scale[i]);
    }
    let p: [F; 4] = load4(&a.rotation);
    let q = load4(&b.rotation);
    let mixed = M::mix(p, q, w);
    let k = F::splat(1.0).div(dot(mixed, mixed).sqrt());
    for i in 0..4 {
        let blended = mixed[i].mul(k);
        F::select(keeps_from, p[i], F::select(takes_to, q[i], blended)).store(&mut a.rotation[i]);
    }
}

#[inline(always)]
pub(crate) fn lerp<F: F8>(a: F, b: F, w: F) -> F {
    a.add(b.sub(a).mul(w))
}

#[inline(always)]
pub(crate) fn dot<F: F8>(a: [F; 4], b: [F; 4]) -> F {
    a[0].mul(b[0]).add(a[1].mul(b[1])).add(a[2].mul(b[2]).add(a[3].mul(b[3])))
}

/// Evaluates a polynomial by Horner's scheme, highest power first.
#[inline(always)]
fn polynomial<F: F8, const N: usize>(x: F, coefficients: [f32; N]) -> F {
    let mut sum = F::splat(coefficients[0]);
    for c in &coefficients[1..] {
        sum = sum.mul(x).add(F::splat(*c));
    }
    sum
}

/// Linear interpolation from `p` to `q`, which is negated if `sign_of_dot` is negative.
#[inline(always)]
fn nlerp_unnormalized<F: F8>(mut p: [F; 4], q: [F; 4], sign_of_dot: F, w: F) -> [F; 4] {
    for i in 0..4 {
        p[i] = lerp(p[i], q[i].flip_sign_by(sign_of_dot), w);
    }
    p
}

impl Mix for Nlerp {
    #[inline(always)]
    fn mix<F: F8>(p: [F; 4], q: [F; 4], w: F) -> [F; 4] {
        let sign_of_dot = dot(p, q);
        nlerp_unnormalized(p, q, sign_of_dot, w)
    }
}

impl Mix for CorrectedNlerp {
    /// A cubic of the weight keeps slerp's speed (A. Kapoulkine, "Approximating slerp", 2015, `onlerp`, fitted for all arcs).
    #[inline(always)]
    fn mix<F: F8>(p: [F; 4], q: [F; 4], w: F) -> [F; 4] {
        let sign_of_dot = dot(p, q);
        let d = sign_of_dot.flip_sign_by(sign_of_dot);
        let a = polynomial(d, [-1.43519, 3.55645, -3.2452, 1.0904]);
        let b = polynomial(d, [0.215638, -1.06021, 0.848013]);
        let middle = w.sub(F::splat(0.5));
        let k = a.mul(middle.mul(middle)).add(b);
        let w = w.add(w.mul(middle).mul(w.sub(F::splat(1.0))).mul(k));
        nlerp_unnormalized(p, q, sign_of_dot, w)
    }
}

impl Mix for Slerp {
    #[inline(always)]
    fn mix<F: F8>(mut p: [F; 4], q: [F; 4], w: F) -> [F; 4] {
        let sign_of_dot = dot(p, q);
        let q = [
            q[0].flip_sign_by(sign_of_dot),
            q[1].flip_sign_by(sign_of_dot),
            q[2].flip_sign_by(sign_of_dot),
            q[3].flip_sign_by(sign_of_dot),
        ];
        // Computed from the difference instead of the product, because small angles then keep their digits.
        let chord = [q[0].sub(p[0]), q[1].sub(p[1]), q[2].sub(p[2]), q[3].sub(p[3])];
        let (a, b) = slerp_weights(w, dot(chord, chord).mul(F::splat(0.5)), MAX_TERMS);
        for i in 0..4 {
            p[i] = p[i].mul(a).add(q[i].mul(b));
        }
        p
    }
}
