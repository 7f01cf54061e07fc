//! Diffuse light of a sky by direction, as real spherical harmonics to order 2, each multiplied by its factor of the cosine lobe
//! (Ramamoorthi & Hanrahan, "An Efficient Representation for Irradiance Environment Maps", 2001) and divided by π: a white sky of
//! radiance 1 lights a white surface to 1.

use crate::sky::octahedral::{OctahedralMap, solid_angle};
use glam::{DVec3, Vec3};

/// Coefficients of 1, y, z, x, xy, yz, 3z² − 1, xz, x² − y².
pub(crate) type Harmonics = [Vec3; 9];

/// The polynomials at a direction.
fn polynomials(n: DVec3) -> [f64; 9] {
    let DVec3 { x, y, z } = n;
    [1.0, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y]
}

/// Squares of the factors that make the polynomials orthonormal, times each band's factor of the cosine lobe over π: 1, ⅔, ¼.
fn factors() -> [f64; 9] {
    let pi = std::f64::consts::PI;
    let (one, two) = (3.0 / (4.0 * pi) * 2.0 / 3.0, 15.0 / (4.0 * pi) / 4.0);
    let (zonal, sectoral) = (5.0 / (16.0 * pi) / 4.0, 15.0 / (16.0 * pi) / 4.0);
    [1.0 / (4.0 * pi), one, one, one, two, two, zonal, two, sectoral]
}

/// Projects a map. Sums are f64, row by row, with the same bits on any number of threads.
pub fn harmonics(sky: &OctahedralMap) -> Harmonics {
    let mut sums = [DVec3::ZERO; 9];
    for y in 0..sky.size {
        for x in 0..sky.size {
            let dir = OctahedralMap::center(sky.size, x, y).as_dvec3();
            let light = sky.texels[(y * sky.size + x) as usize].as_dvec3() * solid_angle(sky.size, x, y);
            for (sum, p) in sums.iter_mut().zip(polynomials(dir)) {
                *sum += light * p;
            }
        }
    }
    let factors = factors();
    std::array::from_fn(|i| (sums[i] * factors[i]).as_vec3())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sky whose radiance is a clamped cosine about a pole: irradiance along the pole is ∫cos² over the half sphere, ⅔π.
    #[test]
    fn harmonics_match_closed_forms() {
        let white = harmonics(&OctahedralMap::from_fn(64, |_, _, _| Vec3::ONE));
        assert!((white[0] - 1.0).abs().max_element() < 1e-3, "{white:?}");
        assert!(white[1..].iter().all(|c| c.abs().max_element() < 3e-4), "{white:?}");

        let cosine = harmonics(&OctahedralMap::from_fn(256, |_, _, dir| Vec3::splat(dir.y.max(0.0))));
        let at = |n: DVec3| -> f32 { polynomials(n).iter().zip(&cosine).map(|(p, c)| *p as f32 * c.x).sum() };
        // Order 2 leaves out bands from 4 on: ⅔ within 1 %.
        assert!((at(DVec3::Y) - 2.0 / 3.0).abs() < 0.01, "{}", at(DVec3::Y));
        assert!((at(DVec3::NEG_Y)).abs() < 0.02, "{}", at(DVec3::NEG_Y));
    }
}
