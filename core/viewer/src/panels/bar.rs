//! The bar above the panels: menus, the first problem, the offer of the last change.

use super::actions::{self, Context};
use super::hint::Hint;
use super::presets::Preset;
use super::{Panels, Tab};
use crate::app::Viewer;
use crate::state::settings::SCALES;
use egui::{RichText, Ui};

/// Problems in the tooltip at most; all of them are in Messages.
const MOST_TOLD: usize = 5;

pub fn show(panels: &mut Panels, ui: &mut Ui, viewer: &mut Viewer, now: f64) {
    egui::Panel::top("bar").show(ui, |ui| {
        ui.horizontal(|ui| {
            super::files::menu(ui, viewer);
            edit_menu(panels, ui, viewer, now);
            super::add_menu::menu(ui, viewer);
            ui.menu_button("Panels", |ui| {
                for tab in Tab::ALL {
                    let mut open = panels.is_open(tab);
                    if ui.checkbox(&mut open, tab.title()).changed() {
                        panels.set_open(tab, open);
                    }
                }
                ui.separator();
                for preset in Preset::ALL {
                    if ui.button(preset.name()).clicked() {
                        panels.dock = preset.dock();
                    }
                }
            });
            ui.menu_button("Look", |ui| {
                ui.radio_value(&mut panels.light, false, "Dark");
                ui.radio_value(&mut panels.light, true, "Light");
                ui.separator();
                for scale in [1.0, 1.25, 1.5, 1.75, 2.0] {
                    debug_assert!((SCALES.0..=SCALES.1).contains(&scale));
                    ui.radio_value(&mut panels.scale, scale, format!("{:.0} %", scale * 100.0));
                }
            });
            ui.toggle_value(&mut panels.help, "Keys");
            // The name stands behind the menus, so that they stay where they are however long it is.
            short(ui, RichText::new(&viewer.name).strong(), &viewer.name);
            guests(ui, viewer);
            status(panels, ui, viewer);
        });
    });
}

/// The menu of changes of the script, for the mouse alone.
fn edit_menu(panels: &mut Panels, ui: &mut Ui, viewer: &mut Viewer, now: f64) {
    const ENTRIES: [(&str, &str); 12] = [
        ("undo", "Undo"),
        ("redo", "Redo"),
        ("cut", "Cut"),
        ("copy", "Copy"),
        ("paste", "Paste at the playhead"),
        ("rename", "Rename"),
        ("split", "Split at the playhead"),
        ("duplicate", "Duplicate"),
        ("disable", "Disable, enable"),
        ("delete", "Delete"),
        ("set_keys", "Set keys at the playhead"),
        ("select_all", "Select all clips"),
    ];
    ui.menu_button("Edit", |ui| {
        for (id, name) in ENTRIES {
            let Some(action) = actions::action(id) else { continue };
            let keys = match id {
                // The system's own.
                "cut" => "Ctrl X".to_string(),
                "copy" => "Ctrl C".to_string(),
                "paste" => "Ctrl V".to_string(),
                id => actions::keys_of(viewer, id),
            };
            let button = ui.add(egui::Button::new(name).shortcut_text(keys));
            if button.hint(action.title).clicked() {
                (action.run)(&mut Context { panels, ui, viewer, now });
                ui.close();
            }
        }
    });
}

/// A name that leaves room for the buttons beside it, however long it is; `whole` where the mouse is over it.
fn short(ui: &mut Ui, name: RichText, whole: &str) {
    let room = (ui.ctx().content_rect().width() / 4.0).min(260.0);
    ui.scope(|ui| {
        ui.set_max_width(room);
        ui.add(egui::Label::new(name).truncate().show_tooltip_when_elided(false)).hint(whole);
    });
}

/// Files that were dropped are shown in place of the script.
fn guests(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(first) = viewer.guests.first() else { return };
    let name = first.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let name = match viewer.guests.len() {
        1 => name,
        more => format!("{name} and {} more", more - 1),
    };
    let all: Vec<String> = viewer.guests.iter().map(|guest| guest.display().to_string()).collect();
    ui.separator();
    short(ui, RichText::new(name).color(ui.visuals().warn_fg_color).strong(), &all.join("\n"));
    if viewer.path.is_some() && ui.button("Add to script").clicked() {
        viewer.edit(|v| v.add_guests());
    }
    if ui.button("Back to the script").clicked() {
        viewer.guests_leave = true;
    }
}

/// The first problem, in a line; a click goes there.
fn first_problem(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(first) = viewer.problems.first().filter(|_| viewer.faulty) else { return };
    let (line, whole) = (first.line, first.to_string());
    let message = first.message.lines().next().unwrap_or("");
    let text = if line > 0 { format!("line {line}: {message}") } else { message.to_string() };
    let text = RichText::new(text).color(ui.visuals().error_fg_color);
    let label = ui.add(egui::Label::new(text).truncate().sense(egui::Sense::click()));
    let label = label.hint(RichText::new(whole).monospace());
    if line > 0 && label.on_hover_cursor(egui::CursorIcon::PointingHand).clicked() {
        viewer.go_to = Some(line);
    }
}

