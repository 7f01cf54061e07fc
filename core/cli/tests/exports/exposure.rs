//! Default brightness: gray and white under the default lights in both renderers, raw values on request, and the same units for the
//! lights of files and of scripts.

use crate::exported::long_time_limits;

use choreo_motion::Time;
use choreo_plugin::Frame;
use choreo_render::{
    CpuRenderer, GpuOptions, Plan, PlanOptions, RenderError, Renderer, SceneResources, VulkanRenderer,
};
use choreo_script::run_file;
use std::sync::Arc;

const SIDE: u32 = 32;

/// Draws scripts with the CPU renderer and, if it is available, with Vulkan.
struct Renderers {
    registry: choreo_plugin::Registry,
    renderers: Vec<(Box<dyn Renderer>, &'static str)>,
}

impl Renderers {
    fn new() -> Renderers {
        let registry = choreo::registry();
        let effects = registry.effects().to_vec();
        let mut renderers: Vec<(Box<dyn Renderer>, &str)> =
            vec![(Box::new(CpuRenderer::new(&effects)), "CPU")];
        match VulkanRenderer::new(GpuOptions { validation: true, effects, ..GpuOptions::default() }) {
            Ok(renderer) => renderers.push((Box::new(renderer), "Vulkan")),
            Err(RenderError::NoVulkan { why }) => {
                println!("SKIP 1: {}", why.lines().next().unwrap_or_default())
            }
            Err(e) => panic!("{e}"),
        }
        Renderers { registry, renderers }
    }

    /// The frame that each renderer draws for a script with a file `lamp.gltf` beside it.
    fn frames(&mut self, script: &str, lamp: &str) -> Vec<(Frame, &'static str)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.rhai");
        std::fs::write(&path, script).unwrap();
        std::fs::write(folder.path().join("lamp.gltf"), lamp).unwrap();
        let stage = run_file(&path, &self.registry, &long_time_limits::script_options()).unwrap().stage;
        let snapshot = stage.at(Time::ZERO).unwrap();
        let options = PlanOptions { effects: self.registry.effects(), ..PlanOptions::new([SIDE; 2], 1) };
        let resources = Arc::new(SceneResources::new(&stage));
        let draw = |(renderer, name): &mut (Box<dyn Renderer>, &'static str)| {
            renderer.load(resources.clone()).unwrap();
            renderer.submit(Plan::new(&resources, &stage, &snapshot, &options)).unwrap();
            (renderer.collect(None).unwrap(), *name)
        };
        self.renderers.iter_mut().map(draw).collect()
    }
}

/// A script with a floor of one color under these lights, seen from above.
fn floor_script(stage: &str, color: &str, lights: &str) -> String {
    format!(
        "stage(#{{ length: 1.0{stage} }});\n{lights}\n\
         cast(\"floor\", shape(\"plane\", #{{ size: 40.0, color: \"{color}\" }}));\n\
         camera(\"above\").at(0.0, 5.0, 5.0).look_at([0.0, 0.0, 0.0]);\n"
    )
}

fn center_pixel(frame: &Frame) -> [u8; 3] {
    let at = ((SIDE / 2 * SIDE + SIDE / 2) * 4) as usize;
    [frame.rgba[at], frame.rgba[at + 1], frame.rgba[at + 2]]
}

fn srgb_to_linear(code: u8) -> f64 {
    let v = f64::from(code) / 255.0;
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// The hue in degrees.
fn hue_degrees(c: [u8; 3]) -> f64 {
    let [r, g, b] = c.map(srgb_to_linear);
    (3.0_f64.sqrt() * (g - b)).atan2(2.0 * r - g - b).to_degrees()
}

#[test]
fn gray_and_white_are_not_overexposed_under_default_lights() {
    let mut drawn = Renderers::new();
    for lights in ["sun();", "", "point();", "spot();", "sun(#{ shadow: true });"] {
        for (frame, name) in drawn.frames(&floor_script("", "#808080", lights), "") {
            let gray = center_pixel(&frame);
            println!("{name} {lights:?} #808080: {gray:?}");
            assert!(gray.iter().all(|c| (110..=150).contains(c)), "{name} {lights:?}: {gray:?}");
        }
        for (frame, name) in drawn.frames(&floor_script("", "white", lights), "") {
            let white = center_pixel(&frame);
            println!("{name} {lights:?} white: {white:?}");
            assert!(white.iter().all(|c| *c < 245) && white[0] > 200, "{name} {lights:?}: {white:?}");
            // The default sun of a stage without lights is warm; the other lights are white.
            let spread = white.iter().max().unwrap() - white.iter().min().unwrap();
            assert!(spread <= if lights.is_empty() { 12 } else { 1 }, "{name} {lights:?}: {white:?}");
        }
    }
    // No pixel of a white ball is brighter than white, and colors keep their hue.
    let ball =
        "sun();\ncast(\"ball\", shape(\"sphere\", #{ size: 3.0, color: \"white\" })).at(0.0, 0.5, 0.0);";
    for (frame, name) in drawn.frames(&floor_script(", background: \"black\"", "white", ball), "") {
        let most = frame.rgba.chunks_exact(4).flat_map(|p| p[..3].iter()).max().unwrap();
        println!("{name} white ball: at most {most}");
        assert!(*most < 245, "{name}: {most}");
    }
    for (code, color) in [("#e0a080", [0xe0, 0xa0, 0x80]), ("#f0c8b4", [0xf0, 0xc8, 0xb4])] {
        for (frame, name) in drawn.frames(&floor_script("", code, "sun();"), "") {
            let shown = center_pixel(&frame);
            println!(
                "{name} {code}: {shown:?}, hue {:.2} instead of {:.2}",
                hue_degrees(shown),
                hue_degrees(color)
            );
            assert!((hue_degrees(shown) - hue_degrees(color)).abs() < 2.0, "{name} {code}: {shown:?}");
        }
    }
}

#[test]
fn raw_output_is_linear_and_one_stop_doubles_it() {
    let mut drawn = Renderers::new();
    let mut shown = |stage: &str, color: &str| -> Vec<[u8; 3]> {
        drawn
            .frames(&floor_script(stage, color, "sun();"), "")
            .iter()
            .map(|(frame, _)| center_pixel(frame))
            .collect()
    };
    // A sun of 2.2 lux lights the floor at an angle whose cosine is 2 / √7.25; the ambient light from above is 0.45.
    let light = 2.2 / std::f64::consts::PI * 2.0 / 7.25_f64.sqrt() + 0.45;
    for raw in shown(", view: \"none\"", "#808080") {
        // The specular reflection: 4 % and a small highlight.
        let diffuse = srgb_to_linear(128) * light * 0.96;
        assert!((srgb_to_linear(raw[0]) - diffuse - 0.02).abs() < 0.02, "{raw:?} instead of {diffuse}");
    }
    for raw in shown(", view: \"none\", exposure: 2.0", "white") {
        assert_eq!(raw, [255; 3]);
    }
    let none = shown(", view: \"none\"", "#404040");
    let brighter = shown(", view: \"none\", exposure: 1.0", "#404040");
    for (none, brighter) in none.iter().zip(&brighter) {
        let factor = srgb_to_linear(brighter[0]) / srgb_to_linear(none[0]);
        assert!((factor - 2.0).abs() < 0.04, "{none:?} {brighter:?}");
    }
    let (neutral, agx) = (shown("", "#808080"), shown(", view: \"agx\"", "#808080"));
    assert_ne!(neutral, agx);
    assert_eq!(neutral, shown(", view: \"neutral\"", "#808080"));
}

/// A glTF file with one light of KHR_lights_punctual, whose node points it to −Y.
fn lamp_gltf(light: &str, at: [f64; 3]) -> String {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    format!(
        r#"{{ "asset": {{ "version": "2.0" }}, "extensionsUsed": ["KHR_lights_punctual"],
  "extensions": {{ "KHR_lights_punctual": {{ "lights": [{{ {light} }}] }} }},
  "scene": 0, "scenes": [{{ "nodes": [0] }}],
  "nodes": [{{ "name": "Lamp", "translation": {at:?}, "rotation": [{}, 0, 0, {half}],
    "extensions": {{ "KHR_lights_punctual": {{ "light": 0 }} }} }}] }}"#,
        -half
    )
}

