//! The panels, and how they lie beside each other.

mod explain;
mod inspector;
mod messages;
mod script;
mod sequencer;
mod tree;
mod viewport;

use crate::app::Viewer;
use egui::{Key, Modifiers, RichText, TextureId, Ui, WidgetText};
use egui_dock::{DockArea, DockState, NodeIndex, Style, TabViewer};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tab {
    Viewport,
    Sequencer,
    Tree,
    Inspector,
    Messages,
    Script,
    Explain,
}

impl Tab {
    pub const ALL: [Tab; 7] =
        [Tab::Viewport, Tab::Sequencer, Tab::Tree, Tab::Inspector, Tab::Messages, Tab::Script, Tab::Explain];

    pub fn title(self) -> &'static str {
        match self {
            Tab::Viewport => "Viewport",
            Tab::Sequencer => "Sequencer",
            Tab::Tree => "Stage",
            Tab::Inspector => "Inspector",
            Tab::Messages => "Messages",
            Tab::Script => "Script",
            Tab::Explain => "Explain",
        }
    }
}

/// Dark, as pictures are judged in the dark; text light enough to be read for hours.
pub fn set_colors(context: &egui::Context) {
    let mut visuals = egui::Visuals::dark();
    visuals.widgets.noninteractive.fg_stroke.color = egui::Color32::from_gray(190);
    visuals.widgets.inactive.fg_stroke.color = egui::Color32::from_gray(205);
    visuals.weak_text_color = Some(egui::Color32::from_gray(140));
    visuals.error_fg_color = egui::Color32::from_rgb(0xff, 0x80, 0x70);
    visuals.warn_fg_color = egui::Color32::from_rgb(0xf0, 0xb0, 0x50);
    context.set_theme(egui::Theme::Dark);
    context.set_visuals_of(egui::Theme::Dark, visuals);
}

/// All that is drawn into the window.
pub struct Panels {
    dock: DockState<Tab>,
    help: bool,
}

impl Default for Panels {
    fn default() -> Panels {
        let mut dock = DockState::new(vec![Tab::Viewport]);
        let surface = dock.main_surface_mut();
        let [above, _] =
            surface.split_below(NodeIndex::root(), 0.66, vec![Tab::Sequencer, Tab::Messages, Tab::Explain]);
        let [middle, _] = surface.split_right(above, 0.72, vec![Tab::Inspector, Tab::Script]);
        surface.split_left(middle, 0.2, vec![Tab::Tree]);
        Panels { dock, help: false }
    }
}

impl Panels {
    /// `picture`: the texture with the frame that is shown; `now`: the clock, seconds.
    pub fn show(&mut self, ui: &mut Ui, viewer: &mut Viewer, picture: Option<TextureId>, now: f64) {
        self.keys(ui, viewer, now);
        egui::Panel::top("bar").show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.label(RichText::new(&viewer.name).strong());
                ui.menu_button("Panels", |ui| {
                    for tab in Tab::ALL {
                        let place = self.dock.find_tab(&tab);
                        let mut open = place.is_some();
                        if ui.checkbox(&mut open, tab.title()).changed() {
                            match place {
                                Some(place) => drop(self.dock.remove_tab(place)),
                                None => self.dock.push_to_focused_leaf(tab),
                            }
                        }
                    }
                    if ui.button("As at first").clicked() {
                        *self = Panels { help: self.help, ..Panels::default() };
                    }
                });
                ui.toggle_value(&mut self.help, "Keys");
                status(ui, viewer);
            });
        });
        if self.help {
            let window = egui::Window::new("Keys").open(&mut self.help).resizable(false).collapsible(false);
            window.anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0]).show(ui.ctx(), help);
        }
        let style = Style::from_egui(ui.style());
        let mut tabs = Tabs { viewer, picture, now };
        DockArea::new(&mut self.dock)
            .style(style)
            .show_leaf_collapse_buttons(false)
            .show_leaf_close_all_buttons(false)
            .show_inside(ui, &mut tabs);
    }

    /// Keys that hold everywhere, unless a text is being written.
    fn keys(&mut self, ui: &mut Ui, viewer: &mut Viewer, now: f64) {
        if ui.ctx().egui_wants_keyboard_input() {
            return;
        }
        let pressed = |key| ui.input_mut(|i| i.consume_key(Modifiers::NONE, key));
        if pressed(Key::Space) {
            viewer.playhead.toggle(now);
        }
        for (key, frames) in
            [(Key::ArrowRight, 1), (Key::ArrowLeft, -1), (Key::Home, i64::MIN / 2), (Key::End, i64::MAX / 2)]
        {
            if pressed(key) {
                viewer.playhead.step(frames);
            }
        }
        if pressed(Key::L) {
            viewer.playhead.looping = !viewer.playhead.looping;
        }
        if pressed(Key::C) {
            viewport::toggle_camera(viewer);
        }
        if pressed(Key::F) {
            viewport::focus(viewer);
        }
        if pressed(Key::T) {
            viewer.in_seconds = !viewer.in_seconds;
        }
        if ui.input_mut(|i| i.consume_key(Modifiers::COMMAND, Key::Z)) {
            viewer.said = viewer.undo().err();
        }
        if ui.input_mut(|i| i.consume_key(Modifiers::COMMAND, Key::Q)) {
            viewer.quit = true;
        }
        if pressed(Key::Escape) {
            viewer.selection = None;
        }
        if pressed(Key::F1) {
            self.help = !self.help;
        }
    }
}

