//! `choreo help TERM`: script calls for a term of the field; and `--help` of the commands that read models or write results,
//! extended by the options of the plugins, from their manifests alone.

use crate::App;
use crate::args::{Cli, HelpArgs};
use crate::failure::{Failure, print, print_json};
use crate::plugins::option_rows;
use crate::terminal::page::Page;
use crate::terminal::pages;
use choreo_plugin::Manifest;
use choreo_plugin::suggest::{did_you_mean, list};
use choreo_script::help::{Answer, Call, answer, nearest_terms, search, words_occur_in};
use choreo_session::plugin_files;
use clap::CommandFactory;
use serde_json::{Value, json};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Largest number of search results printed for a term that has no entry of its own.
const MAX_SEARCH_RESULTS: usize = 8;

/// Rewrites `help` and `help COMMAND` as `--help` and `COMMAND --help`.
pub(crate) fn rewrite_help_as_flag(args: Vec<OsString>) -> Vec<OsString> {
    let is_command = |name: &OsString| Cli::command().find_subcommand(name).is_some();
    match args.as_slice() {
        [program, help] if help == "help" => vec![program.clone(), "--help".into()],
        [program, help, name] if help == "help" && is_command(name) => {
            vec![program.clone(), name.clone(), "--help".into()]
        }
        _ => args,
    }
}

/// Prints the calls for a term of the field, or a page of the documentation.
pub(crate) fn run(args: &HelpArgs, app: &App) -> Result<(), Failure> {
    let term = args.term.join(" ");
    if args.page {
        return print_page(app, &term);
    }
    let mut answer = answer(&term);
    let mut page_entries = pages::search_pages(app, &term);
    // A function in a table of a page is a complete answer; a heading is one answer among several.
    let is_function = page_entries.iter().any(|call| call.usage.contains('('));
    if answer.calls.is_empty() && !is_function {
        answer = search(&term);
        answer.calls.truncate(MAX_SEARCH_RESULTS);
    }
    answer.calls.append(&mut page_entries);
    if let Some(command) = command_entry(&term) {
        answer.calls.retain(|call| call.usage != command.usage);
        answer.calls.insert(0, command);
    }
    if answer.calls.is_empty() {
        let near: Vec<String> = nearest_terms(&term, 5).iter().map(|near| format!("\"{near}\"")).collect();
        let near =
            if near.is_empty() { String::new() } else { format!("; did you mean {}?", near.join(", ")) };
        return Err(Failure::Usage(format!(
            "help: there is no entry \"{term}\"{near}\n    hint: choreo help --page API.md lists everything \
             that a script can call"
        )));
    }
    for call in &mut answer.calls {
        call.about = call.about.take().or_else(|| about_command(&call.usage));
        describe_effect(call, &term, app);
    }
    if args.json {
        print_json(&answer_json(&term, &answer))
    } else {
        print(answer_page(&term, &answer).as_str())
    }
}

fn print_page(app: &App, name: &str) -> Result<(), Failure> {
    // References may include a heading: core/script/API.md, "Cues".
    let path = name.split(',').next().unwrap_or_default().trim();
    let text = pages::page_text(app, path).ok_or_else(|| {
        let hint = match path.split_once("reference/") {
            Some((_, entry)) => format!(
                "choreo help {} prints one entry of the reference; choreo help --page API.md prints all of \
                 it",
                entry.rsplit(['#', '/']).next().unwrap_or_default().trim_end_matches(".md")
            ),
            None => format!("pages: {}", list(pages::page_paths(app), 60)),
        };
        let meant = did_you_mean(path, pages::page_paths(app));
        Failure::Usage(format!("help: there is no page \"{path}\"{meant}\n    hint: {hint}"))
    })?;
    print(&pages::with_scripts(app, text))
}

/// Adds the effect's own description to a call such as `effect("fog")`, and its parameters if the term is the effect's name.
fn describe_effect(call: &mut Call, term: &str, app: &App) {
    let name = call.usage.strip_prefix("effect(\"").and_then(|rest| rest.strip_suffix("\")"));
    let Some(name) = name.map(str::to_string) else { return };
    let Some(effect) = app.registry.effect(&name) else { return };
    let manifest = effect.manifest();
    call.about = Some(manifest.about.clone());
    if words_occur_in(term, &name) || words_occur_in(&name, term) {
        call.details = option_rows(manifest).lines().map(|row| row.trim().to_string()).collect();
    }
    let page = format!("plugins/effects/{name}/README.md");
    if pages::page_text(app, &page).is_some() {
        call.page = page;
    }
}

