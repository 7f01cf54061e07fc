//! The panels and their arrangement.

mod actions;
mod add_menu;
mod assets;
mod axes;
mod bar;
mod bar_menu;
mod bars;
mod camera_fields;
mod canvas;
#[cfg(test)]
mod contrast;
mod curves;
mod dialog;
mod drop;
mod explain;
mod fields;
mod files;
mod foot_contacts;
mod gesture;
mod handles;
mod headers;
mod hint;
mod icons;
mod inspected;
mod inspector;
mod key_menu;
mod keyboard;
mod layout;
mod markers;
mod marks;
mod messages;
mod overlay;
mod palette;
mod performance;
mod presets;
mod property_row;
mod refusal;
mod rename;
mod render;
mod rig;
mod row_order;
mod scene_icons;
mod script;
mod sequencer;
mod shortcut_list;
mod stage_fields;
mod start;
mod tangents;
mod tests;
mod thumbnail_textures;
mod toolbar;
mod trails;
mod tree;
mod values;
mod viewport;

pub(crate) use actions::shortcuts_problem;

pub use sequencer::color_of_clip;

use crate::app::Viewer;
use crate::editing::EditError;
use crate::state::settings::Settings;
use crate::state::view::{MAX_VIEWS, Overlays, View};
use egui::text::{LayoutJob, TextWrapping};
use egui::{Color32, FontId, Galley, Painter, RichText, TextureId, Ui, WidgetText};
use egui_dock::{DockArea, DockState, NodeIndex, Split, Style, TabViewer};
use std::sync::Arc;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tab {
    /// A viewport, by its index.
    Viewport(u8),
    Sequencer,
    Tree,
    Inspector,
    Messages,
    Script,
    Explain,
    Performance,
    Curves,
    Assets,
    Render,
    Tests,
}

const TITLES: [&str; MAX_VIEWS] = ["Viewport", "Viewport 2", "Viewport 3", "Viewport 4"];

impl Tab {
    pub const ALL: [Tab; 15] = [
        Tab::Viewport(0),
        Tab::Sequencer,
        Tab::Tree,
        Tab::Inspector,
        Tab::Messages,
        Tab::Script,
        Tab::Explain,
        Tab::Performance,
        Tab::Curves,
        Tab::Render,
        Tab::Tests,
        Tab::Viewport(1),
        Tab::Viewport(2),
        Tab::Viewport(3),
        Tab::Assets,
    ];

    pub fn title(self) -> &'static str {
        match self {
            Tab::Viewport(view) => TITLES[view as usize % MAX_VIEWS],
            Tab::Sequencer => "Sequencer",
            Tab::Tree => "Stage",
            Tab::Inspector => "Inspector",
            Tab::Messages => "Messages",
            Tab::Script => "Script",
            Tab::Explain => "Explain",
            Tab::Performance => "Performance",
            Tab::Curves => "Curves",
            Tab::Assets => "Assets",
            Tab::Render => "Render",
            Tab::Tests => "Tests",
        }
    }
}

/// Sets the colors of the window: dark, for judging images, or light. Text is comfortable to read in both.
pub fn set_colors(context: &egui::Context, light: bool) {
    context.set_fonts(icons::fonts());
    context.options_mut(|options| {
        // The viewer has its own zoom, which is limited and saved.
        options.zoom_with_keyboard = false;
        // egui measures time from frame to frame. If a frame takes a second, as on a busy machine without a GPU, no press would count as a click.
        options.input_options.max_click_duration = f64::INFINITY;
    });
    let mut dark = egui::Visuals::dark();
    dark.widgets.noninteractive.fg_stroke.color = egui::Color32::from_gray(190);
    dark.widgets.inactive.fg_stroke.color = egui::Color32::from_gray(205);
    dark.weak_text_color = Some(egui::Color32::from_gray(140));
    dark.error_fg_color = egui::Color32::from_rgb(0xff, 0x80, 0x70);
    dark.warn_fg_color = egui::Color32::from_rgb(0xf0, 0xb0, 0x50);
    // A blinking cursor would redraw the window twice a second while a field has the keyboard focus.
    dark.text_cursor.blink = false;
    let dark_text = dark.text_options.color_transfer_function;
    context.set_visuals_of(egui::Theme::Dark, dark);
    let mut bright = egui::Visuals::light();
    bright.widgets.noninteractive.fg_stroke.color = egui::Color32::from_gray(50);
    bright.widgets.inactive.fg_stroke.color = egui::Color32::from_gray(40);
    bright.weak_text_color = Some(egui::Color32::from_gray(105));
    bright.error_fg_color = egui::Color32::from_rgb(0xb0, 0x20, 0x10);
    bright.warn_fg_color = egui::Color32::from_rgb(0x8a, 0x55, 0x00);
    bright.hyperlink_color = egui::Color32::from_rgb(0x00, 0x5f, 0xb0);
    bright.text_cursor.blink = false;
    // Blended in linear light, thin dark strokes look faint; they are strengthened as egui does for light text on dark.
    bright.text_options.color_transfer_function = dark_text;
    context.set_visuals_of(egui::Theme::Light, bright);
    context.set_theme(if light { egui::Theme::Light } else { egui::Theme::Dark });
}

