//! Edits in the panels change the script: transform, lights, effects, clips, cuts, markers; confirmations show a
//! difference; undo and redo.

use crate::place::{Desk, Place, drag, secondary_click};
use choreo_script::Severity;
use choreo_session::{Problem, SceneSource, Session};
use choreo_viewer::editing::expression;
use choreo_viewer::geometry::gizmo::Change;
use choreo_viewer::state::selection::Selected;
use egui::accesskit::Role;
use egui::{Key, Modifiers, pos2, vec2};
use egui_kittest::kittest::{NodeT, Queryable};
use glam::{DQuat, DVec3};
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves).at(-0.5, 0.0, 0.0);   // on the left
ada.play(moves.clip("Walk"));
let x = 0.25;
let bob = cast("bob", moves).at(x * 2.0, 0.0, 0.0);
camera("wide").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
camera("near").at(0.0, 1.0, 3.0).look_at([0.0, 1.0, 0.0]).cut(2.0);
sun(#{ intensity: 3.0, direction: [-0.5, -1.0, -0.5] });
effect("vignette", #{ strength: 0.5 });
marker("turn", 1.0);
"##;

#[test]
fn a_viewport_drag_changes_the_script_and_the_frame() {
    let mut place = Place::new(SCRIPT);
    place.viewer.change_actor("ada", Change::Move(DVec3::new(0.25, 0.0, 1.0))).unwrap();
    assert_eq!(place.text(), SCRIPT.replace(".at(-0.5, 0.0, 0.0)", ".at(-0.25, 0.0, 1.0)"));
    place.reload();
    assert_eq!(place.viewer.message, None, "the actor stands at its new position");
    let (sin, cos) = libm::sincos(core::f64::consts::FRAC_PI_4 / 2.0);
    place.viewer.change_actor("ada", Change::Turn(DQuat::from_xyzw(0.0, sin, 0.0, cos))).unwrap();
    place.reload();
    place.viewer.change_actor("ada", Change::Scale(DVec3::splat(1.5))).unwrap();
    place.reload();
    assert_eq!(place.viewer.message, None);
    assert!(place.text().contains(".turn(45.0)") && place.text().contains(".scale(1.5)"), "{}", place.text());
    for _ in 0..3 {
        place.viewer.undo().unwrap();
    }
    assert_eq!(place.text(), SCRIPT);
    place.viewer.redo().unwrap();
    assert_eq!(place.text(), SCRIPT.replace(".at(-0.5, 0.0, 0.0)", ".at(-0.25, 0.0, 1.0)"));
}

#[test]
fn a_change_that_a_later_line_overrides_is_reported() {
    let mut place = Place::new(SCRIPT);
    place.write(&format!("{SCRIPT}for a in [ada] {{ a.at(7.0, 0.0, 0.0); }}\n"));
    place.reload();
    place.viewer.change_actor("ada", Change::Move(DVec3::X)).unwrap();
    place.reload();
    assert!(
        place.viewer.message.as_ref().unwrap().contains("another line places \"ada\" again"),
        "{:?}",
        place.viewer.message
    );
}

#[test]
fn changing_a_computed_value_offers_a_line_that_overrides_it() {
    let mut harness = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    let refused =
        harness.state_mut().viewer.change_actor("bob", Change::Move(DVec3::X)).unwrap_err().to_string();
    assert!(refused.contains("line 6: .at(x * 2.0, 0.0, 0.0) is computed"), "{refused}");
    harness.run();
    harness.get_by_label("+ bob.move_by(1.0, 0.0, 0.0);");
    assert_eq!(harness.state().text(), SCRIPT);
    harness.get_by_label("Add the line").click();
    harness.run();
    let text = harness.state().text();
    assert!(text.contains(".at(x * 2.0, 0.0, 0.0);\nbob.move_by(1.0, 0.0, 0.0);\ncamera"), "{text}");
    harness.state_mut().reload();
    assert_eq!(harness.state().viewer.scene.as_ref().unwrap().stage.actors[1].transform.translation.x, 1.5);
}

/// A frame on a busy machine can take longer than a second: press and release then arrive in different frames.
#[test]
fn a_click_counts_as_one_click_at_any_frame_time() {
    let mut harness = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    harness.state_mut().viewer.change_actor("bob", Change::Move(DVec3::X)).unwrap_err();
    harness.run();
    let pos = harness.get_by_label("Add the line").rect().center();
    let button = |pressed| {
        let (button, modifiers) = (egui::PointerButton::Primary, egui::Modifiers::NONE);
        egui::Event::PointerButton { pos, button, pressed, modifiers }
    };
    harness.event(egui::Event::PointerMoved(pos));
    harness.step();
    harness.event(button(true));
    // Each frame takes a quarter of a second.
    (0..8).for_each(|_| harness.step());
    harness.event(button(false));
    harness.run();
    assert!(harness.state().text().contains("bob.move_by(1.0, 0.0, 0.0);"), "{}", harness.state().text());
}

#[test]
fn an_external_change_of_the_script_is_merged_after_confirmation() {
    let mut harness = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    let other = SCRIPT.replace("let x = 0.25;", "let x = 0.75; // by the editor");
    harness.state().write(&other);
    let change = Change::Move(DVec3::new(0.1, 0.0, 0.0));
    assert!(
        harness
            .state_mut()
            .viewer
            .change_actor("ada", change)
            .unwrap_err()
            .to_string()
            .contains("changed on disk")
    );
    assert_eq!(harness.state().text(), other, "nothing is written unasked");
    harness.run();
    harness.get_by_label("- let x = 0.25;");
    harness.get_by_label("+ let x = 0.75; // by the editor");
    harness.get_by_label("Write both").click();
    harness.run();
    assert_eq!(harness.state().text(), other.replace(".at(-0.5,", ".at(-0.4,"));
    // The confirmation can also be declined.
    harness.state().write(&other);
    harness.state_mut().viewer.change_actor("ada", change).unwrap_err();
    harness.run();
    harness.get_by_label("Leave it").click();
    harness.run();
    assert_eq!(harness.state().text(), other);
    assert!(harness.state().viewer.offer.is_none());
}

#[test]
fn lights_effects_cuts_and_markers_are_edited() {
    let mut place = Place::new(SCRIPT);
    place.viewer.set_value(&Selected::Light(0), "intensity", "4.5").unwrap();
    place.reload();
    place.viewer.set_value(&Selected::Light(0), "direction", "[0.0, -1.0, 0.0]").unwrap();
    place.reload();
    place.viewer.set_value(&Selected::Effect(0), "strength", "0.75").unwrap();
    place.reload();
    place.viewer.set_cut(0, 2.48).unwrap();
    place.reload();
    place.viewer.set_marker("turn", 1.52).unwrap();
    place.reload();
    let expected = SCRIPT
        .replace("intensity: 3.0", "intensity: 4.5")
        .replace("[-0.5, -1.0, -0.5]", "[0.0, -1.0, 0.0]")
        .replace("strength: 0.5", "strength: 0.75")
        .replace(".cut(2.0)", ".cut(2.48)")
        .replace("\"turn\", 1.0", "\"turn\", 1.52");
    assert_eq!(place.text(), expected);
}

#[test]
fn a_clip_is_added_at_the_playhead_and_by_a_drag_onto_its_row() {
    let mut harness = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    harness.get_by_label("row ada").click();
    harness.run();
    harness.state_mut().viewer.playhead.step(50);
    harness.run();
    harness.get_by_label("play Wave").click();
    harness.run();
    assert_eq!(harness.state().viewer.message, None);
    let line = "ada.play(moves.clip(\"Wave\"), #{ fade: 0.3 }).from(2.0);\n";
    let expected = SCRIPT.replace("clip(\"Walk\"));\n", &format!("clip(\"Walk\"));\n{line}"));
    assert_eq!(harness.state().text(), expected);
    harness.state_mut().reload();
    harness.run();
    let row = harness.get_by_label("row ada").rect();
    let ruler = harness.get_by_label("time").rect();
    let clip = harness.get_by_label_contains("Bow  ").rect().center();
    let to = pos2(ruler.left() + ruler.width() * 0.75, row.center().y);
    harness.drag_at(clip);
    harness.run();
    harness.hover_at(clip + vec2(-30.0, 10.0));
    harness.run();
    harness.hover_at(to);
    harness.run();
    harness.drop_at(to);
    harness.run();
    assert_eq!(harness.state().viewer.message, None);
    assert!(harness.state().text().contains("ada.play(moves.clip(\"Bow\"), #{ fade: 0.3 }).from(3.0);\n"));
    harness.state_mut().reload();
    assert_eq!(harness.state().viewer.scene.as_ref().unwrap().stage.actors[0].layers[0].cues.len(), 3);
}

#[test]
fn a_marker_and_a_cut_are_dragged() {
    let mut harness = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    for (label, expected) in
        [("marker turn", "marker(\"turn\", 2.0)"), ("start of near in row 0", ".cut(3.0)")]
    {
        let second = harness.get_by_label("time").rect().width() / 4.0;
        let handle = harness.get_by_label(label).rect().center();
        drag(&mut harness, handle, handle + vec2(second, 0.0));
        assert_eq!(harness.state().viewer.message, None);
        assert!(harness.state().text().contains(expected), "{}", harness.state().text());
        harness.state_mut().reload();
        harness.run();
    }
}

#[test]
fn dragging_an_inspector_number_is_one_undo_step() {
    let mut harness = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    harness.get_by_label("row ada").click();
    harness.run();
    let field = harness.get_by_label("x").rect().center();
    harness.drag_at(field);
    harness.run();
    harness.hover_at(field + vec2(100.0, 0.0));
    harness.run();
    assert_eq!(harness.state().text(), SCRIPT, "not before it is let go");
    harness.drop_at(field + vec2(100.0, 0.0));
    harness.run();
    let text = harness.state().text();
    assert_ne!(text, SCRIPT);
    assert!(text.contains(", 0.0, 0.0);   // on the left"), "{text}");
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.run();
    assert_eq!(harness.state().text(), SCRIPT);
}

const TRIANGLE: &str = "v -1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// Drops files as the window does: they are previewed in place of the script.
fn dropped(place: &mut Place, files: &[PathBuf]) {
    let (source, left_out) = SceneSource::of_models(files.to_vec(), place.session.source()).unwrap();
    place.viewer.message = left_out;
    place.viewer.previewed_files =
        std::iter::once(&source.input).chain(&source.more_models).cloned().collect();
    let mut session = Session::new(source, &choreo::registry(), false).unwrap();
    place.viewer.take_version(session.build(BTreeSet::new()));
}

#[test]
fn a_dropped_file_is_added_as_a_line() {
    let mut place = Place::new(SCRIPT);
    let file = place.folder.path().join("My Box.obj");
    fs::write(&file, TRIANGLE).unwrap();
    dropped(&mut place, std::slice::from_ref(&file));
    place.viewer.add_previewed_files().unwrap();
    assert_eq!(place.text(), format!("{SCRIPT}let my_box = cast(\"my_box\", load(\"My Box.obj\"));\n"));
    place.reload();
    // The second copy gets another name.
    dropped(&mut place, &[file]);
    place.viewer.add_previewed_files().unwrap();
    assert!(place.text().ends_with("let my_box_2 = cast(\"my_box_2\", load(\"My Box.obj\"));\n"));
    place.reload();
    let elsewhere = tempfile::tempdir().unwrap();
    fs::write(elsewhere.path().join("b.obj"), TRIANGLE).unwrap();
    dropped(&mut place, &[elsewhere.path().join("b.obj")]);
    assert!(
        place.viewer.add_previewed_files().unwrap_err().to_string().contains("outside the script's folder")
    );
}

#[test]
fn files_that_are_dropped_together_stand_side_by_side_and_are_one_change() {
    let mut place = Place::new(SCRIPT);
    let elsewhere = tempfile::tempdir().unwrap();
    let at = |name: &str| place.folder.path().join(name);
    let files =
        [at("one.obj"), at("broken.obj"), elsewhere.path().join("one.obj"), at("two.obj"), at("a.rhai")];
    for (file, text) in files.iter().zip([TRIANGLE, "f 1 2 9\n", TRIANGLE, TRIANGLE, SCRIPT]) {
        fs::write(file, text).unwrap();
    }
    dropped(&mut place, &files);
    assert_eq!(place.viewer.message.as_deref(), Some("a.rhai left out: a script is shown alone"));
    assert!(!place.viewer.is_faulty, "{:?}", place.viewer.problems);
    let reported =
        |p: &Problem| p.file.ends_with("broken.obj") && p.severity == choreo_script::Severity::Warning;
    assert!(place.viewer.problems.iter().any(reported), "{:?}", place.viewer.problems);
    let scene = place.viewer.scene.clone().unwrap();
    let stand: Vec<_> =
        scene.stage.actors.iter().map(|a| (a.name.as_str(), a.transform.translation.x)).collect();
    // Each is two metres wide, with a gap between them.
    assert_eq!(stand, [("one", 0.0), ("one 2", 2.2), ("two", 4.4)]);
    let refused = place.viewer.add_previewed_files().unwrap_err().to_string();
    assert!(refused.contains("broken.obj: it cannot be read; "), "{refused}");
    assert!(refused.contains("outside the script's folder"), "{refused}");
    let lines = "let one = cast(\"one\", load(\"one.obj\"));\n\
                 let two = cast(\"two\", load(\"two.obj\")).at(4.4, 0.0, 0.0);\n";
    assert_eq!(place.text(), format!("{SCRIPT}{lines}"));
    place.reload();
    place.viewer.undo().unwrap();
    assert_eq!(place.text(), SCRIPT);
    // An unreadable file: the scene of the script stays, and nothing is written.
    place.reload();
    let broken = files[1].clone();
    dropped(&mut place, &[broken.clone(), broken]);
    assert!(place.viewer.is_faulty && place.viewer.problems.len() == 2);
    assert!(place.viewer.add_previewed_files().unwrap_err().to_string().contains("cannot be read"));
    assert_eq!(place.text(), SCRIPT);
}

/// Typed arithmetic is evaluated, and the right mouse button resets a field to its default.
#[test]
fn fields_take_expressions_and_go_back_to_their_defaults() {
    let mut harness = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    harness.get_by_label("row ada").click();
    harness.run();
    for (typed, written) in
        [("1/4 - 2", "1.0 / 4.0 - 2.0"), ("2*(0.25 + 1)", "2.0 * (0.25 + 1.0)"), ("-.75", "-0.75")]
    {
        harness.get_by_label("x").click();
        harness.run();
        harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
        harness.event(egui::Event::Text(typed.into()));
        harness.run();
        harness.key_press(Key::Enter);
        harness.run();
        assert_eq!(harness.state().viewer.message, None);
        assert_eq!(harness.state().text(), SCRIPT.replace(".at(-0.5,", &format!(".at({written},")));
        harness.state_mut().reload();
        harness.run();
    }
    harness.state_mut().reload_with(SCRIPT);
    harness.state_mut().viewer.selection = Some(Selected::Effect(0));
    harness.run();
    let pos = harness.get_by_role_and_label(egui::accesskit::Role::Label, "strength").rect().center();
    secondary_click(&mut harness, pos);
    let default = {
        let scene = harness.state().viewer.scene.clone().unwrap();
        let plugin = scene.registry.effect("vignette").unwrap();
        choreo_session::edit::format_number(f64::from(choreo_render::effect_parameters(plugin, &[])[0]))
    };
    assert_ne!(default, "0.5");
    harness.get_by_label(&format!("Reset to {default}")).click();
    harness.run();
    assert_eq!(harness.state().text(), SCRIPT.replace(", #{ strength: 0.5 }", ""), "it is not stated");
    harness.state_mut().reload_with(SCRIPT);
    harness.state_mut().viewer.selection = Some(Selected::Actor("ada".into()));
    harness.run();
    let pos = harness.get_by_label("x").rect().center();
    secondary_click(&mut harness, pos);
    harness.get_by_label("Reset to 0.0").click();
    harness.run();
    assert_eq!(harness.state().text(), SCRIPT.replace(".at(-0.5, 0.0", ".at(0.0, 0.0"));
}

/// f(…) converts frames to seconds, so that an angle typed with it would be wrong.
#[test]
fn frame_numbers_are_accepted_only_in_time_fields() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    desk.state_mut().viewer.selection = Some(Selected::Actor("ada".into()));
    desk.run();
    for field in ["degrees", "x"] {
        type_into(&mut desk, field, "f(12)");
        let viewer = &mut desk.state_mut().viewer;
        let why = viewer.message.take();
        assert_eq!(why.as_deref(), Some("f(…) is a time, but this value is not: write a number"), "{field}");
        assert_eq!(desk.state().text(), SCRIPT);
    }
    type_into(&mut desk, "degrees", "90/2");
    assert_eq!(desk.state().viewer.message, None);
    assert_ne!(desk.state().text(), SCRIPT);
    type_into(&mut desk, "time of the playhead", "f(3) + f(9)");
    assert_eq!(desk.state().viewer.playhead.frame(), 12);
}

#[test]
fn typed_expressions_are_evaluated() {
    for (text, expected) in [
        ("1/3", 1.0 / 3.0),
        (" -2.5 ", -2.5),
        ("1 + 2*3", 7.0),
        ("(1+2)*3 - 4/8", 8.5),
        ("f(12)", 0.48),
        ("f(12) + 2*-f( 5 + 5 )", -0.32),
        ("10/2/5", 1.0),
        ("8-4-2", 2.0),
        (".5", 0.5),
        ("\u{2212}1", -1.0),
    ] {
        let got = expression::evaluate(text, 25.0).unwrap_or_else(|| panic!("{text}"));
        assert!((got - expected).abs() < 1e-12, "{text}: {got}");
    }
}

#[test]
fn text_that_is_no_number_is_rejected() {
    let deep = "(".repeat(100_000);
    for text in ["", "x", "1/0", "1 2", "(1", "1)", "f12", "f(", "--", "1..2", "1e", &deep] {
        assert_eq!(expression::evaluate(text, 25.0), None, "{}", &text[..text.len().min(8)]);
    }
}

/// Types a number into a field of the inspector, found by its label.
fn type_into(desk: &mut Desk, label: &str, text: &str) {
    // The field is the last widget, where the name next to it has the same label.
    desk.get_all_by_label(label).last().unwrap().click();
    desk.run();
    desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
    desk.run();
    desk.event(egui::Event::Text(text.into()));
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
    desk.state_mut().reload();
    desk.run();
}

/// Resets a field by the menu of its name.
fn reset(desk: &mut Desk, label: &str) {
    desk.get_by_label(label).click_secondary();
    desk.run();
    choose_reset(desk);
}

fn choose_reset(desk: &mut Desk) {
    desk.get_by_label("Reset to default").click();
    desk.run();
    desk.state_mut().reload();
    desk.run();
}

#[test]
fn everything_about_a_clip_is_edited_and_reset() {
    const CLIPS: &str = "stage(#{ fps: 25, length: 6.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\")).until(3.0).then(moves.clip(\"Wave\"), #{ fade: 0.5 });
ada.play(moves.clip(\"Bow\")).on(\"Spine..\");
";
    let mut place = Place::new(CLIPS);
    place.viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 });
    let mut desk = place.harness(vec2(1500.0, 1000.0));
    let cue = |desk: &Desk, layer: usize, cue: usize| {
        desk.state().viewer.scene.as_ref().unwrap().stage.actors[0].layers[layer].cues[cue].clone()
    };
    type_into(&mut desk, "speed field", "3/4");
    assert!((cue(&desk, 0, 1).speed - 0.75).abs() < 1e-12, "{}", desk.state().text());
    type_into(&mut desk, "fade field", "f(5)");
    assert!((cue(&desk, 0, 1).fade_in.as_secs() - 0.2).abs() < 1e-9, "{}", desk.state().text());
    type_into(&mut desk, "weight field", "0.5");
    assert_eq!(cue(&desk, 0, 1).weight, 0.5);
    type_into(&mut desk, "trim end", "1.0");
    assert!((cue(&desk, 0, 1).trim.1.as_secs() - 1.0).abs() < 1e-9, "{}", desk.state().text());
    desk.get_by_label("repeat: loop").click();
    desk.run();
    desk.get_by_label("ping_pong").click();
    desk.run();
    desk.state_mut().reload();
    desk.run();
    assert_eq!(cue(&desk, 0, 1).repeat, choreo_stage::Repeat::PingPong, "{}", desk.state().text());
    desk.get_by_label("ease: linear").click();
    desk.run();
    desk.get_by_label("smooth").click();
    desk.run();
    desk.state_mut().reload();
    desk.run();
    assert!(desk.state().text().contains("ease: \"smooth\""), "{}", desk.state().text());
    desk.get_by_label("clip: Wave").click();
    desk.run();
    desk.get_by_label("Jump").click();
    desk.run();
    desk.state_mut().reload();
    desk.run();
    assert_eq!(cue(&desk, 0, 1).clip.name, "Jump");
    // After all resets the line is as before, except for the clip and its repetition.
    for name in ["speed", "weight", "trim", "ease"] {
        let row = desk.query_all_by_label(name).next().unwrap().rect().center();
        secondary_click(&mut desk, row);
        choose_reset(&mut desk);
    }
    let line = ".then(moves.clip(\"Jump\"), #{ fade: f(5), repeat: \"ping_pong\" });";
    assert!(desk.state().text().contains(line), "{}", desk.state().text());
    desk.state_mut().viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 1, cue: 0 });
    desk.run();
    type_into(&mut desk, "on field", "[\"Head\", \"*Arm*\"]");
    assert!(desk.state().text().contains(".on([\"Head\", \"*Arm*\"]);"), "{}", desk.state().text());
    // A joint with its descendants can be chosen, too, and a text is displayed and typed without its quotes.
    for (choose, typed) in [(Some("Hips.."), None), (None, Some("Spine.."))] {
        desk.state_mut().reload();
        desk.run();
        if let Some(joint) = choose {
            desk.get_by_label("joints: ").click();
            desk.run();
            desk.get_by_label(joint).click();
            desk.run();
        }
        if let Some(text) = typed {
            let field = desk.get_by_label("on field");
            assert_eq!(field.value().as_deref(), Some("Hips.."));
            type_into(&mut desk, "on field", text);
        }
        let written = format!(".on(\"{}\");", choose.or(typed).unwrap());
        assert!(desk.state().text().contains(&written), "{}", desk.state().text());
    }
    // An unknown joint is refused, with the most similar name.
    desk.state_mut().reload();
    desk.run();
    let before = desk.state().text();
    for (text, why) in [
        (
            "RihgtHand..",
            "unknown joint \"RihgtHand\" in skeleton \"choreo:mannequin\"; did you mean \"RightHand\"?",
        ),
        (
            "[\"Head\", \"*Wing*\"]",
            "no joint of skeleton \"choreo:mannequin\" matches \"*Wing*\"; joints: mixamorig:Hips, ",
        ),
    ] {
        type_into(&mut desk, "on field", text);
        let message = desk.state().viewer.message.clone().unwrap_or_default();
        assert!(message.contains(why), "{message}");
        assert_eq!(desk.state().text(), before);
    }
}

