//! The command line as clap reads it.

pub mod values;

use clap::builder::ArgPredicate;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

pub(crate) const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    the script, model or another input is wrong, or a test failed
  2    the command line is wrong
  3    the output cannot be written
  4    no device can render it
  5    the system gives it too little memory or too few threads (ulimit -v, ulimit -u)
  6    choreo itself failed; please report it
  130  interrupted (Ctrl-C, SIGTERM or SIGHUP)
  141  the reader of standard output has gone

A result appears whole or not at all: files are written beside their place as NAME.part and renamed when complete.
A video's finished frames stay in the folder NAME.part when its render is stopped, by Ctrl-C too, and --resume goes on with
them. Symbolic links in the place of an output are refused, and outputs in the place of an input.";

/// The end of `--help`, which `-h` leaves out.
fn limits_help() -> String {
    let table = choreo_script::Limits::table();
    format!("Limits, set with --limit NAME=NUMBER:\n{table}\n{EXIT_CODES}")
}

/// Turns a script and a folder of ready-made characters and clips into an animated scene.
#[derive(Parser, Debug)]
#[command(name = "choreo", version, after_help = EXIT_CODES, disable_help_subcommand = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub command: Command,
    /// Do not read choreo.toml, which names search folders, plugin folders and default options of the project
    #[arg(long, global = true)]
    pub no_project_file: bool,
}

#[derive(Subcommand, Debug)]
pub enum Command {
    /// Render a script, or a model file as it is, to video or images
    #[command(after_help = EXIT_CODES, after_long_help = limits_help())]
    Render(RenderArgs),
    /// Write the job that renders a film on many machines, for an engine that is there: Open Job Description or Slurm
    #[command(after_help = EXIT_CODES, after_long_help = limits_help(), mut_arg("input", |input| {
        // Not used there: --status names the folder of a job.
        input.required(false).required_unless_present("status").default_value_if("status", ArgPredicate::IsPresent, ".")
    }))]
    Farm(FarmArgs),
    /// Join the segments that several machines made with render --segment to the file that one machine would have written
    #[command(after_help = EXIT_CODES)]
    Join(JoinArgs),
    /// Put a script with all that it reads into one archive, which gives the same images elsewhere
    #[command(after_help = EXIT_CODES, after_long_help = limits_help())]
    Pack(PackArgs),
    /// Write the scene itself for another program: joints, motion, cameras, as the format has them
    #[command(after_help = EXIT_CODES, after_long_help = limits_help())]
    Export(ExportArgs),
    /// Open a window on a script, or a model: every save is seen at once
    #[command(after_help = EXIT_CODES)]
    View(ViewArgs),
    /// Find everything that can be found without drawing
    #[command(after_help = EXIT_CODES, after_long_help = limits_help())]
    Check(CheckArgs),
    /// Describe a model file, or how an image or video was made
    #[command(after_help = EXIT_CODES)]
    Info(InfoArgs),
    /// List what a scene needs, what was left out, and why
    #[command(after_help = EXIT_CODES, after_long_help = limits_help())]
    Explain(ExplainArgs),
    /// Error against run time for each numerical choice that this scene could make
    #[command(after_help = EXIT_CODES, after_long_help = limits_help())]
    Measure(MeasureArgs),
    /// Every actor's joints in world space at one time
    #[command(after_help = EXIT_CODES, after_long_help = limits_help())]
    Pose(PoseArgs),
    /// Scenes tested by scripts: sections with assertions and images
    #[command(after_help = EXIT_CODES)]
    Test(TestArgs),
    /// The importers, effects and exporters that this program has; packages: install, list, remove, test
    #[command(after_help = EXIT_CODES)]
    Plugins(PluginsArgs),
    /// Begin a project for videos of your own, or a plugin: a crate, or with --single one file
    #[command(after_help = EXIT_CODES)]
    New(NewArgs),
    /// Lay out scripts in one way: blanks, indentation, blank lines. Line breaks, comments and strings stay
    #[command(after_help = EXIT_CODES)]
    Format(FormatArgs),
    /// Serve editors: diagnostics, completion and more over standard input and output (Language Server Protocol)
    #[command(after_help = EXIT_CODES)]
    Lsp(LspArgs),
    /// Print what answers a word of the field, or the help of a command
    #[command(after_help = EXIT_CODES)]
    Help(HelpArgs),
}

