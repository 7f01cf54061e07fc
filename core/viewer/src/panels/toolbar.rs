//! Toolbar in one line. Entries without room are in a menu at its end, with the same names, hints and states.

use super::hint::Hint;
use super::icons;
use egui::containers::menu::{MenuButton, MenuConfig, SubMenuButton};
use egui::{
    Button, FontSelection, PopupCloseBehavior, Response, RichText, TextStyle, TextWrapMode, Ui, WidgetInfo,
    WidgetText, WidgetType, vec2,
};

/// Width of a separator, points.
const SEPARATOR_WIDTH: f32 = 6.0;
/// Assumed width of a widget that was not drawn yet, points.
const ASSUMED_WIDGET_WIDTH: f32 = 60.0;
/// Allowance for egui's rounding of positions, points.
const ROUNDING_ALLOWANCE: f32 = 1.0;
const OVERFLOW_LABEL: &str = "»";

type Act<'a, C> = Box<dyn FnOnce(&mut C) + 'a>;
type Show<'a, C> = Box<dyn FnOnce(&mut Ui, &mut C) + 'a>;

enum EntryKind<'a, C> {
    Button(Act<'a, C>),
    /// A button that is on or off.
    Toggle(bool, Act<'a, C>),
    Menu(Show<'a, C>),
    /// Another widget, which draws itself.
    Widget(Show<'a, C>),
    Text(TextStyle),
    Separator,
}

struct Entry<'a, C> {
    /// Displayed icon or text.
    face: String,
    /// Name in the menu and for screen readers.
    name: String,
    hint: String,
    enabled: bool,
    /// Faces that the entry has at other times; it is as wide as the widest of them.
    other_faces: Vec<String>,
    /// Whether clicks in its menu leave the menu open.
    stays_open: bool,
    /// Whether the entry moves to the menu before those that do not yield.
    yields: bool,
    kind: EntryKind<'a, C>,
}

impl<C> Entry<'_, C> {
    fn is_separator(&self) -> bool {
        matches!(self.kind, EntryKind::Separator)
    }

    fn is_icon(&self) -> bool {
        self.face != self.name
    }

    /// Closing behavior of the entry's menu.
    fn menu(&self) -> MenuConfig {
        MenuConfig::new().close_behavior(match self.stays_open {
            true => PopupCloseBehavior::CloseOnClickOutside,
            false => PopupCloseBehavior::CloseOnClick,
        })
    }
}

/// A toolbar being built. `C`: type of the context that actions get.
pub(super) struct Toolbar<'a, C> {
    id: egui::Id,
    entries: Vec<Entry<'a, C>>,
}

