//! The window: handles events and draws frames. Its thread sleeps unless something has happened.

#[cfg(feature = "accesskit")]
mod assistance;
mod checker;
mod choose;
mod device;
mod documents;
mod error;
mod event_log;
mod gpu;
mod gpu_error;
mod image;
#[cfg(target_os = "linux")]
mod lost_display;
mod open;
mod painter;
mod priority;
pub mod raster;
mod shot;
mod software;
mod start;
mod swapchain;
#[cfg(unix)]
mod termination;

use crate::app::{Viewer, add_messages};
use crate::args::{FileOptions, ViewerOptions};
use crate::library::documents::Documents;
use crate::panels::Panels;
use crate::state::dropped_models::DroppedModels;
use crate::state::settings::{SaveTime, Settings, SettingsWriter};
use crate::state::shortcuts::Shortcuts;
use crate::state::view::Resolution;
use checker::Checker;
use choreo::App;
use choreo_command_line::Device;
use choreo_plugin::{Frame, Registry};
use choreo_session::{
    FrameRenderer, FrameReply, Problem, Scene, SceneSource, SceneVersion, SessionThread, StartRenderer,
};
use error::ViewerError;
use event_log::EventLog;
use gpu_error::GpuError;
use open::{BareWindow, OpenWindow};
use painter::Painter;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::{LogicalSize, PhysicalPosition};
use winit::event::{StartCause, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy};
#[cfg(target_os = "linux")]
use winit::platform::wayland::WindowAttributesExtWayland;
use winit::window::{Window, WindowId};

/// Messages from other threads to the window.
enum WindowMessage {
    /// A version of the file with this number: the open file, or dropped files.
    Version(u64, Box<SceneVersion>),
    Frame(Box<FrameReply>),
    /// Messages of `check`: number of the file, number of the version, and the problems.
    Checked(u64, u64, Vec<Problem>),
    /// Request to close the window.
    Close,
    /// Request of egui to be drawn again after this time.
    Repaint(Duration),
    /// An assistive technology reads the window or acts in it.
    #[cfg(feature = "accesskit")]
    Assistance(egui_winit::accesskit_winit::WindowEvent),
}

/// Number of the first file; dropped files and further opened ones count from 1.
const FIRST_FILE: u64 = 0;

/// Opens the window, and returns when it is closed. The error says what is missing. Half of the lines list the fields of the window.
pub(crate) fn run(options: ViewerOptions, program: &App) -> Result<(), ViewerError> {
    let source = options.first_file.map(|input| options.files.source(input)).transpose()?;
    let event_log = EventLog::new(options.event_log);
    let events = start::create_event_loop()?;
    #[cfg(target_os = "linux")]
    lost_display::install_handler(&events);
    event_log.log_step("event loop");
    let proxy = events.create_proxy();
    #[cfg(unix)]
    {
        let proxy = proxy.clone();
        // The signal ends the program as usual if it cannot be watched.
        let _ = termination::watch_signals(move || drop(proxy.send_event(WindowMessage::Close)));
    }
    let registry = program.registry.clone();
    let effects = registry.effects().to_vec();
    let renderer = start::start_renderer(
        effects,
        options.files.base_source().shader_folder.clone(),
        options.device,
        event_log,
    );
    let frame_renderer = start_frame_renderer(renderer, &proxy)?;
    let session =
        source.clone().map(|source| start_session(source, &registry, &proxy, FIRST_FILE)).transpose()?;
    let settings_file = Settings::file();
    let settings = settings_file.as_deref().map(Settings::read).unwrap_or_default();
    let mut viewer = documents::first_viewer(source.as_ref(), &registry, &options.files, &settings);
    let shortcuts_file = settings_file.as_ref().map(|file| file.with_file_name(Shortcuts::FILE));
    viewer.message = documents::read_shortcuts(&mut viewer, shortcuts_file.as_deref());
    viewer.commands = options.commands;
    viewer.views.iter_mut().for_each(|view| view.overlays = settings.overlays);
    if options.full_size {
        viewer.views.iter_mut().for_each(|view| view.resolution = Resolution::Full);
    }
    let written_preset = viewer.shortcuts.preset.clone();
    let mut app = ViewerWindow {
        program: program.name,
        viewer,
        panels: Panels::new(&settings),
        settings: SettingsWriter::new(settings),
        settings_file,
        written_preset,
        initial_playback: Some((options.start_secs, options.plays_at_start)),
        frame_renderer,
        source: source.unwrap_or_else(|| options.files.base_source().clone()),
        options: options.files,
        device: options.device,
        registry,
        session,
        open_file_number: FIRST_FILE,
        preview_session: None,
        model_session: None,
        newest_session: FIRST_FILE,
        last_good_version: None,
        checker: Checker::new(),
        unchecked: None,
        proxy,
        open_window: None,
        frames: BTreeMap::new(),
        reloads: 0,
        started: Instant::now(),
        last_requested: None,
        wake_at: None,
        drawn_frames: 0,
        mouse_button_changed: false,
        is_covered: false,
        lose_device_at: options.lose_device_at,
        event_log,
        consecutive_failures: 0,
        fatal_error: None,
    };
    let ran = start::run(events, &mut app);
    app.save_settings();
    if let Err(error) = ran {
        // The objects of the window system can no longer be freed after an error.
        #[cfg(target_os = "linux")]
        lost_display::exit_now(&error);
        #[cfg(not(target_os = "linux"))]
        {
            std::mem::forget(app);
            return Err(error);
        }
    }
    app.fatal_error.take().map_or(Ok(()), Err)
}