/// Everything that is drawn in the window.
pub struct Panels {
    dock: DockState<Tab>,
    splits: layout::SplitFractions,
    shortcut_list: shortcut_list::ShortcutList,
    pending_drop: drop::PendingDrop,
    thumbnails: thumbnail_textures::ThumbnailTextures,
    browser: assets::Browser,
    palette: palette::Palette,
    refusals: refusal::Refusals,
    name_field: rename::NameField,
    pub light: bool,
    /// Scale of the user interface, 1 to 2.
    pub scale: f32,
    /// Overlays of the first viewport, which new viewports inherit.
    overlays: Overlays,
    /// Theme and scale that were last set in egui's context.
    applied_theme_and_scale: Option<(bool, f32)>,
}

impl Default for Panels {
    fn default() -> Panels {
        Panels {
            dock: presets::Preset::General.dock(),
            splits: Default::default(),
            shortcut_list: Default::default(),
            pending_drop: Default::default(),
            thumbnails: Default::default(),
            browser: Default::default(),
            palette: Default::default(),
            refusals: Default::default(),
            name_field: Default::default(),
            light: false,
            scale: 1.0,
            overlays: Overlays::default(),
            applied_theme_and_scale: None,
        }
    }
}

impl Panels {
    pub fn new(settings: &Settings) -> Panels {
        let Settings { uses_light_theme: light, scale, overlays, .. } = *settings;
        let mut panels = Panels { light, scale, overlays, ..Panels::default() };
        if let Some(dock) = settings.layout.as_ref().and_then(layout::parse_layout) {
            panels.dock = dock;
        }
        panels
    }

    /// Sets the theme and scale again, since a new context has neither.
    pub(crate) fn forget_context(&mut self) {
        self.applied_theme_and_scale = None;
        self.thumbnails = Default::default();
    }

    pub fn settings(&self) -> Settings {
        let layout = Some(self.splits.to_json(&self.dock));
        let Panels { light, scale, overlays, .. } = *self;
        Settings { uses_light_theme: light, scale, layout, overlays, ..Settings::default() }
    }

