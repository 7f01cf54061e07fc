//! Other programs of a desktop: a window manager, and a file manager from which files are dragged.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    Atom, AtomEnum, CONFIGURE_NOTIFY_EVENT, ChangeWindowAttributesAux, ClientMessageEvent,
    ConfigureNotifyEvent, ConfigureWindowAux, ConnectionExt as _, CreateWindowAux, EventMask, PropMode,
    SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, Window, WindowClass,
};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;
use x11rb::{COPY_DEPTH_FROM_PARENT, COPY_FROM_PARENT, CURRENT_TIME};

fn connected(display: &str) -> (RustConnection, Window) {
    let (connection, screen) = x11rb::connect(Some(display)).unwrap();
    let root = connection.setup().roots[screen].root;
    (connection, root)
}

fn atom(connection: &RustConnection, name: &str) -> Atom {
    connection.intern_atom(false, name.as_bytes()).unwrap().reply().unwrap().atom
}

/// Minimal window manager: maps windows on request, iconifies them (ICCCM §4.1.4) and reports it (EWMH, `_NET_WM_STATE_HIDDEN`).
pub(super) struct Manager {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Manager {
    pub(super) fn start(display: &str) -> Manager {
        let (connection, root) = connected(display);
        let redirect = EventMask::SUBSTRUCTURE_REDIRECT | EventMask::SUBSTRUCTURE_NOTIFY;
        let attributes = ChangeWindowAttributesAux::new().event_mask(redirect);
        connection.change_window_attributes(root, &attributes).unwrap().check().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let thread = std::thread::spawn(move || manage(&connection, &stopped));
        Manager { stop, thread: Some(thread) }
    }
}

impl Drop for Manager {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::SeqCst);
        self.thread.take().map(JoinHandle::join);
    }
}

fn manage(connection: &RustConnection, stop: &AtomicBool) {
    let [state, change, net, hidden] =
        ["WM_STATE", "WM_CHANGE_STATE", "_NET_WM_STATE", "_NET_WM_STATE_HIDDEN"].map(|n| atom(connection, n));
    let said = |window, iconic: bool| {
        let number = if iconic { 3 } else { 1 };
        connection.change_property32(PropMode::REPLACE, window, state, state, &[number, 0]).unwrap();
        let net_states: &[u32] = if iconic { &[hidden] } else { &[] };
        connection.change_property32(PropMode::REPLACE, window, net, AtomEnum::ATOM, net_states).unwrap();
    };
    while !stop.load(Ordering::SeqCst) {
        match connection.poll_for_event() {
            Err(_) => return,
            Ok(None) => std::thread::sleep(Duration::from_millis(5)),
            Ok(Some(Event::MapRequest(asked))) => {
                said(asked.window, false);
                connection.map_window(asked.window).unwrap();
            }
            Ok(Some(Event::ConfigureRequest(asked))) => {
                let wanted = ConfigureWindowAux::from_configure_request(&asked);
                connection.configure_window(asked.window, &wanted).unwrap();
                // Most window managers send this event, even if the window is not only moved.
                let place = connection.get_geometry(asked.window).unwrap().reply().unwrap();
                let event = ConfigureNotifyEvent {
                    response_type: CONFIGURE_NOTIFY_EVENT,
                    sequence: 0,
                    event: asked.window,
                    window: asked.window,
                    above_sibling: 0,
                    x: place.x,
                    y: place.y,
                    width: place.width,
                    height: place.height,
                    border_width: place.border_width,
                    override_redirect: false,
                };
                connection.send_event(false, asked.window, EventMask::STRUCTURE_NOTIFY, event).unwrap();
            }
            Ok(Some(Event::ClientMessage(asked))) if asked.type_ == change => {
                said(asked.window, true);
                connection.unmap_window(asked.window).unwrap();
            }
            Ok(Some(_)) => {}
        }
        connection.flush().unwrap();
    }
}

/// Settings daemon that announces the desktop's scale (<https://specifications.freedesktop.org/xsettings-spec/0.5/>).
pub(super) struct Settings {
    connection: RustConnection,
    owner: Window,
    property: Atom,
}

impl Settings {
    pub(super) fn start(display: &str, dpi: u32) -> Settings {
        let (connection, root) = connected(display);
        let owner = window(&connection, root);
        let selection = atom(&connection, "_XSETTINGS_S0");
        connection.set_selection_owner(owner, selection, CURRENT_TIME).unwrap().check().unwrap();
        let property = atom(&connection, "_XSETTINGS_SETTINGS");
        let settings = Settings { connection, owner, property };
        settings.set_dpi(dpi);
        settings
    }

