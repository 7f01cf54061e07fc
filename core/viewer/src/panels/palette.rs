//! Command palette: a search field for all actions, panels, actors, clips and lines of the script.

use super::actions::{self, ACTIONS, Context};
use super::{Panels, Tab, dialog};
use crate::app::Viewer;
use crate::editing::constraining::NewConstraint;
use crate::library::file_dialog::Purpose;
use crate::library::templates::TEMPLATES;
use crate::state::selection::Selected;
use choreo_motion::Time;
use choreo_session::edit::Addition;
use egui::{Align2, Key, Modifiers, RichText, ScrollArea, TextEdit, Ui, vec2};
use std::path::PathBuf;

/// Largest number of displayed entries.
const MAX_ENTRIES: usize = 60;
/// Largest height of the list, points.
const MAX_LIST_HEIGHT: f32 = 420.0;

/// Effect of an entry.
#[derive(Clone, Debug)]
enum Target {
    RunAction(&'static str),
    OpenPanel(Tab),
    NewScript(usize),
    OpenFile(PathBuf),
    Select(Selected, Option<Time>),
    /// Adds an object. `None`: a camera at the view.
    AddObject(Option<Addition>),
    /// Adds a constraint to the selected actor.
    AddConstraint(NewConstraint),
    /// Plays a clip of the actor's own file: name of the actor, and of the clip.
    PlayClip(String, String),
    GoToLine(usize),
}

impl Target {
    /// Additional words to find the entry by.
    fn synonyms(&self) -> &'static str {
        match self {
            Target::RunAction(id) => actions::synonyms(id),
            Target::OpenPanel(tab) => actions::synonyms(&actions::panel_id(*tab)),
            _ => "",
        }
    }
}

#[derive(Clone, Debug)]
struct Entry {
    text: String,
    /// Kind of the entry, or its shortcut.
    note: String,
    target: Target,
}

#[derive(Default)]
pub(super) struct Palette {
    open: bool,
    /// Whether the text field gets the keyboard focus.
    needs_focus: bool,
    text: String,
    /// Index of the entry that Enter chooses.
    highlighted: usize,
    entries: Vec<Entry>,
}

impl Palette {
    pub(super) fn is_open(&self) -> bool {
        self.open
    }

    pub(crate) fn toggle(&mut self) {
        *self = Palette { open: !self.open, needs_focus: true, ..Palette::default() };
    }

    /// Entries that match the text, the best first.
    fn matching_entries(&self) -> Vec<Entry> {
        let text = self.text.to_lowercase();
        let words: Vec<&str> = text.split_whitespace().collect();
        let mut found: Vec<(usize, usize, &Entry)> = Vec::new();
        for (number, entry) in self.entries.iter().enumerate() {
            let synonyms = entry.target.synonyms();
            let searched = format!("{} {} {synonyms}", entry.text, entry.note).to_lowercase();
            if words.iter().all(|word| searched.contains(word)) {
                let first = words.first().and_then(|word| searched.find(word)).unwrap_or(0);
                found.push((usize::from(first > 0), number, entry));
            }
        }
        // Entries that begin with the first word come first; otherwise the order of the list is kept.
        found.sort_by_key(|(behind, number, _)| (*behind, *number));
        found.into_iter().take(MAX_ENTRIES).map(|(_, _, entry)| entry.clone()).collect()
    }
}

pub(super) fn show(panels: &mut Panels, ui: &Ui, viewer: &mut Viewer, now: f64) {
    if !panels.palette.open {
        return;
    }
    if panels.palette.needs_focus {
        panels.palette.entries = all_entries(viewer);
    }
    // Keys of the list are handled before the text field.
    let pressed = |key| ui.input_mut(|i| i.consume_key(Modifiers::NONE, key));
    let (down, up) = (pressed(Key::ArrowDown), pressed(Key::ArrowUp));
    let (enter, escape) = (pressed(Key::Enter), pressed(Key::Escape));
    let palette = &mut panels.palette;
    let mut chosen = None;
    let shown = dialog::show_modal(ui, "Commands", (Align2::CENTER_TOP, vec2(0.0, 60.0)), |ui| {
        ui.set_width(560.0);
        let field = TextEdit::singleline(&mut palette.text).hint_text("action, panel, actor, clip or line");
        let field = ui.add(field.desired_width(f32::INFINITY));
        let field = super::values::set_widget_name(field, egui::WidgetType::TextEdit, "find a command");
        if std::mem::take(&mut palette.needs_focus) {
            field.request_focus();
        }
        if field.changed() {
            palette.highlighted = 0;
        }
        let found = palette.matching_entries();
        let last = found.len().saturating_sub(1);
        palette.highlighted = match (down, up) {
            (true, false) => (palette.highlighted + 1).min(last),
            (false, true) => palette.highlighted.saturating_sub(1),
            _ => palette.highlighted.min(last),
        };
        ui.separator();
        // The list grows again after a search with few results.
        let list = ScrollArea::vertical().max_height(MAX_LIST_HEIGHT).min_scrolled_height(MAX_LIST_HEIGHT);
        list.auto_shrink([false, true]).show(ui, |ui| {
            for (number, entry) in found.iter().enumerate() {
                let is_highlighted = number == palette.highlighted;
                let button = egui::Button::selectable(is_highlighted, &entry.text).truncate();
                let button = button.right_text(RichText::new(&entry.note).weak().monospace());
                let response = ui.add_sized([ui.available_width(), 20.0], button);
                if is_highlighted && (down || up) {
                    response.scroll_to_me(None);
                }
                if response.clicked() {
                    chosen = Some(entry.target.clone());
                }
            }
            if found.is_empty() {
                ui.weak("nothing found");
            }
        });
        if enter {
            chosen = found.get(palette.highlighted).map(|entry| entry.target.clone());
        }
    });
    let is_dismissed = escape || shown.backdrop_response.clicked();
    if is_dismissed || chosen.is_some() {
        panels.palette = Palette::default();
    }
    if let Some(target) = chosen {
        run_target(&mut Context { panels, ui, viewer, now }, target);
    }
}

