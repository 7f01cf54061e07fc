//! Bar above the panels: menus, the first problem, and the offer of the last edit.

use super::actions::{self, Context};
use super::hint::Hint;
use super::presets::Preset;
use super::toolbar::{self, Toolbar};
use super::{Panels, Tab, dialog};
use crate::app::Viewer;
use crate::state::settings::SCALE_RANGE;
use choreo_script::Severity;
use egui::{RichText, TextStyle, Ui};

/// Largest number of problems in the tooltip; the panel Messages lists all of them.
const MAX_LISTED_PROBLEMS: usize = 5;
/// Width reserved for a note at the end of the bar, points.
const NOTE_WIDTH: f32 = 120.0;

/// State that the entries act on.
struct BarContext<'w> {
    panels: &'w mut Panels,
    viewer: &'w mut Viewer,
    /// Clock, seconds.
    now: f64,
}

pub(super) fn show(panels: &mut Panels, ui: &mut Ui, viewer: &mut Viewer, now: f64) {
    egui::Panel::top("bar").show(ui, |ui| {
        ui.horizontal(|ui| {
            let mut bar = Toolbar::new("top");
            bar.add_menu("File", "", |ui, context: &mut BarContext| {
                super::files::show_file_menu(ui, context.viewer)
            });
            bar.add_menu("Edit", "", show_edit_entries);
            bar.add_menu("Add", "", |ui, context| super::add_menu::show_entries(ui, context.viewer));
            bar.set_enabled(super::add_menu::can_add(viewer));
            bar.add_menu("Panels", "", |ui, context| show_panel_entries(ui, context.panels));
            bar.keep_menu_open();
            bar.add_menu("Appearance", "", |ui, context| show_appearance_entries(ui, context.panels));
            bar.add_toggle(panels.shortcut_list.open, "Shortcuts", "", |context| {
                context.panels.shortcut_list.open ^= true
            });
            // The name follows the menus, so that its length does not move them.
            let name = viewer.name.clone();
            bar.add_widget("name", true, move |ui, _| {
                truncated_label(ui, RichText::new(&name).strong(), &name)
            });
            add_preview_entries(&mut bar, viewer);
            add_status(&mut bar, ui, viewer);
            // Texts at the end of the bar, from right to left. If there is no room, they move into the menu of the toolbar.
            let figures = performance_figures(viewer);
            let spacing = ui.spacing().item_spacing.x;
            let widths =
                figures.iter().map(|(text, _)| toolbar::text_width(ui, text, TextStyle::Body) + spacing);
            let has_note = viewer.message.is_some() || viewer.note.is_some() || viewer.is_faulty;
            let reserved = if has_note { NOTE_WIDTH } else { 0.0 };
            let fits = bar.width(ui) + widths.sum::<f32>() + reserved <= ui.available_width();
            for (text, hint) in figures.iter().filter(|_| !fits) {
                bar.add_text(text, hint, TextStyle::Body);
            }
            bar.show(ui, &mut BarContext { panels, viewer, now }, reserved);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                for (text, hint) in figures.iter().filter(|_| fits) {
                    ui.label(text).hint(hint);
                }
                show_note(ui, viewer);
            });
        });
    });
}

/// Entries of the menu Panels: open panels, and layouts.
fn show_panel_entries(ui: &mut Ui, panels: &mut Panels) {
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
            ui.close();
        }
    }
}

fn show_appearance_entries(ui: &mut Ui, panels: &mut Panels) {
    ui.radio_value(&mut panels.light, false, "Dark");
    ui.radio_value(&mut panels.light, true, "Light");
    ui.separator();
    for scale in [1.0, 1.25, 1.5, 1.75, 2.0] {
        debug_assert!((SCALE_RANGE.0..=SCALE_RANGE.1).contains(&scale));
        ui.radio_value(&mut panels.scale, scale, format!("{:.0} %", scale * 100.0));
    }
}

