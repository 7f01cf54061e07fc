//! A scene that changes under one's hands: what is done again, what is not, and what a mistake leaves in place.

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

struct Place {
    folder: tempfile::TempDir,
    session: Session,
}

impl Place {
    fn new(source: impl FnOnce(&mut SceneSource)) -> Place {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("box.obj"), TRIANGLE).unwrap();
        fs::write(folder.path().join("a.rhai"), SCRIPT).unwrap();
        let mut made = SceneSource::new(folder.path().join("a.rhai"));
        source(&mut made);
        let session = Session::new(made, &registry(), true).unwrap();
        Place { folder, session }
    }

    /// A place with further plugins of the program.
    fn with(plugins: impl FnOnce(&mut Registry)) -> Place {
        let place = Place::new(|_| ());
        let mut registry = registry();
        plugins(&mut registry);
        let session = Session::new(SceneSource::new(place.folder.path().join("a.rhai")), &registry, true);
        Place { session: session.unwrap(), ..place }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().canonicalize().unwrap().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.at(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    /// The version after the next change.
    fn next(&mut self) -> SceneVersion {
        match self.session.wait(Some(Duration::from_secs(300))).unwrap() {
            WatchEvent::Changed(files) => self.session.build(files),
            other => panic!("nothing has changed: {other:?}"),
        }
    }

    fn quiet(&mut self) -> bool {
        self.session.wait(Some(Duration::from_millis(300))).unwrap() == WatchEvent::TimedOut
    }
}

fn good(version: SceneVersion) -> Arc<Scene> {
    version.scene.unwrap_or_else(|| panic!("{:?}", version.problems))
}

fn first_error(version: &SceneVersion) -> String {
    assert!(version.scene.is_none());
    version.problems[0].to_string()
}

#[test]
fn a_number_in_a_cue_imports_nothing_again() {
    let mut place = Place::new(|_| ());
    let first = good(place.session.build(BTreeSet::new()));
    place.write("a.rhai", &SCRIPT.replace("from(0.5)", "from(0.75)"));
    let version = place.next();
    assert_eq!(version.changed, BTreeSet::from([place.at("a.rhai")]));
    assert_eq!((version.number, version.work.builds, version.work.imports), (2, 2, 3), "three at first");
    let second = good(version);
    assert_eq!(second.stage.actors[0].layers[0].cues[0].start, Time::from_secs(0.75));
    assert!(Arc::ptr_eq(&first.stage.actors[0].asset, &second.stage.actors[0].asset));
    let hashes = |s: &Scene| s.resources.primitives.iter().map(|p| p.hash).collect::<Vec<_>>();
    assert_eq!(hashes(&first), hashes(&second));
    // The cue's place is known.
    assert_eq!(
        (second.places.cues[0][0][0].line, second.places.cues[0][0][0].file.ends_with("a.rhai")),
        (4, true)
    );
}

#[test]
fn an_asset_that_changed_is_the_only_one_imported() {
    let mut place = Place::new(|_| ());
    let first = good(place.session.build(BTreeSet::new()));
    place.write("box.obj", "v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n");
    let version = place.next();
    assert_eq!(version.work.imports, 4);
    let second = good(version);
    assert!(Arc::ptr_eq(&first.stage.actors[0].asset, &second.stage.actors[0].asset));
    assert!(!Arc::ptr_eq(&first.stage.actors[1].asset, &second.stage.actors[1].asset));
}

#[test]
fn a_faulty_version_is_told_with_its_place_until_it_is_mended() {
    let mut place = Place::new(|_| ());
    place.session.build(BTreeSet::new());
    place.write("a.rhai", &SCRIPT.replace("\"Walk\"", "\"Wakl\""));
    let version = place.next();
    let error = &version.problems[0];
    assert!(version.scene.is_none() && error.line == 4 && error.message.contains("Wakl"), "{error}");
    place.write("a.rhai", SCRIPT);
    let version = place.next();
    assert_eq!(version.work.imports, 3, "what the last good version held is still there");
    good(version);
    // Also where the mistake is that there is no script.
    fs::remove_file(place.at("a.rhai")).unwrap();
    assert!(first_error(&place.next()).contains("cannot read script"));
    place.write("a.rhai", SCRIPT);
    good(place.next());
}

#[test]
fn files_that_are_missing_are_waited_for() {
    let mut place = Place::new(|_| ());
    place.write("a.rhai", &SCRIPT.replace("box.obj", "props/box.obj"));
    let error = first_error(&place.session.build(BTreeSet::new()));
    assert!(error.contains("props/box.obj"), "{error}");
    place.write("props/box.obj", TRIANGLE);
    good(place.next());
    // A module, too.
    place.write("a.rhai", &format!("import \"steps/walk\" as walk;\n{SCRIPT}"));
    assert!(first_error(&place.next()).contains("steps/walk"));
    place.write("steps/walk.rhai", "fn steps() { 1 }");
    good(place.next());
    place.write("steps/walk.rhai", "fn steps( { 1 }");
    assert!(first_error(&place.next()).contains("walk.rhai:1:"));
    place.write("steps/walk.rhai", "fn steps() { 2 }");
    good(place.next());
    assert!(place.quiet());
}

#[test]
fn one_that_comes_into_an_earlier_folder_wins() {
    let elsewhere = tempfile::tempdir().unwrap();
    fs::write(elsewhere.path().join("far.obj"), TRIANGLE).unwrap();
    let mut place = Place::new(|r| r.search = vec![elsewhere.path().to_path_buf()]);
    place.write("a.rhai", &SCRIPT.replace("box.obj", "far.obj"));
    good(place.session.build(BTreeSet::new()));
    place.write("far.obj", "v 0 0 0\nv 3 0 0\nv 0 3 0\nf 1 2 3\n");
    let version = place.next();
    assert_eq!(version.changed, BTreeSet::from([place.at("far.obj")]));
    good(version);
}

#[test]
fn a_model_is_reloaded_as_a_script_is() {
    let mut place = Place::new(|r| r.input = r.input.with_file_name("box.obj"));
    let first = good(place.session.build(BTreeSet::new()));
    assert_eq!(first.stage.actors.len(), 1);
    place.write("box.obj", "garbage");
    assert!(first_error(&place.next()).contains("box.obj"));
    place.write("box.obj", TRIANGLE);
    good(place.next());
}

const GLOW: &str = "// effect: glow\n// about: brighter\n// version: 1\n// param amount = 0.5 in 0..1: how much\n\
    fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> {\n    return color * (1.0 + p[amount]);\n}\n";

#[test]
fn plugin_files_come_change_and_break() {
    let mut place = Place::new(|_| ());
    place.write("a.rhai", &format!("{SCRIPT}\neffect(\"glow\");\n"));
    let before = place.session.build(BTreeSet::new());
    assert!(before.scene.is_none() || !before.problems.is_empty(), "there is no such effect yet");
    place.write("plugins/glow.wgsl", GLOW);
    let version = place.next();
    assert_eq!(version.work.plugins, 1);
    assert!(good(version).registry.effect("glow").is_some());
    // A script that changes does not compile it again.
    place.write("a.rhai", &format!("{SCRIPT}\neffect(\"glow\", #{{ amount: 0.25 }});\n"));
    let version = place.next();
    assert_eq!(version.work.plugins, 1);
    good(version);
    place.write("plugins/glow.wgsl", &GLOW.replace("return color", "return colour"));
    let error = first_error(&place.next());
    assert!(error.contains("glow.wgsl:6:"), "{error}");
    place.write("plugins/glow.wgsl", &GLOW.replace("1.0 +", "1.5 +"));
    let version = place.next();
    assert_eq!(version.work.plugins, 3);
    good(version);
}

/// An unused plugin is not compiled. It is reported once it gets the name that the script requests.
#[test]
fn a_plugin_file_that_nothing_uses_breaks_nothing() {
    let mut place = Place::new(|_| ());
    place.write("plugins/glow.wgsl", GLOW);
    place.write(
        "plugins/bad.wgsl",
        &GLOW.replace("effect: glow", "effect: bad").replace("return color", "return colour"),
    );
    let first = place.session.build(BTreeSet::new());
    assert_eq!(first.work.plugins, 0);
    assert!(good(first).registry.effect("glow").is_none());
    place.write("a.rhai", &format!("{SCRIPT}\neffect(\"late\");\n"));
    assert!(first_error(&place.next()).contains("unknown effect \"late\""));
    place.write("plugins/bad.wgsl", &GLOW.replace("effect: glow", "effect: late"));
    let version = place.next();
    assert_eq!(version.work.plugins, 1);
    let scene = good(version);
    let names: Vec<&str> = scene.registry.effects().iter().map(|e| e.manifest().name.as_str()).collect();
    assert_eq!(names, ["late"]);
}

/// One texel, red 127, green 64, blue `blue`: type 2, 1 × 1, 32 bits from the top.
fn tga(blue: u8) -> String {
    String::from_utf8(
        [&[0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 32, 0x28][..], &[blue, 64, 127, 127]].concat(),
    )
    .unwrap()
}

#[test]
fn a_texture_of_an_effect_is_watched_as_its_text_is() {
    let inked = GLOW.replace("// version", "// texture ink = ink.tga as data: t\n// version");
    let inked = inked.replace("(1.0 +", "ink(uv) * (1.0 +");
    let mut place = Place::new(|_| ());
    place.write("a.rhai", &format!("{SCRIPT}\neffect(\"glow\");\n"));
    place.write("plugins/glow.wgsl", &inked);
    let error = first_error(&place.session.build(BTreeSet::new()));
    assert!(error.contains("glow.wgsl:3:1: texture ink: \"ink.tga\": no such file or folder"), "{error}");
    place.write("plugins/ink.tga", &tga(0));
    let texel = |scene: &Scene| scene.registry.effect("glow").unwrap().textures()[0].halves[0][2];
    let first = good(place.next());
    assert_eq!(texel(&first), 0);
    place.write("plugins/ink.tga", &tga(127));
    assert!(texel(&good(place.next())) > 0);
    place.write("plugins/ink.tga", "no image");
    let error = first_error(&place.next());
    assert!(error.contains("glow.wgsl:3:1: texture ink: \"ink.tga\":"), "{error}");
    // Nothing outside the effect's own folder is read.
    place.write("plugins/glow.wgsl", &inked.replace("ink.tga", "../box.obj"));
    let error = first_error(&place.next());
    assert!(error.contains("a plugin reads files of its own folder only"), "{error}");
}

/// The effect that draws the first use of the scene.
fn drawing(scene: &Scene) -> Effect {
    let name = scene.stage.effects[0].drawn_by();
    scene.registry.effects().iter().find(|e| e.manifest().name == name).unwrap().clone()
}

#[test]
fn an_image_that_the_script_chooses_for_an_effect_is_watched() {
    let inked =
        GLOW.replace("// version", "// param ink = texture(data): what it is multiplied with\n// version");
    let inked = inked.replace("(1.0 +", "ink(uv) * (1.0 +");
    let mut place = Place::new(|_| ());
    place.write("plugins/glow.wgsl", &inked);
    let script = |value: &str| format!("{SCRIPT}let glow = effect(\"glow\", #{{ ink: {value} }});\n");
    place.write("a.rhai", &script("\"ink.tga\""));
    let error = first_error(&place.session.build(BTreeSet::new()));
    let shown =
        "let glow = effect(\"glow\", #{ ink: \"ink.tga\" });\n                                      ^";
    assert!(
        error.contains("a.rhai:8:35: ") && error.contains("\"ink.tga\"") && error.contains(shown),
        "{error}"
    );
    place.write("ink.tga", &tga(0));
    let texel = |scene: &Scene| drawing(scene).textures()[0].halves[0][2];
    let first = good(place.next());
    assert_eq!(texel(&first), 0);
    // Another edit leaves the effect as it is, so that renderers keep what they made of it.
    place.write("a.rhai", &format!("{}let x = 1;\n", script("\"ink.tga\"")));
    let second = good(place.next());
    assert!(drawing(&first).is_same(&drawing(&second)));
    place.write("ink.tga", &tga(127));
    let third = good(place.next());
    assert!(texel(&third) > 0 && !drawing(&second).is_same(&drawing(&third)));
    place.write("ink.tga", "no image");
    let error = first_error(&place.next());
    assert!(error.contains("glow: ink: \"ink.tga\": "), "{error}");
    for (value, message) in [
        ("3", "glow: ink must be the name of an image file, or image(…), got 3"),
        ("image(1, 4096, tall)", "glow: ink: an image of 1 × 4096, at most 2048 × 2048 for an effect"),
    ] {
        place.write("a.rhai", &format!("let tall = []; tall.pad(4096, 0);\n{}", script(value)));
        let error = first_error(&place.next());
        assert!(error.contains(message), "{error}");
    }
    place.write("a.rhai", &format!("{}glow.key(\"ink\", [[0.0, 1.0]]);", script("image(1, 1, [0.5])")));
    let error = first_error(&place.next());
    assert!(error.contains("key: the texture \"ink\" cannot change over time"), "{error}");
    place.write("a.rhai", &script("image(1, 1, [0.5])"));
    assert!(texel(&good(place.next())) > 0);
}

struct Studio {
    renderer: FrameRenderer,
    reply: Receiver<FrameReply>,
}

impl Studio {
    fn new(start: impl FnOnce() -> Result<Box<dyn Renderer>, RenderError> + Send + 'static) -> Studio {
        let (to, reply) = channel();
        let start = Box::new(move || start().map(|r| (r, None)));
        let renderer = FrameRenderer::start(start, move |p| drop(to.send(p))).unwrap();
        Studio { renderer, reply }
    }

    fn paint(&self, scene: &Arc<Scene>, time: f64) -> FrameReply {
        self.renderer.ask(FrameRequest::new(scene.clone(), Time::from_secs(time), 4, 7));
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
fn the_painter_draws_what_render_draws_and_the_newest_wish_wins() {
    let mut place = Place::new(|_| ());
    let scene = good(place.session.build(BTreeSet::new()));
    let studio = Studio::new(|| Ok(Box::new(CpuRenderer::new(&[]))));
    let reply = studio.paint(&scene, 1.0);
    let info = &reply.result.as_ref().unwrap().1;
    assert_eq!((reply.ticket, info.number, info.time), (7, 1, Time::from_secs(1.0)));
    let expected = rendered(&scene, 1.0, &mut CpuRenderer::new(&[]));
    assert!(frame(&reply).rgba == expected.rgba);
    assert!(frame(&studio.paint(&scene, 0.7)).rgba != expected.rgba, "another time is another image");
}

/// Thick lines of a smaller preview cover the same share of it.
#[test]
fn a_smaller_image_has_lines_as_wide_as_the_whole_one() {
    let script = r#"
stage(#{ size: [160, 120], length: 1.0, background: "black" });
cast("line", lines(#{ positions: [[-9.0, 1.0, 0.0], [9.0, 1.0, 0.0]], width: 16, color: "white" }));
camera("c").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
sun(#{ direction: [-0.6, -1.0, -0.9] });
"#;
    let mut place = Place::new(|_| ());
    place.write("a.rhai", script);
    let scene = good(place.session.build(BTreeSet::new()));
    let studio = Studio::new(|| Ok(Box::new(CpuRenderer::new(&[]))));
    let share = |divisor: u32| {
        let request = FrameRequest::new(scene.clone(), Time::ZERO, 4, 7);
        studio.renderer.ask(FrameRequest { size: [160 / divisor, 120 / divisor], ..request });
        let reply = studio.reply.recv_timeout(Duration::from_secs(600)).unwrap();
        let pixels = frame(&reply).rgba.chunks_exact(4);
        pixels.clone().filter(|p| p[0] > 20).count() as f64 / pixels.len() as f64
    };
    let (whole, quarter) = (share(1), share(4));
    assert!(whole > 0.1 && (quarter - whole).abs() < 0.02, "{whole} {quarter}");
}

#[test]
fn a_painter_whose_renderer_does_not_start_says_so_each_time() {
    let mut place = Place::new(|_| ());
    let scene = good(place.session.build(BTreeSet::new()));
    let studio = Studio::new(|| Err(RenderError::NoVulkan { why: "planted".into() }));
    for _ in 0..2 {
        assert_eq!(
            studio.paint(&scene, 0.0).result.err().map(|e| e.to_string()).as_deref(),
            Some("Vulkan is not available: planted")
        );
    }
}

/// An effect of a crate that panics from an amount on, where the image is drawn or where the frame is planned.
struct Fragile(Manifest);

impl Fragile {
    fn new(name: &str) -> Fragile {
        Fragile(Manifest::new(name, "1.2", "panics").number("amount", "how much", 0.0, 0.0..=1.0))
    }
}

impl EffectPlugin for Fragile {
    fn manifest(&self) -> &Manifest {
        &self.0
    }
}

impl EffectShader for Fragile {
    fn wgsl(&self) -> &str {
        "fn effect(color: vec4<f32>, uv: vec2<f32>, p: array<f32, 8>) -> vec4<f32> { return color; }"
    }
}

impl PixelEffect for Fragile {
    fn pixels(&self, _: &mut [glam::Vec4], _: &[glam::Vec2], parameters: &[f32]) {
        assert!(parameters[0] < 0.5, "too much: {}", parameters[0]);
    }
}

impl ShutterEffect for Fragile {
    fn shutter(&self, parameters: &[f32]) -> Option<Shutter> {
        assert!(parameters[0] < 0.5, "too much: {}", parameters[0]);
        None
    }
}

#[test]
fn an_effect_that_panics_leaves_the_renderer_at_work() {
    let mut place = Place::with(|registry| {
        registry.add_effect(Effect::pixel(Fragile::new("drawn")));
        registry.add_effect(Effect::shutter(Fragile::new("planned")));
    });
    let studio = Studio::new(|| Ok(Box::new(CpuRenderer::new(&[]))));
    for name in ["drawn", "planned"] {
        let script = |amount: f64| format!("{SCRIPT}\neffect(\"{name}\", #{{ amount: {amount} }});\n");
        place.write("a.rhai", &script(0.25));
        let before = studio.paint(&good(place.session.build(BTreeSet::new())), 1.0);
        place.write("a.rhai", &script(0.75));
        let scene = good(place.session.build(BTreeSet::new()));
        for _ in 0..3 {
            let reply = studio.paint(&scene, 1.0);
            let error = reply.result.err().map(|e| e.to_string());
            assert_eq!(error, Some(format!("the plugin {name} 1.2 has failed: too much: 0.75")));
        }
        place.write("a.rhai", &script(0.25));
        let after = studio.paint(&good(place.session.build(BTreeSet::new())), 1.0);
        assert!(frame(&after).rgba == frame(&before).rgba);
    }
    // A renderer that panics when it starts is an error of each frame.
    let studio = Studio::new(|| panic!("no driver"));
    let scene = good(place.session.build(BTreeSet::new()));
    for _ in 0..2 {
        let error = studio.paint(&scene, 0.0).result.err().map(|e| e.to_string());
        assert!(
            error.as_deref().is_some_and(|e| e.ends_with("report it with the files: no driver")),
            "{error:?}"
        );
    }
}

/// `None`, with a word, where there is no Vulkan.
fn vulkan(shaders: Option<PathBuf>) -> Option<Studio> {
    let options = GpuOptions { shader_dir: shaders, ..GpuOptions::default() };
    if let Err(RenderError::NoVulkan { why }) = RecoveringRenderer::new(options.clone()) {
        println!("SKIP 1: {why}");
        return None;
    }
    Some(Studio::new(move || Ok(Box::new(RecoveringRenderer::new(options)?))))
}

#[test]
fn a_number_in_a_cue_uploads_and_compiles_nothing_again() {
    let Some(studio) = vulkan(None) else { return };
    let mut place = Place::new(|_| ());
    let first = good(place.session.build(BTreeSet::new()));
    let before = studio.paint(&first, 1.0);
    assert!(before.work.meshes > 1 && before.work.materials > 1 && before.work.pipelines > 0);
    place.write("a.rhai", &SCRIPT.replace("from(0.5)", "from(0.75)"));
    let after = studio.paint(&good(place.next()), 1.0);
    assert_eq!(after.work, before.work);
    assert!(frame(&after).rgba != frame(&before).rgba, "it is drawn anew all the same");
    // Another triangle: one mesh and nothing else. (FrameInfo able to count.)
    place.write("box.obj", "v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n");
    let moved = studio.paint(&good(place.next()), 1.0);
    assert_eq!(moved.work, CreatedCounts { meshes: before.work.meshes + 1, ..before.work });
}

#[test]
fn an_effect_that_changed_is_one_pipeline() {
    let Some(studio) = vulkan(None) else { return };
    let mut place = Place::new(|_| ());
    place.write("plugins/glow.wgsl", GLOW);
    place.write("a.rhai", &format!("{SCRIPT}\neffect(\"glow\");\n"));
    let before = studio.paint(&good(place.session.build(BTreeSet::new())), 1.0);
    place.write("plugins/glow.wgsl", &GLOW.replace("1.0 +", "1.5 +"));
    let scene = good(place.next());
    let after = studio.paint(&scene, 1.0);
    assert_eq!(after.work, CreatedCounts { pipelines: before.work.pipelines + 1, ..before.work });
    assert!(frame(&after).rgba != frame(&before).rgba);
}

#[test]
fn a_shader_that_breaks_leaves_the_last_good_one_at_work() {
    let shaders = tempfile::tempdir().unwrap();
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders");
    for name in ["background.wgsl", "scene.wgsl"] {
        fs::copy(own.join(name), shaders.path().join(name)).unwrap();
    }
    let folder = shaders.path().to_path_buf();
    let Some(studio) = vulkan(Some(folder.clone())) else { return };
    let mut place = Place::new(|r| r.shaders = Some(folder.clone()));
    let scene = good(place.session.build(BTreeSet::new()));
    let before = studio.paint(&scene, 1.0);
    let text = fs::read_to_string(folder.join("scene.wgsl")).unwrap();
    fs::write(folder.join("scene.wgsl"), format!("fn broken( {{\n{text}")).unwrap();
    let version = place.next();
    assert!(version.shaders);
    let scene = good(version);
    studio.renderer.shaders_changed();
    let broken = studio.paint(&scene, 1.0);
    assert!(broken.notes.iter().any(|n| n.contains("scene.wgsl:1:")), "{:?}", broken.notes);
    assert!(frame(&broken).rgba == frame(&before).rgba && broken.work == before.work);
    fs::write(folder.join("scene.wgsl"), format!("{text}\n// mended\n")).unwrap();
    let scene = good(place.next());
    studio.renderer.shaders_changed();
    let mended = studio.paint(&scene, 1.0);
    assert!(mended.notes.is_empty() && mended.work.pipelines > before.work.pipelines);
    assert!(frame(&mended).rgba == frame(&before).rgba);
}

/// A loop that is written out makes the same stage, bit for bit.
#[test]
fn a_loop_that_is_written_out_makes_the_same_stage() {
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
    let mut place = Place::new(|_| ());
    let mut stage = |text: &str| {
        place.write("a.rhai", text);
        let version = place.session.build(BTreeSet::new());
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
