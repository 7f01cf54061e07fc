//! Specular reflection of a rough surface: visibility terms of the GGX lobe.

use crate::images::{draw_frame, srgb_from_linear, stage};
use crate::{BUDGET_SECS, Random, Section};
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Cell, Choice, Row, Table, quantity};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Time;
use choreo_render::{CpuRenderer, Renderer};
use std::f64::consts::{PI, TAU};

const CHOSEN_METHOD: &str = "Smith, heights correlated (glTF)";
/// Visibility term of a BRDF, masking and shadowing divided by 4 NL NV, as a function of α², NL, NV and VH.
type Visibility = fn(f32, f32, f32, f32) -> f32;
const METHODS: [(&str, Visibility); 5] = [
    (CHOSEN_METHOD, correlated_smith_visibility),
    ("Smith, each direction alone", separate_smith_visibility),
    ("Hammon's fit of the correlated one (2017)", hammon_visibility),
    ("Schlick's fit of Smith, k = α / 2 (Karis 2013)", schlick_visibility),
    ("Kelemen's 1 / (4 VH²)", kelemen_visibility),
];
const ROUGHNESSES: [f64; 6] = [0.1, 0.25, 0.4, 0.6, 0.8, 1.0];
const VIEW_DEGREES: [f64; 5] = [0.0, 30.0, 60.0, 75.0, 85.0];
/// Number of directions in each of two dimensions.
const DIRECTIONS_PER_DIMENSION: u32 = 256;

/// E. Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", 2014, eq. 99: the formula of brdf.wgsl.
fn correlated_smith_visibility(a2: f32, nl: f32, nv: f32, _: f32) -> f32 {
    let rest = 1.0 - a2;
    0.5 / (nl * (nv * nv * rest + a2).sqrt() + nv * (nl * nl * rest + a2).sqrt())
}

fn separate_smith_visibility(a2: f32, nl: f32, nv: f32, _: f32) -> f32 {
    let one = |n: f32| n + (n * n * (1.0 - a2) + a2).sqrt();
    1.0 / (one(nl) * one(nv))
}

fn hammon_visibility(a2: f32, nl: f32, nv: f32, _: f32) -> f32 {
    let (product, sum) = (2.0 * nl * nv, nl + nv);
    0.5 / (product + (sum - product) * a2.sqrt())
}

fn schlick_visibility(a2: f32, nl: f32, nv: f32, _: f32) -> f32 {
    let k = 0.5 * a2.sqrt();
    0.25 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k))
}

fn kelemen_visibility(_: f32, _: f32, _: f32, vh: f32) -> f32 {
    0.25 / (vh * vh)
}

/// GGX lobe times π for F = 1: distribution times visibility.
fn ggx_lobe(visibility: Visibility, a2: f32, [nh, nl, nv, vh]: [f32; 4]) -> f32 {
    let d = nh * nh * (a2 - 1.0) + 1.0;
    a2 / (d * d) * visibility(a2, nl, nv, vh)
}

/// Directional albedo of the lobe: the fraction of uniform light that it reflects towards the viewer. The sum is importance-sampled by the
/// GGX distribution of half vectors.
fn directional_albedo(visibility: Visibility, roughness: f64, nv: f64) -> f64 {
    let a2 = roughness.powi(4);
    let view = [(1.0 - nv * nv).max(0.0).sqrt(), nv];
    let mut sum = 0.0;
    for i in 0..DIRECTIONS_PER_DIMENSION {
        let u = (f64::from(i) + 0.5) / f64::from(DIRECTIONS_PER_DIMENSION);
        let nh = ((1.0 - u) / (1.0 + (a2 - 1.0) * u)).sqrt();
        let across = (1.0 - nh * nh).max(0.0).sqrt();
        for j in 0..DIRECTIONS_PER_DIMENSION {
            let angle = TAU * (f64::from(j) + 0.5) / f64::from(DIRECTIONS_PER_DIMENSION);
            let vh = view[0] * across * libm::cos(angle) + view[1] * nh;
            let nl = 2.0 * vh * nh - nv;
            if nl <= 0.0 || vh <= 0.0 {
                continue;
            }
            let d = nh * nh * (a2 - 1.0) + 1.0;
            let density = a2 / (PI * d * d) * nh / (4.0 * vh);
            let shown = f64::from(ggx_lobe(visibility, a2 as f32, [nh, nl, nv, vh].map(|v| v as f32)));
            sum += shown / PI * nl / density;
        }
    }
    sum / f64::from(DIRECTIONS_PER_DIMENSION * DIRECTIONS_PER_DIMENSION)
}

