//! Accessibility: everything that can be pressed, typed into or dragged has a name for assistive technologies.

use crate::place::{Desk, Place};
use choreo_viewer::library::file_dialog::Purpose;
use choreo_viewer::library::templates::TEMPLATES;
use choreo_viewer::state::selection::Selected;
use egui::accesskit::Role;
use egui::vec2;
use egui_kittest::kittest::{NodeT, Queryable};
use std::collections::BTreeSet;

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 25, length: 4.0, samples: 1 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).until(2.0).then(moves.clip("Wave"), #{ fade: 0.8 });
ada.play(moves.clip("Wave")).on("RightArm");
ada.reach("LeftHand", [0.4, 1.2, 0.3]);
ada.look_at([0.0, 1.0, 3.0]);
let ball = cast("ball", shape("sphere", #{ size: 0.3 })).at(0.0, 2.0, 0.0).attach(ada.joint("Head"));
ball.key("scale", [[0.0, 1], [2.0, 2]]);
camera("wide").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]).key("fov", [[0.0, 40], [2.0, 50]]);
camera("round").orbit(ada, #{ distance: 4.0 }).cut(2.0);
sun(#{ direction: [-0.5, -1.0, -0.5], shadow: #{ size: 1024 } });
spot(#{ position: [1, 2, 1], look_at: [0, 1, 0] });
effect("vignette", #{ strength: 0.5 }).from(1.0);
effect("bloom");
text("Title", #{ at: [0.5, 0.85] }).from(1.0).until(2.0).fade(0.3);
sky("studio");
marker("hello", 1.0);
"##;

/// Roles of widgets that are pressed, typed into, dragged or chosen, and of images.
const NAMED: [Role; 15] = [
    Role::Button,
    Role::CheckBox,
    Role::RadioButton,
    Role::TextInput,
    Role::MultilineTextInput,
    Role::SearchInput,
    Role::SpinButton,
    Role::Slider,
    Role::ComboBox,
    Role::ColorWell,
    Role::MenuItem,
    Role::Link,
    Role::Image,
    Role::Tab,
    Role::Window,
];

/// Widgets of the window without a name, with their rectangles.
fn nameless(desk: &Desk) -> Vec<String> {
    let all = desk.root().children_recursive();
    let bare = all.filter(|node| {
        let node = node.accesskit_node();
        let name = node.label().unwrap_or_default();
        NAMED.contains(&node.role()) && name.trim().is_empty()
    });
    bare.map(|node| {
        let around = node.parent().map(|parent| format!("{:?}", parent.accesskit_node().label()));
        let inside = node.accesskit_node();
        format!("{:?} {:?} at {:?} in {around:?}", inside.role(), inside.value(), node.rect())
    })
    .collect()
}

fn note(all: &mut BTreeSet<String>, desk: &Desk, scene: &str) {
    all.extend(nameless(desk).into_iter().map(|bare| format!("{scene}: {bare}")));
}

#[test]
fn every_interactive_widget_has_an_accessible_name() {
    let mut place = Place::new(SCRIPT);
    place.paint();
    let mut desk = place.harness(vec2(1900.0, 1300.0));
    let mut all = BTreeSet::new();
    let cue = |layer, cue| Selected::Cue { actor: "ada".into(), layer, cue };
    for what in [
        None,
        Some(Selected::Actor("ada".into())),
        Some(Selected::Actor("ball".into())),
        Some(cue(0, 0)),
        Some(cue(0, 1)),
        Some(cue(1, 0)),
        Some(Selected::Camera("wide".into())),
        Some(Selected::Camera("round".into())),
        Some(Selected::Light(0)),
        Some(Selected::Light(1)),
        Some(Selected::Effect(0)),
        Some(Selected::Effect(1)),
        Some(Selected::Title(0)),
        Some(Selected::Sky),
    ] {
        desk.state_mut().viewer.selection = what.clone();
        desk.run();
        note(&mut all, &desk, &format!("{what:?}"));
    }
    desk.state_mut().viewer.selection = Some(Selected::Actor("ball".into()));
    for tab in ["Curves", "Messages", "Script", "Explain", "Performance", "Render", "Tests", "Assets"] {
        let label = format!("{tab} tab");
        if desk.query_by_label(&label).is_none() {
            desk.get_by_label("Panels").click();
            desk.run();
            desk.get_all_by_label(tab).last().unwrap().click();
            desk.run();
        } else {
            desk.get_by_label(&label).click();
        }
        desk.run();
        note(&mut all, &desk, tab);
    }
    desk.state_mut().viewer.documents.open_dialog(Purpose::New(TEMPLATES[0]), None);
    desk.run();
    note(&mut all, &desk, "file dialog");
    desk.state_mut().viewer.documents.dialog = None;
    for key in [egui::Key::F1, egui::Key::P] {
        let command = if key == egui::Key::P { egui::Modifiers::COMMAND } else { egui::Modifiers::NONE };
        desk.key_press_modifiers(command, key);
        desk.run();
        note(&mut all, &desk, &format!("{key:?}"));
    }
    desk.key_press(egui::Key::Escape);
    desk.state_mut().viewer.documents.shows_start_page = true;
    desk.run();
    note(&mut all, &desk, "start page");
    assert!(all.is_empty(), "without a name:\n{}", all.into_iter().collect::<Vec<_>>().join("\n"));
}
