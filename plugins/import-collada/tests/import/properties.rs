//! Animated cameras and lights against closed forms in f64.

use choreo_asset::{Asset, LightKind};
use choreo_importer_kit_testing::{Companions, import, source, warnings};
use choreo_motion::{PropertyTarget, Time};
use choreo_plugin::ImportScope;
use glam::DVec3;
use import_collada::ColladaImporter;
use std::f64::consts::PI;

const ARM: &str = include_str!("../data/arm.dae");

/// An animation of one target at 0, 1 and 2 s, with values and interpolations of its keys.
fn animation(target: &str, stride: usize, values: &str, how: &str) -> String {
    let id = target.replace(['/', '.', '(', ')'], "-");
    format!(
        "<animation><source id=\"{id}-in\"><float_array id=\"{id}-ia\" count=\"3\">0 1 2</float_array>\
         <technique_common><accessor source=\"#{id}-ia\" count=\"3\"/></technique_common></source>\
         <source id=\"{id}-out\"><float_array id=\"{id}-oa\" count=\"{count}\">{values}</float_array><technique_common>\
         <accessor source=\"#{id}-oa\" count=\"3\" stride=\"{stride}\"/></technique_common></source>\
         <source id=\"{id}-how\"><Name_array id=\"{id}-ha\" count=\"3\">{how}</Name_array><technique_common>\
         <accessor source=\"#{id}-ha\" count=\"3\"/></technique_common></source>\
         <sampler id=\"{id}-s\"><input semantic=\"INPUT\" source=\"#{id}-in\"/><input semantic=\"OUTPUT\" source=\"#{id}-out\"/>\
         <input semantic=\"INTERPOLATION\" source=\"#{id}-how\"/></sampler><channel source=\"#{id}-s\" target=\"{target}\"/></animation>",
        count = 3 * stride
    )
}

/// The sample file with other elements and animations in it.
fn read(changes: &[(&str, &str)], animations: &[String]) -> Asset {
    let mut text = ARM.replace("</library_animations>", &(animations.concat() + "</library_animations>"));
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    let asset =
        import(&ColladaImporter, &source("arm.dae", text.as_str()), &Companions::none(), ImportScope::ALL);
    asset.unwrap_or_else(|e| panic!("{e}"))
}

/// The numbers of a target at a time.
fn at(asset: &Asset, target: PropertyTarget, secs: f64) -> Vec<f64> {
    let clip = &asset.clips[0];
    let mut out = vec![0.0; target.width()];
    assert!(clip.sample_property(target, Time::from_secs(secs), &mut out), "{target:?} is not animated");
    out.into_iter().map(f64::from).collect()
}

/// Straight lines between three numbers a second apart.
fn straight([a, b, c]: [f64; 3], secs: f64) -> f64 {
    if secs < 1.0 { a + (b - a) * secs } else { b + (c - b) * (secs - 1.0) }
}

fn times() -> impl Iterator<Item = f64> {
    (0..97).map(|k| 2.0 * (f64::from(k) + 0.37) / 97.0)
}

/// tan(½ yfov) = tan(½ xfov) ÷ 2.
#[test]
fn a_horizontal_angle_becomes_an_accurate_vertical_angle() {
    let lens = animation("cam/xfov", 1, "90 30 110", "LINEAR LINEAR LINEAR");
    let asset = read(&[], &[lens]);
    let truth = |secs| 2.0 * ((0.5 * straight([90.0, 30.0, 110.0], secs).to_radians()).tan() / 2.0).atan();
    let worst = |late: f64| {
        let off = |secs: f64| (at(&asset, PropertyTarget::CameraYfov(0), secs)[0] - truth(secs + late)).abs();
        times().map(off).fold(0.0, f64::max)
    };
    println!("{:.1e} rad", worst(0.0));
    assert!(worst(0.0) < 1.5e-4, "{}", worst(0.0));
    assert!(worst(0.01) > 1e-3, "a late key is not found");
    assert!(warnings(&asset).iter().all(|w| !w.contains("channel")), "{:?}", warnings(&asset));
}

/// Color times intensity is π times the file's color, beyond 1 too.
#[test]
fn animated_light_colors_become_color_and_intensity() {
    let sun = animation("sun/color", 3, "2 1 0  0.5 4 1  0.25 0.5 0.5", "LINEAR LINEAR LINEAR");
    let lamp = animation("lamp/color.G", 1, "1 0 0.5", "STEP STEP STEP");
    let sid = [
        ("<directional><color>", "<directional><color sid=\"color\">"),
        ("<point><color>", "<point><color sid=\"color\">"),
    ];
    let asset = read(&sid, &[sun, lamp]);
    let keys = [[2.0, 0.5, 0.25], [1.0, 4.0, 0.5], [0.0, 1.0, 0.5]];
    let worst = |late: f64| {
        let off = |secs: f64| {
            let color = DVec3::from_slice(&at(&asset, PropertyTarget::LightColor(0), secs));
            let light = color * at(&asset, PropertyTarget::LightIntensity(0), secs)[0];
            let truth = DVec3::from_array(keys.map(|key| straight(key, secs + late))) * PI;
            (light - truth).abs().max_element()
        };
        times().map(off).fold(0.0, f64::max)
    };
    println!("{:.1e}", worst(0.0));
    assert!(worst(0.0) < 4e-3, "{}", worst(0.0));
    assert!(worst(0.01) > 3e-2, "a late key is not found");
    for (secs, green) in [(0.5, 1.0), (0.999, 1.0), (1.0, 0.0), (1.999, 0.0), (2.0, 0.5)] {
        assert_eq!(at(&asset, PropertyTarget::LightColor(1), secs), [1.0, green, 1.0], "{secs} s");
    }
}

/// The full angle of a spot, whose soft edge keeps its share.
#[test]
fn spot_cone_angles_are_animated() {
    let spot = "<spot><color>1 1 1</color><falloff_angle sid=\"angle\">40</falloff_angle></spot>";
    let cone = animation("sun/angle", 1, "40 80 20", "LINEAR LINEAR LINEAR");
    let asset = read(&[("<directional><color>2 1 0</color></directional>", spot)], &[cone]);
    assert!(matches!(asset.lights[0].light.kind, LightKind::Spot { .. }));
    for secs in times() {
        let truth = straight([40.0, 80.0, 20.0], secs).to_radians() / 2.0;
        let [outer, inner] =
            [PropertyTarget::SpotOuter(0), PropertyTarget::SpotInner(0)].map(|t| at(&asset, t, secs)[0]);
        assert!(
            (outer - truth).abs() < 1e-6 && (inner - 0.98 * truth).abs() < 1e-6,
            "{outer} {inner} at {secs} s"
        );
    }
}

#[test]
fn unsupported_animated_values_are_warnings() {
    let asset = read(&[], &[animation("cam/zfar", 1, "100 200 300", "LINEAR LINEAR LINEAR")]);
    let said = warnings(&asset);
    assert!(
        said.iter()
            .any(|w| w.contains("1 channel for an unsupported property of a camera or light; left out")),
        "{said:?}"
    );
}
