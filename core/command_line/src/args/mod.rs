//! The command line as clap parses it: commands and their options.

pub(crate) mod values;

use clap::builder::ArgPredicate;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

pub(crate) const EXIT_CODES_HELP: &str = "\
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

Outputs are complete or absent: a file is written as NAME.part in the same folder, and renamed when complete.
When the render of a video is stopped, also by Ctrl-C, its finished frames stay in the folder NAME.part, and --resume continues
after them. An output path that is a symbolic link or an input is refused.";

/// Text after the options in `--help`; `-h` shows only the exit codes.
fn limits_help() -> String {
    let table = choreo_script::Limits::table();
    format!("Limits, set with --limit NAME=NUMBER:\n{table}\n{EXIT_CODES_HELP}")
}

/// Turns a script and a folder of ready-made characters and clips into an animated scene.
#[derive(Parser, Debug)]
#[command(name = "choreo", version, after_help = EXIT_CODES_HELP, disable_help_subcommand = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub command: Command,
    /// Do not read choreo.toml, which names search folders, plugin folders and default options of the project
    #[arg(long, global = true)]
    pub no_project_file: bool,
}

#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// Render a script, or a model file as it is, to video or images
    #[command(after_help = EXIT_CODES_HELP, after_long_help = limits_help())]
    Render(RenderArgs),
    /// Write a job that renders a film on many machines, for an existing engine: Open Job Description or Slurm
    #[command(after_help = EXIT_CODES_HELP, after_long_help = limits_help(), mut_arg("input", |input| {
        // Not needed with --status, which names the folder of a job.
        input.required(false).required_unless_present("status").default_value_if("status", ArgPredicate::IsPresent, ".")
    }))]
    Farm(FarmArgs),
    /// Join the segments of several machines, made with render --segment, into the file that one machine would have written
    #[command(after_help = EXIT_CODES_HELP)]
    Join(JoinArgs),
    /// Pack a script and every file that it reads into one archive, which renders to the same images on another machine
    #[command(after_help = EXIT_CODES_HELP, after_long_help = limits_help())]
    Pack(PackArgs),
    /// Write the scene for another program: skeletons, animation and cameras, as far as the format can hold them
    #[command(after_help = EXIT_CODES_HELP, after_long_help = limits_help())]
    Export(ExportArgs),
    /// Open a window that shows a script or a model, and updates it after every save
    #[command(after_help = EXIT_CODES_HELP)]
    View(ViewArgs),
    /// Check a scene without drawing: the script, its assets, its callbacks at every frame, and its tests
    #[command(after_help = EXIT_CODES_HELP, after_long_help = limits_help())]
    Check(CheckArgs),
    /// Describe a model file, or how an image or video was made
    #[command(after_help = EXIT_CODES_HELP)]
    Info(InfoArgs),
    /// Explain one frame of a scene: the parts that it needs, what requested them, and the parts that were left out
    #[command(after_help = EXIT_CODES_HELP, after_long_help = limits_help())]
    Explain(ExplainArgs),
    /// Measure error against run time for each numerical method that the scene could use
    #[command(after_help = EXIT_CODES_HELP, after_long_help = limits_help())]
    Measure(MeasureArgs),
    /// Print the joints of every actor in world space at one time
    #[command(after_help = EXIT_CODES_HELP, after_long_help = limits_help())]
    Pose(PoseArgs),
    /// Run tests that are written as scripts: sections with assertions and reference images
    #[command(after_help = EXIT_CODES_HELP)]
    Test(TestArgs),
    /// List the importers, effects and exporters of this program; install, list, remove or test packages of plugins
    #[command(after_help = EXIT_CODES_HELP)]
    Plugins(PluginsArgs),
    /// Create a project for your own videos, or a plugin: a crate, or a single file with --single
    #[command(after_help = EXIT_CODES_HELP)]
    New(NewArgs),
    /// Format scripts: spaces, indentation and blank lines. Line breaks, comments and strings are kept
    #[command(after_help = EXIT_CODES_HELP)]
    Format(FormatArgs),
    /// Run the language server for editors (Language Server Protocol) on standard input and output: diagnostics, completion and more
    #[command(after_help = EXIT_CODES_HELP)]
    Lsp(LspArgs),
    /// Look up a term of animation and rendering, or print the help of a command
    #[command(after_help = EXIT_CODES_HELP)]
    Help(HelpArgs),
}