    /// Draws all panels. `view_textures`: texture with the displayed frame of each view; `now`: clock, seconds.
    pub fn show(&mut self, ui: &mut Ui, viewer: &mut Viewer, view_textures: &[Option<TextureId>], now: f64) {
        if self.applied_theme_and_scale != Some((self.light, self.scale)) {
            set_colors(ui.ctx(), self.light);
            ui.ctx().set_zoom_factor(self.scale);
            self.applied_theme_and_scale = Some((self.light, self.scale));
        }
        hint::track_pointer(ui.ctx());
        values::set_frame_rate(ui, viewer.playhead.fps().as_fps());
        drop::take_dropped_files(&mut self.pending_drop, ui, viewer);
        // A slow frame may contain both the release of the mouse button and Ctrl+Z: the drag is completed before it is undone.
        let after_drag = !viewer.documents.shows_start_page && ui.input(|i| i.pointer.any_released());
        if !after_drag {
            keyboard::handle_keyboard(self, ui, viewer, now);
        }
        bar::show(self, ui, viewer, now);
        bar::show_offer(ui, viewer);
        files::show_dialogs(ui, viewer);
        palette::show(self, ui, viewer, now);
        if self.has_open_dialog(viewer) {
            // The mouse wheel must not scroll panels below the dialog.
            ui.input_mut(|i| i.smooth_scroll_delta = egui::Vec2::ZERO);
        }
        if self.shortcut_list.open {
            shortcut_list::show(ui, &mut self.shortcut_list, viewer);
        }
        if viewer.script_scroll_line.is_some() {
            self.bring_to_front(Tab::Script);
        }
        viewer.views.iter_mut().for_each(|view| view.is_visible = false);
        viewer.script_has_input = false;
        if viewer.documents.shows_start_page {
            return start::show(self, ui, viewer);
        }
        self.overlays = viewer.views[0].overlays;
        viewer.is_scrubbing = false;
        (viewer.curves.hovered, viewer.curves.was_drawn) = (false, false);
        // Fills the gaps at the rounded corners of the panels.
        ui.painter().rect_filled(ui.available_rect_before_wrap(), 0.0, ui.visuals().panel_fill);
        let style = Style::from_egui(ui.style());
        let (thumbnails, browser) = (&mut self.thumbnails, &mut self.browser);
        let mut tabs = Tabs { viewer, view_textures, thumbnails, browser, now };
        self.splits.restore(&mut self.dock, ui.available_size());
        let before = layout::SplitFractions::of(&self.dock);
        DockArea::new(&mut self.dock)
            .style(style)
            .show_leaf_collapse_buttons(false)
            .show_leaf_close_all_buttons(false)
            .show_inside(ui, &mut tabs);
        let has_input =
            ui.input(|i| i.pointer.any_down() || i.pointer.any_released() || !i.keys_down.is_empty());
        self.splits.record_changes(&self.dock, &before, has_input);
        key_menu::show_open_menu(ui, viewer);
        rename::show(&mut self.name_field, ui, viewer);
        if after_drag {
            keyboard::handle_keyboard(self, ui, viewer, now);
        }
        if values::take_refused_flag(ui) {
            viewer.edit(|_| Err(EditError::refused(values::NOT_A_TIME)));
        }
        refusal::show(&mut self.refusals, ui, viewer);
        show_drop_hint(ui, viewer);
    }

    /// Whether a dialog or the command palette has the keyboard.
    fn has_open_dialog(&self, viewer: &Viewer) -> bool {
        self.palette.is_open() || viewer.documents.dialog.is_some() || viewer.offer.is_some()
    }

    fn is_open(&self, tab: Tab) -> bool {
        self.dock.find_tab(&tab).is_some()
    }

    /// Opens or closes a panel.
    fn set_open(&mut self, tab: Tab, open: bool) {
        match (self.dock.find_tab(&tab), open) {
            (Some(place), false) => drop(self.dock.remove_tab(place)),
            (None, true) => match self.viewport_split(tab) {
                Some((node, split)) => {
                    self.dock.main_surface_mut().split_tabs(node, split, 0.5, vec![tab]);
                }
                None => self.dock.push_to_focused_leaf(tab),
            },
            _ => {}
        }
    }

    /// Position of a new viewport, so that four are arranged two by two: the node of another viewport, and the side.
    fn viewport_split(&self, tab: Tab) -> Option<(NodeIndex, Split)> {
        let Tab::Viewport(number) = tab else { return None };
        let (right, below) = (Split::Right, Split::Below);
        let places: &[(u8, Split)] = match number {
            1 => &[(0, right), (2, right), (3, Split::Above)],
            2 => &[(0, below), (3, Split::Left), (1, below)],
            _ => &[(1, below), (2, right), (0, below)],
        };
        let found = |(other, split): &(u8, Split)| {
            let (node, _) = self.dock.find_main_surface_tab(&Tab::Viewport(*other))?;
            Some((node, *split))
        };
        places.iter().find_map(found)
    }

    /// Opens a panel if it is closed, and brings it to the front.
    fn bring_to_front(&mut self, tab: Tab) {
        self.set_open(tab, true);
        if let Some(place) = self.dock.find_tab(&tab) {
            // The panel was found just before.
            let _ = self.dock.set_active_tab(place);
            self.dock.set_focused_node_and_surface(place.node_path());
        }
    }
}

/// Hint about the effect of a drop, while files are dragged over the window.
fn show_drop_hint(ui: &Ui, viewer: &Viewer) {
    let files = ui.input(|i| i.raw.hovered_files.clone());
    if files.is_empty() {
        return;
    }
    let layer = egui::LayerId::new(egui::Order::Foreground, egui::Id::new("drop"));
    let painter = ui.ctx().layer_painter(layer);
    let area = ui.ctx().content_rect();
    painter.rect_filled(area, 0.0, egui::Color32::from_black_alpha(150));
    let name =
        |file: &egui::HoveredFile| Some(file.path.as_ref()?.file_name()?.to_string_lossy().into_owned());
    let text = match &files[..] {
        [file] if viewer.path.is_some() => {
            let name = name(file).unwrap_or_else(|| "a model or a clip".into());
            format!("{name}: drop it on the image to place it there, elsewhere to view it alone")
        }
        [file] => format!("{}: drop it to view it", name(file).unwrap_or_else(|| "a model or a clip".into())),
        files if viewer.path.is_some() => {
            format!(
                "{} files: drop them on the image to place them there, elsewhere to view them alone",
                files.len()
            )
        }
        files => format!("{} files: drop them to view them side by side", files.len()),
    };
    let font = egui::FontId::proportional(22.0);
    painter.text(area.center(), egui::Align2::CENTER_CENTER, text, font, egui::Color32::WHITE);
}

