//! The open window: its input, its painter and its scale factor, which can change.

use super::WindowMessage;
#[cfg(feature = "accesskit")]
use super::assistance::Adapter;
use super::gpu_error::GpuError;
use super::painter::{PaintError, Painter};
use choreo_command_line::Device;
use std::sync::Arc;
use winit::event::InnerSizeWriter;
use winit::event_loop::{ActiveEventLoop, EventLoopProxy};
use winit::window::Window;

/// The window, the translation of its events, and the painter that draws into it.
pub(super) struct OpenWindow {
    pub egui: egui::Context,
    pub input: egui_winit::State,
    // Dropped before the window, whose surface it draws on.
    pub painter: Painter,
    pub window: Arc<Window>,
    /// Scale factor, pixels per point, as reported last. On X11 `Window::scale_factor` may return it only after the window was moved.
    pub scale: f64,
    /// Reason why Vulkan does not draw the window, although it was wanted.
    pub vulkan_error: Option<GpuError>,
    /// Whether an assistive technology has requested the content of the window.
    #[cfg(feature = "accesskit")]
    pub is_accessibility_active: bool,
}

/// A window on the screen without a painter. It survives the loss of a device.
pub(super) struct BareWindow {
    window: Arc<Window>,
    #[cfg(feature = "accesskit")]
    adapter: Adapter,
    /// Whether an assistive technology has requested the content of the window.
    #[cfg(feature = "accesskit")]
    is_accessibility_active: bool,
}

impl BareWindow {
    /// Shows a window. `window`: not visible yet.
    #[cfg_attr(not(feature = "accesskit"), expect(unused_variables))]
    pub(super) fn new(
        window: Window,
        events: &ActiveEventLoop,
        proxy: &EventLoopProxy<WindowMessage>,
    ) -> BareWindow {
        #[cfg(feature = "accesskit")]
        let adapter = Adapter::with_event_loop_proxy(events, &window, proxy.clone());
        window.set_visible(true);
        BareWindow {
            window: Arc::new(window),
            #[cfg(feature = "accesskit")]
            adapter,
            #[cfg(feature = "accesskit")]
            is_accessibility_active: false,
        }
    }
}

impl OpenWindow {
    /// Drops everything that draws into the window. `None` if the accessibility adapter is missing.
    #[cfg_attr(not(feature = "accesskit"), expect(unused_mut))]
    pub(super) fn close(mut self) -> Option<BareWindow> {
        Some(BareWindow {
            window: self.window,
            #[cfg(feature = "accesskit")]
            adapter: self.input.accesskit.take()?,
            #[cfg(feature = "accesskit")]
            is_accessibility_active: self.is_accessibility_active,
        })
    }

    pub(super) fn new(
        shown: BareWindow,
        device: Device,
        proxy: &EventLoopProxy<WindowMessage>,
    ) -> Result<OpenWindow, PaintError> {
        let window = shown.window;
        let (painter, vulkan_error) = Painter::new(&window, device)?;
        let egui = egui::Context::default();
        let proxy = std::sync::Mutex::new(proxy.clone());
        egui.set_request_repaint_callback(move |info| {
            let proxy = proxy.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            drop(proxy.send_event(WindowMessage::Repaint(info.delay)));
        });
        #[cfg_attr(not(feature = "accesskit"), expect(unused_mut))]
        let mut input = egui_winit::State::new(
            egui.clone(),
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            window.theme(),
            Some(painter.largest_texture()),
        );
        #[cfg(feature = "accesskit")]
        {
            input.accesskit = Some(shown.adapter);
            if shown.is_accessibility_active {
                egui.enable_accesskit();
            }
        }
        let scale = window.scale_factor();
        Ok(OpenWindow {
            egui,
            input,
            painter,
            window,
            scale,
            vulkan_error,
            #[cfg(feature = "accesskit")]
            is_accessibility_active: shown.is_accessibility_active,
        })
    }

    /// Input events since the last call, in points of the current scale.
    pub(super) fn take_input(&mut self) -> egui::RawInput {
        let mut input = self.input.take_egui_input(&self.window);
        if self.scale != self.window.scale_factor() {
            let size =
                self.window.inner_size().to_logical::<f32>(self.scale * f64::from(self.egui.zoom_factor()));
            let size = egui::vec2(size.width, size.height);
            input.screen_rect = Some(egui::Rect::from_min_size(egui::Pos2::ZERO, size));
            let viewport = input.viewports.entry(egui::ViewportId::ROOT).or_default();
            viewport.native_pixels_per_point = Some(self.scale as f32);
        }
        input
    }

    /// Sets another scale factor; the window keeps its size in points. X11 may report a change twice, which must not enlarge the window twice.
    pub(crate) fn rescale(&mut self, scale: f64, size: &mut InnerSizeWriter) {
        if scale == self.scale {
            // A request that comes too late has no effect.
            let _ = size.request_inner_size(self.window.inner_size());
        }
        self.scale = scale;
    }
}
