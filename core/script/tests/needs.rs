//! Parts of a file that are not needed are not made. Alone in its process, so that meshes and images can be counted.

mod common;

use choreo_plugin::ImportScope;
use choreo_script::ScriptOptions;
use choreo_script::testing::{TestOptions, list_sections, run_section};
use common::*;
use std::sync::atomic::Ordering;

/// Meshes and images made since the last look.
fn made() -> (usize, usize) {
    (MESHES_MADE.swap(0, Ordering::Relaxed), PICTURES_DECODED.swap(0, Ordering::Relaxed))
}

#[test]
fn what_is_not_needed_is_not_made() {
    a_file_for_its_clips_alone();
    the_script_shows_it_by_itself();
    nobody_draws();
    sections_that_look_at_no_picture();
    clips_that_are_not_played();
}

/// Only the played clips are decoded, for commands that draw or describe a scene once.
fn clips_that_are_not_played() {
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
    // A front that shows in clips alone shows in all of them.
    let facing = r#"let m = load("hero.toy"); cast("a", m).play(m.clip("Run"));"#;
    assert_eq!(decoded(facing, &options), 1 + 3);
    // A clip by number is known only when the script runs.
    let any = r#"let m = load("hero.toy"); let n = 1; cast("a", m).play(m.clip(n));"#;
    assert_eq!(decoded(any, &options), 3);
    // The names are all there, in messages too.
    let wrong = r#"let m = load("hero.toy"); cast("a", m).play(m.clip("Rum"));"#;
    let errors = assets().run_text(wrong, &options).unwrap_err();
    assert!(show(&errors).contains("did you mean \"Run\"?"), "{}", show(&errors));
}

fn a_file_for_its_clips_alone() {
    good(
        r#"
        let moves = load("moves.toy", #{ only: "clips" });
        let again = load("moves.toy", #{ only: "clips" });
        if moves.clips() != ["Walk", "Run", "Wave"] { throw "no clips" }
        "#,
    );
    assert_eq!(made(), (0, 0));
    good(r#"cast("a", load("hero.toy")).play(load("moves.toy", #{ only: "clips" }).clip("Walk"));"#);
    assert_eq!(made(), (1, 1), "the hero's");
    // Cast all the same: it plays, and its warning states why nothing is seen.
    let script = good(r#"cast("a", load("moves.toy", #{ only: "clips" }));"#);
    let asset = &script.stage.actors[0].asset;
    assert!(asset.meshes.is_empty() && asset.warnings[0].text.contains("loaded for its clips only"));
    let errors = run(r#"load("moves.toy", #{ only: "clip" });"#).unwrap_err();
    assert!(show(&errors).contains("load: only"), "{}", show(&errors));
    assert_eq!(made(), (0, 0));
}

/// The same without a word: the text shows that nothing but clips is used.
fn the_script_shows_it_by_itself() {
    let script = good(
        r#"
        let hero = load("hero.toy");
        let moves = load("moves.toy");
        let anna = cast("anna", hero);
        anna.play(moves.clip("Walk")).until(1.0).then(moves.clip(1));
        on_frame(|t| { let n = moves; });
        "#,
    );
    // A closure that does something else with it: it may be anything.
    assert_eq!((made(), script.places.clips_only.len()), ((2, 2), 0));
    let script = good(
        r#"
        let hero = load("hero.toy");
        let moves = load("moves.toy");
        let anna = cast("anna", hero);
        anna.play(moves.clip("Walk")).until(1.0).then(moves.clip(1));
        cast("boris", hero).at(1.0, 0.0, 0.0).play(load("models/knight.toy").clip(moves.clips()[2]));
        "#,
    );
    assert_eq!(made(), (1, 1), "the hero's");
    let left: Vec<(&str, usize)> =
        script.places.clips_only.iter().map(|(file, at)| (file.as_str(), at.line)).collect();
    assert_eq!(left, [("moves.toy", 3), ("models/knight.toy", 6)]);
    assert!(script.stage.actors[0].asset.warnings.is_empty());
    // One of two loads of a file is cast: it is imported once, with all that is in it.
    good(
        r#"
        let moves = load("hero.toy");
        cast("anna", load("hero.toy")).play(moves.clip("Walk"));
        "#,
    );
    assert_eq!(made(), (1, 1));
}

/// No image is decoded for `check`, `info` and `pose`.
fn nobody_draws() {
    let options = ScriptOptions { needs: ImportScope::NO_PIXELS, ..ScriptOptions::default() };
    assets().run_text(r#"cast("a", load("hero.toy"));"#, &options).unwrap();
    assert_eq!(made(), (1, 0));
}

fn sections_that_look_at_no_picture() {
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
        made()
    };
    assert_eq!(run("a.rhai"), (1, 0));
    assert_eq!(run("b.rhai"), (1, 1));
    // Found out after a first run, and run again.
    assert_eq!(run("c.rhai"), (2, 1));
}
