//! The built-in effects, evaluated on the CPU, against closed forms and what each is defined to do.

use choreo_plugin::{
    BACKGROUND_DISTANCE, Effect, EffectImage, EffectImages, InvertedHull, OutlineEffect, Shutter,
    SurfaceInputs, SurfaceSample,
};
use glam::{Vec2, Vec3, Vec4};
use std::sync::LazyLock;

static ALL: LazyLock<Vec<Effect>> = LazyLock::new(effects::all);

fn effect(name: &str) -> &'static Effect {
    ALL.iter().find(|e| e.manifest().name == name).unwrap()
}

fn outline(name: &str) -> &'static dyn OutlineEffect {
    let Effect::Outline(effect) = effect(name) else { panic!("{name} is no outline") };
    &**effect
}

fn pixel(name: &str, color: Vec4, uv: Vec2, p: &[f32]) -> Vec4 {
    let mut colors = [color];
    let Effect::Pixel(effect) = effect(name) else { panic!("{name} is no effect on pixels") };
    effect.pixels(&mut colors, &[uv], p);
    colors[0]
}

fn surface(name: &str, color: Vec4, sample: &SurfaceSample, p: &[f32]) -> Vec4 {
    let mut colors = [color];
    let Effect::Surface(effect) = effect(name) else { panic!("{name} is no effect on surfaces") };
    effect.surfaces(&mut colors, &[*sample], p);
    colors[0]
}

/// All passes of an effect over an image.
fn passes(name: &str, rgba: &[Vec4], size: [u32; 2], p: &[f32]) -> Vec<Vec4> {
    effect(name).over_image(EffectImage { size, rgba }, None, p)
}

#[test]
fn all_effects_compile_and_have_the_version_of_choreo() {
    for effect in ALL.iter() {
        let manifest = effect.manifest();
        assert_eq!(manifest.version, env!("CARGO_PKG_VERSION"), "{}", manifest.name);
        let p = [0.5; 8];
        // Built-in effects are compiled at their first call.
        match effect {
            Effect::Pixel(effect) => effect.pixels(&mut [], &[], &p),
            Effect::Surface(effect) => effect.surfaces(&mut [], &[], &p),
            Effect::Image(effect) => {
                let image = EffectImage { size: [1, 1], rgba: &[Vec4::ONE] };
                let images =
                    EffectImages { now: image, original: image, passes: &[], before: &[], scene: None };
                effect.image_row(&images, 0, 0, &p, &mut []);
            }
            Effect::Outline(effect) => drop(effect.inverted_hull(&p)),
            Effect::Shutter(effect) => drop(effect.shutter(&p)),
            _ => {}
        }
    }
    assert_eq!(ALL.len(), 20);
}

/// At 0 an effect is left out, so that it costs nothing. A shadow catcher of strength 0 hides the surfaces that it is on.
#[test]
fn every_effect_with_a_strength_is_off_at_0() {
    let strengths = [
        ("ambient_occlusion", "strength"),
        ("bloom", "strength"),
        ("depth_of_field", "limit"),
        ("edge_lines", "strength"),
        ("film_grain", "strength"),
        ("fog", "density"),
        ("god_rays", "strength"),
        ("grid", "opacity"),
        ("heat_haze", "strength"),
        ("motion_blur", "shutter"),
        ("outline", "width"),
        ("vignette", "strength"),
    ];
    for (name, parameter) in strengths {
        let off = |value| effect(name).off(&effect(name).manifest().parameters(&[(parameter.into(), value)]));
        assert_eq!(off(0.0), Some(format!("{parameter} is 0")), "{name}");
        assert_eq!(off(0.01), None, "{name}");
    }
    for manifest in ALL.iter().map(|effect| effect.manifest()).filter(|m| m.name != "shadow_catcher") {
        let listed = strengths.iter().any(|(name, _)| manifest.name == *name);
        let strong = manifest.options.iter().any(|option| option.name == "strength");
        assert!(listed || !strong, "{}", manifest.name);
    }
}

mod bloom {
    use super::*;

    const P: [f32; 8] = [0.5, 1.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0];

    #[test]
    fn colors_below_the_threshold_do_not_change() {
        let gray = vec![Vec4::new(0.9, 0.5, 0.2, 1.0); 40 * 30];
        assert_eq!(passes("bloom", &gray, [40, 30], &P), gray);
    }