/// Reference albedo in f64: visible normals are sampled (E. Heitz, "Sampling the GGX Distribution of Visible Normals", 2018), and G₂ / G₁
/// with Smith's Λ is averaged. It uses neither the distribution nor the visibility terms under test.
fn reference_albedo(roughness: f64, nv: f64) -> f64 {
    let alpha = roughness * roughness;
    let view = [(1.0 - nv * nv).max(0.0).sqrt(), 0.0, nv];
    let unit = |v: [f64; 3]| {
        let length = v.iter().map(|c| c * c).sum::<f64>().sqrt();
        v.map(|c| c / length)
    };
    let smith = |cosine: f64| {
        let tangent2 = (1.0 - cosine * cosine) / (cosine * cosine);
        0.5 * ((1.0 + alpha * alpha * tangent2).sqrt() - 1.0)
    };
    let stretched = unit([alpha * view[0], 0.0, view[2]]);
    // The view direction lies in the plane of x and z.
    let (first, second) = ([0.0, 1.0, 0.0], [-stretched[2], 0.0, stretched[0]]);
    let mut sum = 0.0;
    for i in 0..DIRECTIONS_PER_DIMENSION {
        let radius = ((f64::from(i) + 0.5) / f64::from(DIRECTIONS_PER_DIMENSION)).sqrt();
        for j in 0..DIRECTIONS_PER_DIMENSION {
            let angle = TAU * (f64::from(j) + 0.5) / f64::from(DIRECTIONS_PER_DIMENSION);
            let (x, y) = (radius * libm::cos(angle), radius * libm::sin(angle));
            let share = 0.5 * (1.0 + stretched[2]);
            let y = (1.0 - share) * (1.0 - x * x).sqrt() + share * y;
            let z = (1.0 - x * x - y * y).max(0.0).sqrt();
            let facet: [f64; 3] = std::array::from_fn(|c| x * first[c] + y * second[c] + z * stretched[c]);
            let h = unit([alpha * facet[0], alpha * facet[1], facet[2].max(0.0)]);
            let vh = view[0] * h[0] + view[2] * h[2];
            let nl = 2.0 * vh * h[2] - nv;
            if nl > 0.0 {
                sum += (1.0 + smith(nv)) / (1.0 + smith(nv) + smith(nl));
            }
        }
    }
    sum / f64::from(DIRECTIONS_PER_DIMENSION * DIRECTIONS_PER_DIMENSION)
}

pub(crate) fn section() -> Result<Section, String> {
    check_renderer()?;
    let mut errors = [(); METHODS.len()].map(|()| (ErrorStats::default(), String::new()));
    let titles: Vec<String> = VIEW_DEGREES.iter().map(|d| format!(">{d}°")).collect();
    let mut columns: Vec<(&str, &'static str)> = vec![("% of the light lost, looked at from", "roughness")];
    columns.extend(titles.iter().map(|t| (t.as_str(), "degrees")));
    let mut lost = Table::new(
        "Light lost by a surface that absorbs nothing, since only one bounce is computed",
        &columns,
    );
    for roughness in ROUGHNESSES {
        let mut cells = vec![Cell::text(format!("roughness {roughness}"))];
        for degrees in VIEW_DEGREES {
            let nv = libm::cos(degrees.to_radians());
            let exact = reference_albedo(roughness, nv);
            cells.push(Cell::number(quantity(100.0 * (1.0 - exact)), 100.0 * (1.0 - exact)));
            for ((_, visibility), (error, place)) in METHODS.iter().zip(&mut errors) {
                if error.add((directional_albedo(*visibility, roughness, nv) - exact).abs()) {
                    *place = format!("roughness {roughness}, {degrees}° from the normal");
                }
            }
        }
        lost.rows.push(cells);
    }
    let mut choice =
        Choice::new("brdf", "How much of a light does a rough surface reflect towards the viewer?");
    choice.error_unit = "of the light";
    choice.reference = format!(
        "the mean of Smith's masking over {DIRECTIONS_PER_DIMENSION}² visible facets in f64, against the sum of each lobe over {DIRECTIONS_PER_DIMENSION}² directions of light"
    );
    choice.per = "light on a pixel".into();
    let mut random = Random(9);
    let places: Vec<[f32; 5]> =
        (0..1024).map(|_| std::array::from_fn(|_| (0.05 + 0.95 * random.unit()) as f32)).collect();
    let places = &places;
    let case = |(_, visibility): &(&str, Visibility)| {
        let (visibility, mut out) = (*visibility, vec![0.0f32; places.len()]);
        Case::new(places.len(), move || {
            for ([a2, nh, nl, nv, vh], out) in places.iter().zip(&mut out) {
                *out = ggx_lobe(visibility, *a2, [*nh, *nl, *nv, *vh]);
            }
            std::hint::black_box(&out);
        })
    };
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut METHODS.iter().map(case).collect::<Vec<_>>());
    for (((name, _), (error, place)), nanos) in METHODS.iter().zip(errors).zip(nanos) {
        choice.rows.push(Row::new(*name).error(error.worst, error.mean()).nanos(nanos).at(place));
    }
    choice.choose(
        CHOSEN_METHOD,
        "the formula of glTF's appendix B, exact for its facets; the fits save two square roots",
    );
    Ok(Section {
        title: "Lights on rough surfaces",
        text: "Microfacets of a rough surface hide each other. The lobe of GGX (Walter 2007) counts those \
               that both the light and the viewer see, by Smith's function (Heitz 2014), or a fit of it. A \
               pixel of the renderer is compared with the formula first. The table shows how much light is \
               lost because a second bounce is left out, in glTF's formula and so in this renderer."
            .into(),
        choices: vec![choice],
        tables: vec![lost],
        off_front: Vec::new(),
    })
}