/// The scene of a command.
#[derive(Args, Clone, Debug)]
pub(crate) struct SceneArgs {
    /// A script (.rhai), a scene that choreo pack has written (.choreo), or a model file to be framed, lit and played with no script
    #[arg(value_name = "SCRIPT|MODEL")]
    pub input: PathBuf,
    /// A parameter of the script, read there with param("NAME"); repeatable
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Model files: the clip to play (default: the first)
    #[arg(long, value_name = "NAME")]
    pub clip: Option<String>,
    #[command(flatten)]
    pub import: ImportArgs,
    /// A further folder in which load(…) looks for files; repeatable
    #[arg(long = "search", value_name = "DIR")]
    pub search: Vec<PathBuf>,
    /// Raise or lower a limit (see --help); repeatable
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    pub limit: Vec<String>,
    /// The program that makes the output, for its provenance
    #[arg(skip)]
    pub software: String,
    /// The stage of a packed scene that is opened as it was packed
    #[arg(skip)]
    pub packed_stage: Option<PackedStage>,
}

/// The stage of a packed scene, as the program that packed it has made it.
#[derive(Clone, Debug)]
pub(crate) struct PackedStage {
    pub software: String,
    /// Hashes of all that was read and of the stage, in hexadecimal digits.
    pub input_hash: String,
    pub stage: String,
}

