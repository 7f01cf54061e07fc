//! Environment BRDF, the second factor of the split-sum approximation: reflection of uniform light by a rough surface.

use crate::images::{draw_frame, srgb_from_linear, stage};
use crate::{BUDGET_SECS, Section};
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Choice, Row};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Time;
use choreo_render::{CpuRenderer, Renderer};

const CHOSEN_METHOD: &str = "Karis's fit (2014)";
const METHODS: [&str; 4] =
    [CHOSEN_METHOD, "table of 16 × 16, linear", "table of 64 × 64, linear", "Schlick's term alone"];
const REFLECTANCES: [f64; 3] = [0.04, 0.5, 1.0];
/// Number of steps in which roughness and angle are sampled.
const STEPS_PER_DIMENSION: u32 = 24;
/// Number of directions of the reference in each of two dimensions.
const DIRECTIONS_PER_DIMENSION: u32 = 96;
/// Lower bound of the roughness in the renderer.
const MIN_ROUGHNESS: f64 = 0.045;

/// Scale and bias applied to F0. B. Karis, "Physically Based Shading on Mobile", 2014: the formula of brdf.wgsl.
fn karis_fit(roughness: f32, nv: f32) -> [f32; 2] {
    let x = 1.0 - roughness;
    let (y, z, w) = (roughness * -0.0275 + 0.0425, roughness * -0.572 + 1.04, roughness * 0.022 - 0.04);
    let a = (x * x).min(libm::exp2f(nv * -9.28)) * x + y;
    [a * -1.04 + z, a * 1.04 + w]
}

fn schlick_fresnel(nv: f32) -> [f32; 2] {
    let x = 1.0 - nv;
    let fresnel = x * x * x * x * x;
    [1.0 - fresnel, fresnel]
}

/// Reference: GGX (α = roughness²) with Smith's height-correlated visibility and Schlick's Fresnel term, integrated over all light
/// directions by importance-sampled half vectors (Karis, "Real Shading in Unreal Engine 4", 2013).
fn reference_integral(roughness: f64, nv: f64) -> [f64; 2] {
    let a2 = roughness.powi(4);
    let view = [(1.0 - nv * nv).max(0.0).sqrt(), nv];
    let mut sums = [0.0; 2];
    for i in 0..DIRECTIONS_PER_DIMENSION {
        let u = (f64::from(i) + 0.5) / f64::from(DIRECTIONS_PER_DIMENSION);
        let nh = ((1.0 - u) / (1.0 + (a2 - 1.0) * u)).sqrt();
        let across = (1.0 - nh * nh).max(0.0).sqrt();
        for j in 0..DIRECTIONS_PER_DIMENSION {
            let angle = std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(DIRECTIONS_PER_DIMENSION);
            let vh = view[0] * across * libm::cos(angle) + view[1] * nh;
            let nl = 2.0 * vh * nh - nv;
            if nl <= 0.0 || vh <= 0.0 {
                continue;
            }
            let smith = nl * (nv * nv * (1.0 - a2) + a2).sqrt() + nv * (nl * nl * (1.0 - a2) + a2).sqrt();
            let weight = 4.0 * nl * vh / nh * 0.5 / smith;
            let fresnel = (1.0 - vh).powi(5);
            sums[0] += (1.0 - fresnel) * weight;
            sums[1] += fresnel * weight;
        }
    }
    sums.map(|sum| sum / f64::from(DIRECTIONS_PER_DIMENSION * DIRECTIONS_PER_DIMENSION))
}

/// Table of the integral at equal steps of roughness and angle, ends included.
struct IntegralTable {
    side: usize,
    values: Vec<[f32; 2]>,
}

impl IntegralTable {
    fn new(side: usize) -> IntegralTable {
        let at = |i: usize| (i as f64 / (side - 1) as f64).max(1e-3);
        let value =
            |i: usize| reference_integral(at(i / side).max(MIN_ROUGHNESS), at(i % side)).map(|v| v as f32);
        IntegralTable { side, values: (0..side * side).map(value).collect() }
    }

    fn at(&self, roughness: f32, nv: f32) -> [f32; 2] {
        let last = (self.side - 1) as f32;
        let (y, x) = (roughness * last, nv * last);
        let (row, column) = ((y as usize).min(self.side - 2), (x as usize).min(self.side - 2));
        let (fy, fx) = (y - row as f32, x - column as f32);
        let value = |row: usize, column: usize| self.values[row * self.side + column];
        let mix = |a: [f32; 2], b: [f32; 2], t: f32| [0, 1].map(|i| a[i] + (b[i] - a[i]) * t);
        let along = |row: usize| mix(value(row, column), value(row, column + 1), fx);
        mix(along(row), along(row + 1), fy)
    }
}