/// Entries of the menu Edit.
fn show_edit_entries(ui: &mut Ui, context: &mut BarContext) {
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
    for (id, name) in ENTRIES {
        let Some(action) = actions::find_action(id) else { continue };
        let keys = actions::shortcut_text(context.viewer, id);
        let button = ui.add(egui::Button::new(name).shortcut_text(keys));
        if button.hint(action.title).clicked() {
            let BarContext { panels, viewer, now } = context;
            (action.run)(&mut Context { panels, ui, viewer, now: *now });
            ui.close();
        }
    }
}

/// A name that is truncated to leave room for the buttons next to it. `whole`: text of the tooltip.
fn truncated_label(ui: &mut Ui, name: RichText, whole: &str) {
    let room = (ui.ctx().content_rect().width() / 4.0).min(260.0);
    ui.scope(|ui| {
        ui.set_max_width(room);
        ui.add(egui::Label::new(name).truncate().show_tooltip_when_elided(false)).hint(whole);
    });
}

/// Entries for previewed files, which are displayed in place of the script.
fn add_preview_entries(bar: &mut Toolbar<'_, BarContext<'_>>, viewer: &Viewer) {
    let Some(first) = viewer.previewed_files.first() else { return };
    let name = first.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let name = match viewer.previewed_files.len() {
        1 => name,
        more => format!("{name} and {} more", more - 1),
    };
    let all: Vec<String> = viewer.previewed_files.iter().map(|file| file.display().to_string()).collect();
    bar.add_separator();
    bar.add_widget("previewed files", true, move |ui, _| {
        truncated_label(ui, RichText::new(name).color(ui.visuals().warn_fg_color).strong(), &all.join("\n"));
    });
    if viewer.path.is_some() {
        bar.add_button("Add to script", "", |context| context.viewer.edit(|v| v.add_previewed_files()));
    }
    bar.add_button("Back to the script", "", |context| context.viewer.close_preview = true);
}

/// The first problem, in one line; a click goes to its line.
fn show_first_problem(ui: &mut Ui, viewer: &mut Viewer) {
    let Some(first) = viewer.problems.first().filter(|_| viewer.is_faulty) else { return };
    let (line, whole) = (first.line, first.to_string());
    let message = first.message.lines().next().unwrap_or("");
    let text = if line > 0 { format!("line {line}: {message}") } else { message.to_string() };
    let text = RichText::new(text).color(ui.visuals().error_fg_color);
    let label = ui.add(egui::Label::new(text).truncate().sense(egui::Sense::click()));
    let label = label.hint(RichText::new(whole).monospace());
    if line > 0 && label.on_hover_cursor(egui::CursorIcon::PointingHand).clicked() {
        viewer.script_scroll_line = Some(line);
    }
}

/// State of the newest version; a click opens the panel Messages.
fn add_status(bar: &mut Toolbar<'_, BarContext<'_>>, ui: &Ui, viewer: &Viewer) {
    let count_of = |severity| viewer.problems.iter().filter(|p| p.severity == severity).count();
    let (errors, warnings) = (count_of(Severity::Error), count_of(Severity::Warning));
    let count_text = |count: usize, one: &str| match count {
        0 => None,
        1 => Some(format!("1 {one}")),
        count => Some(format!("{count} {one}s")),
    };
    let visuals = ui.visuals();
    let text = if viewer.is_faulty {
        let text = match viewer.scene.is_some() {
            true => "faulty: the last good version is shown",
            false => "faulty: nothing to show yet",
        };
        RichText::new(text).color(visuals.error_fg_color).strong()
    } else if viewer.without_vulkan.is_some() && viewer.renderer_problems.len() == 1 {
        // The renderer reports the same.
        RichText::new("drawn on the CPU").color(visuals.warn_fg_color)
    } else if !viewer.renderer_problems.is_empty() {
        RichText::new("problems: see Messages").color(visuals.error_fg_color)
    } else {
        let parts: Vec<String> =
            count_text(errors, "error").into_iter().chain(count_text(warnings, "warning")).collect();
        if parts.is_empty() {
            return;
        }
        let color = if errors > 0 { visuals.error_fg_color } else { visuals.warn_fg_color };
        RichText::new(parts.join(", ")).color(color)
    };
    let all = viewer.problems.iter().map(ToString::to_string).chain(viewer.renderer_problems.iter().cloned());
    let all: Vec<String> = all.take(MAX_LISTED_PROBLEMS).collect();
    bar.add_widget("status", false, move |ui, context| {
        let label = ui.add(egui::Label::new(text).extend().sense(egui::Sense::click()));
        let label = label.hint(RichText::new(all.join("\n\n")).monospace());
        if label.on_hover_cursor(egui::CursorIcon::PointingHand).clicked() {
            context.panels.bring_to_front(Tab::Messages);
        }
    });
}

