//! `choreo new importer|effect|exporter NAME`: copies a template crate under a new name; with `--wasm` as a package that is built to
//! WebAssembly, with `--single` as one file. `choreo new project NAME`: creates a folder for scripts.

mod project;

use crate::args::{HookArg, NewArgs, NewKind};
use crate::failure::{Failure, print, write_failure};
use choreo_files::{Folder, WriteError};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Files of a crate: name and text.
type TemplateFiles = &'static [(&'static str, &'static str)];

/// A crate that is copied.
struct Template {
    /// First part of the crate's name, such as "import".
    prefix: &'static str,
    /// Word that is replaced by the new name, such as "example"; "Example" is replaced too.
    word: &'static str,
    files: TemplateFiles,
    /// Crates that it depends on, as names of folders in `core`.
    crates: &'static [&'static str],
}

const IMPORTER_TEMPLATE: Template =
    Template { prefix: "import", word: "example", files: import_example::files::FILES, crates: &["plugin"] };

const EFFECT_TEMPLATE: Template = Template {
    prefix: "effect",
    word: "example",
    files: effect_example::files::FILES,
    crates: &["plugin", "wgsl_effect"],
};

const EXPORTER_TEMPLATE: Template =
    Template { prefix: "export", word: "csv", files: export_csv::files::FILES, crates: &["plugin"] };

/// A kind of plugin.
#[derive(Clone, Copy, PartialEq, Eq)]
enum PluginKind {
    Importer,
    Effect,
    Exporter,
}

pub(crate) fn run(args: NewArgs) -> Result<(), Failure> {
    let into = args.into.clone().unwrap_or_default();
    let kind = match args.kind {
        NewKind::Project => return project::run(&args, &into),
        NewKind::Importer => PluginKind::Importer,
        NewKind::Effect => PluginKind::Effect,
        NewKind::Exporter => PluginKind::Exporter,
    };
    check_name(&args.name)?;
    if args.hook.is_some() && kind != PluginKind::Effect {
        return Err(Failure::Usage("--hook is for effects; importers and exporters have none".into()));
    }
    if args.wasm && kind == PluginKind::Effect {
        return Err(Failure::Usage("--wasm is for importers and exporters; effects are WGSL".into()));
    }
    if args.single { create_single_file(&args, kind, &into) } else { create_crate(&args, kind, &into) }
}

/// Checks the name of a crate: a Rust identifier in which `_` stands for `-`, and no keyword.
fn check_name(name: &str) -> Result<(), Failure> {
    let mut chars = name.chars();
    let is_valid = chars.next().is_some_and(|c| c.is_ascii_lowercase())
        && chars.all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
        && !name.ends_with('_')
        && name.len() <= 40;
    match is_valid {
        true => Ok(()),
        false => Err(Failure::Usage(format!(
            "\"{name}\": a plugin's name begins with a letter and has at most 40 lower-case letters, digits \
             and _, as my_format"
        ))),
    }
}

/// Template of an effect for each hook.
fn hook_template(hook: Option<HookArg>) -> &'static str {
    match hook.unwrap_or(HookArg::Pixel) {
        HookArg::Pixel => include_str!("hooks/pixel.wgsl"),
        HookArg::Image => include_str!("hooks/image.wgsl"),
        HookArg::Surface => include_str!("hooks/surface.wgsl"),
        HookArg::Vertex => include_str!("hooks/vertex.wgsl"),
        HookArg::Lighting => include_str!("hooks/lighting.wgsl"),
        HookArg::Outline => include_str!("hooks/outline.wgsl"),
        HookArg::Overlay => include_str!("hooks/overlay.wgsl"),
        HookArg::Shutter => include_str!("hooks/shutter.wgsl"),
    }
}

fn create_single_file(args: &NewArgs, kind: PluginKind, into: &Path) -> Result<(), Failure> {
    let named = |text: &str| text.replace("NAME", &args.name);
    let name = &args.name;
    let (file, text, sample) = match kind {
        PluginKind::Importer => (
            format!("{name}.importer.rhai"),
            include_str!("single.importer.rhai"),
            Some(include_str!("single.sample")),
        ),
        PluginKind::Effect => (format!("{name}.wgsl"), hook_template(args.hook), None),
        PluginKind::Exporter => (format!("{name}.exporter.rhai"), include_str!("single.exporter.rhai"), None),
    };
    let mut files = vec![(PathBuf::from(&file), named(text))];
    files.extend(sample.map(|text| (PathBuf::from(format!("sample.{name}")), named(text))));
    write_all_files(into, &files)?;
    let try_it = match kind {
        PluginKind::Importer => format!("choreo info {}", into.join(format!("sample.{name}")).display()),
        PluginKind::Effect => format!("effect(\"{name}\") in a script beside it"),
        PluginKind::Exporter => format!("choreo export SCRIPT -o out.{name}, with a script beside it"),
    };
    print(&format!("{}: written\n    try: {try_it}\n", into.join(file).display()))
}