/// Starts the thread of a renderer, which sends its frames to the event loop.
fn start_frame_renderer(
    renderer: StartRenderer,
    proxy: &EventLoopProxy<WindowMessage>,
) -> Result<FrameRenderer, ViewerError> {
    let proxy = proxy.clone();
    // Sending fails only if the window no longer exists; here and below.
    let report = move |reply| drop(proxy.send_event(WindowMessage::Frame(Box::new(reply))));
    FrameRenderer::start(renderer, report).map_err(ViewerError::Thread)
}

fn start_session(
    source: SceneSource,
    plugins: &Registry,
    proxy: &EventLoopProxy<WindowMessage>,
    file_number: u64,
) -> Result<SessionThread, ViewerError> {
    let proxy = proxy.clone();
    let report =
        move |version| drop(proxy.send_event(WindowMessage::Version(file_number, Box::new(version))));
    Ok(SessionThread::start(source, plugins, report)?)
}

struct ViewerWindow {
    /// Name of the program, for the title.
    program: &'static str,
    viewer: Viewer,
    panels: Panels,
    settings: SettingsWriter,
    settings_file: Option<PathBuf>,
    /// Preset of the keyboard shortcuts in their file.
    written_preset: String,
    /// Initial time in seconds and play state, until the first version arrives.
    initial_playback: Option<(f64, bool)>,
    frame_renderer: FrameRenderer,
    source: SceneSource,
    options: FileOptions,
    device: Device,
    registry: Registry,
    /// Session of the open file. `None` on the start page.
    session: Option<SessionThread>,
    /// Number of the open file.
    open_file_number: u64,
    /// Session that previews dropped files.
    preview_session: Option<SessionThread>,
    /// Session that reads models dropped on a viewport, with its number and the models.
    model_session: Option<(u64, SessionThread, DroppedModels)>,
    /// Number of the newest session; versions of older dropped files are outdated.
    newest_session: u64,
    /// Newest good version of the script, displayed again when the preview of dropped files is closed.
    last_good_version: Option<SceneVersion>,
    checker: Checker,
    /// Newest scene of the script that was not checked yet; checked after its first image.
    unchecked: Option<Arc<Scene>>,
    proxy: EventLoopProxy<WindowMessage>,
    open_window: Option<OpenWindow>,
    /// Rendered frames that are not on the screen yet, by view.
    frames: BTreeMap<usize, Frame>,
    /// Number of shader changes that were passed on to the renderer.
    reloads: u64,
    started: Instant,
    last_requested: Option<Instant>,
    wake_at: Option<Instant>,
    /// Number of frames of the window so far.
    drawn_frames: u64,
    /// Whether a mouse button was pressed or released since the panels were drawn last.
    mouse_button_changed: bool,
    /// Whether something else covers the window.
    is_covered: bool,
    lose_device_at: Vec<u64>,
    event_log: EventLog,
    /// Number of consecutive failures.
    consecutive_failures: u32,
    fatal_error: Option<ViewerError>,
}

