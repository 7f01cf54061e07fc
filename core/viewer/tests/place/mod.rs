//! Test fixture: a script in a temporary folder and the viewer that shows it, without a window of the system.
#![allow(dead_code)]

pub(crate) mod mouse;

use choreo_plugin::Frame;
use choreo_render::{CpuRenderer, Renderer};
use choreo_session::{FrameRenderer, FrameReply, SceneSource, Session};
use choreo_viewer::app::Viewer;
use choreo_viewer::panels::Panels;
use egui::{Event, Modifiers, PointerButton, Pos2, TextureId, Vec2};
use egui_kittest::Harness;
use std::collections::BTreeSet;
use std::fs;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// All panels of a viewer, run by the test harness.
pub(crate) type Desk = Harness<'static, Place>;

pub(crate) struct Place {
    pub folder: tempfile::TempDir,
    pub session: Session,
    pub viewer: Viewer,
    pub panels: Panels,
    /// Created by the first drawn frame.
    painter: Option<(FrameRenderer, Receiver<FrameReply>)>,
}

impl Place {
    pub(crate) fn new(script: &str) -> Place {
        Place::within(tempfile::tempdir().unwrap(), script)
    }

    /// Creates the fixture in a folder that already contains files.
    pub(crate) fn within(folder: tempfile::TempDir, script: &str) -> Place {
        let path = folder.path().join("a.rhai");
        fs::write(&path, script).unwrap();
        let session = Session::new(SceneSource::new(&path), &choreo::registry(), false).unwrap();
        let mut place = Place {
            folder,
            session,
            viewer: Viewer::new("a.rhai"),
            panels: Panels::default(),
            painter: None,
        };
        place.viewer.path = Some(path);
        place.reload();
        place
    }

    pub(crate) fn reload_with(&mut self, text: &str) {
        self.write(text);
        self.reload();
    }

    pub(crate) fn reload(&mut self) {
        assert!(self.show_version(), "{:?} {:?}", self.viewer.message, self.viewer.problems);
    }

    /// Loads the present script. Returns whether it is free of errors.
    pub(crate) fn show_version(&mut self) -> bool {
        let version = self.session.build(BTreeSet::new());
        let is_good = version.scene.is_some();
        self.viewer.take_version(version);
        is_good
    }

    /// Draws the requested frame, so that the viewer knows the positions of all objects.
    pub(crate) fn paint(&mut self) -> Option<Frame> {
        let asked = self.viewer.next_request()?;
        let (painter, reply) = self.painter.get_or_insert_with(|| {
            let (to, reply) = channel();
            let start = Box::new(|| {
                let renderer: Box<dyn Renderer> = Box::new(CpuRenderer::new(&[]));
                Ok((renderer, None))
            });
            (FrameRenderer::start(start, move |p| drop(to.send(p))).unwrap(), reply)
        });
        painter.request_frame(asked);
        let reply = reply.recv_timeout(Duration::from_secs(600)).unwrap();
        let taken = self.viewer.take_frame(reply);
        Some(taken.unwrap_or_else(|| panic!("{:?}", self.viewer.renderer_problems)).1)
    }

    /// Writes and loads a script that must have errors.
    pub(crate) fn load_faulty(&mut self, text: &str) {
        self.write(text);
        let version = self.session.build(BTreeSet::new());
        assert!(version.scene.is_none(), "the script was expected to be faulty");
        self.viewer.take_version(version);
    }

    pub(crate) fn text(&self) -> String {
        fs::read_to_string(self.folder.path().join("a.rhai")).unwrap()
    }

    pub(crate) fn write(&self, text: &str) {
        fs::write(self.folder.path().join("a.rhai"), text).unwrap();
    }

    /// Test harness with all panels, in a window of `size` points.
    pub(crate) fn harness(self, size: Vec2) -> Desk {
        let ui = |ui: &mut egui::Ui, place: &mut Place| {
            place.panels.show(ui, &mut place.viewer, &[Some(TextureId::User(0)); 4], 0.0);
        };
        let mut harness = Harness::builder().with_size(size).build_ui_state(ui, self);
        harness.run();
        harness
    }
}

/// Drags with the primary button, in two moves.
pub(crate) fn drag(desk: &mut Desk, from: Pos2, to: Pos2) {
    desk.hover_at(from);
    desk.run();
    desk.drag_at(from);
    desk.run();
    desk.hover_at(from + (to - from) * 0.5);
    desk.run();
    desk.hover_at(to);
    desk.run();
    desk.drop_at(to);
    desk.run();
}

pub(crate) fn secondary_click(desk: &mut Desk, pos: Pos2) {
    desk.hover_at(pos);
    desk.run();
    for pressed in [true, false] {
        let (button, modifiers) = (PointerButton::Secondary, Modifiers::NONE);
        desk.event(Event::PointerButton { pos, button, pressed, modifiers });
        desk.run();
    }
}