fn status(panels: &mut Panels, ui: &mut Ui, viewer: &mut Viewer) {
    let errors = viewer.problems.iter().filter(|p| p.severity == choreo_script::Severity::Error).count();
    let warnings = viewer.problems.len() - errors;
    let visuals = ui.visuals();
    let text = if viewer.faulty {
        let text = match viewer.scene.is_some() {
            true => "faulty: the last good version is shown",
            false => "faulty: nothing to show yet",
        };
        Some(RichText::new(text).color(visuals.error_fg_color).strong())
    } else if viewer.without_vulkan.is_some() && viewer.trouble.len() == 1 {
        // The renderer says the same.
        Some(RichText::new("drawn on the CPU").color(visuals.warn_fg_color))
    } else if !viewer.trouble.is_empty() {
        Some(RichText::new("trouble: see Messages").color(visuals.error_fg_color))
    } else if warnings > 0 {
        let text = if warnings == 1 { "1 warning".to_string() } else { format!("{warnings} warnings") };
        Some(RichText::new(text).color(visuals.warn_fg_color))
    } else {
        None
    };
    if let Some(text) = text {
        let all = viewer.problems.iter().map(ToString::to_string).chain(viewer.trouble.iter().cloned());
        let all: Vec<String> = all.take(MOST_TOLD).collect();
        let label = ui.add(egui::Label::new(text).sense(egui::Sense::click()));
        let label = label.hint(RichText::new(all.join("\n\n")).monospace());
        if label.on_hover_cursor(egui::CursorIcon::PointingHand).clicked() {
            panels.bring(Tab::Messages);
        }
    }
    let right = |ui: &mut Ui| {
        if let Some(shown) = viewer.shown() {
            let millis = |d: std::time::Duration| d.as_secs_f64() * 1e3;
            let all = shown.evaluated_in + shown.planned_in + shown.drawn_in;
            ui.label(format!("{:.1} ms a frame", millis(all))).hint(format!(
                "pose {:.2} ms, plan {:.2} ms, draw {:.2} ms on {}",
                millis(shown.evaluated_in),
                millis(shown.planned_in),
                millis(shown.drawn_in),
                shown.device.name
            ));
            ui.label(format!("{}×{}", shown.size[0], shown.size[1]));
        }
        if let Some(why) = &viewer.message {
            let text = RichText::new(why).color(ui.visuals().warn_fg_color);
            ui.add(egui::Label::new(text).truncate()).hint(why);
        } else if let Some(note) = &viewer.note {
            ui.add(egui::Label::new(note).truncate()).hint(note);
        } else {
            first_problem(ui, viewer);
        }
    };
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), right);
}

/// A change that needs a word first, with the difference.
pub fn offer(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(offer) = &viewer.offer else { return };
    let mut agreed = None;
    let window = egui::Window::new("Change the script?").resizable(false).collapsible(false);
    window.anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).show(ui.ctx(), |ui| {
        ui.set_max_width(640.0);
        ui.label(&offer.why);
        ui.add_space(6.0);
        lines(ui, &offer.difference);
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            if ui.button(&offer.agree).clicked() {
                agreed = Some(Agreed::First);
            }
            if offer.other.is_none() && ui.button("Leave it").clicked() {
                agreed = Some(Agreed::None);
            }
        });
        if let Some(other) = &offer.other {
            ui.add_space(6.0);
            ui.label("or");
            lines(ui, &other.difference);
            ui.add_space(6.0);
            ui.horizontal(|ui| {
                if ui.button(&other.agree).clicked() {
                    agreed = Some(Agreed::Other);
                }
                if ui.button("Leave it").clicked() {
                    agreed = Some(Agreed::None);
                }
            });
        }
    });
    match agreed {
        Some(Agreed::First) => viewer.edit(|v| v.accept_offer()),
        Some(Agreed::Other) => {
            if let Some(offer) = &mut viewer.offer
                && let Some(other) = offer.other.take()
            {
                offer.edit = other.edit;
            }
            viewer.edit(|v| v.accept_offer());
        }
        Some(Agreed::None) => viewer.offer = None,
        None => {}
    }
}

/// The answer to an offer.
enum Agreed {
    First,
    Other,
    None,
}

/// The lines of a difference.
fn lines(ui: &mut Ui, difference: &[(char, String)]) {
    let visuals = ui.visuals().clone();
    egui::Frame::new().fill(visuals.extreme_bg_color).inner_margin(6.0).show(ui, |ui| {
        for (sign, line) in difference {
            let color = match sign {
                '-' => visuals.error_fg_color,
                '+' => visuals.hyperlink_color,
                _ => visuals.weak_text_color(),
            };
            ui.label(RichText::new(format!("{sign} {line}")).monospace().color(color));
        }
    });
}