/// How a model file is read. Scripts state it themselves: `load(…, #{ … })`.
#[derive(Args, Clone, Debug)]
pub(crate) struct ImportArgs {
    /// Model files: the importer, whatever the file looks like (see `choreo plugins --for FILE`)
    #[arg(long, value_name = "NAME")]
    pub importer: Option<String>,
    /// Model files: an option of the importer (see `choreo plugins`); repeatable
    #[arg(long = "import", value_name = "NAME=VALUE")]
    pub import: Vec<String>,
    /// A further folder of plugin files: NAME.importer.rhai, NAME.wgsl; repeatable
    #[arg(long = "plugins", value_name = "DIR")]
    pub plugins: Vec<PathBuf>,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The extension is the format (choreo plugins lists them): out.mp4, out.png for one image, frames/%04d.png for numbered ones; or - for y4m on standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: String,
    /// Which frames: 0..120 (120 not included), 0..=119, 0-119, 30.., one number, every 24th as 0..240:24, or a list as 0,5,9..20
    #[arg(long, value_name = "FRAMES", conflicts_with = "at", allow_hyphen_values = true)]
    pub frames: Option<String>,
    /// One image at this time in seconds
    #[arg(long, value_name = "SECS", allow_hyphen_values = true)]
    pub at: Option<String>,
    /// Model files: seconds to render; the clip is looped (default: the clip once through)
    #[arg(long, value_name = "SECS")]
    pub length: Option<String>,
    /// A contact sheet: one image of 12 frames of the scene, or of those of --frames, each with its time; --size is of one frame
    #[arg(long, conflicts_with_all = ["resume", "watch", "stages", "at"])]
    pub sheet: bool,
    /// Pixels, as 1280x720
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    /// Frames a second; 23.976, 29.97 and 59.94 mean the NTSC rates
    #[arg(long, value_name = "RATE")]
    pub fps: Option<String>,
    /// auto: Vulkan on a GPU, else the CPU renderer, which is faster than a Vulkan driver that draws on the CPU
    #[arg(long, value_enum, default_value_t = Device::Auto)]
    pub device: Device,
    /// Part of the name of the device that Vulkan draws on (default: the best there is)
    #[arg(long, value_name = "NAME", conflicts_with = "watch")]
    pub gpu: Option<String>,
    /// Texels read along a slanted texture at most, 1 to 16 (default: 16 on a GPU, 1 where the CPU draws)
    #[arg(long, value_name = "N", conflicts_with = "watch", value_parser = clap::value_parser!(u8).range(1..=16))]
    pub anisotropy: Option<u8>,
    /// Samples a pixel for smooth edges (default: the script's, else 4)
    #[arg(long, value_name = "1|4")]
    pub samples: Option<String>,
    /// An option of the output format (see `choreo plugins`); repeatable
    #[arg(long = "export", value_name = "NAME=VALUE")]
    pub export: Vec<String>,
    /// Passes of each image for a compositor, as color,depth,normal; for formats with the option passes (EXR)
    #[arg(long, value_name = "LIST")]
    pub passes: Option<String>,
    /// Write the frames as a segment into this folder, for choreo join: one of several machines makes a part of the film -o
    #[arg(long, value_name = "DIR", conflicts_with_all = ["at", "sheet", "watch", "stages"])]
    pub segment: Option<PathBuf>,
    /// Render a film for each row of a table, whose columns are parameters as those of --set: rows.csv with their names in its first line,
    /// or rows.json, an array of objects. -o is a pattern, as out/{name}.mp4; {row} is the number of the row
    #[arg(long = "set-from", value_name = "FILE", conflicts_with_all = ["watch", "stages"])]
    pub set_from: Option<PathBuf>,
    /// Only this row of --set-from, from 1
    #[arg(long, value_name = "N", requires = "set_from")]
    pub row: Option<usize>,
    /// Go on where an earlier render of the same was stopped: finished frames are not drawn again
    #[arg(long)]
    pub resume: bool,
    /// Keep no finished frames of a video: delete those of an earlier render that was stopped, and those of this one if it is
    #[arg(long, conflicts_with = "resume")]
    pub discard: bool,
    /// The command that goes on with this render, for messages
    #[arg(skip)]
    pub again: String,
    /// After every save, draw the frames that it touches again and write the output anew, until Ctrl-C
    #[arg(long, conflicts_with = "resume")]
    pub watch: bool,
    /// Draw the stages of the CPU renderer for one frame, six images in the folder -o: model, view, clip, raster, depth, shade
    #[arg(long, conflicts_with_all = ["resume", "watch", "frames"])]
    pub stages: bool,
    /// Write how many frames are done, a line of JSON each on standard error, for the viewer
    #[arg(long, hide = true)]
    pub progress_lines: bool,
    /// Threads at most (default: one for each core)
    #[arg(long, value_name = "N")]
    pub jobs: Option<String>,
    /// Add the time that the device was busy, measured by its clock, to the summary; of the CPU renderer the time of each stage
    #[arg(long, conflicts_with = "watch")]
    pub timings: bool,
    /// No progress bar, no notes, no summary; warnings stay
    #[arg(short, long)]
    pub quiet: bool,
    /// The summary, or what went wrong, as JSON on standard output (standard error for -o -)
    #[arg(long)]
    pub json: bool,
}

impl RenderArgs {
    /// The options of the format, those with an argument of their own among them.
    pub fn given(&self) -> Vec<String> {
        let mut given = self.export.clone();
        given.extend(self.passes.iter().map(|passes| format!("passes={passes}")));
        given
    }
}

