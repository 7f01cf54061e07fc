//! Accessibility of the window for a screen reader: read and operated by AT-SPI over D-Bus, with the registry of real desktops.

use crate::screen::{Running, Screen, assert_no_errors, is_program_installed, until};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use zbus::blocking::{Connection, connection};
use zbus::zvariant::{DynamicType, OwnedObjectPath, OwnedValue, Value};

const SCRIPT: &str = r##"stage(#{ size: [320, 180], fps: 30, length: 4.0 });
let moves = load("choreo:mannequin");
let ada = cast("ada", moves);
ada.play(moves.clip("Walk")).until(2.0);
"##;
const ACCESSIBLE: &str = "org.a11y.atspi.Accessible";
/// `ATSPI_ROLE_PUSH_BUTTON` and `ATSPI_ROLE_CHECK_BOX` of atspi-constants.h.
const BUTTON: u32 = 43;
const CHECK_BOX: u32 = 7;

/// An accessible object: the bus name of its program, and its path.
type Reference = (String, OwnedObjectPath);

struct Node {
    at: Reference,
    role: u32,
    name: String,
}

/// A private D-Bus session bus.
struct Session {
    _daemon: Running,
    address: String,
}

impl Session {
    /// Starts the bus. `None`, with a printed reason, if this machine lacks a program for it.
    fn new(screen: &Screen, folder: &Path) -> Option<Session> {
        let registry = Path::new("/usr/share/dbus-1/services/org.a11y.Bus.service");
        if !is_program_installed("dbus-daemon") || !registry.is_file() {
            println!("SKIP 1: dbus-daemon or at-spi2-core is not installed");
            return None;
        }
        let mut daemon = Command::new("dbus-daemon");
        daemon.args(["--session", "--nofork", "--print-address"]).env("DISPLAY", &screen.display);
        // The registry's socket is in this folder, and nothing of the surrounding desktop is used.
        daemon.env("XDG_RUNTIME_DIR", folder).env("XDG_CONFIG_HOME", folder).env_remove("WAYLAND_DISPLAY");
        daemon.env_remove("DBUS_SESSION_BUS_ADDRESS").env_remove("AT_SPI_BUS_ADDRESS");
        let mut child = daemon.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        Some(Session { _daemon: Running(child), address: line.trim().to_string() })
    }
}

fn connect(address: &str) -> Connection {
    connection::Builder::address(address).unwrap().build().unwrap()
}

/// Reply to a call. `None` if the object no longer exists.
fn call<T>(
    bus: &Connection,
    at: &Reference,
    method: (&str, &str),
    with: &(impl serde::Serialize + DynamicType),
) -> Option<T>
where
    T: for<'d> zbus::zvariant::DynamicDeserialize<'d>,
{
    let reply = bus.call_method(Some(at.0.as_str()), at.1.as_str(), Some(method.0), method.1, with).ok()?;
    reply.body().deserialize().ok()
}

fn name(bus: &Connection, at: &Reference) -> Option<String> {
    let get = ("org.freedesktop.DBus.Properties", "Get");
    String::try_from(call::<OwnedValue>(bus, at, get, &(ACCESSIBLE, "Name"))?).ok()
}

/// Reads an object and all its descendants.
fn read(bus: &Connection, at: Reference, all: &mut Vec<Node>) {
    let role = call(bus, &at, (ACCESSIBLE, "GetRole"), &()).unwrap_or_default();
    let name = name(bus, &at).unwrap_or_default();
    let children: Vec<Reference> = call(bus, &at, (ACCESSIBLE, "GetChildren"), &()).unwrap_or_default();
    all.push(Node { at, role, name });
    children.into_iter().for_each(|child| read(bus, child, all));
}

#[test]
fn a_screen_reader_reads_the_window_and_presses_its_buttons() {
    let Some(screen) = Screen::new() else { return };
    let folder = tempfile::tempdir().unwrap();
    let Some(session) = Session::new(&screen, folder.path()) else { return };
    fs::write(folder.path().join("a.rhai"), SCRIPT).unwrap();
    let said = fs::File::create(folder.path().join("said.txt")).unwrap();
    let mut command = screen.command(&["a.rhai"], folder.path());
    command.current_dir(folder.path()).env("DBUS_SESSION_BUS_ADDRESS", &session.address);
    let mut viewer = Running(command.stdout(said.try_clone().unwrap()).stderr(said).spawn().unwrap());
    let window = screen.window();

    // The initial request of a screen reader.
    let bus = connect(&session.address);
    let a11y = ("org.a11y.Bus".to_string(), OwnedObjectPath::try_from("/org/a11y/bus").unwrap());
    let set = ("org.freedesktop.DBus.Properties", "Set");
    let asked = ("org.a11y.Status", "ScreenReaderEnabled", Value::from(true));
    assert!(call::<()>(&bus, &a11y, set, &asked).is_some());
    let address: String = call(&bus, &a11y, ("org.a11y.Bus", "GetAddress"), &()).unwrap();
    let bus = connect(&address);
    let root = OwnedObjectPath::try_from("/org/a11y/atspi/accessible/root").unwrap();
    let registry = ("org.a11y.atspi.Registry".to_string(), root);
    let whole = || {
        let mut all = Vec::new();
        read(&bus, registry.clone(), &mut all);
        all
    };
    let find = |role: u32, name: &str| {
        whole().into_iter().find(|node| node.role == role && node.name == name).map(|node| node.at)
    };
    let play = until("the button", || find(BUTTON, "Play"));
    let all = whole();
    let list = || all.iter().map(|n| format!("{}: {}\n", n.role, n.name)).collect::<String>();
    let has = |part: &str| assert!(all.iter().any(|node| node.name.contains(part)), "{part}:\n{}", list());
    for part in [
        "choreo-view",
        "a.rhai – choreo",
        "Stage",
        "row ada",
        "Walk",
        "mute ada",
        "hide ada",
        "Loop",
        "Sequencer tab",
        "picture",
    ] {
        has(part);
    }
    if std::env::var_os("CHOREO_SHOTS").is_some() {
        print!("{}", list());
    }

    // Pressing the button changes its name.
    let action = "org.a11y.atspi.Action";
    assert_eq!(call::<bool>(&bus, &play, (action, "DoAction"), &0i32), Some(true));
    let pause = until("the scene plays", || find(BUTTON, "Pause"));
    assert_eq!(call::<bool>(&bus, &pause, (action, "DoAction"), &0i32), Some(true));
    until("it rests", || find(BUTTON, "Play"));
    assert!(find(CHECK_BOX, "Loop").is_some());
    screen.key(&window, "ctrl+q");
    assert_eq!(until("the end", || viewer.0.try_wait().unwrap()).code(), Some(0));
    assert_no_errors(folder.path());
}