/// Texts about the displayed image, with their hints.
fn performance_figures(viewer: &Viewer) -> Vec<(String, String)> {
    let Some(shown) = viewer.shown() else { return Vec::new() };
    let millis = |d: std::time::Duration| d.as_secs_f64() * 1e3;
    let all = shown.evaluated_in + shown.planned_in + shown.drawn_in;
    let hint = format!(
        "pose {:.2} ms, plan {:.2} ms, draw {:.2} ms on {}",
        millis(shown.evaluated_in),
        millis(shown.planned_in),
        millis(shown.drawn_in),
        shown.device.name
    );
    let size = format!("{}×{}", shown.size[0], shown.size[1]);
    vec![(format!("{:.1} ms a frame", millis(all)), hint), (size, "pixels of the image".to_string())]
}

/// Reason why the last edit was refused, else its note, else the first problem.
fn show_note(ui: &mut Ui, viewer: &mut Viewer) {
    if let Some(why) = &viewer.message {
        let text = RichText::new(why).color(ui.visuals().warn_fg_color);
        ui.add(egui::Label::new(text).truncate()).hint(why);
    } else if let Some(note) = &viewer.note {
        ui.add(egui::Label::new(note).truncate()).hint(note);
    } else {
        show_first_problem(ui, viewer);
    }
}

/// Dialog for an offered edit, with the difference.
pub(super) fn show_offer(ui: &Ui, viewer: &mut Viewer) {
    let Some(offer) = &viewer.offer else { return };
    let mut answer = None;
    let is_dismissed = dialog::show(ui, "Change the script?", |ui| {
        ui.set_max_width(640.0);
        ui.label(&offer.why);
        if let Some(line) = viewer.message_line
            && ui.link(format!("go to line {line}")).clicked()
        {
            answer = Some(OfferAnswer::GoTo(line));
        }
        ui.add_space(6.0);
        draw_difference_lines(ui, &offer.difference);
        ui.add_space(6.0);
        ui.horizontal(|ui| {
            if ui.button(&offer.label).clicked() {
                answer = Some(OfferAnswer::Accept);
            }
            if offer.other.is_none() && ui.button("Leave it").clicked() {
                answer = Some(OfferAnswer::Decline);
            }
        });
        if let Some(other) = &offer.other {
            ui.add_space(6.0);
            ui.label("or");
            draw_difference_lines(ui, &other.difference);
            ui.add_space(6.0);
            ui.horizontal(|ui| {
                if ui.button(&other.label).clicked() {
                    answer = Some(OfferAnswer::AcceptOther);
                }
                if ui.button("Leave it").clicked() {
                    answer = Some(OfferAnswer::Decline);
                }
            });
        }
    });
    match answer.or(is_dismissed.then_some(OfferAnswer::Decline)) {
        Some(OfferAnswer::Accept) => viewer.edit(|v| v.accept_offer()),
        Some(OfferAnswer::AcceptOther) => {
            if let Some(offer) = &mut viewer.offer
                && let Some(other) = offer.other.take()
            {
                (offer.edit, offer.label) = (other.edit, other.label);
            }
            viewer.edit(|v| v.accept_offer());
        }
        Some(OfferAnswer::GoTo(line)) => (viewer.offer, viewer.script_scroll_line) = (None, Some(line)),
        Some(OfferAnswer::Decline) => viewer.offer = None,
        None => {}
    }
}

/// Answer to an offer.
enum OfferAnswer {
    Accept,
    AcceptOther,
    /// No edit; goes to the line that caused the refusal.
    GoTo(usize),
    Decline,
}

/// Draws the lines of a difference.
fn draw_difference_lines(ui: &mut Ui, difference: &[(char, String)]) {
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