#[derive(Args, Debug)]
pub(crate) struct FarmArgs {
    /// Print how far the job in this folder is, from what its workers leave there: chunks, frames a second, time left, what failed
    #[arg(long, value_name = "DIR", conflicts_with_all = ["output", "engine", "to", "chunk", "set_from", "preview", "set"])]
    pub status: Option<PathBuf>,
    /// A contact sheet to be written with --status: the first frame of each chunk with its state
    #[arg(long, value_name = "FILE.png", requires = "status")]
    pub sheet: Option<PathBuf>,
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The film, film.mp4 or frames/%04d.png, in the folder output of the job
    #[arg(short, long, value_name = "FILE", required_unless_present = "status")]
    pub output: Option<String>,
    /// The engine that runs the job
    #[arg(long = "for", value_enum, value_name = "ENGINE", required_unless_present = "status")]
    pub engine: Option<Engine>,
    /// The folder of the job: the packed scene, its steps, and later the segments and the film
    #[arg(long, value_name = "DIR", required_unless_present = "status")]
    pub to: Option<PathBuf>,
    /// Frames of a chunk (default: measured, so that starting takes at most 5 % of a machine's time)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub chunk: Option<u64>,
    /// A film for each row of a table, as with render --set-from; -o is a pattern, as {name}.mp4
    #[arg(long = "set-from", value_name = "FILE")]
    pub set_from: Option<PathBuf>,
    /// Render every Nth frame at half the size first, written 1/N: a film of its own in the folder output/preview
    #[arg(long, value_name = "1/N", conflicts_with = "set_from")]
    pub preview: Option<String>,
    /// Pixels, as 1280x720
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    /// Frames a second; 23.976, 29.97 and 59.94 mean the NTSC rates
    #[arg(long, value_name = "RATE")]
    pub fps: Option<String>,
    /// The device of all machines; cpu gives the same bytes on all of them
    #[arg(long, value_enum, default_value_t = Device::Cpu)]
    pub device: Device,
    /// Samples a pixel for smooth edges (default: the script's, else 4)
    #[arg(long, value_name = "1|4")]
    pub samples: Option<String>,
    /// An option of the output format (see `choreo plugins`); repeatable
    #[arg(long = "export", value_name = "NAME=VALUE")]
    pub export: Vec<String>,
    /// No progress bar, no summary
    #[arg(short, long)]
    pub quiet: bool,
    /// The summary, or what went wrong, as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// An engine that runs jobs on many machines.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Engine {
    /// A template of Open Job Description: AWS Deadline Cloud, or openjd on one machine
    Openjd,
    /// Scripts for sbatch: an array job, and a job that depends on it
    Slurm,
}

#[derive(Args, Debug)]
pub(crate) struct PackArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The archive, film.choreo, or a new folder, film/, with the same files
    #[arg(short, long, value_name = "FILE.choreo|DIR/")]
    pub output: PathBuf,
    /// No progress bar, no summary; warnings stay
    #[arg(short, long)]
    pub quiet: bool,
    /// The summary, or what went wrong, as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct JoinArgs {
    /// Segments, or folders of them, in any order
    #[arg(value_name = "SEGMENT|DIR", required = true)]
    pub segments: Vec<PathBuf>,
    /// The film: a file, or frames/%04d.png; in the format of the segments
    #[arg(short, long, value_name = "FILE")]
    pub output: String,
    /// Wait up to this many seconds for segments that are missing: on a shared file system they may be seen late
    #[arg(long, value_name = "SECONDS", default_value_t = 0)]
    pub wait: u32,
    /// Raise or lower a limit, as output=1000000000; repeatable
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    pub limit: Vec<String>,
    /// No progress bar, no summary; warnings of damaged segments stay
    #[arg(short, long)]
    pub quiet: bool,
    /// The summary, or what went wrong, as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ExportArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The file; its extension says the format (see `choreo plugins`)
    #[arg(short, long, value_name = "FILE")]
    pub output: String,
    /// Which frames: 0..120 (120 not included), 0..=119, 30.., one number, every 24th as 0..240:24, or a list as 0,5,9..20
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    pub frames: Option<String>,
    /// Frames a second; 23.976, 29.97 and 59.94 mean the NTSC rates
    #[arg(long, value_name = "RATE")]
    pub fps: Option<String>,
    /// An option of the format (see `choreo plugins`); repeatable
    #[arg(long = "export", value_name = "NAME=VALUE")]
    pub export: Vec<String>,
    /// How far a joint may be from the scene, metres; for formats with the option tolerance
    #[arg(long, value_name = "METRES")]
    pub tolerance: Option<String>,
    /// One animation for each actor instead of one for all; for formats with the option animations
    #[arg(long, value_name = "WHAT", value_parser = ["actors"])]
    pub split: Option<String>,
    /// The clips that actors play, one animation each, in place of the timeline; for formats with the option animations
    #[arg(long, conflicts_with = "split")]
    pub clips: bool,
    /// No progress bar, no summary
    #[arg(short, long)]
    pub quiet: bool,
    /// The summary, or what went wrong, as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

