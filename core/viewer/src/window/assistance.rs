//! Accessibility by AccessKit, for screen readers and other assistive technologies: AT-SPI on Linux, UI Automation on Windows, NSAccessibility on
//! macOS. The accessibility tree is only built while one of them is active.

use super::WindowMessage;
use super::open::OpenWindow;
use egui_winit::accesskit_winit::{Event, WindowEvent};

/// Connection of a window to assistive technologies, created before the window is visible.
pub(super) use egui_winit::accesskit_winit::Adapter;

impl From<Event> for WindowMessage {
    fn from(event: Event) -> WindowMessage {
        WindowMessage::Assistance(event.window_event)
    }
}

/// Names the window's node in the accessibility tree after its title.
pub(super) fn name_window(ui: &egui::Ui, title: &str) {
    ui.ctx().accesskit_node_builder(egui::accesskit_root_id(), |node| node.set_label(title));
}

impl OpenWindow {
    /// Handles an event: activation, an action to be done as if by mouse or keyboard, or deactivation.
    pub(super) fn take_assistance(&mut self, event: WindowEvent) {
        match event {
            WindowEvent::InitialTreeRequested => {
                self.is_accessibility_active = true;
                self.egui.enable_accesskit();
            }
            WindowEvent::ActionRequested(request) => self.input.on_accesskit_action_request(request),
            WindowEvent::AccessibilityDeactivated => {
                self.is_accessibility_active = false;
                self.egui.disable_accesskit();
            }
        }
    }
}
