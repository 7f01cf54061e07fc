//! The start page, files and folders: new scripts, recent scripts and lessons with thumbnails, saving under another name, and the asset browser.

use crate::place::Place;
use choreo_session::{SceneSource, Session};
use choreo_viewer::app::Viewer;
use choreo_viewer::library::documents::Documents;
use choreo_viewer::library::file_dialog::Purpose;
use choreo_viewer::library::lessons;
use choreo_viewer::library::templates::TEMPLATES;
use choreo_viewer::library::thumbnails::{SIZE, Subject, Thumbnail, ThumbnailState, Thumbnails};
use choreo_viewer::panels::Panels;
use choreo_viewer::state::dropped_models::DroppedModels;
use choreo_viewer::state::selection::Selected;
use egui::accesskit::Role;
use egui::{Key, Modifiers, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

const PLAIN: &str =
    "stage(#{ size: [64, 36], background: \"#204060\" });\ncamera(\"c\").at(0.0, 1.0, 5.0);\n";

/// A BVH character with a few joints that lifts an arm; its joints have the names of Mixamo.
const WAVE: &str = "HIERARCHY
ROOT Hips
{
  OFFSET 0 90 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0 20 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT LeftArm
    {
      OFFSET 15 30 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 50 0 0
      }
    }
  }
}
MOTION
Frames: 3
Frame Time: 0.5
0 90 0 0 0 0 0 0 0 0 0 0
0 90 0 0 0 0 0 0 0 80 0 0
0 90 0 0 0 0 0 0 0 0 0 0
";

struct Desk {
    viewer: Viewer,
    panels: Panels,
}

fn documents(like: &Path, cache: Option<PathBuf>) -> Documents {
    let registry = choreo::registry();
    let thumbnails = Thumbnails::new(&registry, &SceneSource::new(like), cache);
    Documents { thumbnails, ..Documents::new(&registry) }
}

fn start_page(documents: Documents) -> Harness<'static, Desk> {
    let mut viewer = Viewer::new("start");
    viewer.documents = documents;
    viewer.documents.shows_start_page = true;
    let ui = |ui: &mut egui::Ui, desk: &mut Desk| desk.panels.show(ui, &mut desk.viewer, &[None; 4], 0.0);
    let desk = Desk { viewer, panels: Panels::default() };
    let mut harness = Harness::builder().with_size(vec2(1200.0, 900.0)).build_ui_state(ui, desk);
    harness.run();
    harness
}

fn open_assets(harness: &mut Harness<'static, Place>) {
    harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
    harness.run_steps(4);
    harness.event(egui::Event::Text("panel assets".into()));
    harness.run_steps(4);
    harness.key_press(Key::Enter);
    harness.run_steps(4);
}

/// Waits for the thumbnail of a file.
fn made(
    thumbnails: &mut Thumbnails,
    subject: &Subject,
    on: Option<&Arc<choreo_asset::Asset>>,
) -> Arc<Thumbnail> {
    for _ in 0..6000 {
        match thumbnails.get(subject, on, || Box::new(|| ())) {
            ThumbnailState::Ready(thumbnail) => return thumbnail,
            ThumbnailState::Failed(why) => panic!("{why}"),
            ThumbnailState::Waiting => std::thread::sleep(Duration::from_millis(50)),
        }
    }
    panic!("waited in vain for an image");
}