impl ExportArgs {
    /// The options of the format, those with an argument of their own among them.
    pub fn given(&self) -> Vec<String> {
        let mut given = self.export.clone();
        given.extend(self.tolerance.iter().map(|metres| format!("tolerance={metres}")));
        given.extend(self.split.iter().map(|what| format!("animations={what}")));
        given.extend(self.clips.then(|| "animations=clips".to_string()));
        given
    }
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    Auto,
    Vulkan,
    Cpu,
}

#[derive(Args, Debug)]
pub(crate) struct ViewArgs {
    /// A script (.rhai), or a model file; without one a page with recent files, lessons and templates
    #[arg(value_name = "SCRIPT|MODEL")]
    pub input: Option<PathBuf>,
    /// Options of the viewer: see choreo-view --help
    #[arg(value_name = "OPTION", trailing_var_arg = true, allow_hyphen_values = true)]
    pub rest: Vec<std::ffi::OsString>,
}

#[derive(Args, Debug)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Warnings fail too
    #[arg(long)]
    pub strict: bool,
    /// Also what is often meant: ends of clips cut off, layers over each other, unused variables
    #[arg(long)]
    pub notes: bool,
    /// Also draw a chart of the cues over time, with what was found, as an image
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// A model, or an image or video that choreo made
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    #[command(flatten)]
    pub import: ImportArgs,
    /// The joints as a tree
    #[arg(long)]
    pub joints: bool,
    /// Which joints of this character follow which of the file's, when it plays the file's clips
    #[arg(long, value_name = "CHARACTER")]
    pub on: Option<PathBuf>,
    /// Print what compressing the clips to this tolerance in metres would save, and what it would cost in accuracy
    #[arg(long, value_name = "METRES")]
    pub compress: Option<f64>,
    /// Model files: a further folder in which their textures may lie; repeatable
    #[arg(long = "search", value_name = "DIR")]
    pub search: Vec<PathBuf>,
    /// Raise or lower a limit, as memory=2000000000; repeatable
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    pub limit: Vec<String>,
    /// JSON on standard output, for programs
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ExplainArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The time to look at, in seconds
    #[arg(long, value_name = "SECS", default_value = "0", allow_hyphen_values = true)]
    pub at: String,
    /// Pixels, as 1280x720
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    #[arg(long, value_name = "1|4")]
    pub samples: Option<String>,
    /// Also the passes of an OpenEXR image, as color,depth,id
    #[arg(long, value_name = "LIST")]
    pub passes: Option<String>,
    /// Also draw what it holds on the device, as an image
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct MeasureArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Only this choice: bake, crossfade, springs, ik, skinning, vertices, mips, sky, shadows, motion_blur, tones, renderer or video; repeatable
    #[arg(long, value_name = "CHOICE")]
    pub only: Vec<String>,
    /// When images are taken, in seconds (default: in the middle)
    #[arg(long, value_name = "SECS", allow_hyphen_values = true)]
    pub at: Option<String>,
    /// Pixels, as 1280x720
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    /// auto: Vulkan beside the CPU renderer where a driver works
    #[arg(long, value_enum, default_value_t = Device::Auto)]
    pub device: Device,
    /// Also draw error against run time, as images below each other
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct PoseArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Seconds
    #[arg(long, value_name = "SECS", default_value = "0", allow_hyphen_values = true)]
    pub at: String,
    /// Also write the posed meshes, skinned and morphed, in the file's own vertex order
    #[arg(long, value_name = "FILE.obj")]
    pub mesh: Option<PathBuf>,
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct TestArgs {
    /// Scripts and folders of them (default: tests/suite and scripts where they are, else all below this folder).
    /// Tests may read in the folder of their project, which has a choreo.toml, else below the folder that this is started in
    #[arg(value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Take over what was drawn as the expected image: all that failed, or the one of this name; repeatable
    #[arg(long, value_name = "NAME", num_args = 0..=1, require_equals = true, default_missing_value = "", conflicts_with_all = ["watch", "list"])]
    pub accept: Vec<String>,
    /// A further folder of plugin files: NAME.importer.rhai, NAME.wgsl; repeatable
    #[arg(long = "plugins", value_name = "DIR")]
    pub plugins: Vec<PathBuf>,
    /// Only sections with this in "FILE > SECTION", any case, or with this tag; repeatable
    #[arg(long, value_name = "TEXT")]
    pub filter: Vec<String>,
    /// The I-th of N equal parts, for several machines
    #[arg(long, value_name = "I/N")]
    pub shard: Option<String>,
    /// Run only what a change touches; results of the rest are reused
    #[arg(long)]
    pub changed: bool,
    /// Say which sections there are, and run none
    #[arg(long)]
    pub list: bool,
    /// Run what a change touches after every save, until Ctrl-C
    #[arg(long, conflicts_with_all = ["list", "json"])]
    pub watch: bool,
    /// Draw all images on this device instead of the one that the scripts name (cpu, unless they name another)
    #[arg(long, value_enum)]
    pub device: Option<Device>,
    /// Compare with images that were accepted on another device or driver, too
    #[arg(long)]
    pub any_device: bool,
    /// A further folder in which load(…) looks for files; repeatable
    #[arg(long = "search", value_name = "DIR")]
    pub search: Vec<PathBuf>,
    /// Raise a limit of the scripts, as operations=50000000; repeatable
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    pub limit: Vec<String>,
    /// Seconds that a section may take: its script, its files, its frames and its images. One that takes longer fails, the
    /// others go on. A file that is being read, or an image that is being drawn, is finished first
    #[arg(long, value_name = "SECONDS", default_value = "300")]
    pub timeout: String,
    /// Sections at once (default: one for each core)
    #[arg(long, value_name = "N")]
    pub jobs: Option<String>,
    /// Say nothing but what failed
    #[arg(short, long)]
    pub quiet: bool,
    /// The report as JSON on standard output, and nothing else
    #[arg(long)]
    pub json: bool,
    /// The report as JUnit XML, for build servers
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// The report as one HTML page with the images that differ
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
}

