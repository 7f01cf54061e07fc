//! Thin-film interference: number of terms of Airy's series, spectral reference, and cost of films in an image.

use crate::images::{measure_times, renderers, stage};
use crate::{BUDGET_SECS, Section};
use choreo_bench::moment::Moment;
use choreo_bench::plots::{Cell, Choice, Row, Table, difference, time};
use choreo_bench::reference::ErrorStats;
use choreo_bench::timing::{Case, Clock, interleaved};
use choreo_motion::Time;
use choreo_plugin::Registry;
use choreo_render::cpu::thin_film::{AIRY_TERMS, reflectance};
use choreo_render::{Plan, PlanOptions};
use glam::Vec3;
use std::f64::consts::PI;
use std::hint::black_box;

const SIZE: [u32; 2] = [640, 360];

pub(crate) fn section() -> Result<Section, String> {
    Ok(Section {
        title: "Thin films",
        text: "The color of a film as thin as a wavelength of light is a sum over the whole spectrum. The \
               shader adds the first terms of Airy's sum, with the eye's response as Gaussians in closed \
               form (Belcour & Barla 2017); reflection at each side is Schlick's. The reference has \
               Fresnel's equations for both polarizations and 471 wavelengths. A third term makes no \
               visible difference: the worst errors are at grazing angles. Three wavelengths for three \
               colors, with Fresnel's equations, are more exact."
            .into(),
        choices: vec![compare_term_counts()],
        tables: vec![measure_costs()?],
        off_front: vec![(
            "film",
            "glTF's extension for films (KHR_materials_iridescence) specifies it, so a model looks as it \
             does in other programs; three wavelengths with Fresnel's equations are closer to the spectrum \
             and cheaper.",
        )],
    })
}

/// A film: index of refraction, thickness in nanometres, cosine of the viewing angle, and normal reflectance of its base in air.
type Film = (f64, f64, f64, f64);

/// Computes the reflectance of a film in linear sRGB.
type ReflectanceMethod = fn(Film) -> [f64; 3];

fn films() -> Vec<Film> {
    let mut films = Vec::new();
    for ior in [1.3, 1.5, 1.8] {
        for f0 in [0.04, 0.2, 0.5] {
            for cosine in [1.0, 0.8, 0.6, 0.4, 0.25] {
                films.extend((2..=18).map(|i| (ior, 50.0 * f64::from(i), cosine, f0)));
            }
        }
    }
    films
}

