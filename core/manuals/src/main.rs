//! Manual pages and completions of `choreo` and `choreo-view`, in the places of packages below a folder `share`: `manuals share`.

use clap::Command;
use clap_complete::{Shell, generate};
use std::io::Result;
use std::path::{Path, PathBuf};

/// Folder and file in which a shell of Debian looks for a program's completions. PowerShell's file is for `. choreo.ps1` in a profile.
fn place(shell: Shell, program: &str) -> PathBuf {
    match shell {
        Shell::Fish => PathBuf::from("fish/vendor_completions.d").join(format!("{program}.fish")),
        Shell::Zsh => PathBuf::from("zsh/vendor-completions").join(format!("_{program}")),
        Shell::PowerShell => PathBuf::from("powershell").join(format!("{program}.ps1")),
        _ => PathBuf::from("bash-completion/completions").join(program),
    }
}

fn completions(command: &mut Command, name: &str, share: &Path) -> Result<()> {
    for shell in [Shell::Bash, Shell::Fish, Shell::Zsh, Shell::PowerShell] {
        let file = share.join(place(shell, name));
        std::fs::create_dir_all(file.parent().unwrap_or(share))?;
        let mut text = Vec::new();
        generate(shell, command, name, &mut text);
        std::fs::write(file, text)?;
    }
    Ok(())
}

fn write(share: &Path) -> Result<()> {
    let pages = share.join("man/man1");
    std::fs::create_dir_all(&pages)?;
    let app = choreo::app();
    // `choreo view` starts the viewer, whose page has the same name and takes its place.
    let programs = [
        ("choreo", choreo::clap_command(&app)),
        ("choreo-view", choreo_viewer::clap_command(&app).name("choreo-view")),
    ];
    for (name, mut command) in programs {
        completions(&mut command, name, share)?;
        clap_mangen::generate_to(command, &pages)?;
    }
    Ok(())
}

fn main() -> Result<()> {
    write(&PathBuf::from(std::env::args_os().nth(1).unwrap_or_else(|| "share".into())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_and_options_are_in_manuals_and_completions() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path()).unwrap();
        let text = |file: &str| {
            std::fs::read_to_string(folder.path().join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
        };
        for (file, part) in [
            ("man/man1/choreo.1", "choreo\\-render(1)"),
            ("man/man1/choreo-render.1", "\\-\\-samples"),
            ("man/man1/choreo-plugins-install.1", "\\-\\-replace"),
            ("man/man1/choreo-view.1", "\\-\\-shaders"),
            ("bash-completion/completions/choreo", "--resume"),
            ("bash-completion/completions/choreo-view", "--play"),
            ("fish/vendor_completions.d/choreo.fish", "-a \"new\""),
            ("zsh/vendor-completions/_choreo", "#compdef choreo"),
            ("powershell/choreo-view.ps1", "'choreo-view'"),
        ] {
            assert!(text(file).contains(part), "{file} has no {part}");
        }
        // Hidden options are for tests.
        assert!(!text("man/man1/choreo-view.1").contains("event"));
    }
}
