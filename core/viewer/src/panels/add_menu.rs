//! Menu that adds new objects to the scene.

use super::hint::Hint;
use crate::app::Viewer;
use crate::editing::constraining::{ConstraintCall, NewConstraint};
use crate::state::selection::Selected;
use choreo_session::edit::{Addition, SHAPES};
use egui::Ui;

/// Names, hints and additions that need no further choice.
const OBJECT_ENTRIES: [(&str, &str, Addition); 2] = [
    ("Character", "the built-in character, in a color of its own", Addition::Character),
    ("Title", "text over the frame, from the playhead on", Addition::Title),
];
const ORBIT_ENTRY: (&str, &str, Addition) =
    ("Around the middle", "circles the stage; active from the playhead on", Addition::Orbit(None));
/// Largest number of actors that cameras are offered for.
const MAX_ACTORS: usize = 100;
const LIGHT_ENTRIES: [(&str, &str, Addition); 5] = [
    ("Sun", "light from one direction, with a shadow", Addition::Sun),
    ("Point", "light from a point to all sides", Addition::Point),
    ("Spot", "a cone of light, with a shadow", Addition::Spot),
    ("Ambient", "the same light from all sides", Addition::Ambient),
    ("Studio", "a room with soft boxes, as light and reflections", Addition::StudioSky),
];

/// Additions for the command palette with their labels. `None`: a camera at the view.
pub(super) fn palette_additions(viewer: &Viewer) -> Vec<(String, Option<Addition>)> {
    let plain = OBJECT_ENTRIES
        .iter()
        .chain(&LIGHT_ENTRIES)
        .map(|(name, _, what)| (name.to_string(), Some(what.clone())));
    let shapes = SHAPES.iter().map(|kind| (format!("shape: {kind}"), Some(Addition::Shape(kind))));
    let effects = effect_names(viewer).into_iter().map(|name| {
        let what = Addition::Effect(name.clone());
        (format!("effect: {name}"), Some(what))
    });
    let others = [
        ("Camera".to_string(), None),
        ("Camera around the middle".to_string(), Some(Addition::Orbit(None))),
        ("Marker".to_string(), Some(Addition::Marker)),
    ];
    let all = plain.chain(others).chain(shapes).chain(effects);
    let all = all.map(|(name, what)| (format!("add {}", name.to_lowercase()), what));
    let cameras = camera_subjects(viewer).into_iter().flat_map(|name| {
        [
            (format!("add camera following {name}"), Some(Addition::Follow(name.clone()))),
            (format!("add camera around {name}"), Some(Addition::Orbit(Some(name)))),
        ]
    });
    all.chain(cameras).collect()
}

/// Actors that a camera can show: the selected one, else all.
fn camera_subjects(viewer: &Viewer) -> Vec<String> {
    let Some(scene) = &viewer.scene else { return Vec::new() };
    let selected = viewer.selection.as_ref().and_then(Selected::actor);
    let all = scene.stage.actors.iter().map(|actor| actor.name.clone());
    all.filter(|name| selected.is_none_or(|selected| selected == name)).take(MAX_ACTORS).collect()
}

/// Entries for cameras that show the selected actor, else menus of all actors.
fn show_camera_entries(ui: &mut Ui, viewer: &Viewer) -> Option<Addition> {
    const FOLLOW_HINT: &str = "moves along with it; active from the playhead on";
    const ORBIT_HINT: &str = "circles it; active from the playhead on";
    type CameraAddition = (&'static str, &'static str, fn(String) -> Addition);
    let kinds: [CameraAddition; 2] = [
        ("Camera following", FOLLOW_HINT, Addition::Follow),
        ("Camera around", ORBIT_HINT, |name| Addition::Orbit(Some(name))),
    ];
    let (all, mut choice) = (camera_subjects(viewer), None);
    let is_selected = viewer.selection.as_ref().and_then(Selected::actor).is_some();
    for (words, about, make) in kinds {
        if let ([name], true) = (&all[..], is_selected) {
            let button = ui.button(format!("{words} {name}")).hint(about);
            choice = button.clicked().then(|| make(name.clone())).or(choice);
            continue;
        }
        ui.add_enabled_ui(!all.is_empty(), |ui| {
            ui.menu_button(words, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| {
                    for name in &all {
                        let button = ui.button(name).hint(about);
                        choice = button.clicked().then(|| make(name.clone())).or(choice.take());
                    }
                });
            });
        });
    }
    choice
}

/// Constraints of the selected actor for the command palette, with their labels.
pub(super) fn palette_constraints(viewer: &Viewer) -> Vec<(String, NewConstraint)> {
    let targets = constraint_targets(viewer);
    let of = |call: ConstraintCall| {
        let all = std::iter::once(None).chain(targets.iter().cloned().map(Some));
        all.map(move |target| {
            let shown = target.as_deref().unwrap_or("a point");
            let words = format!("add constraint: {} {shown}", call.label().to_lowercase());
            (words, NewConstraint { call, target })
        })
    };
    ConstraintCall::ALL.into_iter().flat_map(of).collect()
}