    #[test]
    fn bloom_adds_strength_times_the_light_above_the_threshold() {
        // Near enough for full size, and so far that it is spread in an image four times smaller.
        for (radius, shrink) in [(0.02, 1), (0.2, 4)] {
            let p = [0.5, 1.0, radius, 0.0, 0.0, 0.0, 0.0, 0.0];
            assert_eq!(effect("bloom").shrink(0, [121, 121], &p), shrink);
            let mut rgba = vec![Vec4::W; 121 * 121];
            rgba[61 * 121 + 61] = Vec4::new(5.0, 2.5, 0.0, 1.0);
            let out = passes("bloom", &rgba, [121, 121], &p);
            let sum: Vec4 = out.iter().zip(&rgba).map(|(a, b)| *a - *b).sum();
            // 5 is 4 above the threshold of 1, times ½; green is half of it.
            assert!((sum.x - 2.0).abs() < 2e-3 && (sum.y - 1.0).abs() < 1e-3 && sum.z == 0.0, "{sum}");
            let at = |x: usize, y: usize| out[y * 121 + x].x;
            assert!((at(64, 61) - at(61, 64)).abs() < 1e-6, "round");
            assert!(at(64, 61) > at(74, 61) && at(64, 61) > 0.0, "less with distance");
        }
    }

    #[test]
    fn a_reduced_image_spreads_light_like_the_gaussian() {
        let p = [1.0, 0.5, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0];
        let size = [120, 120];
        let bright = |x: i32, y: i32| (40..60).contains(&x) && (50..80).contains(&y);
        let color = |i: i32| if bright(i % 120, i / 120) { Vec4::new(2.5, 2.5, 2.5, 1.0) } else { Vec4::W };
        let rgba: Vec<Vec4> = (0..120 * 120).map(color).collect();
        let out = passes("bloom", &rgba, size, &p);
        // The blur of a box, in closed form: differences of the normal distribution; 24 pixels are three standard deviations.
        let share = |x: f64, from: f64, to: f64| {
            let normal = |x: f64| 0.5 * (1.0 + libm::erf(x / (8.0 * std::f64::consts::SQRT_2)));
            normal(to - x) - normal(from - x)
        };
        let mut worst = 0.0f64;
        for (i, (out, before)) in (0..).zip(out.iter().zip(&rgba)) {
            let (x, y) = (f64::from(i % 120) + 0.5, f64::from(i / 120) + 0.5);
            let exact = 2.0 * share(x, 40.0, 60.0) * share(y, 50.0, 80.0);
            worst = worst.max((f64::from(out.x - before.x) - exact).abs());
        }
        println!("{worst:.4} of 2");
        // The taps end at three standard deviations, and four pixels are one.
        assert!(worst < 0.05, "{worst}");
    }
}

mod fog {
    use super::*;

    /// Looked at from `eye` metres up.
    fn after(metres: f32, eye: f32, height: f32, p: [f32; 8]) -> f32 {
        let seen = SurfaceSample {
            distance: metres,
            world: Vec3::Y * height,
            viewer: Vec3::Y * eye,
            ..SurfaceSample::default()
        };
        surface("fog", Vec4::ONE, &seen, &p).x
    }

