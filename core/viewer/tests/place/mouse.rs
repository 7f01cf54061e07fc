//! Simulated user with only a mouse: widgets are found by their accessible names and clicked or typed into; screenshots are drawn on the CPU.
#![allow(dead_code)]

use super::{Desk, Place};
use choreo_plugin::Frame;
use choreo_viewer::raster::{self, Texture, Textures};
use egui::accesskit::Role;
use egui::{Event, Modifiers, Pos2, Rect, TextureId, TexturesDelta, Vec2};
use egui_kittest::kittest::{NodeT, Queryable};
use egui_kittest::{Harness, Node, TestRenderer};
use std::cell::RefCell;
use std::path::PathBuf;
use std::rc::Rc;

/// Textures of the window, kept for drawing screenshots.
#[derive(Clone, Default)]
struct TextureRecorder(Rc<RefCell<Textures>>);

impl TestRenderer for TextureRecorder {
    fn handle_delta(&mut self, delta: &mut TexturesDelta) {
        let mut textures = self.0.borrow_mut();
        textures.apply_changes(delta);
        textures.free(delta);
    }
}

pub(crate) struct Mouse {
    pub desk: Desk,
    textures: TextureRecorder,
    /// Folder for screenshots (`CHOREO_SHOTS`). `None`: nothing is drawn.
    images: Option<PathBuf>,
    size: Vec2,
    shown: String,
}

impl Mouse {
    pub(crate) fn new(place: Place, size: Vec2) -> Mouse {
        let ui = |ui: &mut egui::Ui, place: &mut Place| {
            place.panels.show(ui, &mut place.viewer, &[Some(TextureId::User(0)); 4], 0.0);
        };
        let textures = TextureRecorder::default();
        let images = std::env::var_os("CHOREO_SHOTS").map(PathBuf::from);
        let shown = place.text();
        let mut desk =
            Harness::builder().with_size(size).renderer(textures.clone()).build_ui_state(ui, place);
        choreo_viewer::panels::set_colors(&desk.ctx, false);
        desk.run();
        let mut mouse = Mouse { desk, textures, images, size, shown };
        mouse.look();
        mouse
    }

    /// Does the work of the window between two gestures: reloads a changed script and draws the frame.
    pub(crate) fn look(&mut self) {
        let text = self.desk.state().text();
        if text != self.shown {
            self.shown = text;
            self.desk.state_mut().reload();
        }
        self.desk.run();
        while let Some(Frame { width, height, rgba, .. }) = self.desk.state_mut().paint() {
            let mut textures = self.textures.0.borrow_mut();
            textures.insert(TextureId::User(0), |old| Texture::opaque(old, width, height, &rgba));
            drop(textures);
            self.desk.run();
        }
        let trouble = &self.desk.state().viewer.message;
        assert!(trouble.is_none(), "{trouble:?}");
    }

    /// Rectangle of the widget whose name is or begins with `label`. Text next to a field of the same name is skipped.
    pub(crate) fn find(&self, label: &str) -> Rect {
        let is_seen = |rect: &Rect| Rect::from_min_size(Pos2::ZERO, self.size).contains(rect.center());
        let named = self.desk.query_all_by_label_contains(label).filter(|node| is_seen(&node.rect()));
        let order = |node: &Node<'_>| {
            let name = node.accesskit_node().label().unwrap_or_default();
            (name != label, !name.starts_with(label), node.accesskit_node().role() == Role::Label)
        };
        let found = named.min_by_key(order).map(|node| node.rect());
        found.unwrap_or_else(|| panic!("no {label:?} in {:#?}", self.labels()))
    }

    /// Names of all widgets, for the message of a failure.
    pub(crate) fn labels(&self) -> Vec<String> {
        let all = self.desk.query_all_by(|node| node.label().is_some());
        all.map(|node| format!("{} {:?}", node.accesskit_node().label().unwrap_or_default(), node.rect()))
            .collect()
    }

    pub(crate) fn click(&mut self, label: &str) {
        self.click_at(self.find(label).center());
    }

    pub(crate) fn click_at(&mut self, at: Pos2) {
        self.desk.hover_at(at);
        self.desk.run();
        self.desk.drag_at(at);
        self.desk.drop_at(at);
        self.desk.run();
        self.look();
    }

    /// Clicks menu entries one after the other.
    pub(crate) fn menu(&mut self, path: &[&str]) {
        path.iter().for_each(|label| self.click(label));
    }

    /// Opens the field with this name by a click, types into it, and leaves it open.
    pub(crate) fn write(&mut self, label: &str, text: &str) {
        self.click(label);
        self.desk.key_press_modifiers(Modifiers::COMMAND, egui::Key::A);
        self.desk.event(Event::Text(text.into()));
        self.desk.run();
    }

    /// Types into a single-line field and presses Enter.
    pub(crate) fn type_into(&mut self, label: &str, text: &str) {
        self.write(label, text);
        self.desk.key_press(egui::Key::Enter);
        self.desk.run();
        self.look();
    }

    /// Saves a screenshot if a folder for them is set.
    pub(crate) fn picture(&mut self, name: &str) {
        let Some(folder) = self.images.clone() else { return };
        self.desk.run();
        let (width, height) = (self.size.x as usize, self.size.y as usize);
        let mut pixels = vec![0; width * height];
        let primitives = self.desk.ctx.tessellate(self.desk.output().shapes.clone(), 1.0);
        raster::draw(&mut pixels, width, &primitives, 1.0, &self.textures.0.borrow());
        let rgb = pixels.iter().flat_map(|p| [(p >> 16) as u8, (p >> 8) as u8, *p as u8]).collect();
        let image = image::RgbImage::from_raw(width as u32, height as u32, rgb).unwrap();
        image.save(folder.join(format!("{name}.png"))).unwrap();
    }
}
