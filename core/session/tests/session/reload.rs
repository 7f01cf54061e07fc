//! Hot reload: the work that each change repeats, the work that it does not, and the version that stays after an error.

use choreo_motion::Time;
use choreo_plugin::{
    Effect, EffectPlugin, EffectShader, Frame, Manifest, PixelEffect, Registry, Shutter, ShutterEffect,
};
use choreo_render::renderer::CreatedCounts;
use choreo_render::vulkan::{GpuOptions, RecoveringRenderer};
use choreo_render::{CpuRenderer, Plan, PlanOptions, RenderError, Renderer};
use choreo_session::edit::unroll;
use choreo_session::{
    FrameRenderer, FrameReply, FrameRequest, Scene, SceneSource, SceneVersion, Session, WatchEvent,
};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

const SCRIPT: &str = r#"
stage(#{ size: [96, 64], fps: 30, length: 2.0 });
let ada = cast("ada", load("choreo:mannequin", #{ color: "coral" }));
ada.play(load("choreo:mannequin").clip("Walk")).from(0.5);
let box = cast("box", load("box.obj")).at(1.0, 0.0, 0.0);
camera("c").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
"#;
const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.add_importer(import_mannequin::Mannequin);
    registry.add_importer(import_obj::ObjImporter);
    registry
}

struct TestSession {
    folder: tempfile::TempDir,
    session: Session,
}

impl TestSession {
    fn new(source: impl FnOnce(&mut SceneSource)) -> TestSession {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("box.obj"), TRIANGLE).unwrap();
        fs::write(folder.path().join("a.rhai"), SCRIPT).unwrap();
        let mut made = SceneSource::new(folder.path().join("a.rhai"));
        source(&mut made);
        let session = Session::new(made, &registry(), true).unwrap();
        TestSession { folder, session }
    }

    /// A session with additional built-in plugins.
    fn with(plugins: impl FnOnce(&mut Registry)) -> TestSession {
        let test = TestSession::new(|_| ());
        let mut registry = registry();
        plugins(&mut registry);
        let session = Session::new(SceneSource::new(test.folder.path().join("a.rhai")), &registry, true);
        TestSession { session: session.unwrap(), ..test }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().canonicalize().unwrap().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.at(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    /// Waits for the next change and builds the version.
    fn next(&mut self) -> SceneVersion {
        match self.session.wait(Some(Duration::from_secs(300))).unwrap() {
            WatchEvent::Changed(files) => self.session.build(files),
            other => panic!("the watch reports no change: {other:?}"),
        }
    }

    fn quiet(&mut self) -> bool {
        self.session.wait(Some(Duration::from_millis(300))).unwrap() == WatchEvent::TimedOut
    }
}

fn scene_of(version: SceneVersion) -> Arc<Scene> {
    version.scene.unwrap_or_else(|| panic!("{:?}", version.problems))
}

fn first_error(version: &SceneVersion) -> String {
    assert!(version.scene.is_none());
    version.problems[0].to_string()
}

#[test]
fn a_changed_cue_time_imports_no_asset_again() {
    let mut test = TestSession::new(|_| ());
    let first = scene_of(test.session.build(BTreeSet::new()));
    test.write("a.rhai", &SCRIPT.replace("from(0.5)", "from(0.75)"));
    let version = test.next();
    assert_eq!(version.changed_files, BTreeSet::from([test.at("a.rhai")]));
    assert_eq!(
        (version.number, version.work.builds, version.work.imports),
        (2, 2, 3),
        "the first build imports three files"
    );
    let second = scene_of(version);
    assert_eq!(second.stage.actors[0].layers[0].cues[0].start, Time::from_secs(0.75));
    assert!(Arc::ptr_eq(&first.stage.actors[0].asset, &second.stage.actors[0].asset));
    let hashes = |s: &Scene| s.resources.primitives.iter().map(|p| p.hash).collect::<Vec<_>>();
    assert_eq!(hashes(&first), hashes(&second));
    // The position of the cue in the script is known.
    assert_eq!(
        (second.places.cues[0][0][0].line, second.places.cues[0][0][0].file.ends_with("a.rhai")),
        (4, true)
    );
}

#[test]
fn only_the_changed_asset_is_imported_again() {
    let mut test = TestSession::new(|_| ());
    let first = scene_of(test.session.build(BTreeSet::new()));
    test.write("box.obj", "v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n");
    let version = test.next();
    assert_eq!(version.work.imports, 4);
    let second = scene_of(version);
    assert!(Arc::ptr_eq(&first.stage.actors[0].asset, &second.stage.actors[0].asset));
    assert!(!Arc::ptr_eq(&first.stage.actors[1].asset, &second.stage.actors[1].asset));
}

#[test]
fn a_faulty_script_is_reported_with_its_line_until_it_is_corrected() {
    let mut test = TestSession::new(|_| ());
    test.session.build(BTreeSet::new());
    test.write("a.rhai", &SCRIPT.replace("\"Walk\"", "\"Wakl\""));
    let version = test.next();
    let error = &version.problems[0];
    assert!(version.scene.is_none() && error.line == 4 && error.message.contains("Wakl"), "{error}");
    test.write("a.rhai", SCRIPT);
    let version = test.next();
    assert_eq!(version.work.imports, 3, "the assets of the last valid version are still cached");
    scene_of(version);
    // A missing script is reported, too.
    fs::remove_file(test.at("a.rhai")).unwrap();
    assert!(first_error(&test.next()).contains("cannot read script"));
    test.write("a.rhai", SCRIPT);
    scene_of(test.next());
}

#[test]
fn missing_files_and_modules_are_watched() {
    let mut test = TestSession::new(|_| ());
    test.write("a.rhai", &SCRIPT.replace("box.obj", "props/box.obj"));
    let error = first_error(&test.session.build(BTreeSet::new()));
    assert!(error.contains("props/box.obj"), "{error}");
    test.write("props/box.obj", TRIANGLE);
    scene_of(test.next());
    // Missing modules are watched, too.
    test.write("a.rhai", &format!("import \"steps/walk\" as walk;\n{SCRIPT}"));
    assert!(first_error(&test.next()).contains("steps/walk"));
    test.write("steps/walk.rhai", "fn steps() { 1 }");
    scene_of(test.next());
    test.write("steps/walk.rhai", "fn steps( { 1 }");
    assert!(first_error(&test.next()).contains("walk.rhai:1:"));
    test.write("steps/walk.rhai", "fn steps() { 2 }");
    scene_of(test.next());
    assert!(test.quiet());
}

#[test]
fn a_new_file_in_an_earlier_search_folder_replaces_the_loaded_one() {
    let elsewhere = tempfile::tempdir().unwrap();
    fs::write(elsewhere.path().join("far.obj"), TRIANGLE).unwrap();
    let mut test = TestSession::new(|r| r.search_folders = vec![elsewhere.path().to_path_buf()]);
    test.write("a.rhai", &SCRIPT.replace("box.obj", "far.obj"));
    scene_of(test.session.build(BTreeSet::new()));
    test.write("far.obj", "v 0 0 0\nv 3 0 0\nv 0 3 0\nf 1 2 3\n");
    let version = test.next();
    assert_eq!(version.changed_files, BTreeSet::from([test.at("far.obj")]));
    scene_of(version);
}

#[test]
fn a_changed_model_is_reloaded() {
    let mut test = TestSession::new(|r| r.input = r.input.with_file_name("box.obj"));
    let first = scene_of(test.session.build(BTreeSet::new()));
    assert_eq!(first.stage.actors.len(), 1);
    test.write("box.obj", "garbage");
    assert!(first_error(&test.next()).contains("box.obj"));
    test.write("box.obj", TRIANGLE);
    scene_of(test.next());
}

const GLOW: &str = "// effect: glow\n// about: brighter\n// version: 1\n// param amount = 0.5 in 0..1: how much\n\
    fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    return color * (1.0 + p[amount]);\n}\n";

#[test]
fn new_changed_and_faulty_plugin_files_are_reloaded() {
    let mut test = TestSession::new(|_| ());
    test.write("a.rhai", &format!("{SCRIPT}\neffect(\"glow\");\n"));
    let before = test.session.build(BTreeSet::new());
    assert!(before.scene.is_none() || !before.problems.is_empty(), "the effect does not exist yet");
    test.write("plugins/glow.wgsl", GLOW);
    let version = test.next();
    assert_eq!(version.work.plugins, 1);
    assert!(scene_of(version).registry.effect("glow").is_some());
    // A script that changes does not compile it again.
    test.write("a.rhai", &format!("{SCRIPT}\neffect(\"glow\", #{{ amount: 0.25 }});\n"));
    let version = test.next();
    assert_eq!(version.work.plugins, 1);
    scene_of(version);
    test.write("plugins/glow.wgsl", &GLOW.replace("return color", "return colour"));
    let error = first_error(&test.next());
    assert!(error.contains("glow.wgsl:6:"), "{error}");
    test.write("plugins/glow.wgsl", &GLOW.replace("1.0 +", "1.5 +"));
    let version = test.next();
    assert_eq!(version.work.plugins, 3);
    scene_of(version);
}

/// An unused plugin is not compiled. It is reported once it gets the name that the script requests.
#[test]
fn an_unused_faulty_plugin_file_causes_no_error() {
    let mut test = TestSession::new(|_| ());
    test.write("plugins/glow.wgsl", GLOW);
    test.write(
        "plugins/bad.wgsl",
        &GLOW.replace("effect: glow", "effect: bad").replace("return color", "return colour"),
    );
    let first = test.session.build(BTreeSet::new());
    assert_eq!(first.work.plugins, 0);
    assert!(scene_of(first).registry.effect("glow").is_none());
    test.write("a.rhai", &format!("{SCRIPT}\neffect(\"late\");\n"));
    assert!(first_error(&test.next()).contains("unknown effect \"late\""));
    test.write("plugins/bad.wgsl", &GLOW.replace("effect: glow", "effect: late"));
    let version = test.next();
    assert_eq!(version.work.plugins, 1);
    let scene = scene_of(version);
    let names: Vec<&str> = scene.registry.effects().iter().map(|e| e.manifest().name.as_str()).collect();
    assert_eq!(names, ["late"]);
}

/// TGA file of one texel with red 127, green 64 and blue `blue`: type 2 (true color), 1 × 1, 32 bits, rows from the top.
fn one_texel_tga(blue: u8) -> String {
    String::from_utf8(
        [&[0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 32, 0x28][..], &[blue, 64, 127, 127]].concat(),
    )
    .unwrap()
}

#[test]
fn a_texture_file_of_an_effect_is_watched() {
    let inked = GLOW.replace("// version", "// texture ink = ink.tga as data: t\n// version");
    let inked = inked.replace("(1.0 +", "ink(uv) * (1.0 +");
    let mut test = TestSession::new(|_| ());
    test.write("a.rhai", &format!("{SCRIPT}\neffect(\"glow\");\n"));
    test.write("plugins/glow.wgsl", &inked);
    let error = first_error(&test.session.build(BTreeSet::new()));
    assert!(error.contains("glow.wgsl:3:1: texture ink: \"ink.tga\": no such file or folder"), "{error}");
    test.write("plugins/ink.tga", &one_texel_tga(0));
    let texel = |scene: &Scene| scene.registry.effect("glow").unwrap().textures()[0].halves[0][2];
    let first = scene_of(test.next());
    assert_eq!(texel(&first), 0);
    test.write("plugins/ink.tga", &one_texel_tga(127));
    assert!(texel(&scene_of(test.next())) > 0);
    test.write("plugins/ink.tga", "no image");
    let error = first_error(&test.next());
    assert!(error.contains("glow.wgsl:3:1: texture ink: \"ink.tga\":"), "{error}");
    // Nothing outside the effect's own folder is read.
    test.write("plugins/glow.wgsl", &inked.replace("ink.tga", "../box.obj"));
    let error = first_error(&test.next());
    assert!(error.contains("a plugin reads files of its own folder only"), "{error}");
}

/// The effect that the scene uses first.
fn first_effect(scene: &Scene) -> Effect {
    let name = scene.stage.effects[0].effect_name();
    scene.registry.effects().iter().find(|e| e.manifest().name == name).unwrap().clone()
}

#[test]
fn an_image_file_that_the_script_sets_for_an_effect_is_watched() {
    let inked =
        GLOW.replace("// version", "// param ink = texture(data): what it is multiplied with\n// version");
    let inked = inked.replace("(1.0 +", "ink(uv) * (1.0 +");
    let mut test = TestSession::new(|_| ());
    test.write("plugins/glow.wgsl", &inked);
    let script = |value: &str| format!("{SCRIPT}let glow = effect(\"glow\", #{{ ink: {value} }});\n");
    test.write("a.rhai", &script("\"ink.tga\""));
    let error = first_error(&test.session.build(BTreeSet::new()));
    let shown =
        "let glow = effect(\"glow\", #{ ink: \"ink.tga\" });\n                                      ^";
    assert!(
        error.contains("a.rhai:8:35: ") && error.contains("\"ink.tga\"") && error.contains(shown),
        "{error}"
    );
    test.write("ink.tga", &one_texel_tga(0));
    let texel = |scene: &Scene| first_effect(scene).textures()[0].halves[0][2];
    let first = scene_of(test.next());
    assert_eq!(texel(&first), 0);
    // Another edit keeps the same effect, so that renderers keep its pipelines and textures.
    test.write("a.rhai", &format!("{}let x = 1;\n", script("\"ink.tga\"")));
    let second = scene_of(test.next());
    assert!(first_effect(&first).is_same(&first_effect(&second)));
    test.write("ink.tga", &one_texel_tga(127));
    let third = scene_of(test.next());
    assert!(texel(&third) > 0 && !first_effect(&second).is_same(&first_effect(&third)));
    test.write("ink.tga", "no image");
    let error = first_error(&test.next());
    assert!(error.contains("glow: ink: \"ink.tga\": "), "{error}");
    for (value, message) in [
        ("3", "glow: ink must be the name of an image file, or image(…), got 3"),
        ("image(1, 4096, tall)", "glow: ink: an image of 1 × 4096, at most 2048 × 2048 for an effect"),
    ] {
        test.write("a.rhai", &format!("let tall = []; tall.pad(4096, 0);\n{}", script(value)));
        let error = first_error(&test.next());
        assert!(error.contains(message), "{error}");
    }
    test.write("a.rhai", &format!("{}glow.key(\"ink\", [[0.0, 1.0]]);", script("image(1, 1, [0.5])")));
    let error = first_error(&test.next());
    assert!(error.contains("key: the texture \"ink\" cannot change over time"), "{error}");
    test.write("a.rhai", &script("image(1, 1, [0.5])"));
    assert!(texel(&scene_of(test.next())) > 0);
}

struct RendererThread {
    renderer: FrameRenderer,
    reply: Receiver<FrameReply>,
}

impl RendererThread {
    fn new(
        start: impl FnOnce() -> Result<Box<dyn Renderer>, RenderError> + Send + 'static,
    ) -> RendererThread {
        let (to, reply) = channel();
        let start = Box::new(move || start().map(|r| (r, None)));
        let renderer = FrameRenderer::start(start, move |p| drop(to.send(p))).unwrap();
        RendererThread { renderer, reply }
    }

    fn render(&self, scene: &Arc<Scene>, time: f64) -> FrameReply {
        self.renderer.request_frame(FrameRequest::new(scene.clone(), Time::from_secs(time), 4, 7));
        self.reply.recv_timeout(Duration::from_secs(600)).unwrap()
    }
}

fn frame(reply: &FrameReply) -> &Frame {
    &reply.result.as_ref().unwrap_or_else(|e| panic!("{e}")).0
}

/// The frame that `render` draws.
fn rendered(scene: &Scene, time: f64, renderer: &mut dyn Renderer) -> Frame {
    let resources = Arc::new(choreo_render::SceneResources::new(&scene.stage));
    let snapshot = scene.stage.at(Time::from_secs(time)).unwrap();
    let options =
        PlanOptions { effects: scene.registry.effects(), ..PlanOptions::new(scene.stage.settings.size, 4) };
    renderer.set_effects(scene.registry.effects()).unwrap();
    renderer.load(resources.clone()).unwrap();
    renderer.submit(Plan::new(&resources, &scene.stage, &snapshot, &options)).unwrap();
    renderer.collect(None).unwrap()
}

#[test]
fn the_renderer_thread_draws_the_same_frame_as_the_render_command() {
    let mut test = TestSession::new(|_| ());
    let scene = scene_of(test.session.build(BTreeSet::new()));
    let thread = RendererThread::new(|| Ok(Box::new(CpuRenderer::new(&[]))));
    let reply = thread.render(&scene, 1.0);
    let info = &reply.result.as_ref().unwrap().1;
    assert_eq!((reply.ticket, info.number, info.time), (7, 1, Time::from_secs(1.0)));
    let expected = rendered(&scene, 1.0, &mut CpuRenderer::new(&[]));
    assert!(frame(&reply).rgba == expected.rgba);
    assert!(frame(&thread.render(&scene, 0.7)).rgba != expected.rgba, "frames of different times differ");
}

/// Thick lines cover the same share of a smaller preview.
#[test]
fn line_width_scales_with_the_preview_size() {
    let script = r#"
stage(#{ size: [160, 120], length: 1.0, background: "black" });
cast("line", lines(#{ positions: [[-9.0, 1.0, 0.0], [9.0, 1.0, 0.0]], width: 16, color: "white" }));
camera("c").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
"#;
    let mut test = TestSession::new(|_| ());
    test.write("a.rhai", script);
    let scene = scene_of(test.session.build(BTreeSet::new()));
    let thread = RendererThread::new(|| Ok(Box::new(CpuRenderer::new(&[]))));
    let share = |divisor: u32| {
        let request = FrameRequest::new(scene.clone(), Time::ZERO, 4, 7);
        thread.renderer.request_frame(FrameRequest { size: [160 / divisor, 120 / divisor], ..request });
        let reply = thread.reply.recv_timeout(Duration::from_secs(600)).unwrap();
        let pixels = frame(&reply).rgba.chunks_exact(4);
        pixels.clone().filter(|p| p[0] > 20).count() as f64 / pixels.len() as f64
    };
    let (whole, quarter) = (share(1), share(4));
    assert!(whole > 0.1 && (quarter - whole).abs() < 0.02, "{whole} {quarter}");
}

#[test]
fn a_renderer_that_does_not_start_is_an_error_of_every_frame() {
    let mut test = TestSession::new(|_| ());
    let scene = scene_of(test.session.build(BTreeSet::new()));
    let thread = RendererThread::new(|| Err(RenderError::NoVulkan { why: "planted".into() }));
    for _ in 0..2 {
        assert_eq!(
            thread.render(&scene, 0.0).result.err().map(|e| e.to_string()).as_deref(),
            Some("Vulkan is not available: planted")
        );
    }
}

/// A Rust effect that panics if its amount is 0.5 or more: as a pixel effect while drawing, as a shutter effect while planning.
struct PanickingEffect(Manifest);

impl PanickingEffect {
    fn new(name: &str) -> PanickingEffect {
        PanickingEffect(Manifest::new(name, "1.2", "panics").number("amount", "how much", 0.0, 0.0..=1.0))
    }
}

impl EffectPlugin for PanickingEffect {
    fn manifest(&self) -> &Manifest {
        &self.0
    }
}

impl EffectShader for PanickingEffect {
    fn wgsl(&self) -> &str {
        "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color; }"
    }
}

impl PixelEffect for PanickingEffect {
    fn pixels(&self, _: &mut [glam::Vec4], _: &[glam::Vec2], parameters: &[f32]) {
        assert!(parameters[0] < 0.5, "too much: {}", parameters[0]);
    }
}

impl ShutterEffect for PanickingEffect {
    fn shutter(&self, parameters: &[f32]) -> Option<Shutter> {
        assert!(parameters[0] < 0.5, "too much: {}", parameters[0]);
        None
    }
}

#[test]
fn the_renderer_continues_after_an_effect_panics() {
    let mut test = TestSession::with(|registry| {
        registry.add_effect(Effect::pixel(PanickingEffect::new("drawn")));
        registry.add_effect(Effect::shutter(PanickingEffect::new("planned")));
    });
    let thread = RendererThread::new(|| Ok(Box::new(CpuRenderer::new(&[]))));
    for name in ["drawn", "planned"] {
        let script = |amount: f64| format!("{SCRIPT}\neffect(\"{name}\", #{{ amount: {amount} }});\n");
        test.write("a.rhai", &script(0.25));
        let before = thread.render(&scene_of(test.session.build(BTreeSet::new())), 1.0);
        test.write("a.rhai", &script(0.75));
        let scene = scene_of(test.session.build(BTreeSet::new()));
        for _ in 0..3 {
            let reply = thread.render(&scene, 1.0);
            let error = reply.result.err().map(|e| e.to_string());
            assert_eq!(error, Some(format!("the plugin {name} 1.2 has failed: too much: 0.75")));
        }
        test.write("a.rhai", &script(0.25));
        let after = thread.render(&scene_of(test.session.build(BTreeSet::new())), 1.0);
        assert!(frame(&after).rgba == frame(&before).rgba);
    }
    // A renderer that panics when it starts is an error of each frame.
    let thread = RendererThread::new(|| panic!("no driver"));
    let scene = scene_of(test.session.build(BTreeSet::new()));
    for _ in 0..2 {
        let error = thread.render(&scene, 0.0).result.err().map(|e| e.to_string());
        assert!(
            error.as_deref().is_some_and(|e| e.ends_with("report it with the files: no driver")),
            "{error:?}"
        );
    }
}

/// Returns `None`, and prints the reason, if Vulkan is not available.
fn vulkan_thread(shaders: Option<PathBuf>) -> Option<RendererThread> {
    let options = GpuOptions { shader_dir: shaders, ..GpuOptions::default() };
    if let Err(RenderError::NoVulkan { why }) = RecoveringRenderer::new(options.clone()) {
        println!("SKIP 1: {why}");
        return None;
    }
    Some(RendererThread::new(move || Ok(Box::new(RecoveringRenderer::new(options)?))))
}

#[test]
fn a_changed_cue_time_uploads_and_compiles_nothing_again() {
    let Some(thread) = vulkan_thread(None) else { return };
    let mut test = TestSession::new(|_| ());
    let first = scene_of(test.session.build(BTreeSet::new()));
    let before = thread.render(&first, 1.0);
    assert!(
        before.created_counts.meshes > 1
            && before.created_counts.materials > 1
            && before.created_counts.pipelines > 0
    );
    test.write("a.rhai", &SCRIPT.replace("from(0.5)", "from(0.75)"));
    let after = thread.render(&scene_of(test.next()), 1.0);
    assert_eq!(after.created_counts, before.created_counts);
    assert!(frame(&after).rgba != frame(&before).rgba, "the frame is drawn again with the new time");
    // A changed triangle uploads one mesh and nothing else.
    test.write("box.obj", "v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n");
    let moved = thread.render(&scene_of(test.next()), 1.0);
    assert_eq!(
        moved.created_counts,
        CreatedCounts { meshes: before.created_counts.meshes + 1, ..before.created_counts }
    );
}

#[test]
fn a_changed_effect_compiles_one_pipeline() {
    let Some(thread) = vulkan_thread(None) else { return };
    let mut test = TestSession::new(|_| ());
    test.write("plugins/glow.wgsl", GLOW);
    test.write("a.rhai", &format!("{SCRIPT}\neffect(\"glow\");\n"));
    let before = thread.render(&scene_of(test.session.build(BTreeSet::new())), 1.0);
    test.write("plugins/glow.wgsl", &GLOW.replace("1.0 +", "1.5 +"));
    let scene = scene_of(test.next());
    let after = thread.render(&scene, 1.0);
    assert_eq!(
        after.created_counts,
        CreatedCounts { pipelines: before.created_counts.pipelines + 1, ..before.created_counts }
    );
    assert!(frame(&after).rgba != frame(&before).rgba);
}

#[test]
fn a_faulty_shader_leaves_the_last_valid_one_in_use() {
    let shaders = tempfile::tempdir().unwrap();
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders");
    for name in ["background.wgsl", "scene.wgsl"] {
        fs::copy(own.join(name), shaders.path().join(name)).unwrap();
    }
    let folder = shaders.path().to_path_buf();
    let Some(thread) = vulkan_thread(Some(folder.clone())) else { return };
    let mut test = TestSession::new(|r| r.shader_folder = Some(folder.clone()));
    let scene = scene_of(test.session.build(BTreeSet::new()));
    let before = thread.render(&scene, 1.0);
    let text = fs::read_to_string(folder.join("scene.wgsl")).unwrap();
    fs::write(folder.join("scene.wgsl"), format!("fn broken( {{\n{text}")).unwrap();
    let version = test.next();
    assert!(version.shaders_changed);
    let scene = scene_of(version);
    thread.renderer.shaders_changed();
    let broken = thread.render(&scene, 1.0);
    assert!(broken.notes.iter().any(|n| n.contains("scene.wgsl:1:")), "{:?}", broken.notes);
    assert!(frame(&broken).rgba == frame(&before).rgba && broken.created_counts == before.created_counts);
    fs::write(folder.join("scene.wgsl"), format!("{text}\n// mended\n")).unwrap();
    let scene = scene_of(test.next());
    thread.renderer.shaders_changed();
    let mended = thread.render(&scene, 1.0);
    assert!(mended.notes.is_empty() && mended.created_counts.pipelines > before.created_counts.pipelines);
    assert!(frame(&mended).rgba == frame(&before).rgba);
}

/// The stages are equal bit by bit.
#[test]
fn an_unrolled_loop_makes_the_same_stage() {
    const LOOP: &str = r#"stage(#{ size: [96, 64], fps: 30, length: 4.0 });
let moves = load("choreo:mannequin");
let n = 3;
for i in [-2, 0, 1, 7] {
    let post = cast("post " + (i + 3), moves).at(-2 + i, i * 0.1, (i - n) / 3.0).turn(-i * 30 + 7 / 2);
    post.play(moves.clip("Walk"), #{ speed: 1.0 + (i + 3) * 0.1 }).from(0.1 * (i + 3));
    post.key("scale", [[0.0, 1 + (i + 2) * 0.1], [1.0 + 0.3, 2 * 2 - 1.5]]);
    camera(`view ${i + n} of ${n * 2}: ${i}`).at(0.0, 1.0 - i, 4.0 * (i + 3)).look_at([i * i, 1.0, 0.0]);
}
"#;
    let mut test = TestSession::new(|_| ());
    let mut stage = |text: &str| {
        test.write("a.rhai", text);
        let version = test.session.build(BTreeSet::new());
        version.scene.unwrap_or_else(|| panic!("{text}\n{:?}", version.problems)).stage.clone()
    };
    let line = LOOP.lines().position(|line| line.contains("let post")).unwrap() + 1;
    let written = unroll(LOOP, line, 16).unwrap().apply(LOOP);
    let (before, after) = (stage(LOOP), stage(&written));
    assert_eq!(before.actors.len(), 4);
    assert_eq!(before.content_hash(), after.content_hash(), "{written}");
    // A stage that differs in one bit has another hash.
    let other = stage(&written.replace(".turn(63)", ".turn(63.00000000000001)"));
    assert_ne!(before.content_hash(), other.content_hash(), "{written}");
    let first = "let post_1 = cast(\"post 1\", moves).at(-4, -0.2, (-2 - n) / 3.0).turn(63);";
    assert!(written.contains(first), "{written}");
    assert!(
        written
            .contains("camera(`view ${-2 + n} of ${n * 2}: -2`).at(0.0, 3.0, 4.0).look_at([4, 1.0, 0.0]);"),
        "{written}"
    );
}
