//! `choreo new importer NAME` and `new effect NAME`: the example crates under a new name, or with `--single` one file.

use crate::args::{HookArg, NewArgs, PluginKind};
use crate::failure::{Failure, print, write_failure};
use choreo_files::{Folder, WriteError};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Files of a crate: name and text. "example" and "Example" become the new name.
type Files = &'static [(&'static str, &'static str)];

macro_rules! example {
    ($path:literal) => {
        include_str!(concat!("../../../../../plugins/", $path))
    };
}

const IMPORTER: Files = &[
    ("README.md", example!("import-example/README.md")),
    ("src/lib.rs", example!("import-example/src/lib.rs")),
    ("tests/sample.rs", example!("import-example/tests/sample.rs")),
    ("tests/sample.example", example!("import-example/tests/sample.example")),
];

const EFFECT: Files = &[
    ("README.md", example!("effect-example/README.md")),
    ("src/lib.rs", example!("effect-example/src/lib.rs")),
    ("src/example.wgsl", example!("effect-example/src/example.wgsl")),
];

/// Crates that a plugin depends on, by their folders in `core`.
const IMPORTER_CRATES: &[&str] = &["plugin", "asset"];
const EFFECT_CRATES: &[&str] = &["plugin", "wgsl_effect"];

pub fn run(args: NewArgs) -> Result<(), Failure> {
    check_name(&args.name)?;
    if args.hook.is_some() && args.kind == PluginKind::Importer {
        return Err(Failure::Usage("--hook is of effects; an importer has none".into()));
    }
    let into = args.into.clone().unwrap_or_default();
    if args.single { single(&args, &into) } else { whole(&args, &into) }
}

/// A crate's name, a Rust identifier with `_` for `-`, and no word of the language.
fn check_name(name: &str) -> Result<(), Failure> {
    let mut chars = name.chars();
    let good = chars.next().is_some_and(|c| c.is_ascii_lowercase())
        && chars.all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && !name.ends_with('_')
        && name.len() <= 40;
    match good {
        true => Ok(()),
        false => Err(Failure::Usage(format!(
            "\"{name}\": a plugin's name is lower-case letters, digits and _, from a letter on, at most 40; as my_format"
        ))),
    }
}

/// An effect of each hook, to begin with.
fn hook_text(hook: Option<HookArg>) -> &'static str {
    match hook.unwrap_or(HookArg::Pixel) {
        HookArg::Pixel => include_str!("hooks/pixel.wgsl"),
        HookArg::Picture => include_str!("hooks/picture.wgsl"),
        HookArg::Surface => include_str!("hooks/surface.wgsl"),
        HookArg::Vertex => include_str!("hooks/vertex.wgsl"),
        HookArg::Lighting => include_str!("hooks/lighting.wgsl"),
        HookArg::Shell => include_str!("hooks/shell.wgsl"),
        HookArg::Overlay => include_str!("hooks/overlay.wgsl"),
    }
}

fn single(args: &NewArgs, into: &Path) -> Result<(), Failure> {
    let named = |text: &str| text.replace("NAME", &args.name);
    let name = &args.name;
    let (file, text, sample) = match args.kind {
        PluginKind::Importer => (
            format!("{name}.importer.rhai"),
            include_str!("single.importer.rhai"),
            Some(include_str!("single.sample")),
        ),
        PluginKind::Effect => (format!("{name}.wgsl"), hook_text(args.hook), None),
    };
    let mut files = vec![(PathBuf::from(&file), named(text))];
    files.extend(sample.map(|text| (PathBuf::from(format!("sample.{name}")), named(text))));
    write(into, &files)?;
    let try_it = match args.kind {
        PluginKind::Importer => format!("choreo info {}", into.join(format!("sample.{name}")).display()),
        PluginKind::Effect => format!("effect(\"{name}\") in a script beside it"),
    };
    print(&format!("{}: written\n    try: {try_it}\n", into.join(file).display()))
}

fn whole(args: &NewArgs, into: &Path) -> Result<(), Failure> {
    let name = &args.name;
    let sources = sources(args)?;
    let (prefix, files, crates) = match args.kind {
        PluginKind::Importer => ("import", IMPORTER, IMPORTER_CRATES),
        PluginKind::Effect => ("effect", EFFECT, EFFECT_CRATES),
    };
    let own = PathBuf::from(format!("{prefix}-{}", name.replace('_', "-")));
    let folder = into.join(&own);
    free(&folder)?;
    let here = if into.as_os_str().is_empty() { Path::new(".") } else { into };
    let workspace = Workspace::around(here, &sources);
    let mut all = vec![(own.join("Cargo.toml"), cargo_toml(prefix, name, crates, &sources, &workspace))];
    for (file, text) in files {
        all.push((own.join(renamed(file, name)), renamed(text, name)));
    }
    write(into, &all)?;
    let member = match &workspace {
        Workspace::Other(root) => format!(
            "    it belongs to the workspace of {}: add it to members there, where they do not include it\n",
            root.display()
        ),
        Workspace::Ours | Workspace::None => String::new(),
    };
    print(&format!(
        "{}: written\n{member}    try: cargo test --manifest-path {}/Cargo.toml\n",
        folder.display(),
        folder.display()
    ))
}

/// The Cargo workspace around a new crate.
enum Workspace {
    /// The one of choreo's sources.
    Ours,
    /// Another one, with its `Cargo.toml`.
    Other(PathBuf),
    None,
}

