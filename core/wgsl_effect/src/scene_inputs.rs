//! The functions with which effects on images read the scene (depth, normals, motion, actors, time, camera and sun), and those with which
//! effects on pixels, surfaces, vertices and light read the time and the size of the image. Their WGSL is appended to an author's text that
//! calls them, the same on both devices. The renderers supply the functions that they call (`scene_surface`, `scene_motion`, `scene_row_0`
//! and so on).

use crate::environment::HostFunction;
use crate::tokens::Tokens;
use choreo_plugin::{EffectFrame, Hook, SceneInputs};
use std::collections::BTreeSet;

/// A function that an author may call.
struct SceneFunction {
    name: &'static str,
    wgsl: &'static str,
    reads: SceneInputs,
}

const NONE: SceneInputs =
    SceneInputs { surface: false, motion: false, time: false, camera: false, sun: false };
const SURFACE: SceneInputs = SceneInputs { surface: true, ..NONE };
const MOTION: SceneInputs = SceneInputs { motion: true, ..NONE };
const TIME: SceneInputs = SceneInputs { time: true, ..NONE };
const CAMERA: SceneInputs = SceneInputs { camera: true, ..NONE };
const SUN: SceneInputs = SceneInputs { sun: true, ..NONE };

const fn function(name: &'static str, reads: SceneInputs, wgsl: &'static str) -> SceneFunction {
    SceneFunction { name, wgsl, reads }
}

/// All functions, in the order of the table in README.md. They call only functions that the renderers supply, not each other, because an
/// author may declare any of their names.
const FUNCTIONS: [SceneFunction; 16] = [
    function("depth_at", SURFACE, "fn depth_at(at: vec2<i32>) -> f32 { return scene_surface(at).w; }"),
    function("normal_at", SURFACE, "fn normal_at(at: vec2<i32>) -> vec3<f32> { return scene_surface(at).xyz; }"),
    function(
        "view_at",
        SceneInputs { camera: true, ..SURFACE },
        // The projection is inverted row by row, which is exact for perspective and orthographic cameras.
        "fn view_at(at: vec2<i32>) -> vec3<f32> {
    let m = mat4x4<f32>(scene_row_11(), scene_row_12(), scene_row_13(), scene_row_14());
    let z = -scene_surface(at).w;
    let w = m[2].w * z + m[3].w;
    let ndc = (vec2<f32>(at) + 0.5) / vec2<f32>(original_size()) * 2.0 - 1.0;
    return vec3<f32>((ndc * w - m[2].xy * z - m[3].xy) / vec2<f32>(m[0].x, m[1].y), z);
}",
    ),
    function("motion_at", MOTION, "fn motion_at(at: vec2<i32>) -> vec2<f32> { return scene_motion(at).xy; }"),
    function("actor_at", MOTION, "fn actor_at(at: vec2<i32>) -> u32 { return u32(scene_motion(at).z); }"),
    function("time", TIME, "fn time() -> f32 { return scene_row_0().x; }"),
    function("delta", TIME, "fn delta() -> f32 { return scene_row_0().y; }"),
    function("frame", TIME, "fn frame() -> u32 { return u32(scene_row_1().x) + 65536u * u32(scene_row_1().y); }"),
    function("resolution", NONE, "fn resolution() -> vec2<f32> { return vec2<f32>(original_size()); }"),
    function(
        "view_from_world",
        CAMERA,
        "fn view_from_world() -> mat4x4<f32> { return mat4x4<f32>(scene_row_3(), scene_row_4(), scene_row_5(), scene_row_6()); }",
    ),
    function(
        "world_from_view",
        CAMERA,
        "fn world_from_view() -> mat4x4<f32> { return mat4x4<f32>(scene_row_7(), scene_row_8(), scene_row_9(), scene_row_10()); }",
    ),
    function(
        "clip_from_view",
        CAMERA,
        "fn clip_from_view() -> mat4x4<f32> { return mat4x4<f32>(scene_row_11(), scene_row_12(), scene_row_13(), scene_row_14()); }",
    ),
    function(
        "view_from_clip",
        CAMERA,
        "fn view_from_clip() -> mat4x4<f32> { return mat4x4<f32>(scene_row_15(), scene_row_16(), scene_row_17(), scene_row_18()); }",
    ),
    function(
        "pixel_of",
        CAMERA,
        "fn pixel_of(view: vec3<f32>) -> vec2<f32> {
    let m = mat4x4<f32>(scene_row_11(), scene_row_12(), scene_row_13(), scene_row_14());
    let clip = m * vec4<f32>(view, 1.0);
    return (clip.xy / max(clip.w, 1e-6) * 0.5 + 0.5) * vec2<f32>(original_size());
}",
    ),
    function("sun_direction", SUN, "fn sun_direction() -> vec3<f32> { return scene_row_2().xyz; }"),
    function(
        "sun_at",
        SceneInputs { camera: true, ..SUN },
        // The direction is a point infinitely far away.
        "fn sun_at() -> vec3<f32> {
    let view = mat4x4<f32>(scene_row_3(), scene_row_4(), scene_row_5(), scene_row_6()) * vec4<f32>(scene_row_2().xyz, 0.0);
    let clip = mat4x4<f32>(scene_row_11(), scene_row_12(), scene_row_13(), scene_row_14()) * view;
    if (scene_row_2().w < 0.5 || clip.w < 1e-4) { return vec3<f32>(0.0); }
    return vec3<f32>((clip.xy / clip.w * 0.5 + 0.5) * vec2<f32>(original_size()), 1.0);
}",
    ),
];