/// Actors that can be the target of a constraint of the selected actor.
fn constraint_targets(viewer: &Viewer) -> Vec<String> {
    let Some(selected) = viewer.selection.as_ref().and_then(Selected::actor) else { return Vec::new() };
    let all = viewer.scene.iter().flat_map(|scene| &scene.stage.actors).map(|actor| actor.name.clone());
    all.filter(|name| name != selected).take(MAX_ACTORS).collect()
}

/// Menu of constraints for the selected actor.
fn show_constraint_menu(ui: &mut Ui, viewer: &Viewer) -> Option<NewConstraint> {
    let is_selected = viewer.selection.as_ref().and_then(Selected::actor).is_some();
    let (targets, mut choice) = (constraint_targets(viewer), None);
    let add = |ui: &mut Ui| {
        for call in ConstraintCall::ALL {
            let about = "of the selected joint, else of its right hand or head; from the playhead on";
            if ui.button(format!("{} a point", call.label())).hint(about).clicked() {
                choice = Some(NewConstraint { call, target: None });
            }
            ui.add_enabled_ui(!targets.is_empty(), |ui| {
                ui.menu_button(call.label(), |ui| {
                    egui::ScrollArea::vertical().show(ui, |ui| {
                        for name in &targets {
                            if ui.button(name).hint(about).clicked() {
                                choice = Some(NewConstraint { call, target: Some(name.clone()) });
                            }
                        }
                    });
                });
            });
        }
    };
    let menu = ui.add_enabled_ui(is_selected, |ui| ui.menu_button("Constraint", add));
    if !is_selected {
        menu.response.hint("first select the actor for the constraint");
    }
    choice
}

/// Adds an object to the script. `None`: a camera at the view.
pub(super) fn add_object(viewer: &mut Viewer, what: Option<&Addition>) {
    viewer.edit(|v| match what {
        Some(what) => v.add_object(what),
        None => v.add_camera_of_view(),
    });
}

pub(super) fn show_menu(ui: &mut Ui, viewer: &mut Viewer) {
    ui.add_enabled_ui(can_add(viewer), |ui| ui.menu_button("Add", |ui| show_entries(ui, viewer)));
}

/// Whether there is a script to add to; previewed files are not one.
pub(super) fn can_add(viewer: &Viewer) -> bool {
    viewer.path.is_some() && viewer.scene.is_some() && viewer.previewed_files.is_empty()
}

/// Entries of the menu.
pub(super) fn show_entries(ui: &mut Ui, viewer: &mut Viewer) {
    let mut choice: Option<Option<Addition>> = None;
    let entry = |ui: &mut Ui, (name, about, what): &(&str, &str, Addition)| {
        ui.button(*name).hint(*about).clicked().then(|| Some(what.clone()))
    };
    choice = entry(ui, &OBJECT_ENTRIES[0]).or(choice);
    ui.menu_button("Shape", |ui| {
        for kind in SHAPES {
            if ui.button(kind).clicked() {
                choice = Some(Some(Addition::Shape(kind)));
            }
        }
    });
    ui.menu_button("Camera", |ui| {
        if ui.button("From this view").hint("active from the playhead on").clicked() {
            choice = Some(None);
        }
        choice = entry(ui, &ORBIT_ENTRY).or(choice.take());
        choice = show_camera_entries(ui, viewer).map(Some).or(choice.take());
    });
    ui.menu_button("Light", |ui| {
        for light in &LIGHT_ENTRIES {
            choice = entry(ui, light).or(choice.take());
        }
    });
    choice = entry(ui, &OBJECT_ENTRIES[1]).or(choice);
    ui.menu_button("Effect", |ui| {
        egui::ScrollArea::vertical().show(ui, |ui| {
            for name in effect_names(viewer) {
                if ui.button(&name).clicked() {
                    choice = Some(Some(Addition::Effect(name)));
                }
            }
        });
    });
    if ui.button("Marker").hint("a named time at the playhead").clicked() {
        choice = Some(Some(Addition::Marker));
    }
    if let Some(new) = show_constraint_menu(ui, viewer) {
        viewer.edit(|v| v.add_constraint(&new));
        ui.close();
    }
    if let Some(what) = choice {
        add_object(viewer, what.as_ref());
        ui.close();
    }
}

/// Effects that the script can use.
fn effect_names(viewer: &Viewer) -> Vec<String> {
    let Some(scene) = &viewer.scene else { return Vec::new() };
    let mut names: Vec<String> = scene.registry.effect_names().map(str::to_string).collect();
    names.sort();
    names
}
