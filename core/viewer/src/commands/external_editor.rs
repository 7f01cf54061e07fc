//! Opens the user's own editor at a line.

use std::io;
use std::path::Path;
use std::process::{Command, Stdio};

/// Editors that accept `-g file:line`.
const GOTO_EDITORS: [&str; 5] = ["code", "codium", "code-oss", "cursor", "windsurf"];
/// Editors that need a terminal.
const TERMINAL_EDITORS: [&str; 8] = ["vi", "vim", "nvim", "nano", "emacs", "hx", "micro", "kak"];

/// Reason why the editor cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum EditorError {
    /// The editor, or the terminal for it, is not installed.
    #[error(
        "no program \"{program}\" was found to open the script in; set {variable} in the environment to one that is installed"
    )]
    Missing { program: String, variable: &'static str },
    #[error("{editor}: cannot be started: {source}; set VISUAL to your editor")]
    Start { editor: String, source: io::Error },
}

/// Command line that opens a file at a line: `$VISUAL`, else `$EDITOR`, else Visual Studio Code.
fn editor_command(editor: Option<&str>, terminal: Option<&str>, file: &str, line: usize) -> Vec<String> {
    let words: Vec<String> = editor.unwrap_or("code").split_whitespace().map(str::to_string).collect();
    let words = if words.is_empty() { vec!["code".to_string()] } else { words };
    let program =
        Path::new(&words[0]).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let mut all = Vec::new();
    if TERMINAL_EDITORS.contains(&program.as_str()) && !words.iter().any(|w| w == "-c") {
        all.extend([terminal.unwrap_or("x-terminal-emulator").to_string(), "-e".into()]);
    }
    all.extend(words);
    match program.as_str() {
        p if GOTO_EDITORS.contains(&p) => all.extend(["-g".into(), format!("{file}:{line}")]),
        "subl" | "zed" | "hx" => all.push(format!("{file}:{line}")),
        _ => all.extend([format!("+{line}"), file.to_string()]),
    }
    all
}

/// The user's editor, from environment variables.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Editor {
    /// `$VISUAL`, else `$EDITOR`.
    pub command: Option<String>,
    /// The terminal for editors that need one: `$TERMINAL`.
    pub terminal: Option<String>,
}

impl Editor {
    pub fn of_environment() -> Editor {
        let set = |name: &str| std::env::var(name).ok().filter(|v| !v.trim().is_empty());
        Editor { command: set("VISUAL").or_else(|| set("EDITOR")), terminal: set("TERMINAL") }
    }

    /// Starts the editor without waiting for it.
    ///
    /// # Errors
    /// The editor is missing or cannot be started; the text says which variable to set.
    pub fn open(&self, file: &Path, line: usize) -> Result<(), EditorError> {
        let all =
            editor_command(self.command.as_deref(), self.terminal.as_deref(), &file.to_string_lossy(), line);
        // If the editor is missing, a terminal would only open for a moment, so the editor is checked, too.
        let in_terminal = all.get(2).filter(|_| all[1] == "-e");
        for (program, variable) in in_terminal
            .map(|editor| (editor, "VISUAL"))
            .into_iter()
            .chain([(&all[0], if in_terminal.is_some() { "TERMINAL" } else { "VISUAL" })])
        {
            if !is_installed(program) {
                return Err(EditorError::Missing { program: program.clone(), variable });
            }
        }
        let started = Command::new(&all[0])
            .args(&all[1..])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn();
        let mut child = started.map_err(|source| EditorError::Start { editor: all[0].clone(), source })?;
        // The thread waits for the process, which would otherwise stay as a zombie.
        let _ = std::thread::Builder::new().name("editor".into()).spawn(move || drop(child.wait()));
        Ok(())
    }
}

/// Whether a program exists in the search path. On Windows that is left to the system.
fn is_installed(program: &str) -> bool {
    if cfg!(windows) {
        return true;
    }
    if program.contains('/') {
        return Path::new(program).is_file();
    }
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| folder.join(program).is_file())
}

#[cfg(test)]
mod tests {
    use super::editor_command;

    #[test]
    fn each_editor_gets_the_line_in_its_own_syntax() {
        let report = |editor: Option<&str>| editor_command(editor, None, "a b.rhai", 7).join("|");
        assert_eq!(report(None), "code|-g|a b.rhai:7");
        assert_eq!(report(Some("/usr/bin/codium --wait")), "/usr/bin/codium|--wait|-g|a b.rhai:7");
        assert_eq!(report(Some("nvim")), "x-terminal-emulator|-e|nvim|+7|a b.rhai");
        assert_eq!(report(Some("gedit")), "gedit|+7|a b.rhai");
        assert_eq!(report(Some("subl")), "subl|a b.rhai:7");
        assert_eq!(report(Some("  ")), "code|-g|a b.rhai:7");
    }
}