struct Tabs<'a> {
    viewer: &'a mut Viewer,
    view_textures: &'a [Option<TextureId>],
    /// Thumbnail textures.
    thumbnails: &'a mut thumbnail_textures::ThumbnailTextures,
    browser: &'a mut assets::Browser,
    now: f64,
}

impl TabViewer for Tabs<'_> {
    type Tab = Tab;

    fn id(&mut self, tab: &mut Tab) -> egui::Id {
        egui::Id::new(tab.title())
    }

    fn title(&mut self, tab: &mut Tab) -> WidgetText {
        match tab {
            Tab::Messages if self.viewer.is_faulty => {
                RichText::new(tab.title()).color(egui::Color32::from_rgb(0xe8, 0x60, 0x50)).into()
            }
            tab => tab.title().into(),
        }
    }

    fn on_tab_button(&mut self, tab: &mut Tab, response: &egui::Response) {
        let name = format!("{} tab", tab.title());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Button, true, name.clone()));
    }

    fn ui(&mut self, ui: &mut Ui, tab: &mut Tab) {
        match tab {
            Tab::Viewport(view) => {
                let view = *view as usize % MAX_VIEWS;
                while self.viewer.views.len() <= view {
                    let overlays = self.viewer.views[0].overlays;
                    self.viewer.views.push(View { is_visible: false, overlays, ..View::default() });
                }
                let frame_texture = self.view_textures.get(view).copied().flatten();
                viewport::show(ui, self.viewer, view, frame_texture);
            }
            Tab::Sequencer => sequencer::show(ui, self.viewer, self.now),
            Tab::Tree => tree::show(ui, self.viewer),
            Tab::Inspector => inspected::show(ui, self.viewer),
            Tab::Messages => messages::show(ui, self.viewer),
            Tab::Script => script::show(ui, self.viewer),
            Tab::Explain => explain::show(ui, self.viewer),
            Tab::Performance => performance::show(ui, self.viewer),
            Tab::Curves => curves::show(ui, self.viewer),
            Tab::Assets => assets::show(ui, self.viewer, self.browser, self.thumbnails),
            Tab::Render => render::show(ui, self.viewer),
            Tab::Tests => tests::show(ui, self.viewer),
        }
    }

    fn scroll_bars(&self, tab: &Tab) -> [bool; 2] {
        match tab {
            Tab::Viewport(_) | Tab::Sequencer | Tab::Curves | Tab::Script | Tab::Assets => [false, false],
            _ => [true, true],
        }
    }
}

/// Rounds to multiples of 1/`parts` for display; a value that rounds to zero has no sign.
fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts + 0.0
}

/// A number with a fixed number of decimal places; a value that rounds to zero has no sign.
fn fixed_digits(value: f64, digits: usize) -> String {
    format!("{:.digits$}", rounded(value, libm::pow(10.0, digits as f64)))
}

/// A line of text that is truncated with … if it is too wide.
fn truncated_text(painter: &Painter, text: &str, size: f32, color: Color32, width: f32) -> Arc<Galley> {
    let mut job = LayoutJob::simple_singleline(text.to_string(), FontId::proportional(size), color);
    job.wrap = TextWrapping::truncate_at_width(width.max(1.0));
    painter.layout_job(job)
}

#[cfg(test)]
mod fixed_digits_tests {
    use super::fixed_digits;

    #[test]
    fn a_number_that_rounds_to_zero_has_no_minus_sign() {
        // Adding steps gives grid lines that are slightly off zero.
        for (value, digits, text) in [
            (-1e-17, 1, "0.0"),
            (-0.0, 2, "0.00"),
            (-0.04, 1, "0.0"),
            (-0.06, 1, "-0.1"),
            (-0.4, 0, "0"),
            (12.375, 2, "12.38"),
        ] {
            assert_eq!(fixed_digits(value, digits), text);
        }
    }
}
