//! Tone mapping of colors from ten stops below middle gray to six stops above.

use crate::{BUDGET_SECS, Section};
use choreo_bench::scene::tones::{Light, aces, agx, effect};
use glam::{Vec2, Vec3, Vec4};

/// Description of the colors of [`test_colors`].
const COLORS_MEASURED: &str = "845 colors from −10 to +6 stops about middle gray";

pub(crate) fn section() -> Result<Section, String> {
    check_formulas()?;
    Ok(Section {
        title: "Tone mapping",
        text: "Both transforms are chains of matrices, logarithms and curves; the renderer uses a fit of \
               each. The fit of ACES leaves out the glow of dark colors and the hue shift of reds; its \
               worst errors are at saturated colors brighter than white, where a channel is clipped: 24 \
               codes there, one code in the mean."
            .into(),
        choices: vec![
            aces(&test_colors(), COLORS_MEASURED, BUDGET_SECS),
            agx(&test_colors(), COLORS_MEASURED, BUDGET_SECS),
        ],
        tables: Vec::new(),
        off_front: Vec::new(),
    })
}

/// Linear sRGB: grays, and half and fully saturated colors, each from 10 stops below middle gray to 6 stops above.
fn test_colors() -> Vec<Light> {
    const HUES: [(&str, [f32; 3]); 13] = [
        ("gray", [1.0, 1.0, 1.0]),
        ("red", [1.0, 0.0, 0.0]),
        ("green", [0.0, 1.0, 0.0]),
        ("blue", [0.0, 0.0, 1.0]),
        ("yellow", [1.0, 1.0, 0.0]),
        ("cyan", [0.0, 1.0, 1.0]),
        ("magenta", [1.0, 0.0, 1.0]),
        ("pale red", [1.0, 0.5, 0.5]),
        ("pale green", [0.5, 1.0, 0.5]),
        ("pale blue", [0.5, 0.5, 1.0]),
        ("skin", [1.0, 0.62, 0.48]),
        ("leaf", [0.35, 0.8, 0.2]),
        ("sky", [0.35, 0.6, 1.0]),
    ];
    let mut out = Vec::new();
    for (name, hue) in HUES {
        for step in -40..=24 {
            let stops = step as f32 * 0.25;
            out.push((format!("{name}, {stops:+} stops"), Vec3::from(hue) * (0.18 * libm::exp2f(stops))));
        }
    }
    out
}

/// Checks that the formulas are those of the effect.
fn check_formulas() -> Result<(), String> {
    let tonemap = effects::named(&["tonemap"]).remove(0);
    let lights = test_colors();
    for curve in [0.0, 1.0] {
        let mut colors: Vec<Vec4> = lights.iter().map(|(_, light)| light.extend(1.0)).collect();
        let p = [curve, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let choreo_plugin::Effect::Pixel(function) = &tonemap else {
            return Err("tonemap is no effect on pixels".into());
        };
        function.pixels(&mut colors, &vec![Vec2::ZERO; lights.len()], &p);
        for (got, (name, light)) in colors.iter().zip(&lights) {
            let apart = (got.truncate() - effect(curve, *light)).abs().max_element();
            if apart.is_nan() || apart > 1e-6 {
                return Err(format!("the measured function is not the effect: {apart} apart at {name}"));
            }
        }
    }
    Ok(())
}
