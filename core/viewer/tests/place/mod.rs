//! A script in a folder of its own and the viewer that shows it, without a window of the system.

use choreo_live::{Recipe, Session};
use choreo_viewer::app::Viewer;
use choreo_viewer::panels::Panels;
use egui::Vec2;
use egui_kittest::Harness;
use std::collections::BTreeSet;
use std::fs;

pub struct Place {
    pub folder: tempfile::TempDir,
    pub session: Session,
    pub viewer: Viewer,
    pub panels: Panels,
}

impl Place {
    pub fn new(script: &str) -> Place {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.rhai");
        fs::write(&path, script).unwrap();
        let session = Session::new(Recipe::new(&path), &choreo::registry(), false).unwrap();
        let mut place = Place { folder, session, viewer: Viewer::new("a.rhai"), panels: Panels::default() };
        place.viewer.path = Some(path);
        place.reload();
        place
    }

    pub fn reload(&mut self) {
        let version = self.session.build(BTreeSet::new());
        assert!(version.scene.is_some(), "{:?}", version.problems);
        self.viewer.take_version(version);
    }

    pub fn text(&self) -> String {
        fs::read_to_string(self.folder.path().join("a.rhai")).unwrap()
    }

    pub fn write(&self, text: &str) {
        fs::write(self.folder.path().join("a.rhai"), text).unwrap();
    }

    /// All panels, in a window of so many points.
    pub fn harness(self, size: Vec2) -> Harness<'static, Place> {
        let ui = |ui: &mut egui::Ui, place: &mut Place| {
            place.panels.show(ui, &mut place.viewer, &[], 0.0);
        };
        let mut harness = Harness::builder().with_size(size).build_ui_state(ui, self);
        harness.run();
        harness
    }
}