impl ViewerWindow {
    fn now(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    fn request_redraw(&self) {
        if let Some(open) = &self.open_window {
            open.window.request_redraw();
        }
    }

    /// Whether the window is minimized or covered. A hidden window is not drawn, and no frames are requested for it.
    fn is_hidden(&self) -> bool {
        let minimized = |open: &OpenWindow| open.window.is_minimized() == Some(true);
        self.is_covered || self.open_window.as_ref().is_some_and(minimized)
    }

    /// Saves the settings, including the layout of the panels, and the shortcuts.
    fn save_settings(&mut self) {
        self.save_shortcuts();
        let now = self.current_settings();
        if let Some(file) = &self.settings_file {
            self.settings.write(now, file);
        }
    }

    /// Saves changed keyboard shortcuts at once.
    fn save_shortcuts(&mut self) {
        let Some(file) = &self.settings_file else { return };
        let shortcuts = &mut self.viewer.shortcuts;
        if shortcuts.preset == self.written_preset && shortcuts.changed.is_empty() {
            return;
        }
        let problem = shortcuts.write(&file.with_file_name(Shortcuts::FILE));
        self.written_preset.clone_from(&shortcuts.preset);
        if let Some(problem) = problem {
            self.viewer.message = Some(format!("the shortcuts could not be saved: {problem}"));
            self.request_redraw();
        }
    }

    fn current_settings(&self) -> Settings {
        let Documents { recent, tempos, .. } = &self.viewer.documents;
        Settings { recent: recent.clone(), tempos: tempos.clone(), ..self.panels.settings() }
    }

    /// Saves the settings when they have not changed for some time, so that they are not lost if the program is killed.
    fn save_settings_when_due(&mut self) {
        if self.settings_file.is_none() {
            return;
        }
        self.save_shortcuts();
        let (settings, now) = (self.current_settings(), self.now());
        match self.settings.save_time(&settings, now) {
            SaveTime::Now => self.save_settings(),
            SaveTime::After(secs) => self.wake_in(Duration::from_secs_f64(secs)),
            SaveTime::Never => {}
        }
    }

    /// Advances the playhead, and requests the frames that are due.
    fn advance(&mut self) {
        if self.is_hidden() {
            return;
        }
        let cap = self.viewer.performance.max_fps.filter(|_| self.viewer.playhead.is_playing());
        if let (Some(cap), Some(last)) = (cap, self.last_requested) {
            let wait = Duration::from_secs_f64(1.0 / f64::from(cap.max(1))).saturating_sub(last.elapsed());
            if !wait.is_zero() {
                return self.wake_in(wait);
            }
        }
        let due = self.viewer.playhead.tick(self.now());
        while let Some(request) = self.viewer.next_request() {
            if self.reloads != self.viewer.reloads() {
                self.reloads = self.viewer.reloads();
                self.frame_renderer.shaders_changed();
            }
            self.last_requested = Some(Instant::now());
            self.frame_renderer.request_frame(request);
        }
        // A frame that is being rendered wakes the window itself.
        if let Some(due) = due.filter(|_| !self.viewer.is_waiting()) {
            self.wake_in(Duration::from_secs_f64(due.clamp(0.001, 1.0)));
        }
    }

    fn wake_in(&mut self, delay: Duration) {
        let at = Instant::now().checked_add(delay);
        self.wake_at = match (self.wake_at, at) {
            (Some(earlier), Some(at)) => Some(earlier.min(at)),
            (earlier, at) => earlier.or(at),
        };
    }

    fn draw(&mut self, events: &ActiveEventLoop) {
        if self.is_hidden() {
            return;
        }
        let now = self.now();
        #[cfg(feature = "accesskit")]
        let title = format!("{} – {}", self.viewer.name, self.program);
        let Some(open) = &mut self.open_window else { return };
        let size = open.window.inner_size();
        if size.width == 0 || size.height == 0 {
            return;
        }
        self.mouse_button_changed = false;
        let begin = Instant::now();
        let input = open.take_input();
        let textures = open.painter.view_textures();
        let (panels, viewer) = (&mut self.panels, &mut self.viewer);
        let output = open.egui.run_ui(input, |ui| {
            #[cfg(feature = "accesskit")]
            assistance::name_window(ui, &title);
            panels.show(ui, viewer, &textures, now);
        });
        open.input.handle_platform_output(&open.window, output.platform_output);
        let pixels_per_point = output.pixels_per_point;
        let primitives = open.egui.tessellate(output.shapes, pixels_per_point);
        let panels_took = begin.elapsed();
        let window = open.window.clone();
        let (size, frames) = ([size.width, size.height], &self.frames);
        let drawn =
            open.painter.draw(size, &primitives, pixels_per_point, output.textures_delta, frames, || {
                window.pre_present_notify()
            });
        self.event_log.log_window_frame(panels_took, begin.elapsed());
        self.drawn_frames += 1;
        let lost = self
            .lose_device_at
            .contains(&self.drawn_frames)
            .then(|| "the device was lost (simulated by the test)".to_string());
        let lost = lost.map_or(Ok(()), Err);
        let delay = output.viewport_output.get(&egui::ViewportId::ROOT).map(|v| v.repaint_delay);
        match drawn.map_err(|e| e.to_string()).and_then(|drawn| lost.map(|()| drawn)) {
            Ok(false) => {}
            Ok(true) => {
                self.consecutive_failures = 0;
                for (view, frame) in std::mem::take(&mut self.frames) {
                    self.frame_renderer.recycle_frame(frame);
                    if let Some(shown) = self.viewer.views.get(view).and_then(|v| v.shown.as_ref()) {
                        self.event_log.log_shown_frame(view, shown, &self.viewer.device_usage);
                    }
                }
                if open.painter.view_textures() != textures {
                    // The panels do not show the new texture yet.
                    self.request_redraw();
                }
            }
            Err(error) => self.recreate_device(&error, events),
        }
        if let Some(delay) = delay.filter(|d| *d < Duration::from_secs(3600)) {
            self.wake_in(delay);
        }
        self.update_previews();
        self.open_document();
        self.advance();
        self.save_settings_when_due();
        if self.viewer.should_close {
            events.exit();
        }
    }

    /// Starts a session that reads models dropped on a viewport, to add them to the scene.
    fn place_models(&mut self) {
        let Some(models) = self.viewer.dropped_models.take() else { return };
        let Some((source, _)) = SceneSource::of_models(models.files.clone(), &self.source) else { return };
        self.newest_session += 1;
        match start_session(source, &self.registry, &self.proxy, self.newest_session) {
            Ok(session) => self.model_session = Some((self.newest_session, session, models)),
            Err(error) => self.viewer.message = Some(error.to_string()),
        }
    }

    /// Previews dropped files, and closes the preview on request.
    fn update_previews(&mut self) {
        self.place_models();
        let dropped = SceneSource::of_models(std::mem::take(&mut self.viewer.dropped_files), &self.source);
        if let Some((source, left_out)) = dropped {
            self.viewer.message = left_out;
            self.newest_session += 1;
            let files = std::iter::once(&source.input).chain(&source.more_models).cloned().collect();
            match start_session(source, &self.registry, &self.proxy, self.newest_session) {
                Ok(session) => {
                    self.preview_session = Some(session);
                    self.viewer.previewed_files = files;
                }
                Err(error) => self.viewer.message = Some(error.to_string()),
            }
        }
        if std::mem::take(&mut self.viewer.close_preview) {
            self.preview_session = None;
            self.newest_session += 1;
            self.viewer.previewed_files.clear();
            if let Some(version) = self.last_good_version.clone() {
                self.viewer.take_version(version);
            }
            self.request_redraw();
        }
    }

    fn take_version(&mut self, file_number: u64, version: SceneVersion) {
        if let Some((_, _, models)) = self.model_session.take_if(|(number, ..)| *number == file_number) {
            return self.viewer.edit(|v| v.add_models(&models, &version));
        }
        if file_number == self.open_file_number {
            // A faulty version does not replace the last good one.
            if version.scene.is_some() || self.last_good_version.is_none() {
                self.last_good_version = Some(version.clone());
            }
            self.checker.cancel();
            self.unchecked = version.scene.clone().filter(|_| self.source.is_script());
            if !self.viewer.previewed_files.is_empty() {
                return;
            }
        } else if file_number != self.newest_session {
            return;
        }
        self.event_log.log_version(&version);
        self.viewer.take_version(version);
        if self.viewer.scene.is_some()
            && let Some((at, play)) = self.initial_playback.take()
        {
            self.viewer.playhead.seek(choreo_motion::Time::from_secs(at));
            if play {
                self.viewer.playhead.play(self.now());
            }
        }
    }

    /// Checks the newest scene after its first image, so that the check does not delay the image.
    fn start_check(&mut self) {
        let Some(scene) = self.unchecked.take() else { return };
        let (proxy, file_number, number) = (self.proxy.clone(), self.open_file_number, scene.number);
        let report =
            move |messages| drop(proxy.send_event(WindowMessage::Checked(file_number, number, messages)));
        self.checker.start(scene, self.source.clone(), report);
    }

    fn take_messages(&mut self, file_number: u64, number: u64, messages: &[Problem]) {
        if file_number != self.open_file_number {
            return;
        }
        self.event_log.log_check(number, messages.len());
        if let Some(version) = self.last_good_version.as_mut().filter(|version| version.number == number) {
            add_messages(&mut version.problems, messages);
        }
        if self.viewer.previewed_files.is_empty() {
            self.viewer.take_messages(number, messages);
        }
        self.request_redraw();
    }

    fn take_frame(&mut self, reply: FrameReply) {
        self.start_check();
        let Some((view, frame)) = self.viewer.take_frame(reply) else { return };
        if view == self.viewer.active_view
            && self.viewer.views[view].is_plain()
            && let Some(file) = self.viewer.screenshot.take()
        {
            let saved = shot::save_screenshot(&self.registry, &frame, self.viewer.playhead.fps(), &file);
            self.viewer.message = Some(match saved {
                Ok(()) => format!("saved {}", file.display()),
                Err(error) => format!("{}: {error}", file.display()),
            });
        }
        if let Some(skipped) = self.frames.insert(view, frame) {
            self.frame_renderer.recycle_frame(skipped);
        }
    }

    /// Takes a newly opened window, and tells the user if its panels are drawn on the CPU.
    fn take_window(&mut self, open: OpenWindow) {
        let why = open.vulkan_error.as_ref();
        // Drawing on the CPU by choice, because the Vulkan driver would do the same, is not reported.
        let missed = why.filter(|why| !matches!(why, GpuError::SoftwareOnly(_)));
        self.viewer.without_vulkan = missed.map(|why| format!("the window is drawn on the CPU: {why}"));
        self.viewer.window_device = match (&open.painter, why) {
            (Painter::Vulkan(_), _) => "Vulkan".to_string(),
            (Painter::Software(_), None) => "CPU".to_string(),
            (Painter::Software(_), Some(why)) => format!("CPU: {why}"),
        };
        self.open_window = Some(open);
    }

    /// Handles a lost device or surface: creates a new one, up to two times in a row. The displayed state is kept.
    fn recreate_device(&mut self, error: &str, events: &ActiveEventLoop) {
        self.consecutive_failures += 1;
        // A window has only one surface at a time, so the old one is dropped first.
        let shown = self.open_window.take().and_then(OpenWindow::close);
        let again = match shown {
            Some(shown) if self.consecutive_failures < 3 => {
                OpenWindow::new(shown, self.device, &self.proxy).map_err(|e| e.to_string())
            }
            Some(_) => Err("three attempts in a row failed".to_string()),
            None => Err("the window could not be kept open".to_string()),
        };
        match again {
            Ok(open) => {
                self.take_window(open);
                // The new device has no images yet, and the new egui context no colors.
                self.viewer.views.iter_mut().for_each(|view| view.requested = None);
                self.panels.forget_context();
                self.request_redraw();
            }
            Err(second) => {
                self.fatal_error = Some(ViewerError::NotDrawn { first: error.to_string(), second });
                events.exit();
            }
        }
    }
}

impl ApplicationHandler<WindowMessage> for ViewerWindow {
    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        if matches!(cause, StartCause::ResumeTimeReached { .. }) {
            self.wake_at = None;
            // A hidden window is not drawn, so the settings are saved here.
            self.save_settings_when_due();
            self.request_redraw();
        }
    }

    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open_window.is_some() {
            return;
        }
        let attributes = Window::default_attributes()
            .with_title(format!("{} – {}", self.viewer.name, self.program))
            .with_inner_size(LogicalSize::new(1280.0, 860.0))
            .with_min_inner_size(LogicalSize::new(320.0, 200.0))
            .with_visible(false);
        // Name of the desktop entry, by which desktops find the icon of the window.
        #[cfg(target_os = "linux")]
        let attributes = attributes.with_name(format!("{}-view", self.program), self.program);
        let window = events.create_window(attributes).map_err(|e| e.to_string());
        let shown = window.map(|window| BareWindow::new(window, events, &self.proxy));
        self.event_log.log_step("window");
        let opened = shown
            .and_then(|shown| OpenWindow::new(shown, self.device, &self.proxy).map_err(|e| e.to_string()));
        match opened {
            Ok(open) => {
                self.event_log.log_step("device of the window");
                self.take_window(open);
                self.request_redraw();
            }
            Err(error) => {
                self.fatal_error = Some(start::window_error(&error));
                events.exit();
            }
        }
    }

    fn user_event(&mut self, events: &ActiveEventLoop, message: WindowMessage) {
        match message {
            WindowMessage::Version(file_number, version) => {
                self.take_version(file_number, *version);
                self.advance();
                self.request_redraw();
            }
            WindowMessage::Frame(reply) => {
                self.take_frame(*reply);
                // The next frame is rendered while this one is presented.
                self.advance();
                self.request_redraw();
            }
            WindowMessage::Checked(file_number, number, messages) => {
                self.take_messages(file_number, number, &messages)
            }
            WindowMessage::Close => events.exit(),
            WindowMessage::Repaint(delay) if delay.is_zero() => self.request_redraw(),
            WindowMessage::Repaint(delay) => self.wake_in(delay),
            #[cfg(feature = "accesskit")]
            WindowMessage::Assistance(event) => {
                if let Some(open) = &mut self.open_window {
                    open.take_assistance(event);
                }
                self.request_redraw();
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, mut event: WindowEvent) {
        if let WindowEvent::MouseInput { .. } | WindowEvent::CursorMoved { .. } = event {
            // egui reads the position of the mouse at the end of a frame, not at the press or release of a button: on a busy machine a drag would
            // grab the wrong object or none.
            if std::mem::take(&mut self.mouse_button_changed) {
                self.draw(events);
            }
            self.mouse_button_changed = matches!(event, WindowEvent::MouseInput { .. });
        }
        let Some(open) = &mut self.open_window else { return };
        if matches!(event, WindowEvent::CursorMoved { .. }) {
            // While a file is dragged, its source owns the mouse, and may end the drag without an event.
            open.input.egui_input_mut().hovered_files.clear();
        }
        match &mut event {
            WindowEvent::ScaleFactorChanged { scale_factor, inner_size_writer } => {
                open.rescale(*scale_factor, inner_size_writer);
            }
            WindowEvent::CursorMoved { position, .. } => {
                let part = open.window.scale_factor() / open.scale;
                *position = PhysicalPosition::new(position.x * part, position.y * part);
            }
            _ => {}
        }
        let wants = open.input.on_window_event(&open.window, &event);
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::RedrawRequested => self.draw(events),
            WindowEvent::Occluded(covered) => {
                self.is_covered = covered;
                self.request_redraw();
            }
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => self.request_redraw(),
            _ if wants.repaint => self.request_redraw(),
            _ => {}
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        events.set_control_flow(match self.wake_at {
            Some(at) => ControlFlow::WaitUntil(at),
            None => ControlFlow::Wait,
        });
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // The window must be dropped while the window system still exists.
        self.open_window = None;
    }
}