#[test]
fn the_start_page_opens_recent_files_and_lessons_shown_as_images() {
    let folder = tempfile::tempdir().unwrap();
    let (recent, lesson) = (folder.path().join("film.rhai"), folder.path().join("lessons/1_first.rhai"));
    fs::create_dir(folder.path().join("lessons")).unwrap();
    fs::write(&recent, PLAIN).unwrap();
    fs::write(&lesson, PLAIN.replace("#204060", "#806020")).unwrap();
    let mut documents = documents(folder.path(), Some(folder.path().join("cache")));
    documents.recent = vec![recent.clone(), folder.path().join("gone.rhai")];
    documents.lessons = lessons::lessons_in(&folder.path().join("lessons"));
    let mut harness = start_page(documents);
    assert!(harness.query_by_label("gone.rhai").is_none(), "a file that is not there is not shown");
    let thumbnails = &mut harness.state_mut().viewer.documents.thumbnails;
    for (file, color) in [(&recent, [0x20, 0x40, 0x60]), (&lesson, [0x80, 0x60, 0x20])] {
        let image = made(thumbnails, &Subject::file(file.clone()), None);
        let frame = &image.frames[0];
        assert_eq!([frame.width, frame.height], SIZE);
        let near = |pixel: &[u8]| pixel.iter().zip(color).all(|(a, b)| a.abs_diff(b) <= 2);
        assert!(frame.rgba.chunks_exact(4).all(|pixel| near(&pixel[..3])), "all of it is the background");
    }
    harness.run();
    // A lesson is opened as a copy, whose path is asked for.
    harness.get_by_label("1 first").click();
    harness.run();
    assert_eq!(harness.state().viewer.documents.file_to_open, None);
    harness.get_by_label("Open a copy of the lesson");
    harness.get_by_label("Create").click();
    harness.run();
    let copy = harness.state_mut().viewer.documents.file_to_open.take().unwrap();
    assert_eq!(copy.canonicalize().unwrap(), folder.path().join("1_first.rhai").canonicalize().unwrap());
    assert_eq!(fs::read_to_string(&copy).unwrap(), fs::read_to_string(&lesson).unwrap());
    harness.get_by_label("film.rhai").click();
    harness.run();
    assert_eq!(harness.state().viewer.documents.file_to_open, Some(recent));
}

/// A thumbnail is cached under a hash of the file's content, and then read from the cache.
#[test]
fn thumbnails_are_cached_by_content() {
    let folder = tempfile::tempdir().unwrap();
    let (file, cache) = (folder.path().join("a.rhai"), folder.path().join("cache"));
    fs::write(&file, PLAIN).unwrap();
    let registry = choreo::registry();
    let subject = Subject::file(file.clone());
    let fresh = || Thumbnails::new(&registry, &SceneSource::new(""), Some(cache.clone()));
    let first = made(&mut fresh(), &subject, None);
    let kept: Vec<PathBuf> =
        fs::read_dir(cache.join("thumbnails")).unwrap().map(|e| e.unwrap().path()).collect();
    assert_eq!(kept.len(), 1);
    assert_eq!(made(&mut fresh(), &subject, None), first);
    fs::write(&file, PLAIN.replace("#204060", "#000000")).unwrap();
    assert_eq!(made(&mut fresh(), &subject, None).frames[0].rgba[..3], [0, 0, 0]);
    // The cached thumbnail of the first content is replaced: a request must return the replacement.
    let all = fs::read_dir(cache.join("thumbnails")).unwrap().map(|e| e.unwrap().path());
    let black = all.into_iter().find(|path| *path != kept[0]).unwrap();
    fs::copy(black, &kept[0]).unwrap();
    fs::write(&file, PLAIN).unwrap();
    assert_eq!(made(&mut fresh(), &subject, None).frames[0].rgba[..3], [0, 0, 0], "it was not drawn again");
    fs::write(&file, "stage(#{ size: 3 });").unwrap();
    let mut thumbnails = fresh();
    let failed = loop {
        match thumbnails.get(&subject, None, || Box::new(|| ())) {
            ThumbnailState::Waiting => std::thread::sleep(Duration::from_millis(20)),
            ThumbnailState::Ready(_) => panic!("it is faulty"),
            ThumbnailState::Failed(why) => break why,
        }
    };
    assert!(failed.contains("size"), "{failed}");
}