fn create_crate(args: &NewArgs, kind: PluginKind, into: &Path) -> Result<(), Failure> {
    let name = &args.name;
    let sources = find_sources(args)?;
    let template = match kind {
        PluginKind::Importer => IMPORTER_TEMPLATE,
        PluginKind::Effect => EFFECT_TEMPLATE,
        PluginKind::Exporter => EXPORTER_TEMPLATE,
    };
    let own = PathBuf::from(format!("{}-{}", template.prefix, name.replace('_', "-")));
    let folder = into.join(&own);
    check_does_not_exist(&folder)?;
    let here = if into.as_os_str().is_empty() { Path::new(".") } else { into };
    let workspace = Workspace::find(here, &sources);
    let mut files: Vec<(String, String)> = match args.hook.filter(|hook| *hook != HookArg::Pixel) {
        Some(hook) => hook_crate_files(hook, name).into(),
        None => {
            let new = |text: &str| rename_template(text, name, template.word);
            template.files.iter().map(|(file, text)| (new(file), new(text))).collect()
        }
    };
    let mut manifest = cargo_toml(&template, name, &sources, &workspace);
    if args.wasm {
        let kind = if kind == PluginKind::Importer { "importer" } else { "exporter" };
        files = convert_to_wasm_package(&mut manifest, files, &own.display().to_string(), name, kind);
    }
    let mut all = vec![(own.join("Cargo.toml"), manifest)];
    all.extend(files.into_iter().map(|(file, text)| (own.join(file), text)));
    write_all_files(into, &all)?;
    let member = match &workspace {
        Workspace::Other(root) => format!(
            "    it belongs to the workspace of {}: add it to the members there, unless they include it \
             already\n",
            root.display()
        ),
        Workspace::Choreo | Workspace::None => String::new(),
    };
    print(&format!(
        "{}: written\n{member}    try: cargo test --manifest-path {}/Cargo.toml\n",
        folder.display(),
        folder.display()
    ))
}

/// The Cargo workspace that a new crate will belong to.
enum Workspace {
    /// The workspace of choreo's own sources.
    Choreo,
    /// Another workspace, with the path of its `Cargo.toml`.
    Other(PathBuf),
    None,
}

impl Workspace {
    /// Finds the workspace as Cargo does: the nearest `Cargo.toml` above with a `[workspace]`.
    fn find(folder: &Path, sources: &Path) -> Workspace {
        let Ok(folder) = folder.canonicalize() else { return Workspace::None };
        if folder == sources.join("plugins") {
            return Workspace::Choreo;
        }
        let is_root = |manifest: &PathBuf| {
            let text = std::fs::read_to_string(manifest).unwrap_or_default();
            text.lines().any(|line| line.trim() == "[workspace]" || line.starts_with("[workspace."))
        };
        let root = folder.ancestors().map(|folder| folder.join("Cargo.toml")).find(is_root);
        root.map_or(Workspace::None, Workspace::Other)
    }
}