fn answer_page(term: &str, answer: &Answer) -> Page {
    let mut page = Page::default();
    page.line(format_args!("{term}"));
    for Call { usage, about, details, page: from } in &answer.calls {
        page.line(format_args!("  {usage}"));
        page.lines(about.iter().chain(details).map(|about| format!("      {about}")));
        page.line(format_args!("      {from}"));
    }
    page.lines(answer.example.map(|example| format!("Example: {example}")));
    page.lines(answer.note.map(|note| format!("Note: {note}")));
    page
}

fn answer_json(term: &str, answer: &Answer) -> Value {
    let call = |c: &Call| json!({ "usage": c.usage, "about": c.about, "details": c.details, "page": c.page });
    json!({
        "term": term, "calls": answer.calls.iter().map(call).collect::<Vec<_>>(),
        "example": answer.example, "note": answer.note,
    })
}

/// Entry for a term that is a command with further words: "new project", "render --frames", "choreo check".
fn command_entry(term: &str) -> Option<Call> {
    let words: Vec<&str> = term.split_whitespace().skip_while(|word| *word == "choreo").collect();
    let cli = Cli::command();
    let command = cli.find_subcommand(words.first()?)?;
    let usage = format!("choreo {}", words.join(" "));
    let value = |name: &str| {
        let values = command.get_arguments().flat_map(|argument| argument.get_possible_values());
        let found = values.into_iter().find(|value| value.matches(name, true))?;
        found.get_help().map(ToString::to_string)
    };
    let about = match words.get(1..)? {
        [] => command.get_about().map(ToString::to_string),
        [word] => about_command(&usage).or_else(|| value(word)),
        _ => None,
    };
    let page = format!("choreo {} --help", words.first()?);
    Some(Call { usage, about: Some(about?), details: Vec::new(), page })
}

/// Help text of `choreo COMMAND` or `choreo COMMAND --OPTION`.
fn about_command(usage: &str) -> Option<String> {
    let mut words = usage.split(' ').skip(1);
    let cli = Cli::command();
    let mut command = cli.find_subcommand(words.next()?)?;
    let mut next = words.next();
    if let Some(inner) = next.and_then(|word| command.find_subcommand(word)) {
        (command, next) = (inner, words.next());
    }
    let Some(option) = next else { return command.get_about().map(ToString::to_string) };
    let option = option.trim_start_matches('-');
    let found = command.get_arguments().find(|a| a.get_long() == Some(option));
    found?.get_help().map(ToString::to_string)
}

/// Commands whose `--help` lists the options of importers.
const COMMANDS_WITH_IMPORTERS: [&str; 7] =
    ["render", "export", "check", "info", "explain", "measure", "pose"];

/// Command line of the program, with the options of the plugins in `--help`.
pub(crate) fn command_with_plugin_options(args: &[OsString], app: &App) -> clap::Command {
    let plugins = &app.registry;
    let command = Cli::command().name(app.name).version(app.version);
    if !args.iter().any(|a| a == "--help") {
        return command;
    }
    // Plugins are looked for beside the named files and in the current folder. A broken plugin is reported elsewhere.
    let inputs: Vec<&Path> = args.iter().skip(2).map(Path::new).filter(|p| p.exists()).collect();
    let here = [&[Path::new(".")], inputs.as_slice()].concat();
    let after = |flag: &OsString| args.iter().skip_while(move |a| *a != flag).nth(1).map(PathBuf::from);
    let named: Vec<PathBuf> = after(&"--plugins".into()).into_iter().filter(|f| f.is_dir()).collect();
    let found = plugin_files::list_plugin_files(plugins, &named, &here, None).map(|listing| listing.registry);
    let registry = found.as_ref().unwrap_or(plugins);
    let importers = plugin_option_rows(registry.importers().iter().map(|i| i.manifest()));
    let exporters = plugin_option_rows(registry.exporters().iter().map(|e| e.manifest()));
    let scene_exporters = plugin_option_rows(registry.scene_exporters().iter().map(|e| e.manifest()));
    COMMANDS_WITH_IMPORTERS.into_iter().fold(command, |command, name| {
        command.mut_subcommand(name, |sub| {
            let mut text = format!(
                "Options of importers, set with --import NAME=VALUE, in a script by load(FILE, #{{ NAME: VALUE }}):\n{importers}"
            );
            let exporters = match name {
                "render" => &exporters,
                "export" => &scene_exporters,
                _ => "",
            };
            if !exporters.is_empty() {
                text += &format!("\nOptions of exporters, set with --export NAME=VALUE:\n{exporters}");
            }
            let before = sub.get_after_long_help().or(sub.get_after_help()).map(ToString::to_string);
            sub.after_long_help(format!("{text}\n{}", before.unwrap_or_default()))
        })
    })
}

fn plugin_option_rows<'m>(manifests: impl Iterator<Item = &'m Manifest>) -> String {
    let with_options = manifests.filter(|m| !m.options.is_empty());
    with_options.map(|m| format!("  {}\n{}", m.name, option_rows(m))).collect()
}
