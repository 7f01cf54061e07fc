//! CPU reference of overlay.wgsl: coverage of pixels by triangles, lines, points and lattices, a 2×2 quad at a time.

use super::shade::{ALL_SAMPLES, Shaded};
use super::vertex::Vertex;
use crate::lanes::{F4, Weights};
use crate::plan::OverlayVertex;
use glam::{Vec3, Vec4};

/// Vertices of an overlay as triangle assembly reads them.
pub(super) fn overlay_vertices(overlay: &[OverlayVertex]) -> Vec<Vertex> {
    let vertex = |v: &OverlayVertex| Vertex {
        clip: v.clip,
        relative: Vec3::ZERO,
        normal: Vec3::ZERO,
        tangent: Vec4::ZERO,
        scale: 0.0,
        joints: Vec3::ZERO,
    };
    overlay.iter().map(vertex).collect()
}

pub(super) fn shade_overlay(vertices: &[OverlayVertex], ids: [u32; 3], weights: &Weights) -> Shaded {
    let [a, b, c] = ids.map(|i| &vertices[i as usize]);
    let [x, y, z, w] =
        std::array::from_fn(|n| weights.interpolate_scalar(a.shape[n], b.shape[n], c.shape[n]));
    let coverage = match a.lattice.x {
        kind if kind > 1.5 => F4::ONE,
        kind if kind > 0.5 => {
            let rim = F4::ONE - (z * z + w * w).map(f32::sqrt);
            let rim = rim.clamp(0.0, 1.0);
            let along = [x, y].map(|at| {
                let steps = gradient_lengths(at);
                F4(std::array::from_fn(|i| lattice_coverage(at.0[i], steps[i], a.lattice)))
            });
            along[0].max(along[1]) * rim * rim * (F4::splat(3.0) - rim * 2.0)
        }
        _ => F4(std::array::from_fn(|i| {
            let (along, across) = (x.0[i] - x.0[i].clamp(0.0, a.shape.z), y.0[i]);
            (a.shape.w + 0.5 - (along * along + across * across).sqrt()).clamp(0.0, 1.0)
        })),
    };
    let [r, g, b, alpha] = a.color.to_array().map(F4::splat);
    Shaded { rgba: [r, g, b, alpha * coverage], kept_samples: [ALL_SAMPLES; 4], faults: [None; 4] }
}

/// Length of the screen-space gradient of a value at each pixel of a quad, per pixel, from differences within the quad.
fn gradient_lengths(at: F4) -> [f32; 4] {
    let [a, b, c, d] = at.0;
    let (top, bottom, left, right) = (b - a, d - c, c - a, d - b);
    let length = |x: f32, y: f32| (x * x + y * y).sqrt();
    [length(top, left), length(top, right), length(bottom, left), length(bottom, right)]
}

fn line_coverage(at: f32, step: f32, width: f32) -> f32 {
    let distance = (at - (at + 0.5).floor()).abs() / step.max(1e-9);
    (0.5 * width + 0.5 - distance).clamp(0.0, 1.0)
}

fn lattice_coverage(at: f32, step: f32, lattice: Vec4) -> f32 {
    let thin = line_coverage(at, step, lattice.z) * ((0.25 - step) * 8.0).clamp(0.0, 1.0);
    let thick_step = step / lattice.y;
    let thick =
        line_coverage(at / lattice.y, thick_step, lattice.w) * ((0.25 - thick_step) * 8.0).clamp(0.0, 1.0);
    thin.max(thick)
}