#[derive(Args, Debug)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct PluginsArgs {
    #[command(subcommand)]
    pub action: Option<PluginsAction>,
    /// Only the plugins of this name, with the page that describes them
    #[arg(value_name = "NAME")]
    pub name: Option<String>,
    /// A further folder of plugin files: NAME.importer.rhai, NAME.wgsl; repeatable
    #[arg(long = "plugins", value_name = "DIR")]
    pub plugins: Vec<PathBuf>,
    /// Only the claim of each importer on this file; the first reads it
    #[arg(long = "for", value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// JSON on standard output, for programs
    #[arg(long)]
    pub json: bool,
}

/// Actions on packages, which are folders of plugin files with a plugin.toml.
#[derive(Subcommand, Debug)]
pub(crate) enum PluginsAction {
    /// Install a package in the user's folder of plugins, where every command and the viewer find it
    Install {
        /// The package's folder, its plugin.toml or one of its plugin files
        path: PathBuf,
        /// Take the place of an installed package of this name
        #[arg(long)]
        replace: bool,
    },
    /// The installed packages: version, license, plugins
    List {
        /// JSON on standard output, for programs
        #[arg(long)]
        json: bool,
    },
    /// Remove an installed package
    #[command(visible_aliases = ["uninstall", "rm"])]
    Remove {
        /// Its name, as in `choreo plugins list`
        name: String,
    },
    /// Check a package as its users will meet it: description, plugins, sample files and test scripts
    Test {
        /// The package's folder, its plugin.toml, one of its plugin files, or the name of an installed package
        path: PathBuf,
    },
}

