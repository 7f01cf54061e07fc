//! `choreo new project NAME`: creates a folder with a script that renders without changes, its test, `choreo.toml`, a CI workflow and
//! settings for editors.

use super::{check_does_not_exist, write_all_files};
use crate::args::NewArgs;
use crate::failure::{Failure, print};
use std::path::{Path, PathBuf};

/// Files as (path in the folder, text). `NAME` stands for the project's name, `VERSION` for the version of choreo.
const PROJECT_FILES: [(&str, &str); 10] = [
    ("README.md", include_str!("project/readme.txt")),
    ("NAME.rhai", include_str!("project/scene.rhai")),
    ("tests/NAME.rhai", include_str!("project/test.rhai")),
    ("assets/README.md", include_str!("project/assets_readme.txt")),
    ("choreo.toml", include_str!("project/choreo.toml")),
    (".gitignore", include_str!("project/gitignore.txt")),
    (".github/workflows/test.yml", include_str!("project/workflow.yml")),
    (".vscode/settings.json", include_str!("project/vscode_settings.json")),
    (".vscode/tasks.json", include_str!("project/vscode_tasks.json")),
    (".nvim.lua", include_str!("project/nvim.lua")),
];

pub(super) fn run(args: &NewArgs, into: &Path) -> Result<(), Failure> {
    check_project_name(&args.name)?;
    if args.single || args.wasm || args.hook.is_some() || args.sources.is_some() {
        return Err(Failure::Usage(
            "--single, --wasm, --hook and --sources are for plugins; a project has none".into(),
        ));
    }
    let folder = into.join(&args.name);
    check_does_not_exist(&folder)?;
    let named = |text: &str| text.replace("NAME", &args.name).replace("VERSION", env!("CARGO_PKG_VERSION"));
    let own = Path::new(&args.name);
    let files: Vec<(PathBuf, String)> =
        PROJECT_FILES.iter().map(|(file, text)| (own.join(named(file)), named(text))).collect();
    write_all_files(into, &files)?;
    let shown = folder.display();
    print(&format!("{shown}: written\n    try: cd {shown} && choreo view {}.rhai\n", args.name))
}

/// Checks that a name is valid for folders and files on every system, and needs no quotes in a shell.
fn check_project_name(name: &str) -> Result<(), Failure> {
    let mut chars = name.chars();
    let is_valid = chars.next().is_some_and(|c| c.is_ascii_alphabetic())
        && chars.all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
        && name.len() <= 40
        && !WINDOWS_DEVICE_NAMES.contains(&name.to_ascii_lowercase().as_str());
    match is_valid {
        true => Ok(()),
        false => Err(Failure::Usage(format!(
            "\"{name}\": a project's name begins with a letter, has at most 40 letters, digits, - and _, \
             and is not a device name on Windows, as my-film"
        ))),
    }
}

/// Names that no file can have on Windows.
const WINDOWS_DEVICE_NAMES: [&str; 6] = ["aux", "con", "nul", "prn", "com1", "lpt1"];