/// Arguments that describe the scene of a command.
#[derive(Args, Clone, Debug)]
pub(crate) struct SceneArgs {
    /// A script (.rhai), a packed scene (.choreo), or a model file, which is framed, lit and played without a script
    #[arg(value_name = "SCRIPT|MODEL")]
    pub input: PathBuf,
    /// Value of a script parameter, which the script reads with param("NAME"); repeatable
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
    /// Name and version of the program that makes the output, for its provenance
    #[arg(skip)]
    pub software: String,
    /// Identity of the stage, if the scene is packed and must equal the one that was packed
    #[arg(skip)]
    pub packed_stage: Option<PackedStage>,
}

/// Identity of the stage in a packed scene, as recorded by the program that packed it.
#[derive(Clone, Debug)]
pub(crate) struct PackedStage {
    pub software: String,
    /// Hashes of all files read and of the stage, in hexadecimal digits.
    pub input_hash: String,
    pub stage: String,
}

/// Options for reading a model file. Scripts give them to `load(…, #{ … })` instead.
#[derive(Args, Clone, Debug)]
pub(crate) struct ImportArgs {
    /// Model files: use this importer instead of choosing one by the file's content (see `choreo plugins --for FILE`)
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
    /// Output file; the extension determines the format (choreo plugins lists them): out.mp4, out.png for one image, frames/%04d.png for
    /// numbered images, or - for y4m on standard output
    #[arg(short, long, value_name = "FILE")]
    pub output: String,
    /// Which frames: 0..120 (120 not included), 0..=119, 0-119, 30.., one number, every 24th as 0..240:24, or a list as 0,5,9..20
    #[arg(long, value_name = "FRAMES", conflicts_with = "at", allow_hyphen_values = true)]
    pub frames: Option<String>,
    /// One image at this time in seconds
    #[arg(long, value_name = "SECS", allow_hyphen_values = true)]
    pub at: Option<String>,
    /// Model files: seconds to render; the clip is looped (default: the clip once)
    #[arg(long, value_name = "SECS")]
    pub length: Option<String>,
    /// Render a contact sheet: one image with 12 frames of the scene, or with those of --frames, each labeled with its time; --size is the
    /// size of one frame
    #[arg(long, conflicts_with_all = ["resume", "watch", "stages", "at"])]
    pub sheet: bool,
    /// Width and height in pixels, as 1280x720
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    /// Frames per second; 23.976, 29.97 and 59.94 mean the NTSC rates
    #[arg(long, value_name = "RATE")]
    pub fps: Option<String>,
    /// Device to render on. auto: Vulkan on a GPU, else the CPU renderer, which is faster than a Vulkan driver that runs on the CPU
    #[arg(long, value_enum, default_value_t = Device::Auto)]
    pub device: Device,
    /// Part of the name of the Vulkan device to use (default: the fastest one)
    #[arg(long, value_name = "NAME", conflicts_with = "watch")]
    pub gpu: Option<String>,
    /// Anisotropic filtering: largest number of texels along a slanted texture, 1 to 16 (default: 16 on a GPU, 1 on the CPU)
    #[arg(long, value_name = "N", conflicts_with = "watch", value_parser = clap::value_parser!(u8).range(1..=16))]
    pub anisotropy: Option<u8>,
    /// Samples per pixel for antialiasing (default: the script's setting, else 4)
    #[arg(long, value_name = "1|4")]
    pub samples: Option<String>,
    /// Option of the output format (see `choreo plugins`); repeatable
    #[arg(long = "export", value_name = "NAME=VALUE")]
    pub export: Vec<String>,
    /// Render passes of each image for a compositor, as color,depth,normal; for formats with the option passes (EXR)
    #[arg(long, value_name = "LIST")]
    pub passes: Option<String>,
    /// Write the frames into this folder as a segment for choreo join: each of several machines makes a part of the film -o
    #[arg(long, value_name = "DIR", conflicts_with_all = ["at", "sheet", "watch", "stages"])]
    pub segment: Option<PathBuf>,
    /// Render one film for each row of a table, whose columns are parameters as in --set: rows.csv with names in the first line, or
    /// rows.json, an array of objects. -o is a pattern, as out/{name}.mp4; {row} is the number of the row
    #[arg(long = "set-from", value_name = "FILE", conflicts_with_all = ["watch", "stages"])]
    pub set_from: Option<PathBuf>,
    /// Render only this row of --set-from, counted from 1
    #[arg(long, value_name = "N", requires = "set_from")]
    pub row: Option<usize>,
    /// Continue an earlier render with the same options that was stopped: its finished frames are not drawn again
    #[arg(long)]
    pub resume: bool,
    /// Do not keep finished frames of a video: delete those of an earlier, stopped render, and those of this render if it is stopped
    #[arg(long, conflicts_with = "resume")]
    pub discard: bool,
    /// The command that resumes this render, for messages
    #[arg(skip)]
    pub resume_command: String,
    /// Draw the affected frames again after every save and rewrite the output, until Ctrl-C
    #[arg(long, conflicts_with = "resume")]
    pub watch: bool,
    /// Draw the stages of the CPU renderer for one frame, as six images in the folder -o: model, view, clip, raster, depth, shade
    #[arg(long, conflicts_with_all = ["resume", "watch", "frames"])]
    pub stages: bool,
    /// Write the number of finished frames to standard error, as a line of JSON after each frame, for the viewer
    #[arg(long, hide = true)]
    pub progress_lines: bool,
    /// Largest number of threads (default: one per core)
    #[arg(long, value_name = "N")]
    pub jobs: Option<String>,
    /// Add the busy time of the device, measured by its clock, to the summary; for the CPU renderer, the time of each stage
    #[arg(long, conflicts_with = "watch")]
    pub timings: bool,
    /// Print no progress bar, notes or summary; warnings are still printed
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the summary, or the errors, as JSON on standard output (standard error for -o -)
    #[arg(long)]
    pub json: bool,
}

