//! A virtual X display, with simulated mouse and keyboard input.
#![allow(dead_code)]

pub(crate) mod random;
pub(crate) mod resource_record;
pub(crate) mod viewer_process;
pub(crate) mod wayland;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A process that is killed when the test ends, also by a panic.
pub(crate) struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The server is terminated, not killed, so that it removes the lock of its display number.
impl Drop for Screen {
    fn drop(&mut self) {
        let asked = Command::new("kill").arg(self.server.0.id().to_string()).status();
        let end = Instant::now() + Duration::from_secs(5);
        while asked.as_ref().is_ok_and(|s| s.success()) && Instant::now() < end {
            match self.server.0.try_wait() {
                Ok(None) => std::thread::sleep(Duration::from_millis(10)),
                _ => return,
            }
        }
    }
}

pub(crate) struct Screen {
    pub server: Running,
    pub display: String,
}

/// Whether the validation layer is installed.
pub(crate) fn is_validation_installed() -> bool {
    Path::new("/usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json").is_file()
}

/// Asserts that the log has neither a panic nor a message of the validation layer.
pub(crate) fn assert_no_errors(folder: &Path) {
    let said = std::fs::read_to_string(folder.join("said.txt")).unwrap();
    for bad in ["panicked", "VUID", "Validation", "UNASSIGNED"] {
        assert!(!said.contains(bad), "{said}");
    }
}

pub(crate) fn is_program_installed(program: &str) -> bool {
    std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()).any(|p| p.join(program).is_file())
}

/// The viewer's command line without a display; settings are in a separate folder, and overlays are off, so that
/// the pixels of an image are those of the scene.
pub(crate) fn viewer(device: &str, args: &[&str], folder: &Path) -> Command {
    let Some(program) = option_env!("CARGO_BIN_EXE_choreo-view") else {
        panic!("only the tests of choreo-viewer are built with its program")
    };
    let mut command = Command::new(program);
    command.args(args).args(["--device", device]).env("XDG_STATE_HOME", folder.join("state"));
    let settings = folder.join("state/choreo/view.json");
    if !settings.exists() {
        fs::create_dir_all(folder.join("state/choreo")).unwrap();
        fs::write(settings, r#"{"overlays": {"grid": false, "axes": false, "icons": false}}"#).unwrap();
    }
    command
}

/// Starts a viewer in a folder, with its output in a file there. `validation`: under the validation layer.
pub(crate) fn start_in(mut command: Command, folder: &Path, validation: bool) -> Running {
    command.current_dir(folder);
    if validation {
        command.env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation");
    }
    let said = fs::File::create(folder.join("said.txt")).unwrap();
    Running(command.stdout(said.try_clone().unwrap()).stderr(said).spawn().unwrap())
}

impl Screen {
    /// Starts the display. `None`, with a printed reason, if this machine lacks a program for it.
    pub(crate) fn new() -> Option<Screen> {
        for program in ["Xvfb", "xdotool", "import"] {
            if !is_program_installed(program) {
                println!("SKIP 1: {program} is not installed");
                return None;
            }
        }
        // The server picks a free number and prints it; servers of parallel tests could otherwise take the same one.
        let one = fs::File::create(Path::new(env!("CARGO_TARGET_TMPDIR")).join("xvfb.lock")).unwrap();
        one.lock().unwrap();
        let mut server = Command::new("Xvfb");
        // Otherwise the server resets when its last client disconnects, which breaks a client that connects at that time.
        server.args(["-noreset", "-displayfd", "1", "-screen", "0", "1400x1000x24", "-nolisten", "tcp"]);
        let mut child = server.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        let out = child.stdout.take().unwrap();
        std::io::BufRead::read_line(&mut std::io::BufReader::new(out), &mut line).unwrap();
        Some(Screen { server: Running(child), display: format!(":{}", line.trim()) })
    }

    pub(crate) fn run(&self, program: &str, args: &[&str]) -> Output {
        Command::new(program).args(args).env("DISPLAY", &self.display).output().unwrap()
    }

    pub(crate) fn xdotool(&self, args: &[&str]) -> String {
        let output = self.run("xdotool", args);
        String::from_utf8_lossy(&output.stdout).trim().to_string()
    }

    /// Command of the viewer on this display, drawn by Vulkan.
    pub(crate) fn command(&self, args: &[&str], folder: &Path) -> Command {
        self.command_on("vulkan", args, folder)
    }

    /// Command of the viewer on this display, with images of the script's size; see [`viewer`].
    pub(crate) fn command_on(&self, device: &str, args: &[&str], folder: &Path) -> Command {
        let mut command = viewer(device, args, folder);
        command.arg("--full-size").env("DISPLAY", &self.display).env_remove("WAYLAND_DISPLAY");
        command
    }

    /// Starts the viewer in a folder, with its output in a file.
    pub(crate) fn view(&self, args: &[&str], folder: &Path) -> Running {
        start_in(self.command(args, folder), folder, is_validation_installed())
    }

    /// Waits for the viewer's window and returns its id.
    pub(crate) fn window(&self) -> String {
        self.window_named("choreo")
    }

    /// Waits for the window of a program and returns its id.
    pub(crate) fn window_named(&self, program: &str) -> String {
        until("a window", || {
            let found = self.xdotool(&["search", "--onlyvisible", "--name", program]);
            found.lines().next().map(str::to_string)
        })
    }

    /// Screenshot of a window.
    pub(crate) fn shot(&self, window: &str) -> Screenshot {
        // A window has no image for a moment while it is resized or mapped.
        until("an image of the window", || {
            let output = self.run("import", &["-window", window, "-depth", "8", "ppm:-"]);
            Screenshot::read(&output.stdout)
        })
    }

    pub(crate) fn save(&self, window: &str, name: &str) {
        // Screenshots are saved on request for visual inspection.
        if let Some(folder) = std::env::var_os("CHOREO_SHOTS") {
            let file = Path::new(&folder).join(name);
            self.run("import", &["-window", window, &file.to_string_lossy()]);
        }
    }

    pub(crate) fn key(&self, window: &str, key: &str) {
        self.xdotool(&["windowfocus", window]);
        self.xdotool(&["key", key]);
    }

    /// Waits until a viewer and this display are idle; see [`rest`].
    pub(crate) fn rest(&self, viewer: u32) {
        rest(&[viewer, self.server.0.id()]);
    }
}

/// Waits until all processes have handled their input and compute nothing. On a busy machine that takes seconds, and later
/// input would arrive together with earlier input. A viewer that plays never becomes idle, so that the wait ends after ten
/// seconds.
pub(crate) fn rest(processes: &[u32]) {
    let end = Instant::now() + Duration::from_secs(10);
    let mut still = 0;
    while still < 3 && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(10));
        let works = processes.iter().any(|process| is_busy(*process));
        still = if works { 0 } else { still + 1 };
    }
}

