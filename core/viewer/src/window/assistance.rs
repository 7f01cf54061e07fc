//! Screen readers and other assistive technologies read the window and act in it by AccessKit: AT-SPI on Linux, UI Automation on Windows,
//! NSAccessibility on macOS. The tree of the window is made once one of them asks for it, and no longer than it is there.

use super::News;
use super::open::Open;
use egui_winit::accesskit_winit::{Event, WindowEvent};

/// The connection of a window with them: one for each window, made before the window is visible.
pub(super) use egui_winit::accesskit_winit::Adapter;

impl From<Event> for News {
    fn from(event: Event) -> News {
        News::Assistance(event.window_event)
    }
}

/// Gives the window in the tree the name that its title has.
pub(super) fn name_window(ui: &egui::Ui, title: &str) {
    ui.ctx().accesskit_node_builder(egui::accesskit_root_id(), |node| node.set_label(title));
}

impl Open {
    /// The tree is requested, an action is done as if by mouse or keyboard, or nobody listens any more.
    pub(super) fn take_assistance(&mut self, event: WindowEvent) {
        match event {
            WindowEvent::InitialTreeRequested => {
                self.is_read = true;
                self.egui.enable_accesskit();
            }
            WindowEvent::ActionRequested(request) => self.input.on_accesskit_action_request(request),
            WindowEvent::AccessibilityDeactivated => {
                self.is_read = false;
                self.egui.disable_accesskit();
            }
        }
    }
}
