//! Tests of the synonyms: each leads to calls that exist, and to a page.

use super::*;
use crate::api::defs;
use crate::help::{answer, nearest_terms, search};
use std::collections::BTreeMap;

/// Words that users of animation programs search for.
const SEARCHED: &str = "IK, inverse kinematics, foot lock, foot sliding, keyframe, dope sheet, easing, Bézier, NLA, strip, track,
    crossfade, blend, transition, additive layer, mask, weight, root motion, in place, retarget, rest pose, bind pose, T-pose,
    morph target, blend shape, shape key, viseme, spring bone, jiggle, secondary motion, parent, constraint, Child Of, camera,
    focal length, dolly, pan, crane, shake, depth of field, cut, dissolve, HDRI, image-based lighting, ambient occlusion,
    tone mapping, exposure, bloom, instancing, LOD, crowd, terrain, timecode, marker, event, audio, music, beat, lip sync,
    alpha channel, EXR, render pass, AOV, batch, farm, headless, CI";

/// Further words that users are likely to try, each with the call that must be in the answer.
const TERMS_WITH_CALLS: &[(&str, &str)] = &[
    ("ik", "Actor.reach(joint, target, options?)"),
    ("mask", "Cue.on(joints, options?)"),
    ("walk_to", "Actor.path(points, options?)"),
    ("title", "text(words, options?)"),
    ("light", "sun(options?)"),
    ("duration", "stage(#{ length })"),
    ("resolution", "stage(#{ size })"),
    ("lookAt", "Actor.look_at(target, options?)"),
    ("look-at", "Camera.look_at(target, options?)"),
    ("dof", "effect(\"depth_of_field\")"),
    ("ssao", "effect(\"ambient_occlusion\")"),
    ("god rays", "effect(\"god_rays\")"),
    ("opacity", "Actor.tint(color)"),
    ("Actor.reach", "Actor.reach(joint, target, options?)"),
    ("reach()", "Actor.reach(joint, target, options?)"),
    ("lerp", "lerp(a, b, w)"),
    ("headless", "choreo render --frames"),
    ("render farm", "choreo farm"),
    ("pack data", "choreo pack"),
    ("clip plane", "Camera.near(metres)"),
    ("85mm", "Camera.focal_length(millimetres)"),
    ("cache", "choreo render --watch"),
    ("still frame", "choreo render --at"),
    ("weapon", "Actor.attach(actor_or_joint, options?)"),
    ("hide mesh", "Actor.hide_parts(names)"),
    ("dissolve", "Camera.cut(#{ dissolve })"),
    ("camera shake", "Camera.shake(options?)"),
    ("fade to black", "fade_out(seconds, options?)"),
    ("turn to face", "Actor.face(actor_or_point)"),
    ("walk cycle", "Cue.loop()"),
    ("motion capture", "Clip.retarget(asset, options?)"),
    ("mocap", "Clip.retarget(asset, options?)"),
    ("install", "choreo plugins install"),
    ("package", "choreo plugins list"),
    ("exporter", "choreo export"),
    ("csv", "choreo export"),
    ("snapshot", "choreo render --at"),
    ("pivot", "Actor.attach(actor_or_joint, options?)"),
    ("actor position", "Actor.at(x, y, z) or Actor.at(point)"),
    ("post process", "effect(name, options?)"),
    ("constraint", "Actor.reach(joint, target, options?)"),
];

#[test]
fn every_searched_word_has_an_answer() {
    let unanswered: Vec<&str> =
        SEARCHED.split(',').map(str::trim).filter(|term| answer(term).calls.is_empty()).collect();
    assert!(unanswered.is_empty(), "without an answer: {unanswered:?}");
    for (term, call) in TERMS_WITH_CALLS {
        let calls = answer(term).calls;
        assert!(calls.iter().any(|c| c.usage == *call), "{term}: {calls:?}");
    }
    assert!(answer("quaggaflux").calls.is_empty());
}

#[test]
fn every_topic_names_calls_that_exist() {
    let mut owner = BTreeMap::new();
    for topic in TOPICS.iter() {
        let first = topic.terms[0];
        assert!(
            !topic.calls.is_empty() && !topic.example.is_empty(),
            "{first}: a call or an example is missing"
        );
        for term in &topic.terms {
            assert_eq!(owner.insert(normalized_term(term), first), None, "{term} is twice in the table");
        }
        for target in &topic.calls {
            let name = target.text;
            let known =
                target.is_command() || target.entry(defs()).is_some() || mathematics(name, defs()).is_some();
            assert!(known, "{first}: there is no {name}");
            if let (Some(option), Some((_, def))) = (target.option(), target.entry(defs())) {
                assert!(def.about().join("\n").contains(option), "{first}: {name} has no option {option}");
            }
            assert!(
                Call::of(*target, defs()).about.is_some() || target.is_command(),
                "{name} is not described"
            );
        }
    }
    assert!(owner.len() >= 120, "{} terms", owner.len());
}