impl RenderArgs {
    /// Options of the output format: those of `--export`, and those that have an argument of their own.
    pub(crate) fn export_options(&self) -> Vec<String> {
        let mut options = self.export.clone();
        options.extend(self.passes.iter().map(|passes| format!("passes={passes}")));
        options
    }
}

#[derive(Args, Debug)]
pub(crate) struct FarmArgs {
    /// Print the progress of the job in this folder, from the files of its workers: chunks, frames per second, time left, failures
    #[arg(long, value_name = "DIR", conflicts_with_all = ["output", "engine", "to", "chunk", "set_from", "preview", "set"])]
    pub status: Option<PathBuf>,
    /// Contact sheet to write with --status: the first frame of each chunk with the chunk's state
    #[arg(long, value_name = "FILE.png", requires = "status")]
    pub sheet: Option<PathBuf>,
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The film, written into the folder output of the job: film.mp4, or frames/%04d.png
    #[arg(short, long, value_name = "FILE", required_unless_present = "status")]
    pub output: Option<String>,
    /// The engine that runs the job
    #[arg(long = "for", value_enum, value_name = "ENGINE", required_unless_present = "status")]
    pub engine: Option<Engine>,
    /// Folder of the job: the packed scene, its steps, and later the segments and the film
    #[arg(long, value_name = "DIR", required_unless_present = "status")]
    pub to: Option<PathBuf>,
    /// Frames per chunk (default: measured, so that starting takes at most 5 % of a machine's time)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub chunk: Option<u64>,
    /// Render one film for each row of a table, as with render --set-from; -o is a pattern, as {name}.mp4
    #[arg(long = "set-from", value_name = "FILE")]
    pub set_from: Option<PathBuf>,
    /// Render a preview first: every Nth frame at half the size into the folder output/preview; written as 1/N
    #[arg(long, value_name = "1/N", conflicts_with = "set_from")]
    pub preview: Option<String>,
    /// Width and height in pixels, as 1280x720
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    /// Frames per second; 23.976, 29.97 and 59.94 mean the NTSC rates
    #[arg(long, value_name = "RATE")]
    pub fps: Option<String>,
    /// Device that all machines use; cpu gives the same bytes on all machines
    #[arg(long, value_enum, default_value_t = Device::Cpu)]
    pub device: Device,
    /// Samples per pixel for antialiasing (default: the script's setting, else 4)
    #[arg(long, value_name = "1|4")]
    pub samples: Option<String>,
    /// Option of the output format (see `choreo plugins`); repeatable
    #[arg(long = "export", value_name = "NAME=VALUE")]
    pub export: Vec<String>,
    /// Print no progress bar or summary
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the summary, or the errors, as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

/// An engine that runs jobs on many machines.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Engine {
    /// A template in Open Job Description: for AWS Deadline Cloud, or for openjd on one machine
    Openjd,
    /// Scripts for sbatch: an array job, and a job that depends on it
    Slurm,
}