impl<'a, C> Toolbar<'a, C> {
    /// `id`: distinguishes the toolbar from others.
    pub fn new(id: impl std::hash::Hash + std::fmt::Debug) -> Toolbar<'a, C> {
        Toolbar { id: egui::Id::new(("toolbar", id)), entries: Vec::new() }
    }

    fn add(&mut self, face: &str, name: &str, hint: &str, kind: EntryKind<'a, C>) {
        let [face, name, hint] = [face, name, hint].map(str::to_string);
        let (other_faces, stays_open) = (Vec::new(), false);
        self.entries.push(Entry {
            face,
            name,
            hint,
            enabled: true,
            other_faces,
            stays_open,
            yields: false,
            kind,
        });
    }

    /// Reserves room in the last entry for these faces, so that the entries after it do not move.
    pub fn other_faces<'f>(&mut self, faces: impl Iterator<Item = &'f str>) {
        if let Some(last) = self.entries.last_mut() {
            last.other_faces = faces.map(str::to_string).collect();
        }
    }

    /// Keeps the menu of the last entry open until a click outside it.
    pub fn stays_open(&mut self) {
        if let Some(last) = self.entries.last_mut() {
            last.stays_open = true;
        }
    }

    /// Enables or disables the last entry.
    pub fn enabled(&mut self, enabled: bool) {
        if let Some(last) = self.entries.last_mut() {
            last.enabled = enabled;
        }
    }

    pub fn button(&mut self, text: &str, hint: &str, act: impl FnOnce(&mut C) + 'a) {
        self.add(text, text, hint, EntryKind::Button(Box::new(act)));
    }

    pub fn icon(&mut self, icon: &str, name: &str, hint: &str, act: impl FnOnce(&mut C) + 'a) {
        self.add(icon, name, hint, EntryKind::Button(Box::new(act)));
    }

    pub fn toggle(&mut self, on: bool, text: &str, hint: &str, act: impl FnOnce(&mut C) + 'a) {
        self.add(text, text, hint, EntryKind::Toggle(on, Box::new(act)));
    }

    pub fn icon_toggle(
        &mut self,
        icon: &str,
        on: bool,
        name: &str,
        hint: &str,
        act: impl FnOnce(&mut C) + 'a,
    ) {
        self.add(icon, name, hint, EntryKind::Toggle(on, Box::new(act)));
    }

    pub fn menu(&mut self, text: &str, hint: &str, show: impl FnOnce(&mut Ui, &mut C) + 'a) {
        self.add(text, text, hint, EntryKind::Menu(Box::new(show)));
    }

    /// Adds a widget. `name`: distinguishes it from others.
    pub fn widget(&mut self, name: &str, yields: bool, show: impl FnOnce(&mut Ui, &mut C) + 'a) {
        self.add(name, name, "", EntryKind::Widget(Box::new(show)));
        if let Some(last) = self.entries.last_mut() {
            last.yields = yields;
        }
    }

    /// Adds a text, which moves to the menu before buttons do.
    pub fn text(&mut self, text: &str, hint: &str, style: TextStyle) {
        self.add(text, text, hint, EntryKind::Text(style));
        if let Some(last) = self.entries.last_mut() {
            last.yields = true;
        }
    }

    pub fn separator(&mut self) {
        self.add("", "", "", EntryKind::Separator);
    }

    /// Width of all entries in one line, points.
    pub fn width(&self, ui: &Ui) -> f32 {
        let spacing = ui.spacing().item_spacing.x;
        self.widths(ui).iter().map(|width| width + spacing).sum::<f32>() - spacing + ROUNDING_ALLOWANCE
    }

    fn widths(&self, ui: &Ui) -> Vec<f32> {
        let padding = 2.0 * ui.spacing().button_padding.x;
        let width = |entry: &Entry<'a, C>| match &entry.kind {
            EntryKind::Separator => SEPARATOR_WIDTH,
            EntryKind::Widget(_) => {
                ui.data(|d| d.get_temp(self.id.with(&entry.name))).unwrap_or(ASSUMED_WIDGET_WIDTH)
            }
            EntryKind::Text(style) => text_width(ui, &entry.face, style.clone()),
            _ => {
                let faces = std::iter::once(&entry.face).chain(&entry.other_faces);
                let widths = faces.map(|face| text_width(ui, face, TextStyle::Button));
                widths.fold(0.0, f32::max) + padding
            }
        };
        self.entries.iter().map(width).collect()
    }

    /// Draws the toolbar. `reserved`: width at its end that it leaves free, points.
    pub fn show(self, ui: &mut Ui, context: &mut C, reserved: f32) {
        let spacing = ui.spacing().item_spacing.x;
        let more = text_width(ui, OVERFLOW_LABEL, TextStyle::Button) + 2.0 * ui.spacing().button_padding.x;
        let widths = self.widths(ui);
        let parts: Vec<EntryLayout> = std::iter::zip(&self.entries, &widths)
            .map(|(entry, width)| EntryLayout {
                width: *width,
                yields: entry.yields,
                is_separator: entry.is_separator(),
            })
            .collect();
        let room = ui.available_width() - reserved - ROUNDING_ALLOWANCE;
        let on_line = fits_in_line(&parts, spacing, room, more);
        let (id, mut rest) = (self.id, Vec::new());
        for (number, (entry, is_on_line)) in self.entries.into_iter().zip(on_line).enumerate() {
            match is_on_line {
                true => line_entry(ui, (id, number), entry, widths[number], context),
                false => rest.push(entry),
            }
        }
        while rest.first().is_some_and(Entry::is_separator) {
            rest.remove(0);
        }
        if rest.iter().all(Entry::is_separator) {
            return;
        }
        // A click into a text field of the menu must not close it.
        let config = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
        let (response, _) = MenuButton::new(OVERFLOW_LABEL).config(config).ui(ui, |ui| {
            ui.style_mut().wrap_mode = Some(TextWrapMode::Extend);
            let last = rest.iter().rposition(|entry| !entry.is_separator()).unwrap_or(0);
            for (number, entry) in rest.into_iter().enumerate().take(last + 1) {
                ui.push_id((id, number), |ui| menu_entry(ui, entry, context));
            }
        });
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, "more"));
        response.hint("more: entries that do not fit in this line");
    }
}