#[derive(Args, Debug)]
pub(crate) struct NewArgs {
    #[arg(value_enum)]
    pub kind: NewKind,
    /// A plugin has lower-case letters, digits and _, as my_format; a project also capitals and -, as my-film
    pub name: String,
    /// One file that needs nothing but this program: NAME.importer.rhai, NAME.exporter.rhai or NAME.wgsl
    #[arg(long)]
    pub single: bool,
    /// A package that is built to WebAssembly: NAME.importer.wasm or NAME.exporter.wasm, with its plugin.toml
    #[arg(long, conflicts_with = "single")]
    pub wasm: bool,
    /// The hook of an effect (default: pixel)
    #[arg(long, value_enum)]
    pub hook: Option<HookArg>,
    /// The folder to write into (default: this one)
    #[arg(long, value_name = "DIR")]
    pub into: Option<PathBuf>,
    /// The folder of choreo's sources that a crate builds against (default: the one around this folder)
    #[arg(long, value_name = "DIR", conflicts_with = "single")]
    pub sources: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub(crate) struct FormatArgs {
    /// Scripts and folders of them (default: this folder); - reads standard input and prints the result
    #[arg(value_name = "FILES")]
    pub paths: Vec<PathBuf>,
    /// Write nothing; name the scripts that would change, and fail if there are any
    #[arg(long)]
    pub check: bool,
}

#[derive(Args, Debug)]
pub(crate) struct LspArgs {
    /// Said by editors; there is no other way
    #[arg(long, hide = true)]
    pub stdio: bool,
}

#[derive(Args, Debug)]
pub(crate) struct HelpArgs {
    /// A word of Blender, Unity, glTF or of a script ("foot sliding", ik, Actor.reach), or a command
    #[arg(value_name = "TERM", required = true)]
    pub term: Vec<String>,
    /// Print a page of the documentation: core/script/API.md, or film_grain/README.md
    #[arg(long)]
    pub page: bool,
    /// JSON on standard output, for programs
    #[arg(long)]
    pub json: bool,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NewKind {
    /// A folder for videos of your own: a script, a test, choreo.toml, a CI workflow, settings for editors
    Project,
    /// Reads a format
    Importer,
    /// Changes how frames look
    Effect,
    /// Writes scenes for other programs
    Exporter,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HookArg {
    /// One pixel of the image
    Pixel,
    /// A pixel and those around it, and frames before
    #[value(alias = "picture")]
    Image,
    /// A place on a surface
    Surface,
    /// A vertex of a surface, which it moves
    Vertex,
    /// A light on a surface
    Lighting,
    /// A hull around surfaces, or their edges; also called outline
    #[value(alias = "outline")]
    Shell,
    /// Lines, points or triangles of its own
    Overlay,
    /// How long the shutter is open: motion blur
    Shutter,
}

impl Command {
    /// The scene that the command opens.
    pub fn scene(&mut self) -> Option<&mut SceneArgs> {
        match self {
            Command::Render(a) => Some(&mut a.scene),
            Command::Export(a) => Some(&mut a.scene),
            Command::Pack(a) => Some(&mut a.scene),
            Command::Farm(a) if a.status.is_none() => Some(&mut a.scene),
            Command::Check(a) => Some(&mut a.scene),
            Command::Explain(a) => Some(&mut a.scene),
            Command::Measure(a) => Some(&mut a.scene),
            Command::Pose(a) => Some(&mut a.scene),
            _ => None,
        }
    }

    pub fn json(&self) -> bool {
        match self {
            Command::Render(a) => a.json,
            Command::Join(a) => a.json,
            Command::Pack(a) => a.json,
            Command::Farm(a) => a.json,
            Command::Export(a) => a.json,
            Command::Check(a) => a.json,
            Command::Info(a) => a.json,
            Command::Explain(a) => a.json,
            Command::Measure(a) => a.json,
            Command::Pose(a) => a.json,
            Command::Test(a) => a.json,
            Command::Plugins(a) => a.json || matches!(a.action, Some(PluginsAction::List { json: true })),
            Command::Help(a) => a.json,
            Command::New(_) | Command::View(_) | Command::Format(_) | Command::Lsp(_) => false,
        }
    }
}
