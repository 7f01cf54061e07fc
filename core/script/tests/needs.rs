//! Parts of a file that a script does not need are not imported. This test has a process of its own, so that it can count meshes and images.

mod common;

use choreo_plugin::ImportScope;
use choreo_script::ScriptOptions;
use choreo_script::testing::{TestOptions, list_sections, run_section};
use common::*;
use std::sync::atomic::Ordering;

/// Numbers of meshes made and images decoded since the last call.
fn take_import_counts() -> (usize, usize) {
    (MESHES_MADE.swap(0, Ordering::Relaxed), IMAGES_DECODED.swap(0, Ordering::Relaxed))
}

#[test]
fn parts_not_requested_are_not_imported() {
    only_clips_imports_no_meshes();
    clips_only_use_is_found_in_the_script();
    imports_without_pixels_decode_no_images();
    sections_without_image_tests_decode_no_images();
    unplayed_clips_are_not_decoded();
}

/// Only the played clips are decoded, for commands that draw or describe a scene once.
fn unplayed_clips_are_not_decoded() {
    let options = ScriptOptions { played_clips_only: true, ..ScriptOptions::default() };
    let decoded = |text: &str, options: &ScriptOptions| {
        CLIPS_DECODED.store(0, Ordering::Relaxed);
        let script = assets().run_text(text, options).unwrap();
        let clip = &script.stage.actors[0].layers[0].cues[0].clip;
        assert!(!clip.curves().is_empty() && clip.duration.as_secs() > 0.0);
        CLIPS_DECODED.load(Ordering::Relaxed)
    };
    let one = r#"let m = load("hero.toy", #{ facing: "+z" }); cast("a", m).play(m.clip("Run"));"#;
    let two = r#"let m = load("hero.toy", #{ facing: "+z" });
        cast("a", m).play(m.clip("Run")).then(load("moves.toy").clip("Wave"));"#;
    assert_eq!(decoded(one, &options), 1);
    assert_eq!(decoded(two, &options), 4, "each of two files has both names");
    assert_eq!(decoded(one, &ScriptOptions::default()), 3);
    // All clips are decoded to find a front that the skeleton does not show.
    let facing = r#"let m = load("hero.toy"); cast("a", m).play(m.clip("Run"));"#;
    assert_eq!(decoded(facing, &options), 1 + 3);
    // The name of a clip given by number is known only when the script runs.
    let any = r#"let m = load("hero.toy"); let n = 1; cast("a", m).play(m.clip(n));"#;
    assert_eq!(decoded(any, &options), 3);
    // All names are known, also to messages.
    let wrong = r#"let m = load("hero.toy"); cast("a", m).play(m.clip("Rum"));"#;
    let errors = assets().run_text(wrong, &options).unwrap_err();
    assert!(show(&errors).contains("did you mean \"Run\"?"), "{}", show(&errors));
}

fn only_clips_imports_no_meshes() {
    run_or_panic(
        r#"
        let moves = load("moves.toy", #{ only: "clips" });
        let again = load("moves.toy", #{ only: "clips" });
        if moves.clips() != ["Walk", "Run", "Wave"] { throw "no clips" }
        "#,
    );
    assert_eq!(take_import_counts(), (0, 0));
    run_or_panic(r#"cast("a", load("hero.toy")).play(load("moves.toy", #{ only: "clips" }).clip("Walk"));"#);
    assert_eq!(take_import_counts(), (1, 1), "the hero's");
    // An actor of such a file plays clips; its warning says why it is invisible.
    let script = run_or_panic(r#"cast("a", load("moves.toy", #{ only: "clips" }));"#);
    let asset = &script.stage.actors[0].asset;
    assert!(asset.meshes.is_empty() && asset.warnings[0].text.contains("loaded for its clips only"));
    let errors = run(r#"load("moves.toy", #{ only: "clip" });"#).unwrap_err();
    assert!(show(&errors).contains("load: only"), "{}", show(&errors));
    assert_eq!(take_import_counts(), (0, 0));
}

/// Files of which the script uses only clips are imported like those loaded with `only: "clips"`.
fn clips_only_use_is_found_in_the_script() {
    let script = run_or_panic(
        r#"
        let hero = load("hero.toy");
        let moves = load("moves.toy");
        let anna = cast("anna", hero);
        anna.play(moves.clip("Walk")).until(1.0).then(moves.clip(1));
        on_frame(|t| { let n = moves; });
        "#,
    );
    // A closure copies the asset to a variable, so its uses are unknown.
    assert_eq!((take_import_counts(), script.places.clips_only.len()), ((2, 2), 0));
    let script = run_or_panic(
        r#"
        let hero = load("hero.toy");
        let moves = load("moves.toy");
        let anna = cast("anna", hero);
        anna.play(moves.clip("Walk")).until(1.0).then(moves.clip(1));
        cast("boris", hero).at(1.0, 0.0, 0.0).play(load("models/knight.toy").clip(moves.clips()[2]));
        "#,
    );
    assert_eq!(take_import_counts(), (1, 1), "the hero's");
    let clips_only: Vec<(&str, usize)> =
        script.places.clips_only.iter().map(|(file, at)| (file.as_str(), at.line)).collect();
    assert_eq!(clips_only, [("moves.toy", 3), ("models/knight.toy", 6)]);
    assert!(script.stage.actors[0].asset.warnings.is_empty());
    // A file that is loaded twice and cast once is imported once, with its meshes.
    run_or_panic(
        r#"
        let moves = load("hero.toy");
        cast("anna", load("hero.toy")).play(moves.clip("Walk"));
        "#,
    );
    assert_eq!(take_import_counts(), (1, 1));
}

/// No image is decoded for `check`, `info` and `pose`.
fn imports_without_pixels_decode_no_images() {
    let options = ScriptOptions { requested_parts: ImportScope::NO_PIXELS, ..ScriptOptions::default() };
    assets().run_text(r#"cast("a", load("hero.toy"));"#, &options).unwrap();
    assert_eq!(take_import_counts(), (1, 0));
}

fn sections_without_image_tests_decode_no_images() {
    let folder = Folder::new(&[
        ("hero.toy", ""),
        ("a.rhai", r#"test("one", || { expect(cast("a", load("hero.toy"))).at(0).visible(); });"#),
        ("b.rhai", r#"test("one", || { cast("a", load("hero.toy")); expect_image("p"); });"#),
        ("c.rhai", "import \"m\" as m;\ntest(\"one\", || { cast(\"a\", load(\"hero.toy\")); m::look(); });"),
        ("m.rhai", r#"fn look() { expect_image("p"); }"#),
    ]);
    let run = |file: &str| {
        let (path, options) = (folder.file(file), TestOptions::default());
        assert_eq!(list_sections(&path, &registry(), &options).unwrap().len(), 1);
        let run = run_section(&path, 0, &registry(), &options).unwrap();
        assert!(run.errors.is_empty(), "{}", show(&run.errors));
        take_import_counts()
    };
    assert_eq!(run("a.rhai"), (1, 0));
    assert_eq!(run("b.rhai"), (1, 1));
    // The need for images is known only after the first run, so the section is run again.
    assert_eq!(run("c.rhai"), (2, 1));
}