#[test]
fn spellings_of_a_term_give_the_same_answer() {
    for term in ["foot_sliding", "Foot Sliding", "footSliding", "foot-sliding"] {
        assert_eq!(answer(term).calls, answer("foot sliding").calls, "{term}");
    }
    assert_eq!(nearest_terms("foot slidng", 1), ["foot sliding"]);
    assert!(nearest_terms("quaggaflux", 3).is_empty());
}

#[test]
fn search_finds_whole_words_in_any_order() {
    let usages = |term: &str| search(term).calls.into_iter().map(|c| c.usage).collect::<Vec<_>>();
    let has = |term: &str, usage: &str| usages(term).iter().any(|known| known.starts_with(usage));
    assert!(has("follow camera", "Camera.follow"), "{:?}", usages("follow camera"));
    assert!(has("import fbx", "load(") && has("fbx import", "load("), "{:?}", usages("import fbx"));
    assert!(has("counter clockwise", "Actor.turn"), "{:?}", usages("counter clockwise"));
    // "graph" is in "orthographic", "lock" in "clockwise".
    assert!(!has("graph", "Camera.ortho") && !has("lock", "Actor.turn"));
    for (term, note) in [
        ("denoise", "There is no denoiser"),
        ("lut", "There are no LUTs"),
        ("chromatic aberration", "There is no such effect built in"),
        ("seamless loop", "There is no option"),
        ("alpha", "With background: \"#00000000\""),
    ] {
        assert!(answer(term).note.is_some_and(|text| text.starts_with(note)), "{term}");
    }
    assert_eq!(answer("screenshot").example, Some("choreo render my.rhai --at 2 -o x.png"));
    assert_eq!(answer("vignette").calls[0].usage, "effect(\"vignette\")");
    assert_eq!(answer("xray").calls[0].usage, "effect(\"xray\")");
}

#[test]
fn synonyms_of_options_and_values_are_suggested() {
    let option =
        |name, function, known: &[&str]| suggest_option(defs(), name, function, known).map(|s| s.name);
    assert_eq!(option("mask", "play", &["fade", "weight"]).as_deref(), Some("Cue.on"));
    assert_eq!(option("crossfade", "then", &["fade", "weight"]).as_deref(), Some("fade"));
    assert_eq!(option("quaggaflux", "then", &["fade"]), None);
    let lens = ["focus", "f_number", "samples", "limit"];
    for aperture in ["aperture", "fstop", "f_stop", "bokeh"] {
        assert_eq!(option(aperture, "effect", &lens).as_deref(), Some("f_number"));
    }
    assert_eq!(option("intensity", "effect", &["strength", "radius"]).as_deref(), Some("strength"));
    assert_eq!(option("aperture", "effect", &["strength"]), None);
    assert_eq!(suggest_value("amount", ["size", "strength"]), Some("strength"));
    assert_eq!(option("facing", "path", &["speed", "turn"]).as_deref(), Some("load(#{ facing })"));
    assert_eq!(suggest_value("spline", ["linear", "cubic", "catmull_rom"]), Some("cubic"));
    assert_eq!(suggest_value("glow", ["fog", "bloom"]), Some("bloom"));
    assert_eq!(suggest_value("glow", ["fog"]), None);
    assert_eq!(suggest_value("location", ["rotation", "position", "scale"]), Some("position"));
    assert_eq!(suggest_value("orientation", ["position", "rotation"]), Some("rotation"));
    let spot = ["inner", "outer", "name", "color"];
    assert_eq!(option("cone", "spot", &spot).as_deref(), Some("outer"));
    let hint = |name, function, known: &[&str]| suggest_option(defs(), name, function, known).unwrap().hint;
    assert!(
        hint("colour", "sun", &spot).starts_with("sun(#{ color }): "),
        "{}",
        hint("colour", "sun", &spot)
    );
    assert!(hint("colour", "shape", &["color"]).starts_with("shape(#{ color }): "));
    assert_eq!(suggest_value("cube", ["plane", "box", "sphere"]), Some("box"));
    assert_eq!(suggest_value("floor", ["box", "sphere", "cone"]), None);
}

#[test]
fn aliases_name_existing_functions_and_options() {
    for (alias, name) in ALIASES {
        let target = CallText { text: name };
        let (_, def) =
            target.entry(defs()).unwrap_or_else(|| panic!("{alias} stands for {name}, which does not exist"));
        assert!(target.option().is_none_or(|option| def.about().join("\n").contains(option)), "{name}");
    }
}