    pub(super) fn set_dpi(&self, dpi: u32) {
        let name = b"Xft/DPI";
        // Little-endian; serial number, one setting: an integer, its name, its own serial number, its value.
        let mut data = vec![0, 0, 0, 0];
        data.extend(dpi.to_le_bytes());
        data.extend(1u32.to_le_bytes());
        data.extend([0, 0, name.len() as u8, 0]);
        data.extend(name);
        data.push(0);
        data.extend(dpi.to_le_bytes());
        data.extend((dpi * 1024).to_le_bytes());
        let (mode, property) = (PropMode::REPLACE, self.property);
        self.connection.change_property8(mode, self.owner, property, property, &data).unwrap();
        self.connection.flush().unwrap();
    }
}

/// Creates a window that is never mapped.
fn window(connection: &RustConnection, root: Window) -> Window {
    let made = connection.generate_id().unwrap();
    let (depth, class, visual) = (COPY_DEPTH_FROM_PARENT, WindowClass::INPUT_OUTPUT, COPY_FROM_PARENT);
    connection
        .create_window(depth, made, root, 0, 0, 1, 1, 0, class, visual, &CreateWindowAux::new())
        .unwrap();
    made
}

/// Files that are dragged over a window (XDND 5, <https://www.freedesktop.org/wiki/Specifications/XDND/>).
pub(super) struct Drag {
    connection: RustConnection,
    source: Window,
    target: Window,
}

impl Drag {
    /// Enters the middle of the window, and sends the file names on request.
    pub(super) fn over(display: &str, target: &str, files: &[&Path]) -> Drag {
        let (connection, root) = connected(display);
        let source = window(&connection, root);
        let drag = Drag { connection, source, target: target.parse().unwrap() };
        let selection = drag.atom("XdndSelection");
        drag.connection.set_selection_owner(source, selection, CURRENT_TIME).unwrap();
        let uris = drag.atom("text/uri-list");
        drag.send("XdndEnter", [source, 5 << 24, uris, 0, 0]);
        drag.send("XdndPosition", [source, 0, (600 << 16) | 300, CURRENT_TIME, drag.atom("XdndActionCopy")]);
        // The target asks for the data and reports whether it accepts the drop, in any order.
        let (mut given, mut taken) = (false, false);
        while !given || !taken {
            match drag.next() {
                Event::SelectionRequest(asked) => {
                    // Blanks are percent-encoded, as in URIs.
                    let uri =
                        |file: &&Path| format!("file://{}\r\n", file.to_str().unwrap().replace(' ', "%20"));
                    let uri: String = files.iter().map(uri).collect();
                    let mode = PropMode::REPLACE;
                    let (to, property) = (asked.requestor, asked.property);
                    drag.connection.change_property8(mode, to, property, uris, uri.as_bytes()).unwrap();
                    let answer = SelectionNotifyEvent {
                        response_type: SELECTION_NOTIFY_EVENT,
                        sequence: 0,
                        time: asked.time,
                        requestor: asked.requestor,
                        selection: asked.selection,
                        target: asked.target,
                        property: asked.property,
                    };
                    drag.connection.send_event(false, to, EventMask::NO_EVENT, answer).unwrap();
                    drag.connection.flush().unwrap();
                    given = true;
                }
                Event::ClientMessage(event) if event.type_ == drag.atom("XdndStatus") => {
                    assert_eq!(event.data.as_data32()[1] & 1, 1, "it takes the file");
                    taken = true;
                }
                _ => {}
            }
        }
        drag
    }

    pub(super) fn drop(self) {
        self.send("XdndDrop", [self.source, 0, CURRENT_TIME, 0, 0]);
        let finished = self.atom("XdndFinished");
        loop {
            if let Event::ClientMessage(event) = self.next()
                && event.type_ == finished
            {
                assert_eq!(event.data.as_data32()[1] & 1, 1, "it has taken the file");
                return;
            }
        }
    }

    pub(super) fn leave(self) {
        self.send("XdndLeave", [self.source, 0, 0, 0, 0]);
        // A reply that is unread when a connection closes discards earlier requests, so everything is read first.
        self.connection.get_input_focus().unwrap().reply().unwrap();
    }

    fn atom(&self, name: &str) -> Atom {
        atom(&self.connection, name)
    }

    fn send(&self, what: &str, data: [u32; 5]) {
        let message = ClientMessageEvent::new(32, self.target, self.atom(what), data);
        self.connection.send_event(false, self.target, EventMask::NO_EVENT, message).unwrap();
        self.connection.flush().unwrap();
    }

    fn next(&self) -> Event {
        let end = Instant::now() + Duration::from_secs(300);
        loop {
            match self.connection.poll_for_event().unwrap() {
                Some(event) => return event,
                None => std::thread::sleep(Duration::from_millis(5)),
            }
            assert!(Instant::now() < end, "the window does not answer");
        }
    }
}