#[derive(Args, Debug)]
pub(crate) struct PackArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Output: an archive, film.choreo, or a new folder, film/, with the same files
    #[arg(short, long, value_name = "FILE.choreo|DIR/")]
    pub output: PathBuf,
    /// Print no progress bar or summary; warnings are still printed
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the summary, or the errors, as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct JoinArgs {
    /// Segments, or folders with segments, in any order
    #[arg(value_name = "SEGMENT|DIR", required = true)]
    pub segments: Vec<PathBuf>,
    /// The film, in the format of the segments: a file, or frames/%04d.png
    #[arg(short, long, value_name = "FILE")]
    pub output: String,
    /// Wait up to this many seconds for missing segments: on a shared file system they may appear late
    #[arg(long, value_name = "SECONDS", default_value_t = 0)]
    pub wait: u32,
    /// Raise or lower a limit, as output=1000000000; repeatable
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    pub limit: Vec<String>,
    /// Print no progress bar or summary; warnings about damaged segments are still printed
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the summary, or the errors, as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ExportArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Output file; the extension determines the format (see `choreo plugins`)
    #[arg(short, long, value_name = "FILE")]
    pub output: String,
    /// Which frames: 0..120 (120 not included), 0..=119, 30.., one number, every 24th as 0..240:24, or a list as 0,5,9..20
    #[arg(long, value_name = "FRAMES", allow_hyphen_values = true)]
    pub frames: Option<String>,
    /// Frames per second; 23.976, 29.97 and 59.94 mean the NTSC rates
    #[arg(long, value_name = "RATE")]
    pub fps: Option<String>,
    /// Option of the format (see `choreo plugins`); repeatable
    #[arg(long = "export", value_name = "NAME=VALUE")]
    pub export: Vec<String>,
    /// Largest error of a joint's position in metres; for formats with the option tolerance
    #[arg(long, value_name = "METRES")]
    pub tolerance: Option<String>,
    /// Write one animation for each actor instead of one for all; for formats with the option animations
    #[arg(long, value_name = "WHAT", value_parser = ["actors"])]
    pub split: Option<String>,
    /// Write the clips that actors play, one animation each, instead of the timeline; for formats with the option animations
    #[arg(long, conflicts_with = "split")]
    pub clips: bool,
    /// Print no progress bar or summary
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the summary, or the errors, as JSON on standard output
    #[arg(long)]
    pub json: bool,
}

