//! Octahedral maps: the sphere of directions unfolded to a square (Engelhardt & Dachsbacher, "Octahedron Environment Maps",
//! 2008). They need no trigonometry, and their texels have nearly equal solid angles.

use glam::{Vec2, Vec3};

/// Position of a unit vector in the square, 0 to 1; +Y is the center, −Y the corners.
pub fn octahedral(dir: Vec3) -> Vec2 {
    let sum = dir.x.abs() + dir.y.abs() + dir.z.abs();
    let p = Vec2::new(dir.x, dir.z) / sum;
    let folded = Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    (if dir.y >= 0.0 { p } else { folded }) * 0.5 + 0.5
}

/// The unit vector of a position in the square.
pub fn direction(place: Vec2) -> Vec3 {
    let p = place * 2.0 - 1.0;
    let y = 1.0 - p.x.abs() - p.y.abs();
    let folded = Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    let p = if y >= 0.0 { p } else { folded };
    Vec3::new(p.x, y, p.y).normalize()
}

/// ±1; 0 counts as positive.
fn sign(v: f32) -> f32 {
    if v >= 0.0 { 1.0 } else { -1.0 }
}

/// Colors by direction.
#[derive(Clone, Debug, PartialEq)]
pub struct OctahedralMap {
    /// Texels of a side.
    pub size: u32,
    pub texels: Vec<Vec3>,
}

impl OctahedralMap {
    /// Computes each texel from its position and the direction of its center.
    pub fn from_fn(size: u32, color: impl Fn(u32, u32, Vec3) -> Vec3 + Sync) -> OctahedralMap {
        use rayon::prelude::{IntoParallelIterator, ParallelIterator};
        let row = |y: u32| (0..size).map(move |x| (x, y));
        let texels = (0..size)
            .into_par_iter()
            .flat_map_iter(row)
            .map(|(x, y)| color(x, y, OctahedralMap::center(size, x, y)))
            .collect();
        OctahedralMap { size, texels }
    }

    pub(crate) fn center(size: u32, x: u32, y: u32) -> Vec3 {
        direction((Vec2::new(x as f32, y as f32) + 0.5) / size as f32)
    }

    /// A texel up to one texel outside the square: beyond an edge the map continues at the same edge, mirrored about its center.
    pub fn texel(&self, x: i32, y: i32) -> Vec3 {
        let last = self.size as i32 - 1;
        let (mut x, mut y) = (x, y);
        if x < 0 || x > last {
            (x, y) = (x.clamp(0, last), last - y);
        }
        if y < 0 || y > last {
            (x, y) = (last - x, y.clamp(0, last));
        }
        let (x, y) = (x.clamp(0, last), y.clamp(0, last));
        self.texels[(y as u32 * self.size + x as u32) as usize]
    }

    /// Bilinear interpolation in a direction.
    pub fn sample(&self, dir: Vec3) -> Vec3 {
        let at = octahedral(dir) * self.size as f32 - 0.5;
        let (low, t) = (at.floor(), at - at.floor());
        let (x, y) = (low.x as i32, low.y as i32);
        let row = |y| self.texel(x, y) * (1.0 - t.x) + self.texel(x + 1, y) * t.x;
        row(y) * (1.0 - t.y) + row(y + 1) * t.y
    }

    /// The map at half the size: each texel is the mean of four, weighted by their solid angles.
    pub fn halved(&self) -> OctahedralMap {
        let solid = |x, y| solid_angle(self.size, x, y) as f32;
        OctahedralMap::from_fn(self.size / 2, |x, y, _| {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| (2 * x + i, 2 * y + j));
            let all: f32 = four.iter().map(|(x, y)| solid(*x, *y)).sum();
            let sum = four.iter().fold(Vec3::ZERO, |sum, (x, y)| {
                sum + self.texels[(y * self.size + x) as usize] * solid(*x, *y)
            });
            sum / all
        })
    }
}

/// Solid angle of a texel in steradians, to second order in its size. The octahedron's faces lie 1/√3 from the center, so that a
/// piece of area a at a distance d subtends a / (√3 d³).
pub(crate) fn solid_angle(size: u32, x: u32, y: u32) -> f64 {
    let p = [x, y].map(|v| (f64::from(v) + 0.5) / f64::from(size) * 2.0 - 1.0);
    let height = 1.0 - p[0].abs() - p[1].abs();
    let (a, b) = if height >= 0.0 { (p[0], p[1]) } else { (1.0 - p[1].abs(), 1.0 - p[0].abs()) };
    let d2 = a * a + b * b + height * height;
    // The square of area 4 is folded onto faces of area 4√3.
    let side = 2.0 / f64::from(size);
    side * side / (d2 * d2.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_round_trip() {
        for x in 0..33u32 {
            for y in 0..33u32 {
                let place = Vec2::new(x as f32, y as f32) / 33.0 + 0.01;
                let back = octahedral(direction(place));
                assert!((back - place).abs().max_element() < 1e-5, "{place} {back}");
            }
        }
    }

    #[test]
    fn solid_angles_sum_to_the_sphere() {
        let sum = |size: u32| -> f64 {
            (0..size).flat_map(|y| (0..size).map(move |x| (x, y))).map(|(x, y)| solid_angle(size, x, y)).sum()
        };
        let off = (sum(64) - 4.0 * std::f64::consts::PI).abs();
        assert!(off < 1e-3, "{off}");
        // The error is of second order: a quarter at half the texel size.
        let off2 = (sum(128) - 4.0 * std::f64::consts::PI).abs();
        assert!(off2 < off * 0.3, "{off} {off2}");
    }

    #[test]
    fn interpolation_is_continuous_across_edges() {
        // A smooth function of the direction is sampled as well across an edge as inside.
        let smooth = |dir: Vec3| Vec3::new(dir.x, dir.y, dir.z) + 1.0;
        let map = OctahedralMap::from_fn(64, |_, _, dir| smooth(dir));
        for i in 0..1000 {
            let a = i as f32 * 0.1234;
            let down = -0.95 + 0.0019 * i as f32;
            let flat = (1.0 - down * down).max(0.0).sqrt();
            let dir = Vec3::new(libm::cosf(a) * flat, down, libm::sinf(a) * flat).normalize();
            let off = (map.sample(dir) - smooth(dir)).abs().max_element();
            // A kink at each edge of the octahedron, of a texel's width; a wrong neighbor is off by 0.1 and more.
            assert!(off < 0.025, "{dir}: {off}");
        }
    }
}