/// A new thumbnail replaces the oldest one if the cache holds 64 MB; with 63 MB it replaces none.
#[test]
fn the_thumbnail_cache_is_limited_to_64_mb() {
    let folder = tempfile::tempdir().unwrap();
    let (file, cache) = (folder.path().join("a.rhai"), folder.path().join("cache"));
    fs::create_dir_all(cache.join("thumbnails")).unwrap();
    let old = |name: &str, megabytes: u64, age: u64| {
        let path = cache.join("thumbnails").join(name);
        let image = fs::File::create(&path).unwrap();
        // A sparse file, which takes no space on the disk.
        image.set_len(megabytes << 20).unwrap();
        image.set_modified(std::time::SystemTime::now() - Duration::from_secs(age)).unwrap();
        path
    };
    let (oldest, older) = (old("1.png", 31, 2000), old("2.png", 32, 1000));
    let registry = choreo::registry();
    let show = |text: &str| {
        fs::write(&file, text).unwrap();
        let mut thumbnails = Thumbnails::new(&registry, &SceneSource::new(""), Some(cache.clone()));
        made(&mut thumbnails, &Subject::file(file.clone()), None);
    };
    show(PLAIN);
    assert!(oldest.exists() && older.exists());
    old("3.png", 1, 500);
    show(&PLAIN.replace("#204060", "#102030"));
    assert!(!oldest.exists() && older.exists());
}

#[test]
fn every_template_loads_without_a_warning_and_can_be_saved() {
    let folder = tempfile::tempdir().unwrap();
    for template in TEMPLATES {
        let file = folder.path().join(format!("{}.rhai", template.name));
        fs::write(&file, template.text).unwrap();
        let mut session = Session::new(SceneSource::new(&file), &choreo::registry(), false).unwrap();
        let version = session.build(BTreeSet::new());
        assert!(
            version.scene.is_some() && version.problems.is_empty(),
            "{}: {:?}",
            template.name,
            version.problems
        );
    }
    let mut documents = documents(folder.path(), None);
    documents.recent = vec![folder.path().join("x.rhai")];
    let mut harness = start_page(documents);
    harness.get_by_label("Dialogue").click();
    harness.run();
    harness.get_by_label("New: Dialogue");
    harness.get_by_label("Create").click();
    harness.run();
    let made = folder.path().join("scene.rhai");
    assert_eq!(fs::read_to_string(&made).unwrap(), TEMPLATES[2].text);
    assert_eq!(
        harness.state().viewer.documents.file_to_open.as_ref().unwrap().canonicalize().unwrap(),
        made.canonicalize().unwrap()
    );
    assert!(harness.state().viewer.documents.dialog.is_none());
}

#[test]
fn opening_a_missing_script_offers_a_template() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("new/film.rhai");
    let mut harness = start_page(documents(folder.path(), None));
    harness.state_mut().viewer.documents.shows_start_page = false;
    harness.state_mut().viewer.documents.missing_script = Some(file.clone());
    harness.run();
    harness.get_by_label("There is no such file");
    harness.get_by_label("One character").click();
    harness.run();
    assert_eq!(fs::read_to_string(&file).unwrap(), TEMPLATES[1].text);
    let documents = &mut harness.state_mut().viewer.documents;
    assert_eq!((documents.file_to_open.take(), documents.missing_script.clone()), (Some(file), None));
}