/// Width of a text in one line, points.
pub(super) fn text_width(ui: &Ui, text: &str, style: TextStyle) -> f32 {
    let text = WidgetText::from(text);
    let font = FontSelection::Style(style);
    text.into_galley(ui, Some(TextWrapMode::Extend), f32::INFINITY, font).size().x.ceil()
}

/// Draws an entry in the line. `id`: id of the toolbar, and index of the entry.
fn line_entry<C>(ui: &mut Ui, id: (egui::Id, usize), entry: Entry<'_, C>, width: f32, context: &mut C) {
    let (is_icon, menu) = (entry.is_icon(), entry.menu());
    let Entry { face, name, hint, enabled, kind, other_faces, .. } = entry;
    let least = if other_faces.is_empty() { 0.0 } else { width };
    let add = |ui: &mut Ui| match kind {
        EntryKind::Separator => drop(ui.separator()),
        EntryKind::Text(style) => {
            let label = ui.add(egui::Label::new(RichText::new(face).text_style(style)).extend());
            set_name_and_hint(label, false, &name, &hint, None);
        }
        EntryKind::Widget(show) => {
            let begin = ui.cursor().left();
            show(ui, context);
            let width = (ui.min_rect().right() - begin).max(0.0);
            let known = id.0.with(&name);
            if ui.data(|d| d.get_temp(known)) != Some(width) {
                ui.data_mut(|d| d.insert_temp(known, width));
                ui.ctx().request_repaint();
            }
        }
        EntryKind::Button(act) => {
            let button = ui.add(Button::new(face).min_size(vec2(least, 0.0)));
            if set_name_and_hint(button, is_icon, &name, &hint, None).clicked() {
                act(context);
            }
        }
        EntryKind::Toggle(on, act) => {
            let button = ui.add(Button::selectable(on, face).min_size(vec2(least, 0.0)));
            if set_name_and_hint(button, is_icon, &name, &hint, Some(on)).clicked() {
                act(context);
            }
        }
        EntryKind::Menu(show) => {
            let button = Button::new(face).min_size(vec2(width, 0.0));
            let (response, _) = MenuButton::from_button(button).config(menu).ui(ui, |ui| show(ui, context));
            set_name_and_hint(response, false, &name, &hint, None);
        }
    };
    // An entry has the same identity no matter which entries are next to it.
    ui.push_id(id, |ui| if enabled { add(ui) } else { ui.add_enabled_ui(false, add).inner });
}

fn menu_entry<C>(ui: &mut Ui, entry: Entry<'_, C>, context: &mut C) {
    let (is_icon, menu) = (entry.is_icon(), entry.menu());
    let Entry { face, name, hint, enabled, kind, .. } = entry;
    let words = if is_icon { format!("{face}  {name}") } else { name.clone() };
    match kind {
        EntryKind::Separator => drop(ui.separator()),
        EntryKind::Text(style) => {
            let room = ui.ctx().content_rect().width() - 40.0;
            let label = egui::Label::new(RichText::new(&face).text_style(style.clone()));
            let label = match text_width(ui, &face, style) > room {
                true => {
                    ui.set_max_width(room);
                    ui.add(label.wrap())
                }
                false => ui.add(label.extend()),
            };
            set_name_and_hint(label, false, &name, &hint, None);
        }
        EntryKind::Widget(show) => drop(ui.horizontal(|ui| show(ui, context))),
        EntryKind::Button(act) => {
            let response = ui.add_enabled(enabled, Button::new(words));
            if set_name_and_hint(response, is_icon, &name, &hint, None).clicked() {
                act(context);
                ui.close();
            }
        }
        EntryKind::Toggle(on, act) => {
            let response = ui.add_enabled(enabled, Button::selectable(on, words));
            if set_name_and_hint(response, is_icon, &name, &hint, Some(on)).clicked() {
                act(context);
                ui.close();
            }
        }
        EntryKind::Menu(show) => {
            ui.add_enabled_ui(enabled, |ui| {
                let menu = SubMenuButton::new(words).config(menu);
                let (response, _) = menu.ui(ui, |ui| show(ui, context));
                set_name_and_hint(response, is_icon, &name, &hint, None);
            });
        }
    }
}