/// Functions of effects on pixels, surfaces, vertices and light: name and WGSL.
const FRAME_FUNCTIONS: [(&str, &str); 4] = [
    ("time", "fn time() -> f32 { return effect_frame_row_0().x; }"),
    ("delta", "fn delta() -> f32 { return effect_frame_row_0().y; }"),
    (
        "frame",
        "fn frame() -> u32 { return u32(effect_frame_row_0().z) + 65536u * u32(effect_frame_row_0().w); }",
    ),
    ("resolution", "fn resolution() -> vec2<f32> { return effect_frame_row_1().xy; }"),
];

/// The functions of the scene that a text calls, and their inputs.
#[derive(Clone, Debug, Default)]
pub(crate) struct SceneCalls {
    /// Inputs of an effect on images.
    pub inputs: SceneInputs,
    /// An effect of another hook reads the numbers of the frame.
    pub reads_frame: bool,
    /// WGSL of these functions.
    pub wgsl: String,
}

impl SceneCalls {
    /// The calls of an author's text for a hook. A function that the text declares itself is the author's own.
    pub(crate) fn of(author: &str, hook: Hook) -> SceneCalls {
        let (called, declared) = functions_of(author);
        let mut calls = SceneCalls::default();
        if hook != Hook::Image {
            let of_frame = FRAME_FUNCTIONS.iter().filter(|_| hook.has_function());
            for (_, wgsl) in of_frame.filter(|(name, _)| called.contains(name) && !declared.contains(name)) {
                calls.reads_frame = true;
                calls.wgsl += wgsl;
                calls.wgsl.push('\n');
            }
            return calls;
        }
        for function in FUNCTIONS.iter().filter(|f| called.contains(f.name) && !declared.contains(f.name)) {
            calls.inputs = calls.inputs.union(function.reads);
            calls.wgsl += function.wgsl;
            calls.wgsl.push('\n');
        }
        calls
    }

