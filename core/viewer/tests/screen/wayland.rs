//! A headless Wayland compositor with simulated mouse and keyboard input.

use super::{Running, Screenshot, is_program_installed, until};
use std::fs::{self, Permissions};
use std::io::Write;
use std::os::fd::AsFd;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;
use wayland_client::globals::{GlobalListContents, registry_queue_init};
use wayland_client::protocol::wl_keyboard::KeymapFormat;
use wayland_client::protocol::wl_pointer::ButtonState;
use wayland_client::protocol::wl_registry::{self, WlRegistry};
use wayland_client::protocol::wl_seat::{self, WlSeat};
use wayland_client::{Connection, Dispatch, EventQueue, QueueHandle, delegate_noop};
use wayland_protocols_misc::zwp_virtual_keyboard_v1::client::zwp_virtual_keyboard_manager_v1::ZwpVirtualKeyboardManagerV1;
use wayland_protocols_misc::zwp_virtual_keyboard_v1::client::zwp_virtual_keyboard_v1::ZwpVirtualKeyboardV1;
use wayland_protocols_wlr::virtual_pointer::v1::client::zwlr_virtual_pointer_manager_v1::ZwlrVirtualPointerManagerV1;
use wayland_protocols_wlr::virtual_pointer::v1::client::zwlr_virtual_pointer_v1::ZwlrVirtualPointerV1;

/// Size of the only output, in pixels.
pub(crate) const SIZE: [u32; 2] = [1280, 860];

/// Codes from `linux/input-event-codes.h`.
const BTN_LEFT: u32 = 0x110;
const KEY_LEFTCTRL: u32 = 29;
pub(crate) const KEY_Q: u32 = 16;
pub(crate) const KEY_Z: u32 = 44;
/// Bit of the Control modifier in the keymap below.
const CONTROL: u32 = 1 << 2;
/// Keymap of a standard keyboard (xkeyboard-config).
const KEYMAP: &str = r#"xkb_keymap {
    xkb_keycodes { include "evdev+aliases(qwerty)" };
    xkb_types { include "complete" };
    xkb_compat { include "complete" };
    xkb_symbols { include "pc+us+inet(evdev)" };
};"#;
/// User id of `nobody`: sway refuses to run as root.
const NOBODY: u32 = 65_534;

/// The compositor sway, whose windows fill the output.
pub(crate) struct Compositor {
    pub server: Running,
    folder: tempfile::TempDir,
    socket: String,
    control: String,
}