/// Checks that a white metal in the sun has the color of the formula, within one 8-bit code.
fn check_renderer() -> Result<(), String> {
    let registry = choreo::registry();
    for (roughness, degrees) in [(0.5f64, 60.0), (0.7, 30.0), (0.9, 70.0)] {
        let (sine, cosine) = (libm::sin(f64::to_radians(degrees)), libm::cos(f64::to_radians(degrees)));
        let text = format!(
            "stage(#{{ size: [16, 16], view: \"none\" }});
             ambient(0.0);
             sun(#{{ intensity: {PI}, direction: [{}, 0.0, {}], shadow: false }});
             let metal = #{{ color: \"white\", metallic: 1.0, roughness: {roughness}, size: 4 }};
             cast(\"quad\", shape(\"quad\", metal)).at(0, -2, 0);
             camera(\"c\").at(0, 0, 9).look_at([0, 0, 0]).ortho(0.1);",
            -sine, -cosine
        );
        let stage = stage(&text, &registry)?;
        let moment = Moment::new(&stage, Time::ZERO, registry.effects()).map_err(|e| e.to_string())?;
        let mut renderer = CpuRenderer::new(registry.effects());
        renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
        let frame = draw_frame(&mut renderer, &moment.plan([16, 16], 1))?;
        let got = f64::from(frame.rgba[4 * (8 * 16 + 8)]);
        // Half vector between the light and the viewer, who looks straight at the surface.
        let half = libm::cos(f64::to_radians(0.5 * degrees));
        let light = ggx_lobe(
            correlated_smith_visibility,
            roughness.powi(4) as f32,
            [half, cosine, 1.0, half].map(|v| v as f32),
        );
        let expected = 255.0 * srgb_from_linear((f64::from(light) * cosine).clamp(0.0, 1.0));
        if (got - expected).abs() > 1.0 || !(1.0..254.0).contains(&expected) {
            return Err(format!(
                "roughness {roughness}, {degrees}°: the renderer shows {got}, the formula says {expected}"
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_integrals_agree_and_smooth_surfaces_conserve_energy() {
        for (roughness, nv) in [(0.25, 0.9), (0.6, 0.5), (1.0, 0.3)] {
            let (exact, summed) = (
                reference_albedo(roughness, nv),
                directional_albedo(correlated_smith_visibility, roughness, nv),
            );
            assert!((exact - summed).abs() < 2e-3, "{roughness} {nv}: {exact} {summed}");
            // Negative control: the uncorrelated term, which masks from each direction separately, loses too much light.
            assert!(
                roughness < 0.9
                    || exact - directional_albedo(separate_smith_visibility, roughness, nv) > 0.05
            );
        }
        assert!((reference_albedo(0.1, 0.8) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn the_renderer_equals_the_formula() {
        check_renderer().unwrap();
    }
}
