//! Menus Add and Edit, the fields of the stage, and a field that loses the focus by a click elsewhere.

use crate::place::Place;
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_session::edit::{Addition, SHAPES};
use choreo_stage::{ConstraintKind, Target};
use choreo_viewer::commands::external_editor::Editor;
use choreo_viewer::editing::constraining::{ConstraintCall, NewConstraint};
use choreo_viewer::state::selection::Selected;
use choreo_viewer::state::trail::JointRef;
use egui::{Event, Key, Modifiers, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::{DVec2, DVec3, Vec3Swizzles};

const SCRIPT: &str = r##"// A scene.
stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let coral = load("choreo:mannequin", #{ color: "coral" });
let ada = cast("ada", coral);
ada.play(coral.clip("Walk")).until(2.0)
    .then(coral.clip("Wave"), #{ fade: 0.4 });
camera("wide").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
sun(#{ direction: [-0.5, -1.0, -0.5] });
effect("vignette");
"##;

fn harness_with_script(script: &str) -> Harness<'static, Place> {
    let mut place = Place::new(script);
    place.paint();
    place.harness(vec2(1500.0, 1000.0))
}

fn click(desk: &mut Harness<'static, Place>, label: &str) {
    // A widget's accessible name includes its shortcut.
    desk.get_by_label_contains(label).click();
    desk.run();
}

/// All entries of the menu are added to one script, which must load without an error or a warning.
#[test]
fn every_addition_loads_without_an_error() {
    let mut place = Place::new(SCRIPT);
    place.paint();
    let effects: Vec<String> =
        place.viewer.scene.as_ref().unwrap().registry.effect_names().map(str::to_string).collect();
    assert!(effects.len() > 10, "{effects:?}");
    let mut all = vec![
        Addition::Character,
        Addition::Character,
        Addition::Orbit(None),
        Addition::Orbit(Some("ada".into())),
        Addition::Follow("ada".into()),
        Addition::Sun,
        Addition::Point,
        Addition::Spot,
        Addition::Ambient,
        Addition::StudioSky,
        Addition::Title,
        Addition::Marker,
        Addition::Marker,
    ];
    all.extend(SHAPES.map(Addition::Shape));
    all.extend(effects.into_iter().map(Addition::Effect));
    for what in all {
        // Each entry on a separate stage, so that none depends on another.
        let mut place = Place::new(SCRIPT);
        place.viewer.add_object(&what).unwrap();
        let before = place.viewer.selection.clone();
        place.reload();
        assert!(place.viewer.problems.is_empty(), "{what:?}: {:?}", place.viewer.problems);
        assert_eq!(place.viewer.selection, before, "{what:?} is selected, and there");
    }
    place.viewer.add_camera_of_view().unwrap();
    place.reload();
    assert!(place.viewer.problems.is_empty(), "{:?}", place.viewer.problems);
    let text = place.text();
    assert!(
        text.ends_with(".cut(0.0);\n") && text.contains("camera(\"view 1\").at(0.0, 1.0, 5.0)"),
        "{text}"
    );
}

/// Each kind is added twice: later additions are written behind.
#[test]
fn additions_are_written_to_the_script_in_order() {
    let mut place = Place::new(SCRIPT);
    place.paint();
    let kinds = [
        Addition::Character,
        Addition::Shape("box"),
        Addition::Orbit(None),
        Addition::Orbit(Some("ada".into())),
        Addition::Follow("ada".into()),
        Addition::Sun,
        Addition::Point,
        Addition::Spot,
        Addition::Title,
        Addition::Effect("vignette".into()),
        Addition::Marker,
    ];
    for kind in kinds.iter().flat_map(|kind| [kind, kind]) {
        let before = place.text();
        place.viewer.add_object(kind).unwrap();
        assert!(place.text().starts_with(&before), "{kind:?} in {}", place.text());
        place.reload();
    }
    place.viewer.selection = Some(Selected::Actor("ada".into()));
    for call in [ConstraintCall::LookAt, ConstraintCall::Reach] {
        place.viewer.add_constraint(&NewConstraint { call, target: None }).unwrap();
        place.reload();
    }
    let text = place.text();
    let at = |call: &str| text.find(call).unwrap_or_else(|| panic!("no {call} in {text}"));
    assert!(at("ada.look_at(") < at("ada.reach("), "{text}");
}

#[test]
fn characters_come_from_the_menu_in_their_own_colors_beside_each_other() {
    let mut desk = harness_with_script(SCRIPT);
    for _ in 0..2 {
        desk.get_all_by_label("Add").next().unwrap().click();
        desk.run();
        click(&mut desk, "Character");
        desk.state_mut().reload();
        desk.run();
    }
    let text = desk.state().text();
    let added = "let bob_model = load(\"choreo:mannequin\", #{ color: \"teal\" });\nlet bob = cast(\"bob\", bob_model).at(1.0, 0.0, 0.0);\n\
                 bob.play(bob_model.clip(\"Idle\"));\n\
                 let cleo_model = load(\"choreo:mannequin\", #{ color: \"gold\" });\nlet cleo = cast(\"cleo\", cleo_model).at(-1.0, 0.0, 0.0);\n\
                 cleo.play(cleo_model.clip(\"Idle\"));\n";
    assert_eq!(text, format!("{SCRIPT}{added}"));
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("cleo".into())));
    // The menu Edit undoes it, and Delete removes the selected object with all lines that mention it.
    desk.get_by_label("Edit").click();
    desk.run();
    click(&mut desk, "Undo");
    desk.state_mut().reload();
    desk.state_mut().viewer.selection = Some(Selected::Actor("bob".into()));
    desk.run();
    desk.get_by_label("Edit").click();
    desk.run();
    click(&mut desk, "Delete");
    assert_eq!(desk.state().text(), SCRIPT, "the file that only he used goes, too");
    for (what, line) in [
        (Selected::Light(0), "sun(#{ direction: [-0.5, -1.0, -0.5] });\n"),
        (Selected::Effect(0), "effect(\"vignette\");\n"),
        (Selected::Camera("wide".into()), "camera(\"wide\").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);\n"),
    ] {
        desk.state_mut().write(SCRIPT);
        desk.state_mut().reload();
        desk.state_mut().viewer.delete_object(&what).unwrap();
        assert_eq!(desk.state().text(), SCRIPT.replace(line, ""));
    }
}

#[test]
fn duplicating_an_actor_copies_all_lines_that_mention_it() {
    let mut desk = harness_with_script(SCRIPT);
    for (what, copy, more) in [
        (
            Selected::Actor("ada".into()),
            Selected::Actor("ada 2".into()),
            "let ada_2 = cast(\"ada 2\", coral).at(WIDTH, 0.0, 0.0);\nada_2.play(coral.clip(\"Walk\")).until(2.0)\n    \
             .then(coral.clip(\"Wave\"), #{ fade: 0.4 });\n",
        ),
        (
            Selected::Camera("wide".into()),
            Selected::Camera("wide 2".into()),
            "camera(\"wide 2\").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);\n",
        ),
        (Selected::Light(0), Selected::Light(1), "sun(#{ direction: [-0.5, -1.0, -0.5] });\n"),
        (Selected::Effect(0), Selected::Effect(1), "effect(\"vignette\");\n"),
    ] {
        desk.state_mut().reload_with(SCRIPT);
        desk.state_mut().viewer.selection = Some(what.clone());
        desk.run();
        desk.get_by_label("Edit").click();
        desk.run();
        click(&mut desk, "Duplicate");
        let text = desk.state().text();
        desk.state_mut().reload();
        let place = desk.state();
        assert!(place.viewer.problems.is_empty(), "{:?}", place.viewer.problems);
        assert_eq!(place.viewer.selection, Some(copy), "{what:?}");
        let mut more = more.to_string();
        if let Selected::Actor(_) = what {
            let stage = &place.viewer.scene.as_ref().unwrap().stage;
            let beside = stage.actors[1].transform.translation.x - stage.actors[0].transform.translation.x;
            assert!((0.3..=2.0).contains(&beside), "{beside}");
            more = more.replace("WIDTH", &format!("{beside:?}"));
        }
        let mut lines: Vec<&str> = text.lines().collect();
        for line in more.lines() {
            let at = lines.iter().rposition(|other| *other == line);
            lines.remove(at.unwrap_or_else(|| panic!("no {line:?} in {text}")));
        }
        assert_eq!(lines.join("\n") + "\n", SCRIPT, "the copy of {what:?} in {text}");
    }
}

/// The copy of an actor with keyed positions is placed as far beside it as that of a fixed one; computed values stay, and are reported.
#[test]
fn duplicating_a_keyed_actor_offsets_its_keys() {
    let script = |keys: &str| {
        format!(
            "stage(#{{ fps: 25, length: 4.0 }});
let start = [0, 0, 1];
let ada = cast(\"ada\", load(\"choreo:mannequin\"));
ada.key(\"position\", [{keys}, [2.0, [1.5, 0.0, 0.0]]]);
"
        )
    };
    let ada = Selected::Actor("ada".into());
    let mut place = Place::new(&script("[f(10), [0, 0, 1]]"));
    place.viewer.duplicate_object(&ada).unwrap();
    assert_eq!(place.viewer.note, None);
    place.reload();
    assert_eq!(place.viewer.selection, Some(Selected::Actor("ada 2".into())));
    let stage = place.viewer.scene.as_ref().unwrap().stage.clone();
    let offset = |secs: f64| {
        let snapshot = stage.at(Time::from_secs(secs)).unwrap();
        let [a, b] = [0, 1].map(|index| snapshot.actors[index].world_from_model.translation);
        b - a
    };
    let (first, last) = (offset(0.0), offset(3.0));
    assert!(
        (first - last).length() < 1e-9 && (0.3..=2.0).contains(&first.x) && first.z == 0.0,
        "{first} {last}"
    );
    let text = place.text();
    assert!(
        text.contains("ada_2.key(\"position\", [[f(10), [")
            && text.contains("[2.0, [1.5, 0.0, 0.0]]]);\nlet ada_2"),
        "{text}"
    );
    let mut place = Place::new(&script("[f(10), start]"));
    place.viewer.duplicate_object(&ada).unwrap();
    let note = place.viewer.note.clone();
    assert_eq!(
        note.as_deref(),
        Some("the copy is at the same place as the original: line 6 computes its place")
    );
    place.reload();
    assert!(
        place.text().lines().nth(5).unwrap().starts_with("ada_2.key(\"position\", [[f(10), start]"),
        "{}",
        place.text()
    );
}

/// The copy of an actor on a path walks beside it; the copy of an attached actor stays in place, and a note says so.
#[test]
fn duplicating_an_actor_on_a_path_offsets_the_path() {
    let script = "stage(#{ fps: 25, length: 4.0 });
let ada = cast(\"ada\", load(\"choreo:mannequin\")).at(0.0, 0.0, 1.0);
ada.path([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], #{ speed: 0.5 });
let hat = cast(\"hat\", shape(\"box\", #{ size: 0.2 })).attach(ada.joint(\"Head\"));
";
    let mut place = Place::new(script);
    place.viewer.duplicate_object(&Selected::Actor("hat".into())).unwrap();
    let why = "the copy is at the same place as the original: both are attached to ada";
    assert_eq!(place.viewer.note.as_deref(), Some(why));
    place.reload_with(script);
    place.viewer.duplicate_object(&Selected::Actor("ada".into())).unwrap();
    place.reload();
    let stage = place.viewer.scene.as_ref().unwrap().stage.clone();
    let index = |name: &str| stage.actors.iter().position(|actor| actor.name == name).unwrap();
    for secs in [0.0, 1.0, 3.0] {
        let snapshot = stage.at(Time::from_secs(secs)).unwrap();
        let at = |name: &str| snapshot.actors[index(name)].world_from_model.translation;
        let beside = at("ada 2") - at("ada");
        assert!((0.3..=2.0).contains(&beside.x) && beside.yz().length() < 1e-9, "{beside} at {secs}");
    }
}

/// The eight corners of an actor's posed bounds in the image of the active camera, as fractions of half its height and width: computed
/// here from the snapshot in f64.
fn corners_in_image(place: &Place, name: &str, at: Time) -> Vec<DVec2> {
    let scene = place.viewer.scene.clone().unwrap();
    let snapshot = scene.stage.at(at).unwrap();
    let index = scene.stage.actors.iter().position(|actor| actor.name == name).unwrap();
    let (asset, state) = (&scene.stage.actors[index].asset, &snapshot.actors[index]);
    let Projection::Perspective { yfov, .. } = snapshot.camera.projection else { panic!() };
    let [width, height] = scene.stage.settings.size.map(f64::from);
    let tan = (f64::from(yfov) / 2.0).tan();
    let posed = choreo_stage::posed_meshes(asset, state).into_iter().flat_map(|posed| posed.primitives);
    let vertices: Vec<DVec3> = posed.flat_map(|primitive| primitive.positions).collect();
    assert!(vertices.len() > 100);
    let view_from_world = snapshot.camera.world_from_view.inverse();
    let in_view = vertices.into_iter().map(|vertex| view_from_world.transform_point3(vertex));
    in_view.map(|v| DVec2::new(v.x / (width / height), v.y) / (-v.z * tan)).collect()
}

/// The menu has a camera for the selected actor itself, and those for others in submenus; the whole actor is in the image, and large.
#[test]
fn cameras_that_follow_or_circle_an_actor_come_from_the_menu() {
    let script = SCRIPT.replace("ada.play(", "let tiny = cast(\"tiny\", coral).scale(0.05).at(3.0, 0.0, 1.0).turn(120);\nada.key(\"position\", [[0.0, [0, 0, 0]], [4.0, [2, 0, 1]]]);\nada.play(");
    for (name, selected, kind) in [
        ("ada", true, "following"),
        ("ada", false, "around"),
        ("tiny", false, "following"),
        ("tiny", true, "around"),
    ] {
        let mut desk = harness_with_script(&script);
        desk.state_mut().viewer.selection = selected.then(|| Selected::Actor(name.into()));
        desk.run();
        desk.get_all_by_label("Add").next().unwrap().click();
        desk.run();
        for label in ["Camera".to_string(), format!("Camera {kind}")] {
            if !selected || label == "Camera" {
                desk.get_by_label_contains(&format!("{label} ⏵")).click();
                desk.run();
            }
        }
        let label = if selected { format!("Camera {kind} {name}") } else { name.to_string() };
        // The tree and the sequencer show its name, too.
        desk.get_all_by_label(&label).find(|node| node.rect().left() > 180.0).unwrap().click();
        desk.run();
        let place = desk.state_mut();
        assert_eq!(place.viewer.message, None);
        let text = place.text();
        let call = if kind == "around" { ".orbit(" } else { ".follow(" };
        let line = text.lines().last().unwrap();
        assert!(line.contains(&format!("{call}{name}, ")) && line.ends_with(".cut(0.0);"), "{line}");
        place.reload();
        assert!(place.viewer.problems.is_empty(), "{:?}", place.viewer.problems);
        assert!(matches!(&place.viewer.selection, Some(Selected::Camera(camera)) if line.contains(camera)));
        for secs in [0.0, 1.3, 3.9] {
            let seen = corners_in_image(place, name, Time::from_secs(secs));
            let reach = seen.iter().map(|at| at.abs().max_element()).fold(0.0, f64::max);
            assert!((0.35..1.0).contains(&reach), "{line} at {secs}: {reach}");
        }
    }
    // An actor without a variable gets one.
    for (script, wanted) in [
        (
            "cast(\"my box\", shape(\"box\")).at(0.0, 1.0, 0.0);",
            "let my_box = cast(\"my box\", shape(\"box\")).at(0.0, 1.0, 0.0);\n",
        ),
        (
            "cast(\"my box\", shape(\"box\"))\n    .key(\"scale\", [[0.0, 1.0], [1.0, 2.0]]);",
            "let my_box = cast(\"my box\", shape(\"box\"));\nmy_box.key(\"scale\", [[0.0, 1.0], [1.0, 2.0]]);\n",
        ),
    ] {
        let mut place = Place::new(script);
        place.viewer.add_object(&Addition::Follow("my box".into())).unwrap();
        let text = place.text();
        assert!(text.starts_with(&format!("{wanted}camera(\"with my box\").follow(my_box, [")), "{text}");
        place.reload();
        assert!(place.viewer.problems.is_empty(), "{:?}", place.viewer.problems);
        place.viewer.undo().unwrap();
        assert_eq!(place.text(), script);
    }
    // An actor that the script cannot name is refused, with its line.
    let mut place = Place::new("for n in 0..1 { cast(\"box\", shape(\"box\")) }\n");
    let error = place.viewer.add_object(&Addition::Follow("box".into())).unwrap_err().to_string();
    assert!(error.contains("a.rhai:1: a camera needs its name in the script; write let NAME"), "{error}");
}

/// A second call of `ambient` would replace the first.
#[test]
fn a_second_ambient_light_is_refused_with_a_note() {
    let mut place = Place::new(SCRIPT);
    for _ in 0..2 {
        place.viewer.add_object(&Addition::Ambient).unwrap();
        place.reload();
    }
    assert_eq!(place.text().matches("ambient(").count(), 1, "{}", place.text());
    assert!(place.viewer.note.as_ref().unwrap().starts_with("the stage already has ambient light"));
}

/// Ambient light is changed where the script sets it; the row Stage of the tree shows its fields.
#[test]
fn the_stage_is_a_row_of_the_tree_with_ambient_light_and_sky() {
    let call = format!("{SCRIPT}ambient(\"#8fa3c8\", 0.5);\n");
    let number = SCRIPT.replace("length: 4.0", "length: 4.0, ambient: 0.25");
    let map = format!("{SCRIPT}ambient(#{{ up: \"white\", down: \"#404040\", strength: 0.5 }});\n");
    for (script, wanted) in [
        (call.clone(), call.replace("0.5);", "0.75);")),
        (number.clone(), number.replace("ambient: 0.25", "ambient: 0.75")),
        (
            map.clone(),
            map.replace("up: \"white\"", "up: \"#ffffff\"").replace("strength: 0.5", "strength: 0.75"),
        ),
    ] {
        let mut desk = harness_with_script(&script);
        desk.state_mut().viewer.selection = Some(Selected::Light(0));
        desk.run();
        assert!(desk.query_by_label("ambient strength").is_none());
        desk.get_all_by_label("Stage").last().unwrap().click();
        desk.run();
        assert_eq!(desk.state().viewer.selection, None);
        desk.get_by_label("ambient strength").click();
        desk.run();
        desk.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
        desk.event(Event::Text("0.75".into()));
        desk.key_press(egui::Key::Enter);
        desk.run();
        assert_eq!(desk.state().viewer.message, None);
        assert_eq!(desk.state().text(), wanted);
        desk.state_mut().reload();
        assert!(desk.state().viewer.problems.is_empty(), "{:?}", desk.state().viewer.problems);
    }
    // Values that the script computes are not changed.
    let script = format!("{SCRIPT}let s = 0.5;\nambient(\"white\", s * 0.5);\n");
    let mut place = Place::new(&script);
    let now = place.viewer.ambient().unwrap();
    let error = place
        .viewer
        .set_ambient(choreo_viewer::editing::Ambient { strength: 2.0.into(), ..now })
        .unwrap_err();
    assert!(error.to_string().contains("ambient(\"white\", s * 0.5) is computed"), "{error}");
    assert_eq!(place.text(), script);
    // A sky is added here, and is then selected.
    let mut desk = harness_with_script(SCRIPT);
    desk.get_by_label("add the studio").click();
    desk.run();
    assert_eq!(desk.state().text(), format!("{SCRIPT}sky(\"studio\");\n"));
    desk.state_mut().reload();
    desk.run();
    desk.get_by_label("select the sky").click();
    desk.run();
    assert_eq!(desk.state().viewer.selection, Some(Selected::Sky));
}

/// The text editor starts only on an explicit command, and a missing program is reported.
#[test]
fn selecting_a_line_does_not_open_the_editor_by_itself() {
    let mut desk = harness_with_script(SCRIPT);
    desk.state_mut().viewer.editor = Editor { command: Some("no-such-editor --wait".into()), terminal: None };
    desk.state_mut().viewer.script_scroll_line = Some(4);
    desk.run();
    let pos = desk.get_by_label_contains("   4 let ada").rect().left_center() + vec2(60.0, 0.0);
    let click = |desk: &mut Harness<'static, Place>, button, modifiers, times: usize| {
        desk.hover_at(pos);
        desk.run();
        let event = |pressed| Event::PointerButton { pos, button, pressed, modifiers };
        let events = (0..times).flat_map(|_| [true, false].map(event));
        match modifiers.is_none() {
            true => desk.input_mut().events.extend(events),
            false => events.for_each(|event| desk.event_modifiers(event, modifiers)),
        }
        desk.step();
        desk.run();
    };
    let primary = egui::PointerButton::Primary;
    click(&mut desk, primary, egui::Modifiers::NONE, 2);
    assert_eq!(desk.state().viewer.message, None);
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("ada".into())));
    let missing = "no program \"no-such-editor\" was found to open the script in; set VISUAL in the environment to one that is installed";
    click(&mut desk, primary, egui::Modifiers::COMMAND, 1);
    assert_eq!(desk.state().viewer.message.as_deref(), Some(missing));
    desk.state_mut().viewer.message = None;
    click(&mut desk, egui::PointerButton::Secondary, egui::Modifiers::NONE, 1);
    desk.get_by_label("Open line 4 in the editor").click();
    desk.run();
    assert_eq!(desk.state().viewer.message.as_deref(), Some(missing));
    // A missing editor that needs a terminal.
    let editor = Editor { command: Some("nvim".into()), terminal: Some("no-such-terminal".into()) };
    let error = editor.open(std::path::Path::new("a.rhai"), 1).unwrap_err().to_string();
    assert!(error.contains("no program \"") && error.contains("set "), "{error}");
}

/// A number is typed, and the next click selects another clip: the number still applies to the first.
#[test]
fn typed_text_is_applied_to_its_own_object_when_another_is_clicked() {
    let mut desk = harness_with_script(SCRIPT);
    let cue = |cue| Selected::Cue { actor: "ada".into(), layer: 0, cue };
    desk.state_mut().viewer.selection = Some(cue(0));
    desk.run();
    let field = desk.get_by_label("until field").rect().center();
    desk.get_by_label("until field").click();
    desk.run();
    desk.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
    desk.event(Event::Text("1.5".into()));
    desk.run();
    assert_eq!(desk.get_by_label("until field").rect().center().y, field.y);
    desk.get_all_by_label_contains("Wave").find(|node| node.rect().top() > 600.0).expect("its bar").click();
    desk.run();
    assert_eq!(desk.state().text(), SCRIPT.replace("until(2.0)", "until(1.5)"));
    desk.state_mut().reload();
    desk.run();
    assert_eq!(desk.state().viewer.selection, Some(cue(1)));
}

/// An end before the start is refused, however it is typed.
#[test]
fn an_end_before_the_start_is_refused() {
    let mut place = Place::new(SCRIPT);
    let wave = Selected::Cue { actor: "ada".into(), layer: 0, cue: 1 };
    let error =
        place.viewer.set_cue_time(&wave, choreo_session::edit::CueTime::End, 1.0).unwrap_err().to_string();
    assert!(error.contains("Wave would end at 1.000 s, but it begins at 2.000 s"), "{error}");
    assert_eq!(place.text(), SCRIPT);
}

/// Changing one number of a direction keeps the others, whatever its length; a camera is moved by its numbers.
#[test]
fn changing_one_number_keeps_the_text_of_its_neighbors() {
    let mut desk = harness_with_script(SCRIPT);
    for (what, label, typed, wanted) in [
        (Selected::Light(0), "light x", "0.25", SCRIPT.replace("[-0.5, -1.0, -0.5]", "[0.25, -1.0, -0.5]")),
        (
            Selected::Camera("wide".into()),
            "camera at x",
            "2.5",
            SCRIPT.replace(".at(0.0, 1.0, 5.0)", ".at(2.5, 1.0, 5.0)"),
        ),
        (
            Selected::Camera("wide".into()),
            "camera look_at y",
            "0.5",
            SCRIPT.replace("look_at([0.0, 1.0, 0.0])", "look_at([0.0, 0.5, 0.0])"),
        ),
    ] {
        desk.state_mut().reload_with(SCRIPT);
        desk.state_mut().viewer.selection = Some(what);
        desk.run();
        desk.get_by_label(label).click();
        desk.run();
        desk.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
        desk.event(Event::Text(typed.into()));
        desk.key_press(egui::Key::Enter);
        desk.run();
        assert_eq!(desk.state().text(), wanted, "{label}");
    }
}

#[test]
fn the_stage_is_changed_where_nothing_is_selected() {
    let plain = "// Mine.\nlet a = cast(\"a\", load(\"choreo:mannequin\"));\n";
    for (script, wanted) in [
        (SCRIPT, SCRIPT.replace("length: 4.0", "length: 10.5")),
        (plain, plain.replace("// Mine.\n", "// Mine.\nstage(#{ length: 10.5 });\n")),
    ] {
        let mut desk = harness_with_script(script);
        desk.get_by_label("stage length").click();
        desk.run();
        desk.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
        desk.event(Event::Text("10.5".into()));
        desk.key_press(egui::Key::Enter);
        desk.run();
        assert_eq!(desk.state().text(), wanted);
        desk.state_mut().reload();
        assert!(desk.state().viewer.problems.is_empty());
    }
}

/// A length that the script gives in frames stays in frames; a typed expression is kept as typed.
#[test]
fn the_length_of_the_stage_stays_in_frames() {
    let script = SCRIPT.replace("length: 4.0", "length: f(100)");
    for (typed, wanted) in [("10", "f(250)"), ("9.87", "f(247)"), ("f(75)", "f(75)"), ("31/3", "31.0 / 3.0")]
    {
        let mut desk = harness_with_script(&script);
        desk.get_by_label("stage length").click();
        desk.run();
        desk.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
        desk.event(Event::Text(typed.into()));
        desk.key_press(Key::Enter);
        desk.run();
        assert_eq!(desk.state().text(), script.replace("f(100)", wanted), "{typed}");
        desk.state_mut().reload();
        assert!(desk.state().viewer.problems.is_empty(), "{:?}", desk.state().viewer.problems);
    }
}

/// Each field of the stage writes its own option, and displays the value of the stage.
#[test]
fn every_stage_field_changes_only_its_own_option() {
    let plain = "stage(#{ length: 2.0 });\nlet a = cast(\"a\", load(\"choreo:mannequin\"));\n";
    let mut desk = harness_with_script(plain);
    for (label, typed, wanted) in [
        ("stage fps", "25", "fps: 25.0"),
        ("stage width", "640", "size: [640, 720]"),
        ("stage height", "480", "size: [640, 480]"),
        ("stage exposure", "-1.5", "exposure: -1.5"),
    ] {
        desk.get_by_label(label).click();
        desk.run();
        desk.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
        desk.event(Event::Text(typed.into()));
        desk.key_press(egui::Key::Enter);
        desk.run();
        assert_eq!(desk.state().viewer.message, None);
        assert!(desk.state().text().contains(wanted), "{label}: {}", desk.state().text());
        desk.state_mut().reload();
        desk.run();
        let shown: f64 = desk.get_by_label(label).value().unwrap().parse().unwrap();
        assert_eq!(shown, typed.parse::<f64>().unwrap(), "{label}");
    }
    desk.get_by_role(egui::accesskit::Role::ComboBox).click();
    desk.run();
    desk.get_by_label("agx").click();
    desk.run();
    let settings = "length: 2.0, fps: 25.0, size: [640, 480], exposure: -1.5, view: \"agx\"";
    assert_eq!(desk.state().text(), plain.replace("length: 2.0", settings));
}

const REACHING: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Idle"));
let ball = cast("ball", shape("sphere", #{ size: 0.2 })).at(0.3, 1.2, 0.4);
camera("wide").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
sun(#{ direction: [-0.5, -1.0, -0.5] });
"##;

#[test]
fn constraints_are_added_to_the_selected_actor() {
    let mut desk = harness_with_script(REACHING);
    desk.state_mut().viewer.selection = Some(Selected::Actor("ada".into()));
    desk.run();
    desk.get_all_by_label("Add").next().unwrap().click();
    desk.run();
    click(&mut desk, "Constraint ⏵");
    click(&mut desk, "Hand reaches a point");
    let place = desk.state_mut();
    assert_eq!(place.viewer.message, None);
    let text = place.text();
    let line = text.lines().find(|line| line.starts_with("ada.reach(\"RightHand\", [")).unwrap();
    assert!(line.ends_with("]);"), "{line}");
    assert_eq!(text.replace(&format!("\n{line}"), ""), REACHING);
    place.reload();
    assert!(place.viewer.problems.is_empty(), "{:?}", place.viewer.problems);
    let scene = place.viewer.scene.clone().unwrap();
    let ada = &scene.stage.actors[0];
    let ConstraintKind::Reach(reach) = &ada.constraints[0].kind else { panic!() };
    let Target::Point(point) = reach.target else { panic!() };
    let hand = *reach.joints.last().unwrap() as usize;
    let at = |secs| {
        let snapshot = scene.evaluator.clone().at(Time::from_secs(secs)).unwrap();
        snapshot.actors[0].world_from_joint(hand).unwrap().translation
    };
    assert!((at(1.0) - point).length() < 0.02, "the hand is at {} and not at {point}", at(1.0));
    // Another joint, another actor and a later time.
    let new = |call, target: &str| NewConstraint { call, target: Some(target.into()) };
    place.reload_with(REACHING);
    place.viewer.playhead.seek(Time::from_secs(1.0));
    let joint = scene.stage.actors[0].asset.skeleton.find("LeftHand").unwrap();
    place.viewer.selected_joint = Some(JointRef { actor: "ada".into(), joint });
    place.viewer.add_constraint(&new(ConstraintCall::Reach, "ball")).unwrap();
    place.reload();
    place.viewer.selected_joint = None;
    place.viewer.add_constraint(&new(ConstraintCall::LookAt, "ball")).unwrap();
    place.reload();
    assert!(place.viewer.problems.is_empty(), "{:?}", place.viewer.problems);
    let lines = "size: 0.2 })).at(0.3, 1.2, 0.4);\nada.reach(\"LeftHand\", ball).from(1.0);\nada.look_at(ball).from(1.0);\n";
    assert_eq!(place.text(), REACHING.replace("size: 0.2 })).at(0.3, 1.2, 0.4);\n", lines));
    // The palette finds them, too.
    desk.run();
    desk.key_press_modifiers(Modifiers::COMMAND, Key::P);
    desk.run();
    desk.event(Event::Text("hand reaches ball".into()));
    desk.run();
    desk.key_press(Key::Enter);
    desk.run();
    assert!(desk.state().text().contains("ada.reach(\"RightHand\", ball).from(1.0);"));
    // Without a selected actor there is nothing to constrain.
    let viewer = &mut desk.state_mut().viewer;
    viewer.selection = None;
    let refused = viewer.add_constraint(&NewConstraint { call: ConstraintCall::Reach, target: None });
    let refused = refused.unwrap_err().to_string();
    assert_eq!(refused, "first select the actor for the constraint");
}