impl Compositor {
    /// Starts the compositor. `None`, with a printed reason, if this machine lacks a program for it.
    pub(crate) fn new() -> Option<Compositor> {
        for program in ["sway", "grim"] {
            if !is_program_installed(program) {
                println!("SKIP 1: {program} is not installed");
                return None;
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let config = folder.path().join("config");
        let [width, height] = SIZE;
        fs::write(&config, format!("output * resolution {width}x{height}\ndefault_border none\n")).unwrap();
        fs::set_permissions(folder.path(), Permissions::from_mode(0o700)).unwrap();
        let mut command = Command::new("sway");
        command.arg("-c").arg(&config).current_dir("/").env_remove("WAYLAND_DISPLAY").env_remove("DISPLAY");
        command.env("XDG_RUNTIME_DIR", folder.path()).env("HOME", folder.path());
        command.envs([
            ("WLR_BACKENDS", "headless"),
            ("WLR_RENDERER", "pixman"),
            ("WLR_LIBINPUT_NO_DEVICES", "1"),
        ]);
        if fs::metadata(folder.path()).unwrap().uid() == 0 {
            chown(folder.path(), Some(NOBODY), Some(NOBODY)).unwrap();
            command.uid(NOBODY).gid(NOBODY);
        }
        let server = Running(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
        let named = |begins: &str| {
            let files = fs::read_dir(folder.path()).unwrap().flatten();
            let names = files.map(|file| file.file_name().into_string().unwrap());
            names.into_iter().find(|name| name.starts_with(begins) && !name.ends_with(".lock"))
        };
        let socket = until("the compositor", || named("wayland-"));
        let control = until("the compositor's control", || named("sway-ipc"));
        Some(Compositor { server, folder, socket, control })
    }

    fn client(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.env_remove("DISPLAY").env("XDG_RUNTIME_DIR", self.folder.path());
        command.env("WAYLAND_DISPLAY", &self.socket).env("SWAYSOCK", self.folder.path().join(&self.control));
        command
    }

    /// Restricts the viewer's command to this compositor.
    pub(crate) fn connect<'a>(&self, command: &'a mut Command) -> &'a mut Command {
        command.env_remove("DISPLAY").env("XDG_RUNTIME_DIR", self.folder.path());
        command.env("WAYLAND_DISPLAY", &self.socket)
    }

    /// Runs a command of sway, such as `output * scale 2`.
    pub(crate) fn run_sway_command(&self, order: &str) {
        let status = self.client("swaymsg").args(["--quiet", "--", order]).status().unwrap();
        assert!(status.success(), "{order}");
    }

    /// Whether any window is open.
    pub(crate) fn has_window(&self) -> bool {
        let tree = self.client("swaymsg").args(["-t", "get_tree", "--raw"]).output().unwrap().stdout;
        String::from_utf8_lossy(&tree).contains("\"xdg_shell\"")
    }

    /// Screenshot of the output.
    pub(crate) fn shot(&self) -> Screenshot {
        until("an image of the output", || {
            let output = self.client("grim").args(["-t", "ppm", "-"]).output().unwrap();
            Screenshot::read(&output.stdout)
        })
    }

    /// Saves a screenshot on request for visual inspection.
    pub(crate) fn save(&self, name: &str) {
        if let Some(folder) = std::env::var_os("CHOREO_SHOTS") {
            assert!(self.client("grim").arg(Path::new(&folder).join(name)).status().unwrap().success());
        }
    }

    /// Creates the input devices; must precede the window, which would miss the first keys of a later keyboard.
    pub(crate) fn create_input_devices(&self) -> InputDevices {
        let stream = UnixStream::connect(self.folder.path().join(&self.socket)).unwrap();
        let connection = Connection::from_socket(stream).unwrap();
        let (globals, mut queue) = registry_queue_init::<Nothing>(&connection).unwrap();
        let handle = queue.handle();
        let pointers: ZwlrVirtualPointerManagerV1 = globals.bind(&handle, 1..=2, ()).unwrap();
        let pointer = pointers.create_virtual_pointer(None, &handle, ());
        let seat: WlSeat = globals.bind(&handle, 1..=7, ()).unwrap();
        let keyboards: ZwpVirtualKeyboardManagerV1 = globals.bind(&handle, 1..=1, ()).unwrap();
        let keyboard = keyboards.create_virtual_keyboard(&seat, &handle, ());
        let mut keymap = tempfile::tempfile().unwrap();
        keymap.write_all(KEYMAP.as_bytes()).unwrap();
        // The size includes the terminating zero byte.
        keymap.write_all(&[0]).unwrap();
        keyboard.keymap(KeymapFormat::XkbV1.into(), keymap.as_fd(), KEYMAP.len() as u32 + 1);
        queue.roundtrip(&mut Nothing).unwrap();
        InputDevices { queue, pointer, keyboard, begin: Instant::now() }
    }
}

/// Virtual mouse of the output (`wlr-virtual-pointer-unstable-v1`) and virtual keyboard (`virtual-keyboard-unstable-v1`).
pub(crate) struct InputDevices {
    queue: EventQueue<Nothing>,
    pointer: ZwlrVirtualPointerV1,
    keyboard: ZwpVirtualKeyboardV1,
    begin: Instant,
}

impl InputDevices {
    fn milliseconds(&self) -> u32 {
        self.begin.elapsed().as_millis() as u32
    }

    fn sent(&mut self) {
        self.pointer.frame();
        self.queue.roundtrip(&mut Nothing).unwrap();
    }

    /// Moves the mouse to a pixel of the output at scale 1.
    pub(crate) fn to(&mut self, x: usize, y: usize) {
        self.pointer.motion_absolute(self.milliseconds(), x as u32, y as u32, SIZE[0], SIZE[1]);
        self.sent();
    }

    pub(crate) fn button(&mut self, down: bool) {
        let state = if down { ButtonState::Pressed } else { ButtonState::Released };
        self.pointer.button(self.milliseconds(), BTN_LEFT, state);
        self.sent();
    }

    /// Presses a key while Ctrl is held.
    pub(crate) fn ctrl(&mut self, key: u32) {
        let time = self.milliseconds();
        self.keyboard.key(time, KEY_LEFTCTRL, 1);
        self.keyboard.modifiers(CONTROL, 0, 0, 0);
        self.keyboard.key(time, key, 1);
        self.keyboard.key(time, key, 0);
        self.keyboard.key(time, KEY_LEFTCTRL, 0);
        self.keyboard.modifiers(0, 0, 0, 0);
        self.queue.roundtrip(&mut Nothing).unwrap();
    }
}

/// State of the Wayland client, which needs none.
struct Nothing;

impl Dispatch<WlRegistry, GlobalListContents> for Nothing {
    fn event(
        _: &mut Self,
        _: &WlRegistry,
        _: wl_registry::Event,
        _: &GlobalListContents,
        _: &Connection,
        _: &QueueHandle<Self>,
    ) {
    }
}

delegate_noop!(Nothing: ZwlrVirtualPointerManagerV1);
delegate_noop!(Nothing: ZwlrVirtualPointerV1);
delegate_noop!(Nothing: ZwpVirtualKeyboardManagerV1);
delegate_noop!(Nothing: ZwpVirtualKeyboardV1);

impl Dispatch<WlSeat, ()> for Nothing {
    fn event(_: &mut Self, _: &WlSeat, _: wl_seat::Event, _: &(), _: &Connection, _: &QueueHandle<Self>) {}
}
