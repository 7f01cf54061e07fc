//! The menu that puts something new on stage.

use super::hint::Hint;
use crate::app::Viewer;
use choreo_session::edit::{Addition, SHAPES};
use egui::Ui;

/// Names and hints of what is added without a further choice.
const PLAIN: [(&str, &str, Addition); 2] = [
    ("Character", "the built-in character, in a color of its own", Addition::Character),
    ("Title", "words over the frame, from the playhead on", Addition::Title),
];
const ORBIT: (&str, &str, Addition) =
    ("Around the middle", "circles the stage, and is on from the playhead on", Addition::Orbit);
const LIGHTS: [(&str, &str, Addition); 5] = [
    ("Sun", "light from one direction, with a shadow", Addition::Sun),
    ("Point", "light from a point to all sides", Addition::Point),
    ("Spot", "a cone of light, with a shadow", Addition::Spot),
    ("Ambient", "the same light from all sides", Addition::Ambient),
    ("Studio", "a room with soft boxes, as light and reflections", Addition::StudioSky),
];

/// Commands of the menu, for the palette: the words of each, and what it adds; a camera where `None`.
pub fn commands(viewer: &Viewer) -> Vec<(String, Option<Addition>)> {
    let plain = PLAIN.iter().chain(&LIGHTS).map(|(name, _, what)| (name.to_string(), Some(what.clone())));
    let shapes = SHAPES.iter().map(|kind| (format!("shape: {kind}"), Some(Addition::Shape(kind))));
    let effects = effects(viewer).into_iter().map(|name| {
        let what = Addition::Effect(name.clone());
        (format!("effect: {name}"), Some(what))
    });
    let others = [
        ("Camera".to_string(), None),
        ("Camera around the middle".to_string(), Some(Addition::Orbit)),
        ("Marker".to_string(), Some(Addition::Marker)),
    ];
    let all = plain.chain(others).chain(shapes).chain(effects);
    all.map(|(name, what)| (format!("add {}", name.to_lowercase()), what)).collect()
}

/// Adds something to the script; a camera where `None`.
pub fn add(viewer: &mut Viewer, what: Option<&Addition>) {
    viewer.edit(|v| match what {
        Some(what) => v.add(what),
        None => v.add_camera_of_view(),
    });
}

pub fn menu(ui: &mut Ui, viewer: &mut Viewer) {
    // Dropped files that are shown are not the script.
    let can = viewer.path.is_some() && viewer.scene.is_some() && viewer.guests.is_empty();
    ui.add_enabled_ui(can, |ui| ui.menu_button("Add", |ui| entries(ui, viewer)));
}

fn entries(ui: &mut Ui, viewer: &mut Viewer) {
    let mut wanted: Option<Option<Addition>> = None;
    let entry = |ui: &mut Ui, (name, about, what): &(&str, &str, Addition)| {
        ui.button(*name).hint(*about).clicked().then(|| Some(what.clone()))
    };
    wanted = entry(ui, &PLAIN[0]).or(wanted);
    ui.menu_button("Shape", |ui| {
        for kind in SHAPES {
            if ui.button(kind).clicked() {
                wanted = Some(Some(Addition::Shape(kind)));
            }
        }
    });
    ui.menu_button("Camera", |ui| {
        if ui.button("From this view").hint("it is on from the playhead on").clicked() {
            wanted = Some(None);
        }
        wanted = entry(ui, &ORBIT).or(wanted.take());
    });
    ui.menu_button("Light", |ui| {
        for light in &LIGHTS {
            wanted = entry(ui, light).or(wanted.take());
        }
    });
    wanted = entry(ui, &PLAIN[1]).or(wanted);
    ui.menu_button("Effect", |ui| {
        egui::ScrollArea::vertical().show(ui, |ui| {
            for name in effects(viewer) {
                if ui.button(&name).clicked() {
                    wanted = Some(Some(Addition::Effect(name)));
                }
            }
        });
    });
    if ui.button("Marker").hint("a named time at the playhead").clicked() {
        wanted = Some(Some(Addition::Marker));
    }
    if let Some(what) = wanted {
        add(viewer, what.as_ref());
        ui.close();
    }
}

/// Effects that the script can use.
fn effects(viewer: &Viewer) -> Vec<String> {
    let Some(scene) = &viewer.scene else { return Vec::new() };
    let mut names: Vec<String> = scene.registry.effect_names().map(str::to_string).collect();
    names.sort();
    names
}