impl ExportArgs {
    /// Options of the output format: those of `--export`, and those that have an argument of their own.
    pub(crate) fn export_options(&self) -> Vec<String> {
        let mut options = self.export.clone();
        options.extend(self.tolerance.iter().map(|metres| format!("tolerance={metres}")));
        options.extend(self.split.iter().map(|what| format!("animations={what}")));
        options.extend(self.clips.then(|| "animations=clips".to_string()));
        options
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
    /// A script (.rhai) or a model file; without one, the viewer shows recent files, lessons and templates
    #[arg(value_name = "SCRIPT|MODEL")]
    pub input: Option<PathBuf>,
    /// Options of the viewer: see choreo-view --help
    #[arg(value_name = "OPTION", trailing_var_arg = true, allow_hyphen_values = true)]
    pub viewer_options: Vec<std::ffi::OsString>,
}

#[derive(Args, Debug)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Fail on warnings too
    #[arg(long)]
    pub strict: bool,
    /// Also print notes about things that are often intended: truncated ends of clips, overlapping layers, unused variables
    #[arg(long)]
    pub notes: bool,
    /// Also write a chart of the cues over time, with the findings, as an image
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// Print JSON on standard output, for programs
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct InfoArgs {
    /// A model, or an image or video made by choreo
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    #[command(flatten)]
    pub import: ImportArgs,
    /// Print the joints as a tree
    #[arg(long)]
    pub joints: bool,
    /// Print the retargeting: which joint of this character follows which joint of the file, when it plays the file's clips
    #[arg(long, value_name = "CHARACTER")]
    pub on: Option<PathBuf>,
    /// Compress the clips to this tolerance in metres, and print the saved memory and the error
    #[arg(long, value_name = "METRES")]
    pub compress: Option<f64>,
    /// Model files: a further folder in which textures are looked for; repeatable
    #[arg(long = "search", value_name = "DIR")]
    pub search: Vec<PathBuf>,
    /// Raise or lower a limit, as memory=2000000000; repeatable
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    pub limit: Vec<String>,
    /// Print JSON on standard output, for programs
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct ExplainArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Time of the explained frame in seconds
    #[arg(long, value_name = "SECS", default_value = "0", allow_hyphen_values = true)]
    pub at: String,
    /// Width and height in pixels, as 1280x720
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    /// Samples per pixel for antialiasing (default: the script's setting, else 4)
    #[arg(long, value_name = "1|4")]
    pub samples: Option<String>,
    /// Also explain the passes of an OpenEXR image, as color,depth,id
    #[arg(long, value_name = "LIST")]
    pub passes: Option<String>,
    /// Also write a chart of the memory that the frame takes on the device, as an image
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// Print JSON on standard output, for programs
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct MeasureArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Measure only this choice: bake, crossfade, springs, ik, skinning, vertices, mips, sky, shadows, motion_blur, tones, renderer or
    /// video; repeatable
    #[arg(long, value_name = "CHOICE")]
    pub only: Vec<String>,
    /// Time in seconds at which images are rendered (default: the middle of the scene)
    #[arg(long, value_name = "SECS", allow_hyphen_values = true)]
    pub at: Option<String>,
    /// Width and height in pixels, as 1280x720
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,
    /// Renderers to measure. auto: the CPU renderer, and Vulkan where a driver works
    #[arg(long, value_enum, default_value_t = Device::Auto)]
    pub device: Device,
    /// Also write plots of error against run time, one below the other, as an image
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// Print JSON on standard output, for programs
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct PoseArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Time in seconds
    #[arg(long, value_name = "SECS", default_value = "0", allow_hyphen_values = true)]
    pub at: String,
    /// Also write the posed meshes, skinned and morphed, with vertices in the order of the file
    #[arg(long, value_name = "FILE.obj")]
    pub mesh: Option<PathBuf>,
    /// Print JSON on standard output, for programs
    #[arg(long)]
    pub json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct TestArgs {
    /// Scripts, and folders with scripts (default: tests/suite and scripts if they exist, else everything below this folder). Tests may
    /// read files in the folder of their project, which contains choreo.toml, else below the folder in which this command is run
    #[arg(value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Accept drawn images as reference images: of all failed tests, or the one of this name; repeatable
    #[arg(long, value_name = "NAME", num_args = 0..=1, require_equals = true, default_missing_value = "", conflicts_with_all = ["watch", "list"])]
    pub accept: Vec<String>,
    /// A further folder of plugin files: NAME.importer.rhai, NAME.wgsl; repeatable
    #[arg(long = "plugins", value_name = "DIR")]
    pub plugins: Vec<PathBuf>,
    /// Run only sections whose "FILE > SECTION" contains this text, in upper or lower case, or which have this tag; repeatable
    #[arg(long, value_name = "TEXT")]
    pub filter: Vec<String>,
    /// Run the I-th of N equal parts, to share the tests between machines
    #[arg(long, value_name = "I/N")]
    pub shard: Option<String>,
    /// Run only sections that a change affects; results of the rest are reused
    #[arg(long)]
    pub changed: bool,
    /// List the sections and run none
    #[arg(long)]
    pub list: bool,
    /// Run the affected sections after every save, until Ctrl-C
    #[arg(long, conflicts_with_all = ["list", "json"])]
    pub watch: bool,
    /// Draw all images on this device instead of the one that the scripts name (cpu, unless they name another)
    #[arg(long, value_enum)]
    pub device: Option<Device>,
    /// Compare also with reference images that were accepted on another device or driver
    #[arg(long)]
    pub any_device: bool,
    /// A further folder in which load(…) looks for files; repeatable
    #[arg(long = "search", value_name = "DIR")]
    pub search: Vec<PathBuf>,
    /// Raise a limit of the scripts, as operations=50000000; repeatable
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    pub limit: Vec<String>,
    /// Longest time of a section in seconds, for its script, files, frames and images. A section that takes longer fails, and the others
    /// continue. A file that is being read, or an image that is being drawn, is finished first
    #[arg(long, value_name = "SECONDS", default_value = "300")]
    pub timeout: String,
    /// Number of sections run at the same time (default: one per core)
    #[arg(long, value_name = "N")]
    pub jobs: Option<String>,
    /// Print failures only
    #[arg(short, long)]
    pub quiet: bool,
    /// Print the report as JSON on standard output, and nothing else
    #[arg(long)]
    pub json: bool,
    /// Write the report as JUnit XML, for build servers
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write the report as one HTML page, with the images that differ
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
}

#[derive(Args, Debug)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct PluginsArgs {
    #[command(subcommand)]
    pub action: Option<PluginsAction>,
    /// List only the plugins of this name, with the page that describes them
    #[arg(value_name = "NAME")]
    pub name: Option<String>,
    /// A further folder of plugin files: NAME.importer.rhai, NAME.wgsl; repeatable
    #[arg(long = "plugins", value_name = "DIR")]
    pub plugins: Vec<PathBuf>,
    /// Print which importers accept this file; the first one reads it
    #[arg(long = "for", value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// Print JSON on standard output, for programs
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
        /// Replace an installed package of the same name
        #[arg(long)]
        replace: bool,
    },
    /// List the installed packages: version, license, plugins
    List {
        /// Print JSON on standard output, for programs
        #[arg(long)]
        json: bool,
    },
    /// Remove an installed package
    #[command(visible_aliases = ["uninstall", "rm"])]
    Remove {
        /// Name of the package, as in `choreo plugins list`
        name: String,
    },
    /// Test a package as its users will use it: description, plugins, sample files and test scripts
    Test {
        /// The package's folder, its plugin.toml, one of its plugin files, or the name of an installed package
        path: PathBuf,
    },
}