impl Workspace {
    /// As Cargo finds it: the nearest `Cargo.toml` above with a `[workspace]`.
    fn around(folder: &Path, sources: &Path) -> Workspace {
        let Ok(folder) = folder.canonicalize() else { return Workspace::None };
        if folder == sources.join("plugins") {
            return Workspace::Ours;
        }
        let is_root = |manifest: &PathBuf| {
            let text = std::fs::read_to_string(manifest).unwrap_or_default();
            text.lines().any(|line| line.trim() == "[workspace]" || line.starts_with("[workspace."))
        };
        let root = folder.ancestors().map(|folder| folder.join("Cargo.toml")).find(is_root);
        root.map_or(Workspace::None, Workspace::Other)
    }
}

/// The sources that the new crate builds against: given, or those around the current folder.
fn sources(args: &NewArgs) -> Result<PathBuf, Failure> {
    let is_sources = |folder: &Path| folder.join("core/plugin/Cargo.toml").is_file();
    if let Some(given) = &args.sources {
        let found = given.canonicalize().ok().filter(|g| is_sources(g));
        return found.ok_or_else(|| {
            Failure::Usage(format!("--sources {}: choreo's sources are not there", given.display()))
        });
    }
    let here = std::env::current_dir().unwrap_or_default();
    here.ancestors().find(|folder| is_sources(folder)).map(Path::to_path_buf).ok_or_else(|| {
        Failure::Usage(
            "a crate needs choreo's sources: give their folder with --sources DIR, or write a single file with --single"
                .into(),
        )
    })
}

/// `example` as the new name, in the spelling of the place: `import-example`, `import_example`, `ExampleImporter`.
fn renamed(text: &str, name: &str) -> String {
    let camel: String = name
        .split('_')
        .map(|part| {
            part.chars()
                .take(1)
                .map(|c| c.to_ascii_uppercase())
                .chain(part.chars().skip(1))
                .collect::<String>()
        })
        .collect();
    // The copy must not contain what the examples state about themselves.
    text.replace(": the importer to copy. `choreo new importer NAME` does it.", ".")
        .replace(": the effect to copy. `choreo new effect NAME` does it.", ".")
        .replace(" The one to copy for a format of your own.", "")
        .replace(" The effect to copy for a look of your own.", "")
        .replace("import-example", &format!("import-{}", name.replace('_', "-")))
        .replace("effect-example", &format!("effect-{}", name.replace('_', "-")))
        .replace("Example", &camel)
        .replace("example", name)
        // A folder of ours, which keeps its name.
        .replace(&format!("core/cli/{name}s"), "core/cli/examples")
}

fn cargo_toml(prefix: &str, name: &str, crates: &[&str], sources: &Path, workspace: &Workspace) -> String {
    let in_workspace = matches!(workspace, Workspace::Ours);
    let name = name.replace('_', "-");
    // A path in a TOML text: backslashes of Windows would be escapes.
    let sources = sources.display().to_string().replace('\\', "/");
    let one = |folder: &&str| match (folder.replace('_', "-"), in_workspace) {
        (crate_name, true) => format!("choreo-{crate_name}.workspace = true\n"),
        (crate_name, false) => format!("choreo-{crate_name} = {{ path = \"{sources}/core/{folder}\" }}\n"),
    };
    let crates: String = crates.iter().map(one).collect();
    let glam = match (prefix, in_workspace) {
        ("effect", true) => "glam.workspace = true\n",
        ("effect", false) => {
            "glam = { version = \"0.34\", default-features = false, features = [\"libm\"] }\n"
        }
        _ => "",
    };
    let package = match in_workspace {
        true => {
            "version.workspace = true\nedition.workspace = true\nrust-version.workspace = true\npublish.workspace = true\n"
        }
        false => "version = \"0.1.0\"\nedition = \"2024\"\n",
    };
    // A crate outside a workspace is one, so that Cargo looks for none above it.
    let own = if matches!(workspace, Workspace::None) { "\n[workspace]\n" } else { "" };
    format!("[package]\nname = \"{prefix}-{name}\"\n{package}{own}\n[dependencies]\n{crates}{glam}")
}

/// All files or none, by names beneath a folder: nothing that exists is touched, and no link is followed.
fn write(into: &Path, files: &[(PathBuf, String)]) -> Result<(), Failure> {
    files.iter().try_for_each(|(name, _)| free(&into.join(name)))?;
    for (name, text) in files {
        create(into, name, text).map_err(|e| write_failure(&into.join(name).display().to_string(), e))?;
    }
    Ok(())
}

/// Refuses what exists. A link is named where it is to be created over.
fn free(path: &Path) -> Result<(), Failure> {
    match std::fs::symlink_metadata(path) {
        Ok(there) if !there.is_symlink() => {
            Err(Failure::Output(format!("{}: it exists already; nothing was written", path.display())))
        }
        _ => Ok(()),
    }
}

fn create(into: &Path, name: &Path, text: &str) -> Result<(), WriteError> {
    if !into.as_os_str().is_empty() {
        std::fs::create_dir_all(into)?;
    }
    let folder = Folder::open(into)?.create_folders(name.parent().unwrap_or(Path::new("")))?;
    let name = Path::new(name.file_name().unwrap_or_default());
    let mut file = folder.create_new(name).map_err(|e| WriteError::at(folder.path().join(name), e))?;
    Ok(file.write_all(text.as_bytes())?)
}