/// CIE XYZ of a wavelength in nanometres (Wyman, Sloan & Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching Functions",
/// 2013).
fn cie_xyz(nm: f64) -> [f64; 3] {
    let lobe = |height: f64, at: f64, below: f64, above: f64| {
        let t = (nm - at) * if nm < at { below } else { above };
        height * libm::exp(-0.5 * t * t)
    };
    [
        lobe(0.362, 442.0, 0.0624, 0.0374)
            + lobe(1.056, 599.8, 0.0264, 0.0323)
            + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
}

/// Converts XYZ to linear sRGB (IEC 61966-2-1).
fn rgb_from_xyz([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
        -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
        0.0556434 * x - 0.2040259 * y + 1.0572252 * z,
    ]
}

/// Fresnel amplitudes at both surfaces of the film, for both polarizations; and the round-trip phase times the wavelength in nanometres.
fn fresnel_and_phase((ior, nanometres, cosine, f0): Film) -> ([[f64; 2]; 2], f64) {
    let base = (1.0 + f0.sqrt()) / (1.0 - f0.sqrt());
    let sine2 = 1.0 - cosine * cosine;
    let inside = (1.0 - sine2 / (ior * ior)).sqrt();
    let below = (1.0 - sine2 / (base * base)).sqrt();
    let s = |n1: f64, c1: f64, n2: f64, c2: f64| (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2);
    let p = |n1: f64, c1: f64, n2: f64, c2: f64| (n2 * c1 - n1 * c2) / (n2 * c1 + n1 * c2);
    let amplitudes = [
        [s(1.0, cosine, ior, inside), s(ior, inside, base, below)],
        [p(1.0, cosine, ior, inside), p(ior, inside, base, below)],
    ];
    (amplitudes, 4.0 * PI * ior * nanometres * inside)
}

/// Airy's reflectance of a film, with all internal reflections.
fn airy_reflectance([a, b]: [f64; 2], cosine_of_phase: f64) -> f64 {
    let cross = 2.0 * a * b * cosine_of_phase;
    (a * a + b * b + cross) / (1.0 + a * a * b * b + cross)
}

/// Reflectance of a film, averaged over all phases.
fn mean_reflectance([a, b]: [f64; 2]) -> f64 {
    let (a2, b2) = (a * a, b * b);
    (a2 + b2 - 2.0 * a2 * b2) / (1.0 - a2 * b2)
}

/// Mean reflectance plus the spectral deviation from it, weighted by `color_matching`: every `step` nanometres from the wavelength `from` on.
fn by_spectrum(film: Film, from: u32, step: usize, color_matching: impl Fn(f64) -> [f64; 3]) -> [f64; 3] {
    let (amplitudes, path) = fresnel_and_phase(film);
    let middle = amplitudes.iter().map(|a| mean_reflectance(*a)).sum::<f64>() * 0.5;
    let (mut xyz, mut whole) = ([0.0; 3], 0.0);
    for nm in (from..=830).step_by(step).map(f64::from) {
        let phase = libm::cos(path / nm);
        let deviation = amplitudes.iter().map(|a| airy_reflectance(*a, phase)).sum::<f64>() * 0.5 - middle;
        let weights = color_matching(nm);
        xyz.iter_mut().zip(weights).for_each(|(sum, w)| *sum += deviation * w);
        whole += weights[1];
    }
    rgb_from_xyz(xyz.map(|v| v / whole)).map(|v| (middle + v).max(0.0))
}

/// Reflectance at three wavelengths only, one for each color.
fn reflectance_at_three_wavelengths(film: Film) -> [f64; 3] {
    let (amplitudes, path) = fresnel_and_phase(film);
    [611.0, 549.0, 465.0].map(|nm| {
        let phase = libm::cos(path / nm);
        amplitudes.iter().map(|a| airy_reflectance(*a, phase)).sum::<f64>() * 0.5
    })
}

fn reflectance_by_terms<const COUNT: u32>((ior, nanometres, cosine, f0): Film) -> [f64; 3] {
    reflectance::<COUNT>(ior as f32, nanometres as f32, cosine as f32, Vec3::splat(f0 as f32))
        .to_array()
        .map(f64::from)
}

fn reflectance_without_film((_, _, cosine, f0): Film) -> [f64; 3] {
    [f0 + (1.0 - f0) * libm::pow(1.0 - cosine, 5.0); 3]
}

fn compare_term_counts() -> Choice {
    let films = films();
    let truth: Vec<[f64; 3]> = films.iter().map(|f| by_spectrum(*f, 360, 1, cie_xyz)).collect();
    let methods: [(String, ReflectanceMethod); 7] = [
        ("no film".into(), reflectance_without_film),
        ("three wavelengths".into(), reflectance_at_three_wavelengths),
        ("1 term".into(), reflectance_by_terms::<1>),
        (format!("{AIRY_TERMS} terms"), reflectance_by_terms::<AIRY_TERMS>),
        ("3 terms".into(), reflectance_by_terms::<3>),
        ("6 terms".into(), reflectance_by_terms::<6>),
        ("24 wavelengths".into(), |film| by_spectrum(film, 370, 20, cie_xyz)),
    ];
    let mut choice = Choice::new("film", "What color does a thin film have?");
    choice.error_unit = "of the light";
    choice.per = "evaluation".into();
    choice.reference = format!(
        "Fresnel's equations and Airy's sum of all terms at 471 wavelengths, in f64, as linear sRGB; {} films of 100 to 900 nm on bases that \
         reflect 0.04 to 0.5, looked at up to 75° from straight on",
        films.len()
    );
    let mut cases = Vec::new();
    for (name, method) in &methods {
        let mut error = ErrorStats::default();
        let mut at = String::new();
        for (film, exact) in films.iter().zip(&truth) {
            for (got, exact) in method(*film).iter().zip(exact) {
                if error.add((got - exact).abs()) {
                    let (ior, nanometres, cosine, f0) = film;
                    at = format!("{nanometres} nm of {ior} on {f0}, cosine {cosine}");
                }
            }
        }
        choice.rows.push(Row::new(name.as_str()).error(error.worst, error.mean()).at(at));
        let films = &films;
        cases.push(Case::new(films.len(), move || {
            for film in films {
                black_box(method(black_box(*film)));
            }
        }));
    }
    let nanos = interleaved(Clock::Thread, BUDGET_SECS, &mut cases);
    drop(cases);
    choice.rows.iter_mut().zip(nanos).for_each(|(row, nanos)| row.nanos = Some(nanos));
    choice.choose(
        &format!("{AIRY_TERMS} terms"),
        "as in glTF's extension; a third term costs half as much again and changes nothing",
    );
    choice
}

/// Cost of spheres that fill much of an image, with and without a film.
fn measure_costs() -> Result<Table, String> {
    let registry: Registry = choreo::registry();
    let planned = |look: &str| {
        let text = format!(
            r##"
            stage(#{{ length: 1.0, background: "#8aa0b8" }});
            let ball = shape("sphere", #{{ size: 1.0, color: "#707070", metallic: 1.0, roughness: 0.3 {look} }});
            for x in 0..4 {{ for y in 0..2 {{ cast("ball " + x + " " + y, ball).at(-1.5 + 1.0 * x, 1.0 * y, 0.0); }} }}
            sun(#{{ direction: [-0.5, -1.0, -0.6], intensity: 2.0 }});
            camera("front").fov(34).at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
            "##
        );
        let moment = Moment::new(&stage(&text, &registry)?, Time::ZERO, registry.effects())
            .map_err(|e| e.to_string())?;
        let options = PlanOptions { effects: registry.effects(), ..PlanOptions::new(SIZE, 1) };
        let plan = Plan::new(&moment.resources, &moment.stage, &moment.snapshot, &options);
        Ok::<_, String>((moment, plan))
    };
    let scenes = [planned("")?, planned(", iridescence: 1.0, film: 400.0")?];
    let title = format!(
        "Cost of a film: eight metal spheres under a sun, {}×{}, 1 sample, {}",
        SIZE[0],
        SIZE[1],
        Clock::Process.words()
    );
    let columns =
        [("renderer", "renderer"), (">without", "without"), (">with a film", "with"), (">beyond", "beyond")];
    let mut table = Table::new(title, &columns);
    for (name, mut renderer) in renderers(&registry) {
        let mut nanos = Vec::new();
        for (moment, plan) in &scenes {
            renderer.load(moment.resources.clone()).map_err(|e| e.to_string())?;
            crate::images::draw_frame(&mut *renderer, plan)?;
            nanos.extend(measure_times(&mut *renderer, &[plan], BUDGET_SECS));
        }
        table.rows.push(vec![
            Cell::text(name),
            time(nanos[0]),
            time(nanos[1]),
            difference(&nanos[0], &nanos[1]),
        ]);
    }
    Ok(table)
}