#[test]
fn save_as_copies_the_files_that_the_script_reads() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir_all(folder.path().join("here/assets")).unwrap();
    fs::create_dir(folder.path().join("there")).unwrap();
    fs::write(folder.path().join("here/assets/wave.bvh"), WAVE).unwrap();
    let script = folder.path().join("here/a.rhai");
    fs::write(&script, "let wave = load(\"assets/wave.bvh\");\nlet ada = cast(\"ada\", wave);\n").unwrap();
    let mut session = Session::new(SceneSource::new(&script), &choreo::registry(), false).unwrap();
    let mut viewer = Viewer::new("a.rhai");
    viewer.path = Some(script.clone());
    viewer.take_version(session.build(BTreeSet::new()));
    let to = folder.path().join("there/b.rhai");
    viewer.take_file(Purpose::SaveAs, &to).unwrap();
    assert_eq!(fs::read_to_string(&to).unwrap(), fs::read_to_string(&script).unwrap());
    let mut session = Session::new(SceneSource::new(&to), &choreo::registry(), false).unwrap();
    let version = session.build(BTreeSet::new());
    assert!(version.scene.is_some(), "{:?}", version.problems);
    // An existing file of that name is not replaced.
    fs::write(folder.path().join("there/assets/wave.bvh"), "mine").unwrap();
    let error = viewer.take_file(Purpose::SaveAs, &to).unwrap_err().to_string();
    assert!(error.contains("another file with this name already exists"), "{error}");
    assert_eq!(fs::read_to_string(folder.path().join("there/assets/wave.bvh")).unwrap(), "mine");
}