/// A mask applies to all clips of a chain: when typed for one clip, it is offered for that clip alone and for all.
#[test]
fn a_mask_of_a_clip_of_a_chain_is_offered_for_it_alone() {
    const CHAIN: &str = "stage(#{ fps: 25, length: 8.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\")).until(2.0)
    .then(moves.clip(\"Wave\"), #{ fade: 0.3 }).until(4.0)
    .then(moves.clip(\"Bow\")).until(6.0);
";
    let alone = CHAIN.replace(
        "until(2.0)\n    .then(moves.clip(\"Wave\"), #{ fade: 0.3 }).until(4.0)\n    .then(moves.clip(\"Bow\")).until(6.0);\n",
        "until(4.0)\n    .then(moves.clip(\"Bow\")).until(6.0);\nada.play(moves.clip(\"Wave\"), #{ fade: 0.3 }).from(2.0).until(4.0).on(\"RightShoulder..\");\n",
    );
    let all = CHAIN.replace("until(2.0)", "until(2.0).on(\"RightShoulder..\")");
    for (agree, wanted) in [("Take Wave out of the chain", alone), ("Change all 3", all)] {
        let mut place = Place::new(CHAIN);
        place.viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 });
        let mut desk = place.harness(vec2(1500.0, 1000.0));
        type_into(&mut desk, "on field", "RightShoulder..");
        let why = desk.state().viewer.message.clone().unwrap_or_default();
        assert_eq!(why, "a.rhai:5: the mask is shared by the whole row: Walk, Wave and Bow would get it");
        assert_eq!(desk.state().text(), CHAIN);
        desk.get_by_label(agree).click();
        desk.run();
        assert_eq!(desk.state().text(), wanted);
        desk.state_mut().reload();
        assert_eq!(desk.state().viewer.message, None);
    }
}

#[test]
fn lights_lenses_titles_and_materials_are_edited_and_reset() {
    const SCENE: &str = "stage(#{ fps: 25, length: 4.0 });
let box = cast(\"box\", shape(\"box\", #{ size: 1.0, color: \"#ff0000\" }));
let view = camera(\"view\").at(0.0, 1.0, 5.0).fov(40.0);
let key = sun(#{ intensity: 3.0 });
let words = text(\"Hello\", #{ size: 0.1 }).from(1.0);
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1000.0));
    let select = |desk: &mut Desk, what: Selected| {
        desk.state_mut().viewer.selection = Some(what);
        desk.run();
    };
    let stage = |desk: &Desk| desk.state().viewer.scene.as_ref().unwrap().stage.clone();
    select(&mut desk, Selected::Light(0));
    reset(&mut desk, "intensity");
    assert!(desk.state().text().contains("let key = sun();"), "{}", desk.state().text());
    // Expected value: 2.2 lux by default.
    assert!((stage(&desk).lights[0].light.intensity - 2.2).abs() < 1e-6);
    select(&mut desk, Selected::Camera("view".into()));
    type_into(&mut desk, "focal length field", "50");
    // The script has degrees: 50 mm on a film height of 24 mm are 2 atan(12 / 50).
    let degrees = 2.0 * libm::atan(12.0 / 50.0).to_degrees();
    let choreo_asset::Projection::Perspective { yfov, .. } = stage(&desk).cameras[0].projection else {
        panic!()
    };
    assert!((f64::from(yfov).to_degrees() - degrees).abs() < 1e-3, "{}", desk.state().text());
    // The field of view has enough digits to restore the focal length.
    assert!(desk.state().text().contains(".fov(26.99147)"), "{}", desk.state().text());
    let length = desk.get_by_label("focal length field").value().unwrap_or_default();
    assert_eq!(length.parse::<f64>(), Ok(50.0));
    type_into(&mut desk, "near field", "0.25");
    assert!(desk.state().text().contains(".near(0.25)"), "{}", desk.state().text());
    select(&mut desk, Selected::Title(0));
    type_into(&mut desk, "opacity field", "0.5");
    type_into(&mut desk, "at x", "0.25");
    type_into(&mut desk, "size field", "0.2");
    let text = "let words = text(\"Hello\", #{ size: 0.2, opacity: 0.5, at: [0.25, 0.5] }).from(1.0);";
    assert!(desk.state().text().contains(text), "{}", desk.state().text());
    select(&mut desk, Selected::Actor("box".into()));
    type_into(&mut desk, "roughness field", "0.25");
    assert_eq!(stage(&desk).actors[0].asset.materials[0].roughness, 0.25);
    reset(&mut desk, "roughness");
    assert_eq!(stage(&desk).actors[0].asset.materials[0].roughness, 0.9);
}

#[test]
fn a_line_that_creates_several_objects_is_changed_for_all_or_expanded() {
    const LOOP: &str = "stage(#{ fps: 25, length: 4.0 });
for i in [1, 2, 3] {
    let ball = cast(`ball ${i}`, shape(\"sphere\")).at(0.0, i, 0.0).scale(0.5);
    ball.key(\"tint\", [[0.0, \"red\"]]);
}
";
    let mut desk = Place::new(LOOP).harness(vec2(1500.0, 1000.0));
    let grown = Change::Scale(DVec3::splat(2.0));
    let refused = desk.state_mut().viewer.change_actor("ball 2", grown).unwrap_err().to_string();
    assert!(refused.ends_with("a.rhai:3: this line makes 3 objects; change it there"), "{refused}");
    desk.run();
    desk.get_by_label("line 3 makes 3 objects. This would change all of them:");
    desk.get_by_label("Change all 3").click();
    desk.run();
    assert_eq!(desk.state().text(), LOOP.replace(".scale(0.5)", ".scale(1.0)"));
    desk.state_mut().reload();
    // A computed value cannot be changed for all objects; the numbers next to it can.
    desk.state_mut().viewer.change_actor("ball 2", Change::Move(DVec3::X)).unwrap_err();
    desk.run();
    desk.get_by_label("Change all 3");
    desk.get_by_label("Leave it").click();
    desk.run();
    desk.state_mut().viewer.change_actor("ball 2", Change::Move(DVec3::Y)).unwrap_err();
    desk.run();
    assert!(desk.query_by_label("Change all 3").is_none());
    let before = desk.state().viewer.scene.as_ref().unwrap().stage.clone();
    desk.get_by_label("Write the loop out").click();
    desk.run();
    desk.state_mut().reload();
    let after = desk.state().viewer.scene.as_ref().unwrap().stage.clone();
    let placed = |stage: &choreo_stage::Stage| -> Vec<(String, DVec3)> {
        stage.actors.iter().map(|a| (a.name.clone(), a.transform.translation)).collect()
    };
    assert_eq!(placed(&before), placed(&after), "{}", desk.state().text());
    // After the loop is unrolled, the pending change is made.
    desk.state_mut().reload();
    let moved = placed(&desk.state().viewer.scene.as_ref().unwrap().stage);
    let wanted = placed(&before).into_iter().map(|(name, at)| match name.as_str() {
        "ball 2" => (name, at + DVec3::Y),
        _ => (name, at),
    });
    assert_eq!(moved, wanted.collect::<Vec<_>>(), "{}", desk.state().text());
    desk.state_mut().viewer.change_actor("ball 2", grown).unwrap();
    assert_eq!(desk.state().text().matches(".scale(2.0)").count(), 1, "{}", desk.state().text());
}

/// Unrolling a loop replaces its computed values by numbers and texts, so that they can be moved, renamed and edited.
#[test]
fn objects_of_a_loop_are_edited_after_the_loop_is_expanded() {
    const LOOP: &str = "stage(#{ fps: 25, length: 4.0 });
let moves = load(\"choreo:mannequin\");
for i in [-1, 0, 1] {
    let post = cast(\"post \" + (i + 2), moves).at(-2 + i, 0.0, i * 0.5);
    post.play(moves.clip(\"Walk\"), #{ speed: 1.0 + i * 0.25 }).from(1 + i);
}
";
    let mut desk = Place::new(LOOP).harness(vec2(1500.0, 1000.0));
    desk.state_mut().viewer.change_actor("post 3", Change::Move(DVec3::X)).unwrap_err();
    desk.run();
    desk.get_by_label("Write the loop out").click();
    desk.run();
    let reload = |desk: &mut Desk| {
        desk.state_mut().reload();
        assert_eq!(desk.state().viewer.message, None);
        desk.run();
    };
    reload(&mut desk);
    reload(&mut desk);
    desk.state_mut().viewer.change_actor("post 3", Change::Move(DVec3::new(0.25, 0.0, 0.0))).unwrap();
    reload(&mut desk);
    desk.state_mut().viewer.selection = Some(Selected::Cue { actor: "post 1".into(), layer: 0, cue: 0 });
    desk.run();
    type_into(&mut desk, "speed field", "2");
    type_into(&mut desk, "from field", "0.5");
    desk.state_mut().viewer.rename(&Selected::Actor("post 2".into()), "Middle").unwrap();
    reload(&mut desk);
    let lines: Vec<String> = desk.state().text().lines().skip(2).map(str::to_string).collect();
    assert_eq!(
        lines,
        [
            "let post_1 = cast(\"post 1\", moves).at(-3, 0.0, -0.5);",
            "post_1.play(moves.clip(\"Walk\"), #{ speed: 2.0 }).from(0.5);",
            "let middle = cast(\"Middle\", moves).at(-2, 0.0, 0.0);",
            "middle.play(moves.clip(\"Walk\"), #{ speed: 1.0 }).from(1);",
            "let post_3 = cast(\"post 3\", moves).at(0.25, 0.0, 0.5);",
            "post_3.play(moves.clip(\"Walk\"), #{ speed: 1.25 }).from(2);",
        ]
    );
}

/// Constraints, attachments, springs, shadows and keyed weights have fields, each of which changes its own call.
#[test]
fn constraints_springs_and_shadows_are_edited_and_reset() {
    const SCENE: &str = "stage(#{ fps: 25, length: 4.0 });
let moves = load(\"choreo:mannequin\");
let ball = cast(\"ball\", shape(\"sphere\"));
let ada = cast(\"ada\", moves);
ada.reach(\"LeftHand\", ball, #{ soft: 0.1 }).from(1.0);
ada.look_at(ball).fade(0.5);
ada.spring(\"Head\", #{ frequency: 3.0 });
ball.attach(ada.joint(\"RightHand\"), #{ from: 2.0 });
ada.play(moves.clip(\"Walk\")).weight([[0.0, 1.0], [2.0, 0.5]]);
let key = sun(#{ intensity: 3.0 });
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1600.0));
    let select = |desk: &mut Desk, what: Selected| {
        desk.state_mut().viewer.selection = Some(what);
        desk.run();
    };
    let stage = |desk: &Desk| desk.state().viewer.scene.as_ref().unwrap().stage.clone();
    let reach = |desk: &Desk| {
        let constraint = stage(desk).actors[1].constraints[0].clone();
        let choreo_stage::ConstraintKind::Reach(reach) = constraint.kind.clone() else { panic!() };
        (constraint, reach)
    };
    select(&mut desk, Selected::Actor("ada".into()));
    type_into(&mut desk, "reach soft field", "1/4");
    assert_eq!(reach(&desk).1.soft, 0.25, "{}", desk.state().text());
    type_into(&mut desk, "reach weight field", "0.5");
    assert_eq!(reach(&desk).0.weight, 0.5, "{}", desk.state().text());
    type_into(&mut desk, "reach from field", "f(50)");
    assert!((reach(&desk).0.start.as_secs() - 2.0).abs() < 1e-9, "{}", desk.state().text());
    desk.get_by_label("reach keep field").click();
    desk.run();
    desk.state_mut().reload();
    desk.run();
    assert!(reach(&desk).1.keep_rotation, "{}", desk.state().text());
    type_into(&mut desk, "look_at fade field", "1.0");
    assert_eq!(stage(&desk).actors[1].look_at[0].fade.as_secs(), 1.0, "{}", desk.state().text());
    type_into(&mut desk, "spring frequency field", "4");
    type_into(&mut desk, "spring damping field", "0.75");
    let line = |desk: &Desk, start: &str| {
        desk.state().text().lines().find(|line| line.starts_with(start)).unwrap().to_string()
    };
    assert_eq!(line(&desk, "ada.spring"), "ada.spring(\"Head\", #{ frequency: 4.0, damping: 0.75 });");
    assert_eq!(
        line(&desk, "ada.reach"),
        "ada.reach(\"LeftHand\", ball, #{ soft: 1.0 / 4.0, weight: 0.5, keep: true }).from(f(50));"
    );
    assert_eq!(line(&desk, "ada.look_at"), "ada.look_at(ball).fade(1.0);");
    reset(&mut desk, "damping");
    reset(&mut desk, "soft");
    assert_eq!(line(&desk, "ada.spring"), "ada.spring(\"Head\", #{ frequency: 4.0 });");
    assert_eq!(reach(&desk).1.soft, 0.05, "as the reference has it");

    select(&mut desk, Selected::Actor("ball".into()));
    type_into(&mut desk, "attach blend field", "0.5");
    type_into(&mut desk, "attach from field", "1.5");
    assert_eq!(
        line(&desk, "ball.attach"),
        "ball.attach(ada.joint(\"RightHand\"), #{ from: 1.5, blend: 0.5 });"
    );

    select(&mut desk, Selected::Light(0));
    desk.get_by_label("shadow field").click();
    desk.run();
    desk.state_mut().reload();
    desk.run();
    type_into(&mut desk, "shadow size field", "512");
    type_into(&mut desk, "shadow softness field", "0.2");
    let shadow = stage(&desk).lights[0].shadow.unwrap();
    assert_eq!((shadow.size, shadow.softness), (512, Some(0.2)), "{}", desk.state().text());
    reset(&mut desk, "size");
    reset(&mut desk, "softness");
    assert_eq!(line(&desk, "let key"), "let key = sun(#{ intensity: 3.0, shadow: true });");

    // A number would replace the keys.
    select(&mut desk, Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 });
    desk.get_by_label("2 keys, 0.00 to 2.00 s");
    assert!(desk.query_by_label("weight field").is_none());
}

/// An end that the script does not set is not displayed as zero: the effective value is shown in weak text, or nothing.
#[test]
fn an_end_that_is_not_stated_is_not_zero() {
    const SCENE: &str = "stage(#{ fps: 30, length: 6.0 });
let moves = load(\"choreo:mannequin\");
let ball = cast(\"ball\", shape(\"sphere\"));
let ada = cast(\"ada\", moves);
ada.look_at(ball);
ada.play(moves.clip(\"Walk\")).until(f(60)).then(moves.clip(\"Wave\"));
text(\"Hello\", #{ at: [-0.0001, 0.5] });
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1000.0));
    let value = |desk: &Desk, label: &str| desk.get_by_label(label).value().unwrap_or_default();
    desk.state_mut().viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 });
    desk.run();
    assert_eq!(value(&desk, "until field"), "6.00");
    desk.state_mut().viewer.selection = Some(Selected::Title(0));
    desk.run();
    assert_eq!(value(&desk, "until field"), "6.00");
    // A number that rounds to zero has no sign.
    assert_eq!(value(&desk, "at x").trim_start_matches('0'), ".00");
    desk.state_mut().viewer.selection = Some(Selected::Actor("ada".into()));
    desk.run();
    assert_eq!(value(&desk, "look_at until field"), "");
    // Leaving a field unchanged writes nothing.
    desk.get_by_label("look_at until field").click();
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
    assert_eq!(desk.state().text(), SCENE);
    type_into(&mut desk, "look_at until field", "2");
    assert_eq!(desk.state().text(), SCENE.replace("look_at(ball)", "look_at(ball, #{ until: 2.0 })"));
    assert_eq!(value(&desk, "look_at until field"), "2.00");
    desk.state_mut().reload_with(SCENE);
    desk.state_mut().viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 });
    desk.run();
    type_into(&mut desk, "until field", "5");
    assert!(desk.state().text().contains("\"Wave\")).until(5.0);"), "{}", desk.state().text());
}

/// An asset shared by several actors is changed for one of them or for all, as the user chooses.
#[test]
fn an_asset_of_several_actors_is_changed_for_one_or_for_all() {
    const SCENE: &str = "stage(#{ fps: 25, length: 4.0 });
let cube = shape(\"box\", #{ size: 1.0, roughness: 0.5 });
let a = cast(\"a\", cube);
let b = cast(\"b\", cube).at(2.0, 0.0, 0.0);
";
    let mut place = Place::new(SCENE);
    place.viewer.selection = Some(Selected::Actor("b".into()));
    let mut desk = place.harness(vec2(1500.0, 1600.0));
    // A reload would close the dialog.
    let type_into = |desk: &mut Desk, label: &str, text: &str| {
        desk.get_all_by_label(label).last().unwrap().click();
        desk.run();
        desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
        desk.run();
        desk.event(egui::Event::Text(text.into()));
        desk.run();
        desk.key_press(Key::Enter);
        desk.run();
    };
    type_into(&mut desk, "roughness field", "0.25");
    assert_eq!(desk.state().text(), SCENE);
    desk.get_by_label("2 actors share the asset cube. b alone would get an asset of its own:");
    desk.get_by_label("Change b alone").click();
    desk.run();
    let own = "let b_asset = shape(\"box\", #{ size: 1.0, roughness: 0.25 });\nlet b = cast(\"b\", b_asset)";
    let changed = SCENE.replace("let b = cast(\"b\", cube)", own);
    assert_eq!(desk.state().text(), changed);
    desk.state_mut().reload();
    desk.run();
    // b now has a separate asset.
    type_into(&mut desk, "roughness field", "0.75");
    assert_eq!(desk.state().text(), changed.replace("0.25", "0.75"));
    desk.state_mut().viewer.undo().unwrap();
    desk.state_mut().viewer.undo().unwrap();
    desk.state_mut().reload();
    desk.run();
    type_into(&mut desk, "roughness field", "0.25");
    desk.get_by_label("Change all 2").click();
    desk.run();
    assert_eq!(desk.state().text(), SCENE.replace("roughness: 0.5", "roughness: 0.25"));
}

/// A typed time is written in the unit of the script, seconds or frames; typed frames and expressions are kept as typed.
#[test]
fn typed_times_keep_the_style_of_the_script() {
    const SCENE: &str = "stage(#{ fps: 30, length: 6.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\")).from(0.5).until(f(60));
";
    let mut place = Place::new(SCENE);
    place.viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 });
    let mut desk = place.harness(vec2(1500.0, 1000.0));
    for (field, typed, written) in [
        ("from", "f(31)", ".from(f(31)).until(f(60))"),
        ("from", "1.5", ".from(f(45)).until(f(60))"),
        ("from", "1.25", ".from(1.25).until(f(60))"),
        ("from", "1/3", ".from(1.0 / 3.0).until(f(60))"),
        ("until", "1.5", ".from(1.0 / 3.0).until(f(45))"),
        ("until", "f( 61 )", ".from(1.0 / 3.0).until(f(61))"),
        ("from", "0.25", ".from(0.25).until(f(61))"),
    ] {
        type_into(&mut desk, &format!("{field} field"), typed);
        assert_eq!(desk.state().text(), SCENE.replace(".from(0.5).until(f(60))", written));
    }
}

/// A third is written and displayed as typed, and edited again; so is 3/4, although it has an exact decimal form.
#[test]
fn a_typed_expression_is_written_displayed_and_edited_again() {
    const SCENE: &str = "stage(#{ fps: 30, length: 30.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\"), #{ fade: 0.4 }).then(moves.clip(\"Wave\")).weight(0.5);
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1000.0));
    for (number, with) in
        [(0, ["#{ fade: 0.4 }", "#{ fade: 0.4, speed: X }"]), (1, [".weight(0.5)", ".weight(0.5).speed(X)"])]
    {
        desk.state_mut().reload_with(SCENE);
        desk.state_mut().viewer.selection =
            Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: number });
        desk.run();
        for (typed, written) in
            [("1/3", "1.0 / 3.0"), ("2 / 3", "2.0 / 3.0"), ("3/4", "3.0 / 4.0"), ("1/7", "1.0 / 7.0")]
        {
            type_into(&mut desk, "speed field", typed);
            let wanted = SCENE.replacen(with[0], &with[1].replace('X', written), 1);
            assert_eq!(desk.state().text(), wanted);
        }
        assert!(desk.state().viewer.problems.is_empty(), "{:?}", desk.state().viewer.problems);
        let cue = desk.state().viewer.scene.as_ref().unwrap().stage.actors[0].layers[0].cues[number].clone();
        assert_eq!(cue.speed, 1.0 / 7.0);
        // Leaving a field unchanged writes nothing.
        let before = desk.state().text();
        desk.get_by_label("speed field").click();
        desk.run();
        desk.key_press(Key::Enter);
        desk.run();
        assert_eq!(desk.state().text(), before);
    }
}

/// Other fields of the inspector also keep typed expressions: a light, a lens, a fade, a point, an effect.
#[test]
fn every_field_keeps_a_typed_expression() {
    const SCENE: &str = "stage(#{ fps: 30, length: 4.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\"), #{ fade: 0.4 });
camera(\"wide\").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]).fov(40.0);
spot(#{ position: [0.0, 3.0, 0.0], look_at: [0.0, 1.0, 0.0], intensity: 60.0, outer: 35.0 });
effect(\"vignette\", #{ strength: 0.5 });
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1000.0));
    let wide = Selected::Camera("wide".into());
    let cue = Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 };
    for (what, field, typed, old, new) in [
        (Selected::Light(0), "light intensity", "100/3", "intensity: 60.0", "intensity: 100.0 / 3.0"),
        (Selected::Light(0), "light outer", "100/3", "outer: 35.0", "outer: 100.0 / 3.0"),
        (Selected::Light(0), "light x", "1/3", "position: [0.0, 3", "position: [1.0 / 3.0, 3"),
        (wide, "field of view", "100/3", "fov(40.0)", "fov(100.0 / 3.0)"),
        (cue, "fade field", "1/3", "fade: 0.4", "fade: 1.0 / 3.0"),
        (Selected::Effect(0), "strength number", "1/3", "strength: 0.5", "strength: 1.0 / 3.0"),
    ] {
        desk.state_mut().reload_with(SCENE);
        desk.state_mut().viewer.selection = Some(what);
        desk.run();
        type_into(&mut desk, field, typed);
        let wanted = SCENE.replace(old, new);
        assert_eq!(desk.state().text(), wanted, "{field}");
        assert!(desk.state().viewer.problems.is_empty(), "{:?}", desk.state().viewer.problems);
        // Leaving a field unchanged writes nothing.
        desk.get_all_by_label(field).last().unwrap().click();
        desk.run();
        desk.key_press(Key::Enter);
        desk.run();
        assert_eq!(desk.state().text(), wanted, "{field}");
    }
}

/// Numbers in lists and times are kept as typed, and their neighbors as written.
#[test]
fn a_typed_expression_is_kept_when_a_neighbor_changes() {
    const SCENE: &str = "stage(#{ fps: 25, length: 6.0, ambient: 0.5 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves).at(2.0 / 7.0, 0, 0.333).turn(10).scale(2);
ada.play(moves.clip(\"Walk\")).from(0.5).until(5.0);
cast(\"bob\", moves).key(\"position\", [[0.0, [1.0 / 7.0, 0, 0]], [2.0, [1, 0, 0]]]);
camera(\"wide\").at(1.0 / 7.0, 1, 4.0).look_at([0.0, 1.0, 0.0]);
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1000.0));
    let actor = |name: &str| Some(Selected::Actor(name.into()));
    let cue = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 });
    let wide = Some(Selected::Camera("wide".into()));
    let with_trim = "\"Walk\"), #{ trim: [1.0 / 3.0, 1.0] })";
    for (what, field, typed, old, new) in [
        (actor("ada"), "z", "2/3", "0, 0.333)", "0, 2.0 / 3.0)"),
        // The other number with the same digits stays.
        (actor("ada"), "y", "1/3", "0, 0.333)", "1.0 / 3.0, 0.333)"),
        (actor("ada"), "degrees", "100/3", "turn(10)", "turn(100.0 / 3.0)"),
        (actor("ada"), "scale y", "1/3", "scale(2)", "scale(2, 1.0 / 3.0, 2)"),
        (actor("bob"), "z", "1/3", "[1.0 / 7.0, 0, 0]", "[1.0 / 7.0, 0, 1.0 / 3.0]"),
        (cue.clone(), "from field", "1/3", "from(0.5)", "from(1.0 / 3.0)"),
        (cue.clone(), "until field", "f(100)", "until(5.0)", "until(f(100))"),
        (cue, "trim start", "1/3", "\"Walk\"))", with_trim),
        (wide, "camera at y", "1/3", "(1.0 / 7.0, 1, 4.0)", "(1.0 / 7.0, 1.0 / 3.0, 4.0)"),
        (None, "ambient strength", "1/3", "ambient: 0.5", "ambient: 1.0 / 3.0"),
    ] {
        desk.state_mut().reload_with(SCENE);
        desk.state_mut().viewer.selection = what;
        desk.run();
        type_into(&mut desk, field, typed);
        let wanted = SCENE.replace(old, new);
        assert_eq!(desk.state().text(), wanted, "{field}");
        assert_eq!(desk.state().viewer.message, None, "{field}");
        // Leaving a field unchanged writes nothing.
        desk.get_all_by_label(field).last().unwrap().click();
        desk.run();
        desk.key_press(Key::Enter);
        desk.run();
        assert_eq!(desk.state().text(), wanted, "{field}");
    }
    // A typed expression is edited like other numbers: the actor can be moved.
    desk.state_mut().reload_with(&SCENE.replace("0.333)", "1.0 / 3.0)"));
    desk.state_mut().viewer.change_actor("ada", Change::Move(DVec3::Z)).unwrap();
    assert_eq!(desk.state().text(), SCENE.replace("0.333)", "1.333)"));
}

/// A position with a computed number refuses only that number: for a camera, and for an actor in the viewport.
#[test]
fn numbers_beside_a_computed_one_are_edited() {
    const SCENE: &str = "stage(#{ fps: 25, length: 4.0 });
let x = 1.5;
let box = cast(\"box\", shape(\"box\")).at(1.0 / 3.0, 0.0, 2.0 * x);
camera(\"wide\").at(0, 1, 2.0 * x).look_at([0.0, 1.0, 0.0]);
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1600.0));
    desk.state_mut().viewer.change_actor("box", Change::Move(DVec3::Y)).unwrap();
    assert_eq!(desk.state().text(), SCENE.replace("3.0, 0.0, 2.0", "3.0, 1.0, 2.0"));
    desk.state_mut().reload_with(SCENE);
    let refused = desk.state_mut().viewer.change_actor("box", Change::Move(DVec3::Z)).unwrap_err();
    assert!(refused.to_string().contains("line 3: .at(1.0 / 3.0, 0.0, 2.0 * x) is computed"), "{refused}");
    desk.state_mut().reload_with(SCENE);
    desk.state_mut().viewer.offer = None;
    desk.state_mut().viewer.selection = Some(Selected::Camera("wide".into()));
    desk.run();
    type_into(&mut desk, "camera at y", "2");
    let higher = SCENE.replace("(0, 1, 2.0 * x)", "(0, 2, 2.0 * x)");
    assert_eq!(desk.state().text(), higher);
    desk.get_by_label("camera at z").click();
    desk.run();
    desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
    desk.event(egui::Event::Text("5".into()));
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
    let message = desk.state().viewer.message.clone().unwrap_or_default();
    assert!(message.contains("line 4: .at(0, 2, 2.0 * x) is computed"), "{message}");
    assert_eq!(desk.state().text(), higher);
}

/// A field of view is written as a focal length where the script has one, because that takes precedence.
#[test]
fn a_lens_in_millimetres_stays_in_millimetres() {
    const SCENE: &str = "stage(#{ fps: 25, length: 4.0 });
camera(\"wide\").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]).focal_length(85);
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1000.0));
    desk.state_mut().viewer.selection = Some(Selected::Camera("wide".into()));
    desk.run();
    type_into(&mut desk, "field of view", "40");
    assert_eq!(desk.state().text(), SCENE.replace("(85)", "(32.96973)"));
}

/// A right click on a number opens the menu of its name.
#[test]
fn a_right_click_on_a_number_resets_it_as_one_on_its_name_does() {
    const SCENE: &str = "stage(#{ fps: 25, length: 4.0, exposure: 0.5 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\"), #{ speed: 2.0, trim: [0.25, 1.0] });
camera(\"wide\").near(0.2).at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
sun(#{ intensity: 3.0, color: \"white\" });
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1000.0));
    let cue = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 });
    for (what, field, stated) in [
        (cue.clone(), "speed field", "speed: 2.0, "),
        (cue, "trim end", ", trim: [0.25, 1.0]"),
        (Some(Selected::Camera("wide".into())), "near field", ".near(0.2)"),
        (Some(Selected::Light(0)), "light intensity", "intensity: 3.0, "),
        (None, "stage exposure", ", exposure: 0.5"),
    ] {
        desk.state_mut().reload_with(SCENE);
        desk.state_mut().viewer.selection = what;
        desk.run();
        let number = desk.get_by_label(field).rect().center();
        secondary_click(&mut desk, number);
        choose_reset(&mut desk);
        assert_eq!(desk.state().text(), SCENE.replace(stated, ""), "{field}");
    }
}

/// A value that a callback sets is not a key: the inspector names the line of the callback.
#[test]
fn values_of_callbacks_are_named_as_such() {
    const SCENE: &str = "stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let wide = camera(\"wide\").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
let edge = effect(\"vignette\", #{ strength: 0.5 });
on_frame(|t| edge.set(\"strength\", 0.25));
";
    // A callback that leaves a value unchanged hides no field.
    let other = SCENE.replace("edge.set(\"strength\", 0.25)", "wide.at(0.0, 1.0, 5.0)");
    for (script, is_named) in [(SCENE, true), (other.as_str(), false)] {
        let mut place = Place::new(script);
        place.viewer.selection = Some(Selected::Effect(0));
        place.paint();
        let desk = place.harness(vec2(1500.0, 1000.0));
        assert_eq!(desk.query_by_label("0.250 (by on_frame, line 4)").is_some(), is_named);
        assert_eq!(desk.query_by_label("strength number").is_none(), is_named);
    }
    // The field of view of the active camera, too.
    let zoomed = SCENE.replace("edge.set(\"strength\", 0.25)", "wide.fov(30)");
    for (script, is_named) in [(zoomed.as_str(), true), (SCENE, false)] {
        let mut place = Place::new(script);
        place.viewer.selection = Some(Selected::Camera("wide".into()));
        place.paint();
        let desk = place.harness(vec2(1500.0, 1000.0));
        assert_eq!(desk.query_by_label("30.000 (by on_frame, line 4)").is_some(), is_named);
    }
    // Any of several callbacks may set it; those of a loop have one line.
    let callback = "on_frame(|t| edge.set(\"strength\", 0.25));\n";
    let looped = "for n in [1, 2] { on_frame(|t| edge.set(\"strength\", 0.25)); }\n".to_string();
    for (more, lines) in [
        (looped, "4 and 5"),
        (callback.repeat(2), "4, 5 and 6"),
        (callback.repeat(3), "4, 5, 6 and 1 other"),
        (callback.repeat(4), "4, 5, 6 and 2 others"),
    ] {
        let mut place = Place::new(&format!("{SCENE}{more}"));
        place.viewer.selection = Some(Selected::Effect(0));
        place.paint();
        place.harness(vec2(1500.0, 1000.0)).get_by_label(&format!("0.250 (by on_frame, lines {lines})"));
    }
}

/// A trim beyond the clip is clamped so that something remains; a clip of length zero would be an error in the script.
#[test]
fn a_trim_cannot_remove_the_whole_clip() {
    let mut desk = Place::new(SCRIPT).harness(vec2(1500.0, 1000.0));
    desk.state_mut().viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 0 });
    desk.run();
    desk.get_by_label("trim start").click();
    desk.run();
    desk.key_press_modifiers(Modifiers::COMMAND, Key::A);
    desk.event(egui::Event::Text("2".into()));
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
    assert!(desk.state().text().contains("trim: [0.99, 1.0]"), "{}", desk.state().text());
    desk.state_mut().reload();
    assert!(desk.state().viewer.problems.is_empty(), "{:?}", desk.state().viewer.problems);
}

/// Fields write only what the script accepts: no inertialization for a clip of an upper layer, and one text for the color of an effect.
#[test]
fn fields_write_only_what_the_script_accepts() {
    const SCENE: &str = "stage(#{ fps: 30, length: 4.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\"));
ada.play(moves.clip(\"Wave\")).on(\"RightShoulder..\");
effect(\"outline\", #{ color: \"#ffd060\" }).on(ada);
";
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1000.0));
    for (layer, is_offered) in [(0, true), (1, false)] {
        desk.state_mut().viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer, cue: 0 });
        desk.run();
        assert_eq!(desk.query_by_label("inertial field").is_some(), is_offered, "layer {layer}");
    }
    desk.state_mut().viewer.selection = Some(Selected::Effect(0));
    desk.run();
    type_into(&mut desk, "color hex", "#1080f0");
    assert_eq!(desk.state().text(), SCENE.replace("#ffd060", "#1080f0"));
    assert!(desk.state().viewer.problems.is_empty(), "{:?}", desk.state().viewer.problems);
}

/// Values without fields are those at the playhead, and none is shown twice. Angles are those that a person would type.
#[test]
fn rows_of_the_inspector_agree_with_its_fields() {
    const SCENE: &str = "stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let cube = shape(\"box\", #{ size: 1.0 });
cast(\"ada\", cube).turn(180);
camera(\"wide\").key(\"fov\", [[0.0, 40], [2.0, 50]]).key(\"position\", [[0.0, [0, 1, -4]]]).key(\"rotation\", [[0.0, [0, 180, 0]]]);
";
    for what in [Selected::Camera("wide".into()), Selected::Actor("ada".into())] {
        let mut place = Place::new(SCENE);
        place.viewer.selection = Some(what);
        place.paint();
        let desk = place.harness(vec2(1500.0, 1000.0));
        desk.get_by_label("0.0° 180.0° 0.0°");
        if let Some(length) = desk.query_by_label("focal length field") {
            // The focal length of 40° is 12 mm / tan 20°.
            let length: f64 = length.value().unwrap_or_default().parse().unwrap();
            assert!((length - 32.97).abs() < 0.01, "{length}");
        }
        assert!(["fov", "position", "rotation"].iter().all(|name| desk.query_by_label(name).is_none()));
    }
}

/// Names of the inspector's fields for numbers and colors, and a value to type into each. Fields that are also shown without a selection
/// are left out.
fn fields_of(desk: &mut Desk, what: &Selected) -> Vec<(String, String)> {
    let mut all = |what: Option<&Selected>| {
        desk.state_mut().viewer.selection = what.cloned();
        desk.run();
        let fields = desk.query_all_by(|node| {
            let is_color = node.label().is_some_and(|label| label.ends_with(" hex"));
            node.role() == Role::SpinButton || is_color
        });
        let field = |node: egui_kittest::Node<'_>| {
            let node = node.accesskit_node();
            let low = node.min_numeric_value().unwrap_or(f64::NEG_INFINITY);
            let high = node.max_numeric_value().unwrap_or(f64::INFINITY);
            let text = match node.numeric_value() {
                None => "#336699".to_string(),
                Some(_) if high - low < 1e3 => format!("{:.3}", low + 0.37 * (high - low)),
                Some(now) => format!("{:.3}", (now + 1.0).clamp(low, high)),
            };
            Some((node.label()?, text))
        };
        fields.filter_map(field).collect::<Vec<_>>()
    };
    let others: BTreeSet<String> = all(None).into_iter().map(|(name, _)| name).collect();
    all(Some(what)).into_iter().filter(|(name, _)| !others.contains(name)).collect()
}

/// A number or color within the range of its field is written, and the script still loads.
#[test]
fn every_field_accepts_its_whole_range() {
    const SCENE: &str = "stage(#{ fps: 25, length: 6.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\")).until(3.0).then(moves.clip(\"Wave\"), #{ fade: 0.5 });
ada.play(moves.clip(\"Bow\")).on(\"Spine..\");
let ball = cast(\"ball\", shape(\"sphere\", #{ emissive: \"#ff0000\" }));
let pill = cast(\"pill\", shape(\"capsule\"));
let ring = cast(\"ring\", shape(\"torus\"));
let wax = cast(\"wax\", shape(\"box\", #{ shininess: 40.0 }));
ada.reach(\"LeftHand\", ball);
ada.spring(\"Head\");
camera(\"wide\").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
camera(\"round\").orbit([0.0, 1.0, 0.0], #{ distance: 3.0 });
sun(#{ shadow: #{ softness: 0.1 } });
point();
spot(#{ inner: 20.0, outer: 30.0 });
effect(\"bloom\");
text(\"Hello\", #{ size: 0.1 }).from(1.0);
";
    let cue = |layer, cue| Selected::Cue { actor: "ada".into(), layer, cue };
    let actors = ["ada", "ball", "pill", "ring", "wax"].map(|name| Selected::Actor(name.into()));
    let cameras = ["wide", "round"].map(|name| Selected::Camera(name.into()));
    let lights = [0, 1, 2].map(Selected::Light);
    let others = [cue(0, 0), cue(0, 1), cue(1, 0), Selected::Effect(0), Selected::Title(0)];
    let mut desk = Place::new(SCENE).harness(vec2(1500.0, 2400.0));
    for what in actors.into_iter().chain(cameras).chain(lights).chain(others) {
        let fields = fields_of(&mut desk, &what);
        assert!(!fields.is_empty(), "{what:?}");
        for (name, text) in fields {
            type_into(&mut desk, &name, &text);
            let viewer = &desk.state().viewer;
            assert_eq!(viewer.message, None, "{what:?}, {name}: {text}");
            assert!(viewer.problems.iter().all(|p| p.severity != Severity::Error), "{:?}", viewer.problems);
            assert_ne!(desk.state().text(), SCENE, "{what:?}, {name}: {text}");
            desk.state_mut().reload_with(SCENE);
            desk.run();
        }
    }
}

/// A clip starts by a fade or by inertialization: setting one removes the other.
#[test]
fn fade_and_inertialization_replace_each_other() {
    const CLIPS: &str = "stage(#{ fps: 25, length: 6.0 });
let moves = load(\"choreo:mannequin\");
let ada = cast(\"ada\", moves);
ada.play(moves.clip(\"Walk\")).until(3.0).then(moves.clip(\"Wave\"), #{ fade: 0.5 });
";
    let mut desk = Place::new(CLIPS).harness(vec2(1500.0, 1000.0));
    desk.state_mut().viewer.selection = Some(Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 });
    desk.run();
    type_into(&mut desk, "inertial field", "0.1");
    assert_eq!(desk.state().text(), CLIPS.replace("fade: 0.5", "inertial: 0.1"));
    type_into(&mut desk, "fade field", "0.25");
    assert_eq!(desk.state().text(), CLIPS.replace("fade: 0.5", "fade: 0.25"));
    // Each is one undo step.
    desk.state_mut().viewer.undo().unwrap();
    assert_eq!(desk.state().text(), CLIPS.replace("fade: 0.5", "inertial: 0.1"));
    // A speed of zero is refused before the script is changed.
    desk.state_mut().reload_with(CLIPS);
    desk.run();
    type_into(&mut desk, "speed field", "0");
    assert_eq!(desk.state().text(), CLIPS);
    let message = desk.state().viewer.message.clone().unwrap_or_default();
    assert!(message.contains("a clip has a speed of at least 0.001"), "{message}");
}

/// An emissive strength needs an emissive color, and is removed with it; the transparency of a shape is one of three words.
#[test]
fn shape_materials_are_edited_with_the_options_of_the_script() {
    const SHAPE: &str = "stage(#{ fps: 25, length: 4.0 });
cast(\"ball\", shape(\"sphere\", #{ color: \"#ff0000\" }));
";
    let mut desk = Place::new(SHAPE).harness(vec2(1500.0, 1000.0));
    desk.state_mut().viewer.selection = Some(Selected::Actor("ball".into()));
    desk.run();
    assert!(desk.query_by_label("emissive_strength field").is_none());
    type_into(&mut desk, "asset emissive hex", "#ffffff");
    type_into(&mut desk, "emissive_strength field", "4");
    let material =
        |desk: &Desk| desk.state().viewer.scene.as_ref().unwrap().stage.actors[0].asset.materials[0].clone();
    assert_eq!(material(&desk).emissive, glam::Vec3::splat(4.0), "{}", desk.state().text());
    reset(&mut desk, "emissive");
    assert_eq!(desk.state().text(), SHAPE);
    desk.get_by_label("alpha: opaque").click();
    desk.run();
    desk.get_by_label("blend").click();
    desk.run();
    desk.state_mut().reload();
    desk.run();
    assert_eq!(desk.state().text(), SHAPE.replace("#ff0000\"", "#ff0000\", alpha: \"blend\""));
    assert_eq!(material(&desk).alpha_mode, choreo_asset::AlphaMode::Blend);
}

/// A drag by one point changes a number by a hundredth of its value, with Shift by a tenth of that.
#[test]
fn the_drag_speed_of_a_number_grows_with_its_value() {
    const SCENE: &str = "stage(#{ fps: 25, length: 4.0 });
effect(\"bloom\", #{ threshold: 0.9 });
text(\"Hello\", #{ size: 0.12 });
";
    for (what, field, name, now) in [
        (Selected::Effect(0), "threshold number", "threshold: ", 0.9),
        (Selected::Title(0), "size field", "size: ", 0.12),
    ] {
        for (held, fastest) in [(Modifiers::NONE, 0.5), (Modifiers::SHIFT, 0.05)] {
            let mut desk = Place::new(SCENE).harness(vec2(1500.0, 1000.0));
            desk.state_mut().viewer.selection = Some(what.clone());
            desk.run();
            assert!(desk.query_by_role_and_label(Role::Slider, "threshold").is_none());
            let at = desk.get_by_label(field).rect().center();
            desk.event(egui::Event::ModifiersChanged(held));
            drag(&mut desk, at, at + vec2(30.0, 0.0));
            let text = desk.state().text();
            let number = text.split(name).nth(1).and_then(|rest| rest.split([',', ' ']).next()).unwrap();
            let to: f64 = number.parse().unwrap();
            assert!(to > now && to - now <= fastest * now, "{held:?}: {now} became {to}");
        }
    }
}