#[test]
fn lights_of_files_and_scripts_have_the_same_units() {
    let mut drawn = Renderers::new();
    let (inner, outer) = (20.0_f64, 40.0_f64);
    let spot = format!(
        "\"type\": \"spot\", \"intensity\": 37.0, \"spot\": {{ \"innerConeAngle\": {}, \"outerConeAngle\": {} }}",
        inner.to_radians(),
        outer.to_radians()
    );
    let cases = [
        ("\"type\": \"directional\", \"intensity\": 1.7", "sun(#{ direction: [0, -1, 0], intensity: 1.7 });"),
        ("\"type\": \"point\", \"intensity\": 12.0", "point(#{ position: [1, 3, 0], intensity: 12.0 });"),
        (
            &spot,
            "spot(#{ position: [1, 3, 0], direction: [0, -1, 0], inner: 20, outer: 40, intensity: 37.0 });",
        ),
    ];
    for (of_file, of_script) in cases {
        let file = lamp_gltf(of_file, [1.0, 3.0, 0.0]);
        let by_file =
            drawn.frames(&floor_script("", "#808080", "cast(\"lamp\", load(\"lamp.gltf\"));"), &file);
        let by_script = drawn.frames(&floor_script("", "#808080", of_script), &file);
        let other = drawn.frames(&floor_script("", "#808080", &of_script.replace("7", "8")), &file);
        for (i, (a, name)) in by_file.iter().enumerate() {
            let apart = |b: &Frame| a.rgba.iter().zip(&b.rgba).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
            // The direction in the file is a rounded rotation.
            assert!(apart(&by_script[i].0) <= 1, "{name} {of_script}: {}", apart(&by_script[i].0));
            let changed = of_script.contains('7');
            assert!(!changed || apart(&other[i].0) > 1, "{name} {of_script}: another intensity was not seen");
        }
    }
}