    /// The functions that the renderers supply to this WGSL: name, a declaration that stands for it, and the code that runs on the CPU.
    pub(crate) fn supplied_functions(&self) -> Vec<(String, String, HostFunction)> {
        let image = |name: &str, host: HostFunction| {
            let text = format!("fn {name}(at: vec2<i32>) -> vec4<f32> {{ return vec4(f32(at.x)); }}\n");
            (name.to_string(), text, host)
        };
        let row = |i: usize| {
            let text = format!("fn scene_row_{i}() -> vec4<f32> {{ return vec4(1.0); }}\n");
            (format!("scene_row_{i}"), text, HostFunction::SceneRow(i))
        };
        let of_frame = |i: usize| {
            let text = format!("fn effect_frame_row_{i}() -> vec4<f32> {{ return vec4(1.0); }}\n");
            (format!("effect_frame_row_{i}"), text, HostFunction::FrameRow(i))
        };
        let mut all = Vec::new();
        all.extend((0..EffectFrame::NUMBERS / 4).filter(|_| self.reads_frame).map(of_frame));
        all.extend(self.inputs.surface.then(|| image("scene_surface", HostFunction::SceneSurface)));
        all.extend(self.inputs.motion.then(|| image("scene_motion", HostFunction::SceneMotion)));
        if self.wgsl.contains("scene_row_") {
            all.extend((0..EffectFrame::ROWS).map(row));
        }
        all
    }
}

/// Names of all functions of the scene that effects of a hook may call.
pub(crate) fn names(hook: Hook) -> impl Iterator<Item = &'static str> {
    let of_images = FUNCTIONS.iter().map(|f| f.name).filter(move |_| hook == Hook::Image);
    let of_frame = FRAME_FUNCTIONS.iter().map(|(name, _)| *name);
    of_images.chain(of_frame.filter(move |_| hook != Hook::Image && hook.has_function()))
}

/// Names of the functions that a text calls, and of those that it declares.
fn functions_of(text: &str) -> (BTreeSet<&str>, BTreeSet<&str>) {
    let (mut called, mut declared) = (BTreeSet::new(), BTreeSet::new());
    let mut before = ["", ""];
    for (_, token) in Tokens::of(text) {
        if token == "(" {
            if before[0] == "fn" { &mut declared } else { &mut called }.insert(before[1]);
        }
        before = [before[1], token];
    }
    (called, declared)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calling_a_scene_function_adds_its_wgsl_and_inputs() {
        let calls = SceneCalls::of("fn effect() { let v = view_at(at); } // time()", Hook::Image);
        assert_eq!(calls.inputs, SURFACE.union(CAMERA));
        assert!(calls.wgsl.contains("fn view_at(") && !calls.wgsl.contains("fn time("));
        assert_eq!(calls.supplied_functions().len(), 1 + EffectFrame::ROWS);
        assert_eq!(SceneCalls::of("fn effect() { let time = p[time]; }", Hook::Image).inputs, NONE);
        // A function that the author declares is no input.
        assert_eq!(
            SceneCalls::of("fn time() -> f32 { return 1.0; } fn effect() { time(); }", Hook::Image).inputs,
            NONE
        );
    }

    #[test]
    fn other_hooks_call_functions_of_the_frame_numbers() {
        let text = "fn effect() { let t = time() + depth_at(at); }";
        let calls = SceneCalls::of(text, Hook::Pixel);
        assert!(calls.reads_frame && calls.wgsl.contains("fn time(") && !calls.wgsl.contains("depth_at"));
        assert_eq!((calls.inputs, calls.supplied_functions().len()), (NONE, 2));
        assert!(
            !SceneCalls::of(text, Hook::Shutter).reads_frame
                && !SceneCalls::of(text, Hook::Image).reads_frame
        );
        assert_eq!(names(Hook::Surface).collect::<Vec<_>>(), FRAME_FUNCTIONS.map(|(name, _)| name));
    }

    #[test]
    fn scene_functions_do_not_call_each_other() {
        for function in &FUNCTIONS {
            let (called, _) = functions_of(function.wgsl);
            assert!(names(Hook::Image).all(|name| !called.contains(name)), "{}", function.name);
        }
    }

    #[test]
    fn the_readme_lists_every_scene_function() {
        let own = |f: &SceneFunction| f.wgsl.starts_with(&format!("fn {}(", f.name));
        assert!(FUNCTIONS.iter().all(own));
        let readme = include_str!("../README.md");
        let missing: Vec<_> =
            names(Hook::Image).filter(|name| !readme.contains(&format!("| `{name}("))).collect();
        assert!(missing.is_empty(), "README.md does not list {missing:?}");
    }
}
