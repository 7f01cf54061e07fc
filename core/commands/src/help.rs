//! `--help` of what reads models or writes results: the options of the plugins, from their manifests alone.

use crate::args::Cli;
use crate::plugins::option_rows;
use choreo_plugin::{Manifest, Registry};
use choreo_session::plugin_files;
use clap::CommandFactory;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

const READ_MODELS: [&str; 6] = ["render", "check", "info", "explain", "measure", "pose"];

/// The command line with what the plugins say, where somebody asks for all of it.
pub fn command(args: &[OsString], plugins: &Registry) -> clap::Command {
    let command = Cli::command();
    if !args.iter().any(|a| a == "--help") {
        return command;
    }
    // Those beside what is named, and here; a plugin that is broken is told elsewhere.
    let inputs: Vec<&Path> = args.iter().skip(2).map(Path::new).filter(|p| p.exists()).collect();
    let here = [&[Path::new(".")], inputs.as_slice()].concat();
    let after = |flag: &OsString| args.iter().skip_while(move |a| *a != flag).nth(1).map(PathBuf::from);
    let named: Vec<PathBuf> = after(&"--plugins".into()).into_iter().filter(|f| f.is_dir()).collect();
    let found = plugin_files::list(plugins, &named, &here, None).map(|listing| listing.registry);
    let registry = found.as_ref().unwrap_or(plugins);
    let importers = rows(registry.importers().iter().map(|i| i.manifest()));
    let exporters = rows(registry.exporters().iter().map(|e| e.manifest()));
    READ_MODELS.into_iter().fold(command, |command, name| {
        command.mut_subcommand(name, |sub| {
            let mut text = format!(
                "Options of importers, set with --import NAME=VALUE, in a script by load(FILE, #{{ NAME: VALUE }}):\n{importers}"
            );
            if name == "render" {
                text += &format!("\nOptions of exporters, set with --export NAME=VALUE:\n{exporters}");
            }
            let before = sub.get_after_long_help().or(sub.get_after_help()).map(ToString::to_string);
            sub.after_long_help(format!("{text}\n{}", before.unwrap_or_default()))
        })
    })
}

fn rows<'m>(manifests: impl Iterator<Item = &'m Manifest>) -> String {
    let with_options = manifests.filter(|m| !m.options.is_empty());
    with_options.map(|m| format!("  {}\n{}", m.name, option_rows(m))).collect()
}