#[test]
fn copying_a_lesson_copies_the_files_that_it_reads() {
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts").canonicalize().unwrap();
    let mut viewer = Viewer::new("start");
    viewer.documents = documents(&scripts, None);
    viewer.documents.lessons = lessons::lessons_in(&scripts);
    // A lesson with a module, one with a model, and one with a folder of plugins.
    for (name, file) in [
        ("07_keys_and_frames", "modules/formations.rhai"),
        ("19_faces", "models/face.gltf"),
        ("08_plugins", "valley.heights"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let index = viewer.documents.lessons.iter().position(|lesson| lesson.name == name).unwrap();
        viewer.documents.open_dialog(Purpose::Lesson(index), Some(&folder.path().join("x.rhai")));
        let proposed = viewer.documents.dialog.take().unwrap().name;
        assert_eq!(proposed, format!("{name}.rhai"));
        let to = folder.path().join(proposed);
        viewer.take_file(Purpose::Lesson(index), &to).unwrap();
        assert_eq!(viewer.documents.file_to_open.as_ref(), Some(&to));
        let lesson = &viewer.documents.lessons[index].file;
        assert_eq!(fs::read_to_string(&to).unwrap(), fs::read_to_string(lesson).unwrap());
        assert!(folder.path().join(file).is_file(), "{name}");
        let mut session = Session::new(SceneSource::new(&to), &choreo::registry(), false).unwrap();
        let version = session.build(BTreeSet::new());
        assert!(version.scene.is_some(), "{name}: {:?}", version.problems);
    }
}

#[test]
fn the_browser_previews_a_clip_on_the_character_and_adds_it() {
    const SCRIPT: &str = "stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Idle\"));
camera(\"wide\").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
";
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("moves")).unwrap();
    fs::write(folder.path().join("moves/wave.bvh"), WAVE).unwrap();
    fs::write(folder.path().join("notes.txt"), "").unwrap();
    let root = folder.path().canonicalize().unwrap();
    let mut place = Place::within(folder, SCRIPT);
    place.viewer.documents = documents(&root, None);
    place.viewer.selection = Some(Selected::Actor("ada".into()));
    let mut harness = place.harness(vec2(1500.0, 1000.0));
    open_assets(&mut harness);
    assert!(harness.query_by_label("notes.txt").is_none());
    harness.get_by_label("moves").click();
    harness.run_steps(4);
    harness.get_by_label("wave.bvh").click();
    harness.run_steps(4);
    let file = root.join("moves/wave.bvh");
    let wave = made(&mut harness.state_mut().viewer.documents.thumbnails, &Subject::file(file.clone()), None);
    let [clip] = wave.clips.as_slice() else { panic!("{:?}", wave.clips) };
    assert!((clip.secs - 1.0).abs() < 1e-6, "three frames, half a second apart: {}", clip.secs);
    harness.run_steps(4);
    harness.get_by_label(&format!("{}  1.00 s", clip.name)).click();
    harness.run_steps(4);
    // The preview shows the mannequin, and moves: its first image is the rest pose.
    let scene = harness.state().viewer.scene.clone().unwrap();
    let on = Some(("ada".to_string(), scene.number));
    let subject = Subject { file: file.clone(), clip: Some(clip.name.clone()), character: on };
    let asset = scene.stage.actors[0].asset.clone();
    let preview = made(&mut harness.state_mut().viewer.documents.thumbnails, &subject, Some(&asset));
    assert_eq!((preview.frames.len(), preview.secs), (16, 1.0));
    let different = |a: usize, b: usize| {
        preview.frames[a].rgba.iter().zip(&preview.frames[b].rgba).filter(|(a, b)| a != b).count()
    };
    assert!(different(0, 8) > 500, "the arm is lifted in the middle");
    // The arm is equally high a sixteenth after the start and before the end.
    assert!(different(1, 15) < different(1, 8) / 20, "{} {}", different(1, 15), different(1, 8));
    assert_ne!(preview.frames[0], wave.frames[0], "it is another character");
    harness.state_mut().viewer.playhead.seek(choreo_motion::Time::from_secs(2.0));
    harness.step();
    harness.get_by_label(&format!("play {} of the file", clip.name)).click();
    harness.step();
    // Idle has no end, so that the clip begins at the playhead.
    let line =
        format!("ada.play(load(\"moves/wave.bvh\").clip(\"{}\"), #{{ fade: 0.3 }}).from(2.0);\n", clip.name);
    let expected = SCRIPT.replace("camera(", &format!("{line}camera("));
    assert_eq!(harness.state().text(), expected);
    harness.state_mut().reload();
    let stage = &harness.state().viewer.scene.as_ref().unwrap().stage;
    assert_eq!(stage.actors[0].layers[0].cues.len(), 2);
}

/// The built-in character is listed like a model file: its clips can be previewed, added and dragged, and it can be added to the stage.
#[test]
fn the_browser_lists_the_built_in_character_and_its_clips() {
    const BUILT_IN: &str = "choreo:mannequin";
    const SCRIPT: &str = "stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
camera(\"wide\").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
";
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("moves")).unwrap();
    let root = folder.path().canonicalize().unwrap();
    let mut place = Place::within(folder, SCRIPT);
    place.viewer.documents = documents(&root, None);
    place.viewer.selection = Some(Selected::Actor("ada".into()));
    let mut harness = place.harness(vec2(1500.0, 1000.0));
    open_assets(&mut harness);
    // A subfolder lists only its own files.
    harness.get_by_role_and_label(Role::Button, "moves").click();
    harness.run_steps(4);
    assert!(harness.query_by_role_and_label(Role::Button, BUILT_IN).is_none());
    harness.get_by_label("Up").click();
    harness.run_steps(4);
    harness.get_by_role_and_label(Role::Button, BUILT_IN).click();
    harness.run_steps(4);
    let scene = harness.state().viewer.scene.clone().unwrap();
    let asset = scene.stage.actors[0].asset.clone();
    let thumbnails = &mut harness.state_mut().viewer.documents.thumbnails;
    let shown = made(thumbnails, &Subject::file(BUILT_IN.into()), None);
    let names: Vec<&str> = shown.clips.iter().map(|clip| clip.name.as_str()).collect();
    assert_eq!(names, asset.clips.iter().map(|clip| clip.name.as_str()).collect::<Vec<_>>());
    harness.run_steps(4);
    // The clips are listed one below the other.
    let places: Vec<egui::Rect> = shown.clips[..3]
        .iter()
        .map(|clip| format!("{}  {:.2} s", clip.name, clip.secs))
        .map(|entry| harness.get_by_role_and_label(Role::Button, &entry).rect())
        .collect();
    let is_below =
        |pair: &[egui::Rect]| pair[0].left() == pair[1].left() && pair[0].bottom() <= pair[1].top();
    assert!(places.windows(2).all(is_below), "{places:?}");
    let clip = &shown.clips[0];
    let entry = format!("{}  {:.2} s", clip.name, clip.secs);
    // The inspector has the same words as a text.
    let from = harness.get_by_role_and_label(Role::Button, &entry).rect().center();
    let row = harness.get_by_label("row ada").rect().center();
    let ruler = harness.get_by_label("time").rect();
    drag(&mut harness, from, egui::pos2(ruler.left() + ruler.width() * 0.5, row.y));
    assert_eq!(harness.state().viewer.message, None);
    let line = format!("ada.play(moves.clip(\"{}\")).from(2.0);\n", clip.name);
    assert_eq!(harness.state().text(), SCRIPT.replace("camera(", &format!("{line}camera(")));
    harness.state_mut().reload_with(SCRIPT);
    harness.run_steps(4);
    // The list keeps its scroll position.
    let button = format!("play {} of the file", clip.name);
    let places = |harness: &Harness<'static, Place>| {
        let name = harness.get_by_role_and_label(Role::Button, &entry).rect();
        [harness.get_by_label(&button).rect(), name]
    };
    let before = places(&harness);
    harness.get_by_role_and_label(Role::Button, &entry).click();
    harness.run_steps(4);
    let number = harness.state().viewer.scene.as_ref().unwrap().number;
    let on = Some(("ada".to_string(), number));
    let subject = Subject { file: BUILT_IN.into(), clip: Some(clip.name.clone()), character: on };
    let preview = made(&mut harness.state_mut().viewer.documents.thumbnails, &subject, Some(&asset));
    assert!((preview.secs - clip.secs).abs() < 1e-6, "{} {}", preview.secs, clip.secs);
    harness.run_steps(4);
    let note = preview.note.clone().expect("how many joints follow");
    assert!(harness.query_by_label(&note).is_some(), "{note}");
    assert_eq!(places(&harness), before);
    harness.get_by_label(&button).click();
    harness.step();
    assert!(harness.state().text().contains("ada.play(moves.clip("), "{}", harness.state().text());
    // The added actor gets a readable name.
    let dropped = DroppedModels { files: vec![BUILT_IN.into()], at: glam::DVec3::X, beside: false };
    let read =
        Session::new(SceneSource::new(BUILT_IN), &choreo::registry(), false).unwrap().build(BTreeSet::new());
    harness.state_mut().reload_with(PLAIN);
    harness.state_mut().viewer.edit(|v| v.add_models(&dropped, &read));
    assert_eq!(harness.state().viewer.message, None);
    let added = "let mannequin_model = load(\"choreo:mannequin\");\nlet mannequin = cast(\"mannequin\", mannequin_model).at(1.0, 0.0, 0.0);\n";
    assert!(harness.state().text().contains(added), "{}", harness.state().text());
}

