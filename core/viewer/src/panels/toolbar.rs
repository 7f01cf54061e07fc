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

type Action<'a, C> = Box<dyn FnOnce(&mut C) + 'a>;
type Show<'a, C> = Box<dyn FnOnce(&mut Ui, &mut C) + 'a>;

enum EntryKind<'a, C> {
    Button(Action<'a, C>),
    /// A button that is on or off.
    Toggle(bool, Action<'a, C>),
    Menu(Show<'a, C>),
    /// Another widget, which draws itself.
    Widget(Show<'a, C>),
    Text(TextStyle),
    Separator,
}

struct Entry<'a, C> {
    /// Displayed icon or text.
    caption: String,
    /// Name in the menu and for screen readers.
    name: String,
    hint: String,
    enabled: bool,
    /// Captions that the entry has at other times; it is as wide as the widest of them.
    other_captions: Vec<String>,
    /// Whether clicks in its menu leave the menu open.
    stays_open: bool,
    /// Whether the entry moves to the menu before those without this flag.
    moves_to_menu_first: bool,
    kind: EntryKind<'a, C>,
}

impl<C> Entry<'_, C> {
    fn is_separator(&self) -> bool {
        matches!(self.kind, EntryKind::Separator)
    }

    fn is_icon(&self) -> bool {
        self.caption != self.name
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
    pub(super) fn new(id: impl std::hash::Hash + std::fmt::Debug) -> Toolbar<'a, C> {
        Toolbar { id: egui::Id::new(("toolbar", id)), entries: Vec::new() }
    }

    fn add(&mut self, caption: &str, name: &str, hint: &str, kind: EntryKind<'a, C>) {
        let [caption, name, hint] = [caption, name, hint].map(str::to_string);
        let (other_captions, stays_open) = (Vec::new(), false);
        self.entries.push(Entry {
            caption,
            name,
            hint,
            enabled: true,
            other_captions,
            stays_open,
            moves_to_menu_first: false,
            kind,
        });
    }

    /// Reserves room in the last entry for these captions, so that the entries after it do not move.
    pub(super) fn reserve_width_for<'f>(&mut self, captions: impl Iterator<Item = &'f str>) {
        if let Some(last) = self.entries.last_mut() {
            last.other_captions = captions.map(str::to_string).collect();
        }
    }

    /// Keeps the menu of the last entry open until a click outside it.
    pub(super) fn keep_menu_open(&mut self) {
        if let Some(last) = self.entries.last_mut() {
            last.stays_open = true;
        }
    }

    /// Enables or disables the last entry.
    pub(super) fn set_enabled(&mut self, enabled: bool) {
        if let Some(last) = self.entries.last_mut() {
            last.enabled = enabled;
        }
    }

    pub(super) fn add_button(&mut self, text: &str, hint: &str, action: impl FnOnce(&mut C) + 'a) {
        self.add(text, text, hint, EntryKind::Button(Box::new(action)));
    }

    pub(super) fn add_icon(&mut self, icon: &str, name: &str, hint: &str, action: impl FnOnce(&mut C) + 'a) {
        self.add(icon, name, hint, EntryKind::Button(Box::new(action)));
    }

    pub(super) fn add_toggle(&mut self, on: bool, text: &str, hint: &str, action: impl FnOnce(&mut C) + 'a) {
        self.add(text, text, hint, EntryKind::Toggle(on, Box::new(action)));
    }

    pub(super) fn add_icon_toggle(
        &mut self,
        icon: &str,
        on: bool,
        name: &str,
        hint: &str,
        action: impl FnOnce(&mut C) + 'a,
    ) {
        self.add(icon, name, hint, EntryKind::Toggle(on, Box::new(action)));
    }

    pub(super) fn add_menu(&mut self, text: &str, hint: &str, show: impl FnOnce(&mut Ui, &mut C) + 'a) {
        self.add(text, text, hint, EntryKind::Menu(Box::new(show)));
    }

    /// Adds a widget. `name`: distinguishes it from others.
    pub(super) fn add_widget(
        &mut self,
        name: &str,
        moves_to_menu_first: bool,
        show: impl FnOnce(&mut Ui, &mut C) + 'a,
    ) {
        self.add(name, name, "", EntryKind::Widget(Box::new(show)));
        if let Some(last) = self.entries.last_mut() {
            last.moves_to_menu_first = moves_to_menu_first;
        }
    }

    /// Adds a text, which moves to the menu before buttons do.
    pub(super) fn add_text(&mut self, text: &str, hint: &str, style: TextStyle) {
        self.add(text, text, hint, EntryKind::Text(style));
        if let Some(last) = self.entries.last_mut() {
            last.moves_to_menu_first = true;
        }
    }

    pub(super) fn add_separator(&mut self) {
        self.add("", "", "", EntryKind::Separator);
    }

    /// Width of all entries in one line, points.
    pub(super) fn width(&self, ui: &Ui) -> f32 {
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
            EntryKind::Text(style) => text_width(ui, &entry.caption, style.clone()),
            _ => {
                let captions = std::iter::once(&entry.caption).chain(&entry.other_captions);
                let widths = captions.map(|caption| text_width(ui, caption, TextStyle::Button));
                widths.fold(0.0, f32::max) + padding
            }
        };
        self.entries.iter().map(width).collect()
    }

    /// Draws the toolbar. `reserved`: width at its end that it leaves free, points.
    pub(super) fn show(self, ui: &mut Ui, context: &mut C, reserved: f32) {
        let spacing = ui.spacing().item_spacing.x;
        let menu_button_width =
            text_width(ui, OVERFLOW_LABEL, TextStyle::Button) + 2.0 * ui.spacing().button_padding.x;
        let widths = self.widths(ui);
        let parts: Vec<EntryLayout> = std::iter::zip(&self.entries, &widths)
            .map(|(entry, width)| EntryLayout {
                width: *width,
                moves_to_menu_first: entry.moves_to_menu_first,
                is_separator: entry.is_separator(),
            })
            .collect();
        let room = ui.available_width() - reserved - ROUNDING_ALLOWANCE;
        let on_line = entries_on_line(&parts, spacing, room, menu_button_width);
        let (id, mut rest) = (self.id, Vec::new());
        for (number, (entry, is_on_line)) in self.entries.into_iter().zip(on_line).enumerate() {
            match is_on_line {
                true => show_line_entry(ui, (id, number), entry, widths[number], context),
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
                ui.push_id((id, number), |ui| show_menu_entry(ui, entry, context));
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
fn show_line_entry<C>(ui: &mut Ui, id: (egui::Id, usize), entry: Entry<'_, C>, width: f32, context: &mut C) {
    let (is_icon, menu) = (entry.is_icon(), entry.menu());
    let Entry { caption, name, hint, enabled, kind, other_captions, .. } = entry;
    let min_width = if other_captions.is_empty() { 0.0 } else { width };
    let add = |ui: &mut Ui| match kind {
        EntryKind::Separator => drop(ui.separator()),
        EntryKind::Text(style) => {
            let label = ui.add(egui::Label::new(RichText::new(caption).text_style(style)).extend());
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
        EntryKind::Button(action) => {
            let button = ui.add(Button::new(caption).min_size(vec2(min_width, 0.0)));
            if set_name_and_hint(button, is_icon, &name, &hint, None).clicked() {
                action(context);
            }
        }
        EntryKind::Toggle(on, action) => {
            let button = ui.add(Button::selectable(on, caption).min_size(vec2(min_width, 0.0)));
            if set_name_and_hint(button, is_icon, &name, &hint, Some(on)).clicked() {
                action(context);
            }
        }
        EntryKind::Menu(show) => {
            let button = Button::new(caption).min_size(vec2(width, 0.0));
            let (response, _) = MenuButton::from_button(button).config(menu).ui(ui, |ui| show(ui, context));
            set_name_and_hint(response, false, &name, &hint, None);
        }
    };
    // An entry has the same identity no matter which entries are next to it.
    ui.push_id(id, |ui| if enabled { add(ui) } else { ui.add_enabled_ui(false, add).inner });
}

fn show_menu_entry<C>(ui: &mut Ui, entry: Entry<'_, C>, context: &mut C) {
    let (is_icon, menu) = (entry.is_icon(), entry.menu());
    let Entry { caption, name, hint, enabled, kind, .. } = entry;
    let text = if is_icon { format!("{caption}  {name}") } else { name.clone() };
    match kind {
        EntryKind::Separator => drop(ui.separator()),
        EntryKind::Text(style) => {
            let room = ui.ctx().content_rect().width() - 40.0;
            let label = egui::Label::new(RichText::new(&caption).text_style(style.clone()));
            let label = match text_width(ui, &caption, style) > room {
                true => {
                    ui.set_max_width(room);
                    ui.add(label.wrap())
                }
                false => ui.add(label.extend()),
            };
            set_name_and_hint(label, false, &name, &hint, None);
        }
        EntryKind::Widget(show) => drop(ui.horizontal(|ui| show(ui, context))),
        EntryKind::Button(action) => {
            let response = ui.add_enabled(enabled, Button::new(text));
            if set_name_and_hint(response, is_icon, &name, &hint, None).clicked() {
                action(context);
                ui.close();
            }
        }
        EntryKind::Toggle(on, action) => {
            let response = ui.add_enabled(enabled, Button::selectable(on, text));
            if set_name_and_hint(response, is_icon, &name, &hint, Some(on)).clicked() {
                action(context);
                ui.close();
            }
        }
        EntryKind::Menu(show) => {
            ui.add_enabled_ui(enabled, |ui| {
                let menu = SubMenuButton::new(text).config(menu);
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
    let hint = if is_icon { icons::name_and_hint(name, hint) } else { hint.to_string() };
    match hint.is_empty() {
        true => response,
        false if enabled => response.hint(hint),
        false => response.on_disabled_hover_text(hint),
    }
}

/// Properties of an entry that decide where it is placed.
struct EntryLayout {
    width: f32,
    moves_to_menu_first: bool,
    is_separator: bool,
}

/// Whether each entry is in the line. If there is no room for all, those with `moves_to_menu_first` leave first, then the others, from the last to
/// the first, until the rest fits next to the menu button, which is `menu_button_width` wide. Separators without neighbors leave, too.
fn entries_on_line(parts: &[EntryLayout], spacing: f32, room: f32, menu_button_width: f32) -> Vec<bool> {
    let mut on_line = vec![true; parts.len()];
    let used_width = |on_line: &[bool]| {
        let widths =
            std::iter::zip(parts, on_line).filter(|(_, on)| **on).map(|(part, _)| part.width + spacing);
        widths.sum::<f32>() - spacing
    };
    if used_width(&on_line) <= room {
        return on_line;
    }
    let order = |moves_to_menu_first: bool| {
        (0..parts.len())
            .rev()
            .filter(move |i| parts[*i].moves_to_menu_first == moves_to_menu_first && !parts[*i].is_separator)
    };
    for leaving in order(true).chain(order(false)) {
        on_line[leaving] = false;
        // A separator stays if entries of the line are on both sides.
        let mut follows_entry = false;
        let mut last = None;
        for (i, part) in parts.iter().enumerate() {
            match part.is_separator {
                true => {
                    on_line[i] = false;
                    last = last.or(follows_entry.then_some(i));
                }
                false if on_line[i] => {
                    if let Some(separator) = last.take() {
                        on_line[separator] = true;
                    }
                    follows_entry = true;
                }
                false => {}
            }
        }
        if used_width(&on_line) + spacing + menu_button_width <= room {
            break;
        }
    }
    on_line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry_of_width(width: f32) -> EntryLayout {
        EntryLayout { width, moves_to_menu_first: false, is_separator: false }
    }

    #[test]
    fn toolbar_entries_without_room_move_to_the_menu_from_the_end_texts_first() {
        let separator = || EntryLayout { is_separator: true, ..entry_of_width(6.0) };
        let text = || EntryLayout { moves_to_menu_first: true, ..entry_of_width(100.0) };
        let parts = [
            entry_of_width(20.0),
            separator(),
            text(),
            separator(),
            entry_of_width(20.0),
            entry_of_width(20.0),
        ];
        let shown = |room: f32| -> String {
            entries_on_line(&parts, 4.0, room, 10.0)
                .into_iter()
                .map(|on| if on { '1' } else { '0' })
                .collect()
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