pub(crate) fn section() -> Result<Section, String> {
    check_renderer()?;
    let tables = [IntegralTable::new(16), IntegralTable::new(64)];
    let reflected = |method: usize, roughness: f32, nv: f32| match method {
        0 => karis_fit(roughness, nv),
        1 | 2 => tables[method - 1].at(roughness, nv),
        _ => schlick_fresnel(nv),
    };
    let mut errors = [(); METHODS.len()].map(|()| (ErrorStats::default(), String::new()));
    let step = |i: u32| (f64::from(i) + 0.5) / f64::from(STEPS_PER_DIMENSION);
    for (roughness, nv) in
        (0..STEPS_PER_DIMENSION).flat_map(|r| (0..STEPS_PER_DIMENSION).map(move |n| (step(r), step(n))))
    {
        let roughness = roughness.max(MIN_ROUGHNESS);
        let [scale, bias] = reference_integral(roughness, nv);
        for (method, (error, place)) in errors.iter_mut().enumerate() {
            let [own_scale, own_bias] = reflected(method, roughness as f32, nv as f32).map(f64::from);
            for f0 in REFLECTANCES {
                if error.add((f0 * own_scale + own_bias - f0 * scale - bias).abs()) {
                    let degrees = libm::acos(nv).to_degrees();
                    *place = format!("F0 {f0}, roughness {roughness:.2}, {degrees:.0}° from the normal");
                }
            }
        }
    }
    let mut choice =
        Choice::new("environment_brdf", "How much of an even environment does a rough surface reflect?");
    choice.error_unit = "of the light";
    choice.reference = format!(
        "the integral over {DIRECTIONS_PER_DIMENSION}² directions in f64, of GGX, Smith's visibility and Schlick's term; F0 of 0.04, 0.5 and 1"
    );
    choice.per = "evaluation".into();
    let places: Vec<[f32; 2]> = (0..STEPS_PER_DIMENSION * STEPS_PER_DIMENSION)
        .map(|i| [step(i / STEPS_PER_DIMENSION), step(i % STEPS_PER_DIMENSION)].map(|v| v as f32))
        .collect();
    let (places, reflected) = (&places, &reflected);
    let case = |method: usize| {
        Case::new(places.len(), move || {
            for [roughness, nv] in places {
                std::hint::black_box(reflected(method, std::hint::black_box(*roughness), *nv));
            }
        })
    };
    let nanos =
        interleaved(Clock::Thread, BUDGET_SECS, &mut (0..METHODS.len()).map(case).collect::<Vec<_>>());
    for (method, (error, place)) in errors.into_iter().enumerate() {
        let row = Row::new(METHODS[method]).error(error.worst, error.mean()).nanos(nanos[method]).at(place);
        choice.rows.push(row);
    }
    choice.choose(CHOSEN_METHOD, "no texture needed, and the same formula in the shaders and on the CPU");
    Ok(Section {
        title: "Reflections of rough surfaces",
        text: "Image-based light is the mean of the environment around the mirrored direction times the \
               share of uniform light that the surface reflects. That share depends on roughness, angle and \
               F0. A pixel of the renderer is compared with the fit first, which proves that the renderer \
               uses this fit."
            .into(),
        choices: vec![choice],
        tables: Vec::new(),
        off_front: vec![(
            "environment_brdf",
            "a table is more exact, but on a GPU it is a texture that every lit pipeline must bind; in this \
             measurement it stays in the cache.",
        )],
    })
}

/// Checks that a metal of F0 = 1 under uniform light has the color of the fit, within one 8-bit code.
fn check_renderer() -> Result<(), String> {
    let registry = choreo::registry();
    for (roughness, degrees) in [(0.2, 0.0), (0.5, 60.0), (0.9, 80.0)] {
        let text = format!(
            "stage(#{{ size: [16, 16], view: \"none\" }});
             ambient(1.0);
             sun(#{{ intensity: 0 }});
             let metal = #{{ color: \"white\", metallic: 1.0, roughness: {roughness}, double_sided: true, size: 4 }};
             cast(\"quad\", shape(\"quad\", metal)).at(0, -2, 0).turn({degrees});
             camera(\"c\").at(0, 0, 9).look_at([0, 0, 0]).ortho(0.1);"
        );
        let stage = stage(&text, &registry)?;
        let moment = Moment::new(&stage, Time::ZERO, registry.effects()).map_err(|e| e.to_string())?;
        let mut renderer = CpuRenderer::new(registry.effects());
        renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
        let frame = draw_frame(&mut renderer, &moment.plan([16, 16], 1))?;
        let got = f64::from(frame.rgba[4 * (8 * 16 + 8)]);
        let nv = libm::cos(f64::to_radians(degrees)) as f32;
        let fit: f32 = karis_fit(roughness as f32, nv).iter().sum();
        let expected = 255.0 * srgb_from_linear(f64::from(fit).clamp(0.0, 1.0));
        if (got - expected).abs() > 1.0 {
            return Err(format!(
                "roughness {roughness}, {degrees}°: the renderer shows {got}, the fit says {expected}"
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_follows_schlick_and_reflectance_is_at_most_one() {
        for nv in [0.2, 0.5, 0.9] {
            let [scale, bias] = reference_integral(MIN_ROUGHNESS, nv);
            let [mirror_scale, mirror_bias] = schlick_fresnel(nv as f32).map(f64::from);
            assert!((scale - mirror_scale).abs() < 0.01 && (bias - mirror_bias).abs() < 0.01, "{nv}");
            let [scale, bias] = reference_integral(1.0, nv);
            assert!(scale + bias < 1.0 && scale + bias > 0.3, "{nv}: {scale} {bias}");
        }
    }

    #[test]
    fn the_renderer_equals_the_fit() {
        check_renderer().unwrap();
    }
}