#[test]
fn a_model_from_the_asset_browser_is_added_to_the_stage() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wave.bvh"), WAVE).unwrap();
    let root = folder.path().canonicalize().unwrap();
    let mut place = Place::within(folder, PLAIN);
    place.viewer.documents = documents(&root, None);
    let mut harness = place.harness(vec2(1500.0, 1000.0));
    open_assets(&mut harness);
    let pos = harness.get_by_label("wave.bvh").rect().center();
    harness.hover_at(pos);
    harness.run_steps(4);
    let button = |pressed| {
        let (button, modifiers) = (egui::PointerButton::Primary, Modifiers::NONE);
        egui::Event::PointerButton { pos, button, pressed, modifiers }
    };
    // Both clicks within one frame: a frame of the harness takes longer than a double click.
    harness.input_mut().events.extend([true, false, true, false].map(button));
    harness.step();
    let dropped = harness.state().viewer.dropped_models.clone().unwrap();
    assert_eq!(dropped.files, [root.join("wave.bvh")]);
    let mut session = Session::new(SceneSource::new(&dropped.files[0]), &choreo::registry(), false).unwrap();
    let read = session.build(BTreeSet::new());
    harness.state_mut().viewer.edit(|v| v.add_models(&dropped, &read));
    assert_eq!(harness.state().viewer.message, None);
    harness.state_mut().reload();
    assert_eq!(
        harness.state().viewer.scene.as_ref().unwrap().stage.actors.len(),
        1,
        "{}",
        harness.state().text()
    );
}

