//! Packings of unit vectors and weights into few bits.

use glam::{DVec3, Vec2, Vec3};

/// A packing of unit vectors: name, size in bytes, and a function that packs and unpacks.
pub(crate) type NormalPacking = (&'static str, usize, fn(Vec3) -> Vec3);

/// A packing of the weights of a vertex: name, size in bytes of four weights, and a function that packs and unpacks.
pub(crate) type WeightPacking = (&'static str, usize, fn(&[f32]) -> Vec<f32>);

pub const NORMALS: [NormalPacking; 5] = [
    ("f32 × 3", 12, |n| n),
    ("16-bit signed × 4", 8, |n| snorm(n, 32767.0)),
    ("octahedron, 16-bit × 2", 4, |n| octahedron(n, 32767.0)),
    ("8-bit signed × 4", 4, |n| snorm(n, 127.0)),
    ("octahedron, 8-bit × 2", 2, |n| octahedron(n, 127.0)),
];

fn round(v: f32, steps: f32) -> f32 {
    libm::roundf(v.clamp(-1.0, 1.0) * steps) / steps
}

fn snorm(n: Vec3, steps: f32) -> Vec3 {
    Vec3::new(round(n.x, steps), round(n.y, steps), round(n.z, steps)).normalize_or(Vec3::Z)
}

/// Octahedral encoding of a unit vector (Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014,
/// listing 1; rounded, without the search for the best neighbor).
fn octahedron(n: Vec3, steps: f32) -> Vec3 {
    let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
    let wrap = |p: Vec2| Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y));
    let sum = n.x.abs() + n.y.abs() + n.z.abs();
    let flat = Vec2::new(n.x, n.y) / sum.max(f32::MIN_POSITIVE);
    let folded = if n.z < 0.0 { wrap(flat) } else { flat };
    let p = Vec2::new(round(folded.x, steps), round(folded.y, steps));
    let z = 1.0 - p.x.abs() - p.y.abs();
    let p = if z < 0.0 { wrap(p) } else { p };
    Vec3::new(p.x, p.y, z).normalize_or(Vec3::Z)
}

/// The angle between two directions in degrees, in f64.
pub fn degrees_between(a: Vec3, b: Vec3) -> f64 {
    let (a, b): (DVec3, DVec3) = (a.as_dvec3().normalize(), b.as_dvec3().normalize());
    (2.0 * libm::atan2((a - b).length(), (a + b).length())).to_degrees()
}

pub const WEIGHTS: [WeightPacking; 4] = [
    ("f32 × 4", 16, |w| w.to_vec()),
    ("16-bit unsigned × 4, sum kept", 8, |w| unorm(w, 65535.0, true)),
    ("16-bit unsigned × 4, as rounded", 8, |w| unorm(w, 65535.0, false)),
    ("8-bit unsigned × 4, sum kept", 4, |w| unorm(w, 255.0, true)),
];

fn unorm(weights: &[f32], steps: f32, sum_kept: bool) -> Vec<f32> {
    let mut codes: Vec<f32> = weights.iter().map(|w| libm::roundf(w.clamp(0.0, 1.0) * steps)).collect();
    if sum_kept {
        // The largest weight takes the rounding of the others.
        let largest = (0..codes.len()).max_by(|a, b| codes[*a].total_cmp(&codes[*b])).unwrap_or(0);
        let others: f32 = codes.iter().enumerate().filter(|(i, _)| *i != largest).map(|(_, c)| c).sum();
        if let Some(code) = codes.get_mut(largest) {
            *code = (steps - others).max(0.0);
        }
    }
    codes.iter().map(|c| c / steps).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_vectors_are_within_their_error() {
        let limits = [1e-5, 0.003, 0.006, 0.7, 1.4];
        let mut worst = [0.0f64; 5];
        for i in 0..2000 {
            // A spiral over the sphere.
            let z = 1.0 - (i as f32 + 0.5) / 1000.0;
            let a = i as f32 * 2.399_963;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = Vec3::new(r * libm::cosf(a), r * libm::sinf(a), z).normalize();
            for ((_, _, method), worst) in NORMALS.iter().zip(&mut worst) {
                *worst = worst.max(degrees_between(n, method(n)));
            }
        }
        assert!(worst.iter().zip(limits).all(|(w, l)| *w < l), "{worst:?}");
        assert!(worst[3] > 0.1, "8 bits have a measurable error");
    }

    #[test]
    fn packed_weights_keep_their_sum() {
        for (name, _, method) in WEIGHTS {
            let back = method(&[0.33331, 0.33333, 0.2, 0.13336]);
            let sum: f32 = back.iter().sum();
            assert!((sum - 1.0).abs() < 1e-4, "{name}: {sum}");
        }
    }
}