/// Adds the name, the hint and the state of an entry.
fn set_name_and_hint(
    response: Response,
    is_icon: bool,
    name: &str,
    hint: &str,
    on: Option<bool>,
) -> Response {
    let enabled = response.enabled();
    if is_icon {
        response.widget_info(|| match on {
            Some(on) => WidgetInfo::selected(WidgetType::Checkbox, enabled, on, name),
            None => WidgetInfo::labeled(WidgetType::Button, enabled, name),
        });
    }
    let hint = if is_icon { icons::hinted(name, hint) } else { hint.to_string() };
    match hint.is_empty() {
        true => response,
        false if enabled => response.hint(hint),
        false => response.on_disabled_hover_text(hint),
    }
}

/// Properties of an entry that decide where it is placed.
struct EntryLayout {
    width: f32,
    yields: bool,
    is_separator: bool,
}

/// Whether each entry is in the line. If there is no room for all, those that yield leave first, then the others, from the last to the first, until
/// the rest fits next to the menu button, which is `more` wide. Separators without neighbors leave, too.
fn fits_in_line(parts: &[EntryLayout], spacing: f32, room: f32, more: f32) -> Vec<bool> {
    let mut on_line = vec![true; parts.len()];
    let taken = |on_line: &[bool]| {
        let widths =
            std::iter::zip(parts, on_line).filter(|(_, on)| **on).map(|(part, _)| part.width + spacing);
        widths.sum::<f32>() - spacing
    };
    if taken(&on_line) <= room {
        return on_line;
    }
    let order = |yields: bool| {
        (0..parts.len()).rev().filter(move |i| parts[*i].yields == yields && !parts[*i].is_separator)
    };
    for leaving in order(true).chain(order(false)) {
        on_line[leaving] = false;
        // A separator stays if entries of the line are on both sides.
        let mut is_behind = false;
        let mut last = None;
        for (i, part) in parts.iter().enumerate() {
            match part.is_separator {
                true => {
                    on_line[i] = false;
                    last = last.or(is_behind.then_some(i));
                }
                false if on_line[i] => {
                    if let Some(separator) = last.take() {
                        on_line[separator] = true;
                    }
                    is_behind = true;
                }
                false => {}
            }
        }
        if taken(&on_line) + spacing + more <= room {
            break;
        }
    }
    on_line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(width: f32) -> EntryLayout {
        EntryLayout { width, yields: false, is_separator: false }
    }

    #[test]
    fn entries_without_room_leave_from_the_end_texts_first() {
        let separator = || EntryLayout { is_separator: true, ..part(6.0) };
        let text = || EntryLayout { yields: true, ..part(100.0) };
        let parts = [part(20.0), separator(), text(), separator(), part(20.0), part(20.0)];
        let shown = |room: f32| -> String {
            fits_in_line(&parts, 4.0, room, 10.0).into_iter().map(|on| if on { '1' } else { '0' }).collect()
        };
        // 192 points of entries and five gaps.
        assert_eq!(shown(192.0), "111111");
        assert_eq!(shown(191.0), "110011", "one separator is enough");
        assert_eq!(shown(96.0), "110011", "20 + 6 + 20 + 20, three gaps, and the menu with its own");
        assert_eq!(shown(91.0), "110010");
        assert_eq!(shown(50.0), "100000", "no separator at the end");
        assert_eq!(shown(5.0), "000000");
    }
}