/// A clip is dropped on a row and a model on the image: the pointer determines its start time or its position.
#[test]
fn a_clip_and_a_model_are_dragged_from_the_asset_browser_into_the_scene() {
    const SCRIPT: &str = "stage(#{ size: [320, 180], fps: 25, length: 4.0, samples: 1 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Idle\"));
camera(\"wide\").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
";
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wave.bvh"), WAVE).unwrap();
    let root = folder.path().canonicalize().unwrap();
    let mut place = Place::within(folder, SCRIPT);
    place.viewer.documents = documents(&root, None);
    place.viewer.selection = Some(Selected::Actor("ada".into()));
    place.paint();
    let mut harness = place.harness(vec2(1500.0, 1000.0));
    open_assets(&mut harness);
    let tile = harness.get_by_label("wave.bvh").rect().center();
    let [left, top, right, bottom] = harness.state().viewer.views[0].image_rect;
    let at = egui::pos2(left + (right - left) * 0.5, top + (bottom - top) * 0.9);
    drag(&mut harness, tile, at);
    let dropped = harness.state_mut().viewer.dropped_models.take().unwrap();
    assert_eq!(dropped.files, [root.join("wave.bvh")]);
    // The camera is 1 m high and level: four tenths of the image below its center the ground is this far away.
    let scene = harness.state().viewer.scene.clone().unwrap();
    let choreo_asset::Projection::Perspective { yfov, .. } = scene.stage.cameras[0].projection else {
        panic!()
    };
    let expected = 4.0 - 1.0 / (0.8 * f64::from(yfov / 2.0).tan());
    assert!((dropped.at - glam::DVec3::new(0.0, 0.0, expected)).length() < 1e-3, "{}", dropped.at);

    harness.get_by_label("wave.bvh").click();
    harness.run_steps(4);
    let file = root.join("wave.bvh");
    let wave = made(&mut harness.state_mut().viewer.documents.thumbnails, &Subject::file(file), None);
    harness.run_steps(4);
    let name = &wave.clips[0].name;
    let clip = harness.get_by_label(&format!("{name}  1.00 s")).rect().center();
    let row = harness.get_by_label("row ada").rect().center();
    let ruler = harness.get_by_label("time").rect();
    drag(&mut harness, clip, egui::pos2(ruler.left() + ruler.width() * 0.5, row.y));
    assert_eq!(harness.state().viewer.message, None);
    let line = format!("ada.play(load(\"wave.bvh\").clip(\"{name}\"), #{{ fade: 0.3 }}).from(2.0);\n");
    assert!(harness.state().text().contains(&line), "{}", harness.state().text());
    // The row of cameras does not accept a clip.
    let camera = harness.get_by_label("row camera").rect().center();
    let before = harness.state().text();
    drag(&mut harness, clip, egui::pos2(ruler.center().x, camera.y));
    assert_eq!(harness.state().text(), before);
    assert!(harness.state().viewer.message.as_ref().unwrap().contains("only actors play clips"));
}

fn drag(desk: &mut Harness<'static, Place>, from: egui::Pos2, to: egui::Pos2) {
    desk.drag_at(from);
    desk.run();
    // Farther than the threshold between a click and a drag.
    for part in [0.1, 0.6, 1.0] {
        desk.hover_at(from + (to - from) * part);
        desk.run();
    }
    desk.drop_at(to);
    desk.run();
}
