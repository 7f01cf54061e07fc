//! The view transform from light to display colors, four pixels at once. CPU reference of view.wgsl.

use crate::lanes::{F4, V3};
use crate::plan::{Features, Plan};
use glam::Vec3;

/// Display color of the sky's light, after exposure and view transform.
pub(crate) fn display_color(plan: &Plan, light: Vec3) -> Vec3 {
    if plan.display.is_empty() {
        return light;
    }
    let color = apply_view_transform(plan.display, V3::splat(light) * F4::splat(plan.exposure));
    Vec3::new(color.x.0[0], color.y.0[0], color.z.0[0])
}

/// Display color: applies the view transform that the features select.
#[inline]
pub(super) fn apply_view_transform(features: Features, light: V3) -> V3 {
    match features {
        f if f.has(Features::AGX) => agx(light),
        f if f.has(Features::VIEW_TRANSFORM) => neutral(light),
        _ => light,
    }
}

fn map_channels(v: V3, f: impl Fn(F4) -> F4) -> V3 {
    V3 { x: f(v.x), y: f(v.y), z: f(v.z) }
}

fn multiply_matrix(m: [[f32; 3]; 3], v: V3) -> V3 {
    let [x, y, z] = m.map(|r| v.dot(V3::splat(Vec3::from_array(r))));
    V3 { x, y, z }
}

/// Khronos PBR Neutral Tone Mapper 1.0. A dielectric's reflection of 0.04 is subtracted, so that a matte surface in even light
/// shows its base color. From 0.76 on, the brightest channel is compressed and the color loses saturation.
pub(super) fn neutral(light: V3) -> V3 {
    let color = map_channels(light, |c| c.clamp(0.0, 16_777_216.0));
    let least = color.x.min(color.y).min(color.z);
    let low = least.min(F4::splat(0.08));
    let offset = low - low * low * 6.25;
    let color = map_channels(color, |c| c - offset);
    let peak = color.max_component();
    let bright = peak.0.map(|p| p >= 0.76);
    if bright == [false; 4] {
        return color;
    }
    // Lanes that are not bright are replaced below; the bound keeps them finite.
    let high = peak.max(F4::splat(0.76));
    let compressed_peak = F4::ONE - F4::splat(0.0576) / (high - F4::splat(0.52));
    let desaturation = F4::ONE - F4::ONE / ((high - compressed_peak) * 0.15 + F4::ONE);
    map_channels(color, |c| {
        let compressed = (c * (compressed_peak / high)).mix(compressed_peak, desaturation);
        F4(std::array::from_fn(|i| if bright[i] { compressed.0[i] } else { c.0[i] }))
    })
}

/// Troy Sobotka's AgX by Benjamin Wrensch's polynomial ("Minimal AgX Implementation", 2023).
pub(super) fn agx(light: V3) -> V3 {
    let color = map_channels(light, |c| c.clamp(0.0, 16_777_216.0));
    let inset = multiply_matrix(
        [
            [0.842_479_05, 0.0784336, 0.079_223_745],
            [0.042_328_242, 0.878_468_6, 0.079_166_13],
            [0.042_375_655, 0.0784336, 0.879_143],
        ],
        color,
    );
    let curve = |c: F4| {
        let x = ((c.max(F4::splat(1e-10)).map(libm::log2f) + F4::splat(12.47393)) / 16.5).clamp(0.0, 1.0);
        let x2 = x * x;
        let x4 = x2 * x2;
        x4 * x2 * 15.5 - x4 * x * 40.14 + x4 * 31.96 - x2 * x * 6.868 + x2 * 0.4298 + x * 0.1191
            - F4::splat(0.00232)
    };
    let out = multiply_matrix(
        [
            [1.196_879, -0.098_020_88, -0.099_029_74],
            [-0.052_896_852, 1.151_903_2, -0.098_961_174],
            [-0.052_971_636, -0.098_043_45, 1.151_073_7],
        ],
        map_channels(inset, curve),
    );
    // The curve gives codes of a display with gamma 2.2; the image is linear.
    map_channels(out, |c| c.max(F4::ZERO).map(|c| libm::powf(c, 2.2)).clamp(0.0, 1.0))
}