    #[test]
    fn fog_absorbs_light_per_metre_and_thins_with_height() {
        let p = [0.1, 2.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(after(2.0, 0.0, 0.0, p), 1.0, "what is nearer than start is clear");
        assert!((after(12.0, 0.0, 0.0, p) - libm::expf(-1.0)).abs() < 1e-6, "ten metres of a tenth");
        assert_eq!(after(12.0, 0.5, 0.5, p), after(12.0, 1.0, 1.0, p), "as thick up to the height");
        // Two metres above it the density is e⁻¹ of that below.
        assert!((after(12.0, 3.0, 3.0, p) - libm::expf(-libm::expf(-1.0))).abs() < 1e-6);
        assert!(after(1e9, 0.0, 0.0, p) == 0.0);
    }

    #[test]
    fn fog_along_slopes_equals_the_sum_of_small_steps() {
        for (eye, height, metres, start, thins, falloff) in [
            (1.6, 0.0, 20.0, 0.0, 0.0, 0.5),
            (0.2, 9.0, 15.0, 3.0, 1.0, 0.8),
            (30.0, -2.0, 60.0, 5.0, 2.0, 0.3),
            (2.0, 2.01, 8.0, 0.0, 0.0, 2.0),
            (1.0, 4.0, 10.0, 0.0, 0.0, 0.0),
        ] {
            let p = [0.1, start, thins, falloff, 0.0, 0.0, 0.0, 0.0];
            let steps = 200_000;
            let mut depth = 0.0;
            for i in 0..steps {
                let along = (f64::from(i) + 0.5) / f64::from(steps);
                let at = f64::from(start) + (f64::from(metres) - f64::from(start)) * along;
                let y = f64::from(eye) + (f64::from(height) - f64::from(eye)) * at / f64::from(metres);
                let density = 0.1 * libm::exp(-f64::from(falloff) * (y - f64::from(thins)).max(0.0));
                depth += density * (f64::from(metres) - f64::from(start)) / f64::from(steps);
            }
            let got = f64::from(after(metres, eye, height, p));
            assert!((got - libm::exp(-depth)).abs() < 2e-4, "{got} for {}", libm::exp(-depth));
        }
    }

    #[test]
    fn fog_leaves_the_zenith_clear_and_hides_the_horizon() {
        let p = [0.1, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0];
        let sky = |up: f32| after(BACKGROUND_DISTANCE, 0.0, up * BACKGROUND_DISTANCE, p);
        // Straight up: density / falloff metres of it in all.
        assert!((sky(1.0) - libm::expf(-0.2)).abs() < 1e-5);
        assert!((sky(0.25) - libm::expf(-0.8)).abs() < 1e-5);
        assert!(sky(0.0) == 0.0 && sky(-0.5) == 0.0);
        assert!(
            effect("fog").changes_background(&p)
                && !effect("fog").changes_background(&[0.1, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        );
    }

    #[test]
    fn distant_surfaces_take_the_color_of_the_sky() {
        let seen =
            SurfaceSample { distance: 1e6, background: Vec3::new(0.1, 0.2, 0.3), ..SurfaceSample::default() };
        let p = [0.1, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
        assert_eq!(surface("fog", Vec4::ONE, &seen, &p), Vec4::new(0.1, 0.2, 0.3, 1.0));
    }
}

mod fxaa {
    use super::*;

    const SPAN: f32 = 3.0;

    fn run(size: [u32; 2], span: f32, color: impl Fn(i32, i32) -> f32) -> Vec<f32> {
        let p = [0.125, span, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let [w, h] = size.map(|s| s as i32);
        let all = || (0..h).flat_map(move |y| (0..w).map(move |x| (x, y)));
        let rgba: Vec<Vec4> = all().map(|(x, y)| Vec3::splat(color(x, y)).extend(1.0)).collect();
        passes("fxaa", &rgba, size, &p).into_iter().map(|c| c.x).collect()
    }

    #[test]
    fn uniform_images_and_straight_edges_do_not_change() {
        assert!(run([8, 8], SPAN, |_, _| 0.3).iter().all(|c| *c == 0.3));
        // An upright edge between pixels has no steps to smooth: bright stays bright.
        let upright = run([16, 16], SPAN, |x, _| if x < 8 { 0.0 } else { 1.0 });
        assert!(upright[8 * 16 + 2] == 0.0 && upright[8 * 16 + 13] == 1.0);
    }

    /// Sum of the errors against exact coverage of an edge that rises by so much a pixel: as it is, and smoothed.
    fn errors(slope: f32, span: f32) -> [f32; 2] {
        let (w, h) = (48, 44);
        let line = |x: f32| 8.0 + x * slope;
        let hard = |x: i32, y: i32| f32::from(y as f32 + 0.5 > line(x as f32 + 0.5));
        let smooth = run([w as u32, h as u32], span, hard);
        let mut sums = [0.0; 2];
        for y in 4..h - 4 {
            for x in 8..w - 8 {
                let at = |i: i32| i as f32 / 8.0 + 0.0625;
                let inside = |i: &i32| y as f32 + at(i % 8) > line(x as f32 + at(i / 8));
                let covered = (0..64).filter(inside).count() as f32 / 64.0;
                sums[0] += (hard(x, y) - covered).abs();
                sums[1] += (smooth[(y * w + x) as usize] - covered).abs();
            }
        }
        sums
    }

    /// The default was chosen by this measurement: spans of 2, 3, 4 and 8 reduce the error to 0.68, 0.62, 0.68 and 0.93 of its value.
    #[test]
    fn slanted_edges_come_nearer_to_their_coverage_at_every_slope() {
        let slopes = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
        let left = |span: f32| {
            let all = slopes.map(|slope| errors(slope, span));
            all.iter().map(|e| e[1]).sum::<f32>() / all.iter().map(|e| e[0]).sum::<f32>()
        };
        for slope in slopes {
            let [before, after] = errors(slope, SPAN);
            assert!(after < before * 0.95, "{slope}: {before} {after}");
        }
        let chosen = left(SPAN);
        println!("error left of spans 2, 3, 4, 8: {:?}", [2.0, 3.0, 4.0, 8.0].map(left));
        assert!(chosen < 0.65 && [1.5, 4.0, 8.0].iter().all(|other| left(*other) > chosen));
    }
}

mod motion_blur {
    use super::*;

    #[test]
    fn shutter_degrees_become_a_fraction_of_the_frame() {
        let p = [8.0, 90.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let Effect::Shutter(blur) = effect("motion_blur") else { panic!("motion_blur is no shutter") };
        assert_eq!(blur.shutter(&p), Some(Shutter { samples: 8, open: 0.25, before: 0.0 }));
    }
}

mod outline {
    use super::*;

    #[test]
    fn parameters_come_in_the_order_of_the_manifest() {
        let names: Vec<&str> = effect("outline").manifest().options.iter().map(|o| o.name.as_str()).collect();
        assert_eq!(names, ["width", "color", "light"]);
        let shell = outline("outline").inverted_hull(&[3.0, 0.25, 0.5, 0.75, 1.0, 0.0, 0.0, 0.0]).unwrap();
        let expected = InvertedHull { width: 3.0, color: Vec3::new(0.25, 0.5, 0.75), lighting_mix: 1.0 };
        assert_eq!(shell, expected);
        assert!(effect("outline").hook().applies_to_actors());
    }
}

mod shadow_catcher {
    use super::*;

    #[test]
    fn fully_lit_surfaces_are_invisible() {
        let p = [0.5, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.0];
        let at = |shadow: f32| {
            surface("shadow_catcher", Vec4::ONE, &SurfaceSample { shadow, ..SurfaceSample::default() }, &p)
        };
        assert_eq!(at(0.0).w, 0.0);
        assert_eq!(at(0.8), Vec4::new(0.1, 0.2, 0.3, 0.4));
    }
}

mod tonemap {
    use super::*;

    fn map(curve: f32, stops: f32, color: Vec3) -> Vec3 {
        let p = [curve, stops, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        pixel("tonemap", color.extend(1.0), Vec2::ZERO, &p).truncate()
    }

    #[test]
    fn grays_stay_gray_increase_and_never_clip() {
        for curve in [0.0, 1.0, 2.0] {
            let mut last = -1.0;
            for i in 0..160 {
                let gray = libm::exp2f(i as f32 * 0.1 - 10.0);
                let got = map(curve, 0.0, Vec3::splat(gray));
                assert!(got.max_element() - got.min_element() < 2e-3, "{curve} {gray}: {got}");
                assert!(got.y >= last && got.y <= 1.0, "{curve} {gray}: {got}");
                last = got.y;
            }
            assert!(last > 0.85, "{curve}: {last}");
            assert!(map(curve, 0.0, Vec3::ZERO).max_element() < 1e-3, "black stays black");
        }
    }

    #[test]
    fn mid_gray_has_the_published_value_of_agx_and_aces() {
        // AgX has its pivot at mid gray, of code one half (Sobotka, AgX-S2O3), shown by a 2.2 display.
        let expected = libm::pow(0.5, 2.2);
        let got = f64::from(map(1.0, 0.0, Vec3::splat(0.18)).y);
        assert!((got - expected).abs() < 0.004, "{got} {expected}");
        // ACES' output transform shows 0.18 as 0.10 (ACES 1.x: 4.8 of 48 nits).
        let got = map(0.0, 0.0, Vec3::splat(0.18)).y;
        assert!((got - 0.1).abs() < 0.01, "{got}");
    }

    #[test]
    fn exposure_is_in_stops_and_curve_none_only_clips() {
        for curve in [0.0, 1.0, 2.0, 3.0] {
            let c = Vec3::new(0.1, 0.4, 0.2);
            assert!(map(curve, 1.0, c).abs_diff_eq(map(curve, 0.0, c * 2.0), 1e-6));
        }
        assert_eq!(map(3.0, 0.0, Vec3::new(0.25, 0.5, 7.0)), Vec3::new(0.25, 0.5, 1.0));
        for wild in [f32::MAX, f32::INFINITY, -5.0] {
            assert!((0..4).all(|c| map(c as f32, 10.0, Vec3::splat(wild)).is_finite()), "{wild}");
        }
    }
}

mod toon {
    use super::*;

    #[test]
    fn toon_has_one_brightness_per_step_and_keeps_the_hue() {
        let p = [4.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut seen: Vec<f32> = Vec::new();
        for i in 0..1000 {
            let light = i as f32 / 999.0;
            let got =
                surface("toon", Vec4::new(light, light * 0.5, 0.0, 0.25), &SurfaceSample::default(), &p);
            assert!((got.y - got.x * 0.5).abs() < 1e-5 && got.w == 0.25);
            if light > 0.001 && !seen.iter().any(|s| (s - got.x).abs() < 1e-4) {
                seen.push(got.x);
            }
        }
        let expected = [0.125f32, 0.375, 0.625, 0.875].map(|v| v * v);
        assert!(seen.len() == 4 && seen.iter().zip(expected).all(|(s, e)| (s - e).abs() < 1e-4), "{seen:?}");
    }

    #[test]
    fn soft_steps_are_continuous() {
        let p = [3.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut last = 0.0;
        for i in 1..=2000 {
            let got = surface("toon", Vec4::splat(i as f32 / 2000.0), &SurfaceSample::default(), &p).x;
            assert!(got >= last - 1e-5 && (i == 1 || got - last < 0.01), "{i}: {last} {got}");
            last = got;
        }
    }
}

mod views {
    use super::*;

    #[test]
    fn each_view_shows_its_quantity() {
        let seen = SurfaceSample {
            normal: Vec3::NEG_Y,
            uv: Vec2::new(1.25, -0.75),
            joints: Vec3::X,
            distance: 12.5,
            ..SurfaceSample::default()
        };
        let show = |what: f32| {
            let p = [what, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            surface("views", Vec4::splat(0.5), &seen, &p)
        };
        assert_eq!(show(0.0), Vec4::new(0.5, 0.0, 0.5, 0.5));
        assert_eq!(show(1.0), Vec4::new(0.25, 0.25, 0.0, 0.5));
        assert_eq!(show(2.0), Vec4::new(1.0, 0.0, 0.0, 0.5));
        assert_eq!(show(3.0), Vec4::new(0.75, 0.75, 0.75, 0.5));
        let needs = |what: f32| effect("views").surface_inputs(&[what, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(needs(0.0).normals && needs(1.0).uvs && needs(2.0).joints);
        assert_eq!(needs(3.0), SurfaceInputs::default());
    }
}

mod vignette {
    use super::*;

    const P: [f32; 8] = [0.5, 0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

    #[test]
    fn vignette_keeps_the_center_and_alpha_and_darkens_the_corners() {
        let white = Vec4::new(1.0, 1.0, 1.0, 0.5);
        assert_eq!(pixel("vignette", white, Vec2::splat(0.5), &P), white);
        for corner in [Vec2::ZERO, Vec2::ONE, Vec2::X, Vec2::Y] {
            let got = pixel("vignette", white, corner, &P);
            assert!((got.x - 0.5).abs() < 1e-6 && got.w == 0.5, "{corner}: {got}");
        }
    }

    #[test]
    fn brightness_decreases_steadily_from_the_center() {
        let mut last = f32::INFINITY;
        for i in 0..=100 {
            let v = pixel("vignette", Vec4::ONE, Vec2::splat(0.5 + 0.005 * i as f32), &P).x;
            assert!(v <= last);
            last = v;
        }
    }
}

mod wireframe {
    use super::*;

    #[test]
    fn wireframe_has_its_color_and_no_inverted_hull() {
        let p = [0.25, 0.5, 0.75, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(outline("wireframe").wireframe(&p), Some(Vec3::new(0.25, 0.5, 0.75)));
        assert_eq!(outline("wireframe").inverted_hull(&p), None);
    }
}

mod xray {
    use super::*;

    #[test]
    fn silhouettes_are_opaque_and_facing_surfaces_translucent() {
        let alpha = |facing: f32| {
            let seen = SurfaceSample { facing, ..SurfaceSample::default() };
            surface("xray", Vec4::ONE, &seen, &[0.25, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).w
        };
        assert!((alpha(0.0) - 1.0).abs() < 1e-6 && (alpha(1.0) - 0.25).abs() < 1e-6);
        assert_eq!(alpha(0.5), alpha(-0.5));
        assert!((alpha(0.5) - (0.25 + 0.75 * 0.25)).abs() < 1e-6);
    }
}