/// Folder of choreo's sources for the new crate to build against: the given one, or the one around the current folder.
fn find_sources(args: &NewArgs) -> Result<PathBuf, Failure> {
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

/// Files of an effect crate whose hook differs from that of the example.
fn hook_crate_files(hook: HookArg, name: &str) -> [(String, String); 3] {
    let (kind, test) = match hook {
        HookArg::Pixel => ("Pixel", ""),
        HookArg::Image => ("Image", include_str!("crate_tests/image.txt")),
        HookArg::Surface => ("Surface", include_str!("crate_tests/surface.txt")),
        HookArg::Vertex => ("Vertex", include_str!("crate_tests/vertex.txt")),
        HookArg::Lighting => ("Lighting", include_str!("crate_tests/lighting.txt")),
        HookArg::Outline => ("Outline", include_str!("crate_tests/outline.txt")),
        HookArg::Overlay => ("Overlay", include_str!("crate_tests/overlay.txt")),
        HookArg::Shutter => ("Shutter", include_str!("crate_tests/shutter.txt")),
    };
    let named = |text: &str| text.replace("TEST", test).replace("HOOK", kind).replace("NAME", name);
    [
        ("README.md".into(), named(include_str!("effect_readme.txt"))),
        ("src/lib.rs".into(), named(include_str!("effect_lib.rs.txt"))),
        (format!("src/{name}.wgsl"), named(hook_template(Some(hook)))),
    ]
}

/// Turns a crate into a package whose plugin is built to WebAssembly: changes the crate type, and adds `plugin.toml` and a section to the
/// README.
fn convert_to_wasm_package(
    manifest: &mut String,
    files: Vec<(String, String)>,
    crate_name: &str,
    name: &str,
    kind: &str,
) -> Vec<(String, String)> {
    let named = |text: &str| {
        let text = text.replace("CRATE", &crate_name.replace('-', "_")).replace("NAME", name);
        text.replace("KIND", kind).replace("VERSION", env!("CARGO_PKG_VERSION"))
    };
    let library = "[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n\n[dependencies]";
    *manifest = manifest.replacen("[dependencies]", library, 1);
    // Profiles belong to the root of a workspace.
    if manifest.contains("[workspace]") {
        *manifest += include_str!("wasm_profile.toml.txt");
    }
    let described = ("plugin.toml".to_string(), named(include_str!("wasm_package.toml.txt")));
    let extended = |(file, text): (String, String)| match file.as_str() {
        "README.md" => (file, text + named(include_str!("wasm_readme.txt")).as_str()),
        _ => (file, text),
    };
    files.into_iter().map(extended).chain([described]).collect()
}

/// Replaces the template's word by the new name in each spelling: `import-example`, `import_example`, `ExampleImporter`.
fn rename_template(text: &str, name: &str, word: &str) -> String {
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
    let capital: String =
        word.chars().take(1).map(|c| c.to_ascii_uppercase()).chain(word.chars().skip(1)).collect();
    // Sentences that the examples contain about themselves are removed from the copy.
    let mut text = text
        .replace("#[doc(hidden)]\npub mod files;\n\n", "")
        .replace(" The one to copy for a format of your own.", "")
        .replace(" The effect to copy for a look of your own.", "");
    for kind in ["importer", "effect", "exporter"] {
        text = text.replace(&format!(": the {kind} to copy. `choreo new {kind} NAME` does it."), ".");
    }
    for prefix in ["import", "effect", "export"] {
        text = text.replace(&format!("{prefix}-{word}"), &format!("{prefix}-{}", name.replace('_', "-")));
    }
    text.replace(&capital, &camel).replace(word, name)
}

fn cargo_toml(template: &Template, name: &str, sources: &Path, workspace: &Workspace) -> String {
    let Template { prefix, crates, .. } = template;
    let in_workspace = matches!(workspace, Workspace::Choreo);
    let name = name.replace('_', "-");
    // Backslashes of Windows paths would be escapes in a TOML string.
    let sources = sources.display().to_string().replace('\\', "/");
    let one = |folder: &&str| match (folder.replace('_', "-"), in_workspace) {
        (crate_name, true) => format!("choreo-{crate_name}.workspace = true\n"),
        (crate_name, false) => format!("choreo-{crate_name} = {{ path = \"{sources}/core/{folder}\" }}\n"),
    };
    let crates: String = crates.iter().map(one).collect();
    let about = match *prefix {
        "import" => "Reads",
        "export" => "Writes",
        _ => "The effect",
    };
    let package = match in_workspace {
        true => format!(
            "description = \"{about} {name} for choreo\"\nversion.workspace = true\nedition.workspace = true\nrust-version.workspace = true\nlicense.workspace = true\n"
        ),
        false => "version = \"0.1.0\"\nedition = \"2024\"\n".to_string(),
    };
    // A crate outside a workspace becomes its own workspace, so that Cargo looks for none above it.
    let own = if matches!(workspace, Workspace::None) { "\n[workspace]\n" } else { "" };
    format!("[package]\nname = \"{prefix}-{name}\"\n{package}{own}\n[dependencies]\n{crates}")
}

/// Writes all files or none, by names below a folder. Existing files are not replaced, and links are not followed.
fn write_all_files(into: &Path, files: &[(PathBuf, String)]) -> Result<(), Failure> {
    files.iter().try_for_each(|(name, _)| check_does_not_exist(&into.join(name)))?;
    for (name, text) in files {
        create_file(into, name, text)
            .map_err(|e| write_failure(&into.join(name).display().to_string(), e))?;
    }
    Ok(())
}

/// Refuses a path that exists. A symbolic link is refused later, when the file is created.
fn check_does_not_exist(path: &Path) -> Result<(), Failure> {
    match std::fs::symlink_metadata(path) {
        Ok(there) if !there.is_symlink() => {
            Err(Failure::Output(format!("{}: it exists already; nothing was written", path.display())))
        }
        _ => Ok(()),
    }
}

fn create_file(into: &Path, name: &Path, text: &str) -> Result<(), WriteError> {
    if !into.as_os_str().is_empty() {
        std::fs::create_dir_all(into)?;
    }
    let folder = Folder::open(into)?.create_folders(name.parent().unwrap_or(Path::new("")))?;
    let name = Path::new(name.file_name().unwrap_or_default());
    let mut file = folder.create_new(name).map_err(|e| WriteError::at(folder.path().join(name), e))?;
    Ok(file.write_all(text.as_bytes())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_plugin::Hook;
    use choreo_wgsl_effect::WgslEffect;
    use clap::ValueEnum;
    use std::collections::BTreeSet;

    #[test]
    fn every_hook_has_its_template() {
        let templates = HookArg::value_variants().iter().map(|hook| {
            let text = hook_template(Some(*hook)).replace("NAME", "mine");
            WgslEffect::from_text("mine.wgsl", &text).unwrap_or_else(|e| panic!("{hook:?}: {e}")).hook()
        });
        assert_eq!(templates.collect::<BTreeSet<Hook>>(), choreo_wgsl_effect::hooks().collect());
        assert_eq!(HookArg::from_str("shell", true), Ok(HookArg::Outline));
    }
}