fn run_target(c: &mut Context, target: Target) {
    match target {
        Target::RunAction(id) => {
            if let Some(action) = actions::find_action(id) {
                (action.run)(c);
            }
        }
        Target::OpenPanel(tab) => c.panels.bring_to_front(tab),
        Target::NewScript(number) => {
            let shown = c.viewer.path.clone();
            c.viewer.documents.open_dialog(Purpose::New(TEMPLATES[number]), shown.as_deref());
        }
        Target::OpenFile(file) => c.viewer.documents.file_to_open = Some(file),
        Target::Select(what, at) => {
            if let Some(at) = at {
                c.viewer.playhead.pause();
                c.viewer.playhead.seek(at);
            }
            c.viewer.selection = Some(what);
        }
        Target::AddObject(what) => super::add_menu::add_object(c.viewer, what.as_ref()),
        Target::AddConstraint(new) => c.viewer.edit(|v| v.add_constraint(&new)),
        Target::PlayClip(actor, clip) => {
            let secs = c.viewer.playhead.time().as_secs();
            c.viewer.edit(|v| v.add_clip(&actor, &actor, &clip, secs));
        }
        Target::GoToLine(line) => c.viewer.script_scroll_line = Some(line),
    }
}

/// All entries that can be found.
fn all_entries(viewer: &Viewer) -> Vec<Entry> {
    let entry = |text: String, note: String, target: Target| Entry { text, note, target };
    let mut all: Vec<Entry> = ACTIONS
        .iter()
        .filter(|action| action.id != "palette")
        .map(|action| {
            let keys = viewer.shortcuts.display_text(action.id, action.default_shortcuts);
            entry(action.title.to_string(), keys, Target::RunAction(action.id))
        })
        .collect();
    for tab in Tab::ALL {
        let keys: Vec<String> =
            actions::panel_shortcuts(viewer, tab).iter().map(ToString::to_string).collect();
        all.push(entry(format!("panel {}", tab.title()), keys.join(", "), Target::OpenPanel(tab)));
    }
    if viewer.path.is_some() && viewer.previewed_files.is_empty() {
        let additions = super::add_menu::palette_additions(viewer).into_iter();
        all.extend(additions.map(|(text, what)| entry(text, "new".into(), Target::AddObject(what))));
        let constraints = super::add_menu::palette_constraints(viewer).into_iter();
        all.extend(
            constraints.map(|(text, new)| entry(text, "constraint".into(), Target::AddConstraint(new))),
        );
    }
    for (number, template) in TEMPLATES.iter().enumerate() {
        all.push(entry(format!("new: {}", template.name), "template".into(), Target::NewScript(number)));
    }
    for file in &viewer.documents.recent {
        all.push(entry(format!("open {}", file.display()), "recent".into(), Target::OpenFile(file.clone())));
    }
    add_object_entries(viewer, &mut all);
    let places = viewer.scene.as_ref().map(|scene| &scene.places);
    let text = places.and_then(|places| places.sources.get(&places.main).cloned()).unwrap_or_default();
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        all.push(entry(
            line.trim().to_string(),
            format!("line {}", number + 1),
            Target::GoToLine(number + 1),
        ));
    }
    all
}

/// Entries for objects of the stage, clips on the timeline, and clips that the selected actor could play.
fn add_object_entries(viewer: &Viewer, all: &mut Vec<Entry>) {
    let Some(scene) = &viewer.scene else { return };
    let stage = &scene.stage;
    let mut select = |text: String, note: &str, what: Selected, at: Option<Time>| {
        all.push(Entry { text, note: note.to_string(), target: Target::Select(what, at) });
    };
    for actor in &stage.actors {
        select(actor.name.clone(), "actor", Selected::Actor(actor.name.clone()), None);
    }
    for camera in &stage.cameras {
        select(camera.name.clone(), "camera", Selected::Camera(camera.name.clone()), None);
    }
    for index in 0..stage.lights.len() {
        select(viewer.light_name(index), "light", Selected::Light(index), None);
    }
    for (index, effect) in stage.effects.iter().enumerate() {
        select(effect.plugin.clone(), "effect", Selected::Effect(index), Some(effect.start));
    }
    for bar in viewer.bars() {
        if let Selected::Cue { actor, .. } = &bar.what {
            let text = format!("{} of {actor}", bar.label);
            select(
                text,
                &format!("clip at {}", viewer.time_text(bar.start)),
                bar.what.clone(),
                Some(bar.start),
            );
        }
    }
    let selected = viewer.selection.as_ref().and_then(Selected::actor);
    let selected = selected.and_then(|name| stage.actors.iter().find(|actor| actor.name == name));
    if let Some(actor) = selected {
        for clip in &actor.asset.clips {
            let (name, clip) = (actor.name.clone(), clip.name.clone());
            let text = format!("play {clip} on {name}");
            all.push(Entry { text, note: "at the playhead".into(), target: Target::PlayClip(name, clip) });
        }
    }
}