/// Whether any thread of a process runs or waits for a core (`man proc_pid_stat`, field 3).
fn is_busy(process: u32) -> bool {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    let stats = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("stat")).ok());
    // The name before it can contain blanks; it ends at the last parenthesis.
    stats.into_iter().any(|stat| stat.rsplit(')').next().is_some_and(|fields| !fields.starts_with(" S")))
}

#[derive(Clone, PartialEq)]
pub(crate) struct Screenshot {
    pub width: usize,
    pub height: usize,
    pub rgb: Vec<u8>,
}

impl Screenshot {
    /// Reads a binary PPM.
    pub(crate) fn read(bytes: &[u8]) -> Option<Screenshot> {
        let mut at = 0;
        let mut words = Vec::new();
        while words.len() < 4 {
            let end = at + bytes.get(at..)?.iter().position(u8::is_ascii_whitespace)?;
            words.push(std::str::from_utf8(&bytes[at..end]).ok()?);
            at = end + 1;
        }
        let (width, height) = (words[1].parse().ok()?, words[2].parse().ok()?);
        Some(Screenshot { width, height, rgb: bytes.get(at..)?.to_vec() })
    }

    /// Number of pixels with about this color.
    pub(crate) fn count(&self, color: [u8; 3]) -> usize {
        let near = |p: &[u8]| p.iter().zip(color).all(|(a, b)| a.abs_diff(b) <= 2);
        self.rgb.chunks_exact(3).filter(|p| near(p)).count()
    }

    /// Bounding rectangle of all pixels of this color: left, top, right, bottom.
    pub(crate) fn bounds(&self, color: [u8; 3]) -> [usize; 4] {
        let mut found = [usize::MAX, usize::MAX, 0, 0];
        for (i, p) in self.rgb.chunks_exact(3).enumerate() {
            if p.iter().zip(color).all(|(a, b)| a.abs_diff(b) <= 1) {
                let (x, y) = (i % self.width, i / self.width);
                found = [found[0].min(x), found[1].min(y), found[2].max(x + 1), found[3].max(y + 1)];
            }
        }
        found
    }

    /// Whether a pixel has about this color; the device's encoding can differ by one or two steps.
    pub(crate) fn is(&self, x: usize, y: usize, color: [u8; 3]) -> bool {
        self.pixel(x, y).iter().zip(color).all(|(a, b)| a.abs_diff(b) <= 3)
    }

    /// A bar of the sequencer: the pixel row between two heights with the most pixels of a color, and the first and last such pixel.
    pub(crate) fn bar(&self, color: [u8; 3], [top, bottom]: [usize; 2]) -> Option<(usize, usize, usize)> {
        let rows = (top..bottom.min(self.height)).map(|y| {
            // Dark colors can differ by a few steps after the device's encoding.
            let near = |x: &usize| self.pixel(*x, y).iter().zip(color).all(|(a, b)| a.abs_diff(b) <= 8);
            let mut found = (0..self.width).filter(near);
            let first = found.next();
            let (last, count) = found.fold((first, 0usize), |(_, n), x| (Some(x), n + 1));
            (count, y, first, last)
        });
        let (count, y, first, last) = rows.max_by_key(|row| row.0)?;
        (count > 8).then_some((first?, last?, y))
    }

    pub(crate) fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let at = (y * self.width + x) * 3;
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }
}

pub(crate) fn until<T>(what: &str, mut is: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + Duration::from_secs(600);
    loop {
        if let Some(found) = is() {
            return found;
        }
        assert!(Instant::now() < end, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(50));
    }
}