const KEYS: [(&str, &str); 15] = [
    ("Space", "play, pause"),
    ("← →", "one frame back, on"),
    ("Home End", "first, last frame"),
    ("L", "loop"),
    ("T", "times as seconds or frames"),
    ("C", "the script's camera or a free one"),
    ("F", "look at what is selected"),
    ("Esc", "select nothing"),
    ("drag", "a bar's end or fade: changes the script"),
    ("Ctrl Z", "takes that back"),
    ("drag", "viewport: turn; with Shift or the middle button: pan"),
    ("wheel", "viewport: nearer; sequencer: zoom, with Shift: pan"),
    ("W A S D Q E", "viewport, mouse over it: walk"),
    ("F1", "this list"),
    ("Ctrl Q", "close"),
];

fn help(ui: &mut Ui) {
    egui::Grid::new("keys").num_columns(2).spacing([16.0, 4.0]).show(ui, |ui| {
        for (key, what) in KEYS {
            ui.monospace(key);
            ui.label(what);
            ui.end_row();
        }
    });
}

fn status(ui: &mut Ui, viewer: &Viewer) {
    let errors = viewer.problems.iter().filter(|p| p.severity == choreo_script::Severity::Error).count();
    let warnings = viewer.problems.len() - errors;
    if viewer.faulty {
        let text = match viewer.scene.is_some() {
            true => "faulty: the last good version is shown",
            false => "faulty: nothing to show yet",
        };
        ui.label(RichText::new(text).color(ui.visuals().error_fg_color).strong());
    } else if !viewer.trouble.is_empty() {
        ui.label(RichText::new("trouble: see Messages").color(ui.visuals().error_fg_color));
    } else if warnings > 0 {
        let text = if warnings == 1 { "1 warning".to_string() } else { format!("{warnings} warnings") };
        ui.label(RichText::new(text).color(ui.visuals().warn_fg_color));
    }
    if let Some(why) = &viewer.said {
        ui.label(RichText::new(why).color(ui.visuals().warn_fg_color));
    }
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        if let Some(shown) = &viewer.shown {
            let millis = |d: std::time::Duration| d.as_secs_f64() * 1e3;
            let all = shown.evaluated_in + shown.planned_in + shown.drawn_in;
            ui.label(format!("{:.1} ms a frame", millis(all))).on_hover_text(format!(
                "pose {:.2} ms, plan {:.2} ms, draw {:.2} ms on {}",
                millis(shown.evaluated_in),
                millis(shown.planned_in),
                millis(shown.drawn_in),
                shown.device.name
            ));
            ui.label(format!("{}×{}", shown.size[0], shown.size[1]));
        }
    });
}

struct Tabs<'a> {
    viewer: &'a mut Viewer,
    picture: Option<TextureId>,
    now: f64,
}

impl TabViewer for Tabs<'_> {
    type Tab = Tab;

    fn id(&mut self, tab: &mut Tab) -> egui::Id {
        egui::Id::new(tab.title())
    }

    fn title(&mut self, tab: &mut Tab) -> WidgetText {
        match tab {
            Tab::Messages if self.viewer.faulty => {
                RichText::new(tab.title()).color(egui::Color32::from_rgb(0xff, 0x80, 0x70)).into()
            }
            tab => tab.title().into(),
        }
    }

    fn ui(&mut self, ui: &mut Ui, tab: &mut Tab) {
        match tab {
            Tab::Viewport => viewport::show(ui, self.viewer, self.picture),
            Tab::Sequencer => sequencer::show(ui, self.viewer, self.now),
            Tab::Tree => tree::show(ui, self.viewer),
            Tab::Inspector => inspector::show(ui, self.viewer),
            Tab::Messages => messages::show(ui, self.viewer),
            Tab::Script => script::show(ui, self.viewer),
            Tab::Explain => explain::show(ui, self.viewer),
        }
    }

    fn scroll_bars(&self, tab: &Tab) -> [bool; 2] {
        match tab {
            Tab::Viewport | Tab::Sequencer | Tab::Script => [false, false],
            _ => [true, true],
        }
    }
}
