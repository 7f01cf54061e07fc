//! Arithmetic on the four pixels of a 2×2 quad, as arrays of four numbers. The compiler turns it into vector instructions. Every
//! operation is one IEEE operation per lane, so the results do not depend on the instruction set.

use glam::{Vec2, Vec3};
use std::ops::{Add, AddAssign, Mul, MulAssign, Neg, Sub};

/// Four f32 values, one for each lane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(16))]
pub(crate) struct F4(pub [f32; 4]);

macro_rules! impl_lanewise_operator {
    ($trait:ident, $f:ident, $op:tt) => {
        impl $trait for F4 {
            type Output = F4;
            #[inline(always)]
            fn $f(self, o: F4) -> F4 {
                let (a, b) = (self.0, o.0);
                F4([a[0] $op b[0], a[1] $op b[1], a[2] $op b[2], a[3] $op b[3]])
            }
        }
        impl $trait<f32> for F4 {
            type Output = F4;
            #[inline(always)]
            fn $f(self, o: f32) -> F4 {
                let a = self.0;
                F4([a[0] $op o, a[1] $op o, a[2] $op o, a[3] $op o])
            }
        }
    };
}
impl_lanewise_operator!(Add, add, +);
impl_lanewise_operator!(Sub, sub, -);
impl_lanewise_operator!(Mul, mul, *);
impl_lanewise_operator!(Div, div, /);
use std::ops::Div;

impl AddAssign for F4 {
    #[inline(always)]
    fn add_assign(&mut self, o: F4) {
        *self = *self + o;
    }
}
impl MulAssign for F4 {
    #[inline(always)]
    fn mul_assign(&mut self, o: F4) {
        *self = *self * o;
    }
}
impl Neg for F4 {
    type Output = F4;
    #[inline(always)]
    fn neg(self) -> F4 {
        self.map(|v| -v)
    }
}

impl F4 {
    pub(crate) const ZERO: F4 = F4([0.0; 4]);
    pub(crate) const ONE: F4 = F4([1.0; 4]);

    #[inline(always)]
    pub(crate) fn splat(v: f32) -> F4 {
        F4([v; 4])
    }
    #[inline(always)]
    pub(crate) fn map(self, f: impl Fn(f32) -> f32) -> F4 {
        let a = self.0;
        F4([f(a[0]), f(a[1]), f(a[2]), f(a[3])])
    }
    /// `self < o ? self : o`, one instruction. Returns `o` if either is NaN.
    #[inline(always)]
    pub(crate) fn min(self, o: F4) -> F4 {
        let (a, b) = (self.0, o.0);
        F4(std::array::from_fn(|i| if a[i] < b[i] { a[i] } else { b[i] }))
    }
    #[inline(always)]
    pub(crate) fn max(self, o: F4) -> F4 {
        let (a, b) = (self.0, o.0);
        F4(std::array::from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] }))
    }
    #[inline(always)]
    pub(crate) fn clamp(self, low: f32, high: f32) -> F4 {
        self.max(F4::splat(low)).min(F4::splat(high))
    }
    #[inline(always)]
    pub(crate) fn sqrt(self) -> F4 {
        self.map(f32::sqrt)
    }
    #[inline(always)]
    pub(crate) fn mix(self, to: F4, t: F4) -> F4 {
        self * (F4::ONE - t) + to * t
    }
}

/// Mask with one flag for each lane.
pub(crate) type Mask = [bool; 4];

pub(crate) const ALL_LANES: Mask = [true; 4];
pub(crate) const NO_LANES: Mask = [false; 4];

/// Lanes of `yes` where the mask is set, of `no` elsewhere.
#[inline(always)]
pub(crate) fn select(mask: Mask, yes: F4, no: F4) -> F4 {
    F4(std::array::from_fn(|i| if mask[i] { yes.0[i] } else { no.0[i] }))
}

/// Four vectors, structure of arrays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct V3 {
    pub x: F4,
    pub y: F4,
    pub z: F4,
}

impl Add for V3 {
    type Output = V3;
    #[inline(always)]
    fn add(self, o: V3) -> V3 {
        V3 { x: self.x + o.x, y: self.y + o.y, z: self.z + o.z }
    }
}
impl Sub for V3 {
    type Output = V3;
    #[inline(always)]
    fn sub(self, o: V3) -> V3 {
        V3 { x: self.x - o.x, y: self.y - o.y, z: self.z - o.z }
    }
}
impl Mul for V3 {
    type Output = V3;
    #[inline(always)]
    fn mul(self, o: V3) -> V3 {
        V3 { x: self.x * o.x, y: self.y * o.y, z: self.z * o.z }
    }
}
impl Mul<F4> for V3 {
    type Output = V3;
    #[inline(always)]
    fn mul(self, o: F4) -> V3 {
        V3 { x: self.x * o, y: self.y * o, z: self.z * o }
    }
}
impl Neg for V3 {
    type Output = V3;
    #[inline(always)]
    fn neg(self) -> V3 {
        V3 { x: -self.x, y: -self.y, z: -self.z }
    }
}

impl V3 {
    #[inline(always)]
    pub(crate) fn splat(v: Vec3) -> V3 {
        V3 { x: F4::splat(v.x), y: F4::splat(v.y), z: F4::splat(v.z) }
    }
    #[inline(always)]
    pub(crate) fn dot(self, o: V3) -> F4 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }
    #[inline(always)]
    pub(crate) fn cross(self, o: V3) -> V3 {
        V3 { x: self.y * o.z - self.z * o.y, y: self.z * o.x - self.x * o.z, z: self.x * o.y - self.y * o.x }
    }
    /// Unit vector of the same direction. A zero vector (a degenerate normal) stays zero instead of turning into NaN.
    #[inline(always)]
    pub(crate) fn unit(self) -> V3 {
        self * (F4::ONE / self.dot(self).max(F4::splat(1e-20)).sqrt())
    }
    #[inline(always)]
    pub(crate) fn mix(self, to: V3, t: F4) -> V3 {
        V3 { x: self.x.mix(to.x, t), y: self.y.mix(to.y, t), z: self.z.mix(to.z, t) }
    }
    #[inline(always)]
    pub(crate) fn max_component(self) -> F4 {
        self.x.max(self.y).max(self.z)
    }
}

/// Unit vector of the same direction as one vector, computed like [`V3::unit`].
pub(crate) fn unit(v: Vec3) -> Vec3 {
    v * (1.0 / v.dot(v).max(1e-20).sqrt())
}

/// Perspective-correct barycentric weights of the four pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weights {
    pub values: [F4; 3],
    /// Pixels in which the triangle is visible. The other pixels are only shaded for the differences between neighbors.
    pub visible: Mask,
}

impl Weights {
    #[inline(always)]
    pub(crate) fn interpolate_scalar(&self, a: f32, b: f32, c: f32) -> F4 {
        self.values[0] * a + self.values[1] * b + self.values[2] * c
    }
    #[inline(always)]
    pub(crate) fn interpolate_vec2(&self, [a, b, c]: [Vec2; 3]) -> [F4; 2] {
        [self.interpolate_scalar(a.x, b.x, c.x), self.interpolate_scalar(a.y, b.y, c.y)]
    }
    #[inline(always)]
    pub(crate) fn interpolate_vec3(&self, [a, b, c]: [Vec3; 3]) -> V3 {
        V3 {
            x: self.interpolate_scalar(a.x, b.x, c.x),
            y: self.interpolate_scalar(a.y, b.y, c.y),
            z: self.interpolate_scalar(a.z, b.z, c.z),
        }
    }
}
