//! Files of which only the clips are wanted. Alone in its process, so that meshes can be counted.

mod common;

use common::*;
use std::sync::atomic::Ordering;

#[test]
fn a_file_for_its_clips_alone_makes_no_mesh() {
    let made = || MESHES_MADE.load(Ordering::Relaxed);
    good(
        r#"
        let moves = load("moves.toy", #{ only: "clips" });
        let again = load("moves.toy", #{ only: "clips" });
        if moves.clips() != ["Walk", "Run", "Wave"] { throw "no clips" }
        "#,
    );
    assert_eq!(made(), 0);
    good(r#"cast("a", load("hero.toy")).play(load("moves.toy", #{ only: "clips" }).clip("Walk"));"#);
    assert_eq!(made(), 1, "the hero's");
    // Cast all the same: it plays, and its warning says why nothing is seen.
    let script = good(r#"cast("a", load("moves.toy", #{ only: "clips" }));"#);
    let asset = &script.stage.actors[0].asset;
    assert!(asset.meshes.is_empty() && asset.warnings[0].text.contains("loaded for its clips only"));
    let errors = run(r#"load("moves.toy", #{ only: "clip" });"#).unwrap_err();
    assert!(show(&errors).contains("load: only"), "{}", show(&errors));
}