#[derive(Args, Debug)]
pub(crate) struct NewArgs {
    /// A project, or the kind of plugin to create
    #[arg(value_enum)]
    pub kind: NewKind,
    /// Name of the plugin, with lower-case letters, digits and _, as my_format; for a project also with capitals and -, as my-film
    pub name: String,
    /// Create a single file that needs nothing but this program: NAME.importer.rhai, NAME.exporter.rhai or NAME.wgsl
    #[arg(long)]
    pub single: bool,
    /// Create a package that is built to WebAssembly: NAME.importer.wasm or NAME.exporter.wasm, with its plugin.toml
    #[arg(long, conflicts_with = "single")]
    pub wasm: bool,
    /// Hook of the effect (default: pixel)
    #[arg(long, value_enum)]
    pub hook: Option<HookArg>,
    /// Folder to write into (default: this one)
    #[arg(long, value_name = "DIR")]
    pub into: Option<PathBuf>,
    /// Folder of choreo's sources for a crate to build against (default: the one around this folder)
    #[arg(long, value_name = "DIR", conflicts_with = "single")]
    pub sources: Option<PathBuf>,
}

#[derive(Args, Debug)]
pub(crate) struct FormatArgs {
    /// Scripts, and folders with scripts (default: this folder); - reads standard input and prints the result
    #[arg(value_name = "FILES")]
    pub paths: Vec<PathBuf>,
    /// Write nothing; name the scripts that would change, and fail if there are any
    #[arg(long)]
    pub check: bool,
}

#[derive(Args, Debug)]
pub(crate) struct LspArgs {
    /// Passed by editors; the server has no other transport than standard input and output
    #[arg(long, hide = true)]
    pub stdio: bool,
}

#[derive(Args, Debug)]
pub(crate) struct HelpArgs {
    /// A term of Blender, Unity, glTF or of scripts ("foot sliding", ik, Actor.reach), or a command
    #[arg(value_name = "TERM", required = true)]
    pub term: Vec<String>,
    /// Print a page of the documentation: core/script/API.md, or film_grain/README.md
    #[arg(long)]
    pub page: bool,
    /// Print JSON on standard output, for programs
    #[arg(long)]
    pub json: bool,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NewKind {
    /// A folder for videos of your own: a script, a test, choreo.toml, a CI workflow, settings for editors
    Project,
    /// A plugin that reads a format
    Importer,
    /// A plugin that changes how frames look
    Effect,
    /// A plugin that writes scenes for other programs
    Exporter,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HookArg {
    /// Changes the color of each pixel of the image
    Pixel,
    /// Changes pixels of the image, and reads neighboring pixels and previous frames
    #[value(alias = "picture")]
    Image,
    /// Changes the color of each point of a surface
    Surface,
    /// Moves the vertices of a surface
    Vertex,
    /// Changes how surfaces reflect each light
    Lighting,
    /// Draws outlines: an inverted hull around surfaces, or the edges of their triangles
    #[value(alias = "shell")]
    Outline,
    /// Draws triangles, lines, points or lattices
    Overlay,
    /// Sets how long the shutter is open: motion blur
    Shutter,
}

impl Command {
    /// Scene arguments; `None` for a command that opens no scene.
    pub(crate) fn scene_args_mut(&mut self) -> Option<&mut SceneArgs> {
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

    /// Whether results and errors are printed as JSON.
    pub(crate) fn prints_json(&self) -> bool {
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
