//! Brings light of any strength into what a screen can show: ACES, AgX, or plain clipping, after an exposure.

use choreo_plugin::{Effect, Manifest};
use glam::{Vec2, Vec3, Vec4};
use std::sync::LazyLock;

static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "tonemap",
        env!("CARGO_PKG_VERSION"),
        "brings light of any strength into what a screen shows",
    )
    .text(
        "curve",
        "how bright colors are rolled off: aces has contrast, agx keeps hues",
        "aces",
        &["aces", "agx", "none"],
    )
    .number("exposure", "stops before the curve: 1 is twice the light", 0.0, -10.0..=10.0)
});

#[derive(Clone, Copy, Debug, Default)]
pub struct Tonemap;

fn rows(m: [[f32; 3]; 3], v: Vec3) -> Vec3 {
    let dot = |r: [f32; 3]| r[0] * v.x + r[1] * v.y + r[2] * v.z;
    Vec3::new(dot(m[0]), dot(m[1]), dot(m[2]))
}

/// Stephen Hill's fit of the ACES reference and output transforms, sRGB to sRGB (BakingLab, ACES.hlsl).
fn aces(color: Vec3) -> Vec3 {
    let v =
        rows([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]], color);
    let a = v * (v + 0.0245786) - 0.000090537;
    let b = v * (0.983729 * v + 0.432951) + 0.238081;
    rows([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]], a / b)
}

/// Troy Sobotka's AgX by Benjamin Wrensch's polynomial ("Minimal AgX Implementation", 2023): 16.5 stops, mid grey at 10 of them.
fn agx(color: Vec3) -> Vec3 {
    let inset = rows(
        [
            [0.842_479_05, 0.0784336, 0.079_223_745],
            [0.042_328_242, 0.878_468_6, 0.079_166_13],
            [0.042_375_655, 0.0784336, 0.879_143],
        ],
        color,
    );
    let stops = |v: f32| ((libm::log2f(v.max(1e-10)) + 12.47393) / 16.5).clamp(0.0, 1.0);
    let x = Vec3::new(stops(inset.x), stops(inset.y), stops(inset.z));
    let x2 = x * x;
    let x4 = x2 * x2;
    let y =
        15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.00232;
    let out = rows(
        [
            [1.196_879, -0.098_020_88, -0.099_029_74],
            [-0.052_896_852, 1.151_903_2, -0.098_961_174],
            [-0.052_971_636, -0.098_043_45, 1.151_073_7],
        ],
        y,
    );
    // The curve gives codes of a 2.2 display; the picture is linear.
    let linear = |v: f32| libm::powf(v.max(0.0), 2.2);
    Vec3::new(linear(out.x), linear(out.y), linear(out.z))
}

impl Effect for Tonemap {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn wgsl(&self) -> &str {
        include_str!("tonemap.wgsl")
    }

    fn cpu(&self, color: Vec4, _uv: Vec2, p: &[f32; 8]) -> Vec4 {
        // More than 2²⁴ would overflow the squares.
        let light = (color.truncate() * libm::exp2f(p[1])).clamp(Vec3::ZERO, Vec3::splat(16_777_216.0));
        let mapped = match p[0] {
            curve if curve < 0.5 => aces(light),
            curve if curve < 1.5 => agx(light),
            _ => light,
        };
        mapped.clamp(Vec3::ZERO, Vec3::ONE).extend(color.w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_wgsl_effect::WgslEffect;

    fn map(curve: f32, stops: f32, color: Vec3) -> Vec3 {
        let p = [curve, stops, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        Tonemap.cpu(color.extend(1.0), Vec2::ZERO, &p).truncate()
    }

    #[test]
    fn greys_stay_grey_rise_and_never_clip() {
        for curve in [0.0, 1.0] {
            let mut last = -1.0;
            for i in 0..160 {
                let grey = libm::exp2f(i as f32 * 0.1 - 10.0);
                let got = map(curve, 0.0, Vec3::splat(grey));
                assert!(got.max_element() - got.min_element() < 2e-3, "{curve} {grey}: {got}");
                assert!(got.y >= last && got.y <= 1.0, "{curve} {grey}: {got}");
                last = got.y;
            }
            assert!(last > 0.85, "{curve}: {last}");
            assert!(map(curve, 0.0, Vec3::ZERO).max_element() < 1e-3, "black stays black");
        }
    }

    #[test]
    fn mid_grey_is_where_the_transforms_put_it() {
        // AgX has its pivot at mid grey, of code one half (Sobotka, AgX-S2O3), shown by a 2.2 display.
        let expected = libm::pow(0.5, 2.2);
        let got = f64::from(map(1.0, 0.0, Vec3::splat(0.18)).y);
        assert!((got - expected).abs() < 0.004, "{got} {expected}");
        // ACES' output transform shows 0.18 as 0.10 (ACES 1.x: 4.8 of 48 nits).
        let got = map(0.0, 0.0, Vec3::splat(0.18)).y;
        assert!((got - 0.1).abs() < 0.01, "{got}");
    }

    #[test]
    fn exposure_counts_in_stops_and_none_only_clips() {
        for curve in [0.0, 1.0, 2.0] {
            let c = Vec3::new(0.1, 0.4, 0.2);
            assert!(map(curve, 1.0, c).abs_diff_eq(map(curve, 0.0, c * 2.0), 1e-6));
        }
        assert_eq!(map(2.0, 0.0, Vec3::new(0.25, 0.5, 7.0)), Vec3::new(0.25, 0.5, 1.0));
        for wild in [f32::MAX, f32::INFINITY, -5.0] {
            assert!((0..3).all(|c| map(c as f32, 10.0, Vec3::splat(wild)).is_finite()), "{wild}");
        }
    }

    #[test]
    fn the_shader_gives_the_same() {
        let shader = WgslEffect::from_text("t.wgsl", &format!("// effect: t\n{}", Tonemap.wgsl())).unwrap();
        let mut worst = 0.0f32;
        for i in 0..3000u32 {
            let part = |n: u32, of: u32| (i / of % n) as f32 / (n - 1) as f32;
            let color = Vec3::new(part(10, 1) * 3.0, part(10, 10) * 3.0, part(10, 100) * 30.0);
            let p = [(i / 1000) as f32, part(7, 3) - 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            let (a, b) = (
                shader.cpu(color.extend(0.5), Vec2::ZERO, &p),
                Tonemap.cpu(color.extend(0.5), Vec2::ZERO, &p),
            );
            worst = worst.max((a - b).abs().max_element());
        }
        assert!(worst < 1e-5, "{worst}");
        let other = shader.cpu(Vec4::splat(0.5), Vec2::ZERO, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((other - Tonemap.cpu(Vec4::splat(0.5), Vec2::ZERO, &[0.0; 8])).abs().max_element() > 1e-2);
    }
}
