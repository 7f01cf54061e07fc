//! Form of a render or export, and the command line that it stands for.

use crate::commands::queue::Request;
use crate::commands::{Format, OutputKind};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    Whole,
    /// Frames visible in the timeline.
    VisibleInTimeline,
    /// The frame at the playhead.
    Playhead,
    Chosen,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Size of the script, scaled by a numerator and a denominator.
    Scaled(u32, u32),
    Chosen,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RenderForm {
    /// Index of the format.
    pub format: usize,
    /// Output file; empty: the proposed one.
    pub output: String,
    pub range: Range,
    /// First and last frame.
    pub chosen_frames: [i64; 2],
    pub size: Size,
    pub chosen_size: [u32; 2],
    /// Samples per pixel. `None`: those of the script.
    pub samples: Option<u32>,
    /// Options of the format, `NAME=VALUE` separated by blanks.
    pub options: String,
}

impl Default for RenderForm {
    fn default() -> RenderForm {
        RenderForm {
            format: 0,
            output: String::new(),
            range: Range::Whole,
            chosen_frames: [0, 0],
            size: Size::Scaled(1, 1),
            chosen_size: [1280, 720],
            samples: None,
            options: String::new(),
        }
    }
}

/// Data of the scene that the form needs.
#[derive(Clone, Debug)]
pub struct FormScene<'a> {
    pub input: &'a Path,
    /// Number of frames.
    pub frames: i64,
    /// First and last frame visible in the timeline.
    pub shown: [i64; 2],
    pub playhead: i64,
    pub size: [u32; 2],
}

/// The output with the first number, from 2 on, that makes its name free: `film_2.mp4`. Of numbered images the folder gets the number.
pub(crate) fn free_output(output: &Path, is_taken: impl Fn(&Path) -> bool) -> PathBuf {
    let text = |part: Option<&OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let file = text(output.file_name());
    let folder = output.parent().filter(|folder| file.contains('%') && folder.file_name().is_some());
    let with_number = |number: u32| match folder {
        Some(folder) => {
            let other = folder.with_file_name(format!("{}_{number}", text(folder.file_name())));
            (other.clone(), other.join(&file))
        }
        None => {
            let end = output.extension().map(|end| format!(".{}", end.to_string_lossy())).unwrap_or_default();
            let other = output.with_file_name(format!("{}_{number}{end}", text(output.file_stem())));
            (other.clone(), other)
        }
    };
    let is_free = |(made, output): &(PathBuf, PathBuf)| !made.exists() && !is_taken(output);
    let found = (2..=u32::MAX).map(with_number).find(is_free);
    found.map_or_else(|| output.to_path_buf(), |(_, output)| output)
}

impl RenderForm {
    /// First and last frame to draw.
    pub fn frames(&self, scene: &FormScene) -> [i64; 2] {
        let last = (scene.frames - 1).max(0);
        let [first, until] = match self.range {
            Range::Whole => [0, last],
            Range::VisibleInTimeline => scene.shown,
            Range::Playhead => [scene.playhead; 2],
            Range::Chosen => self.chosen_frames,
        };
        let first = first.clamp(0, last);
        [first, until.clamp(first, last)]
    }

    /// Size of the image, pixels. A scaled size is even, as films require.
    pub fn image_size(&self, scene: &FormScene) -> [u32; 2] {
        match self.size {
            Size::Scaled(1, 1) => scene.size,
            Size::Scaled(numerator, denominator) => scene.size.map(|side| {
                let half = u64::from(side) * u64::from(numerator) / u64::from(denominator.max(1) * 2);
                (half as u32 * 2).max(2)
            }),
            Size::Chosen => self.chosen_size,
        }
    }

    /// Proposed output: next to the script and with its name; images in a folder.
    pub(crate) fn proposed_output(&self, scene: &FormScene, format: &Format) -> PathBuf {
        let stem = scene.input.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let extension = &format.extension;
        let name = match format.kind {
            OutputKind::Film | OutputKind::Scene => format!("{stem}.{extension}"),
            OutputKind::Images if self.range == Range::Playhead => {
                format!("{stem}_{}.{extension}", self.frames(scene)[0])
            }
            OutputKind::Images => format!("{stem}_frames/%04d.{extension}"),
        };
        scene.input.with_file_name(name)
    }

    pub fn request(&self, scene: &FormScene, format: &Format) -> Request {
        let output = match self.output.trim() {
            "" => self.proposed_output(scene, format),
            text => PathBuf::from(text),
        };
        let [first, last] = self.frames(scene);
        let mut options: Vec<OsString> = vec!["--frames".into(), format!("{first}..{}", last + 1).into()];
        let mut about = match first == last {
            true => format!("frame {first}"),
            false => format!("frames {first} to {last}"),
        };
        if format.kind != OutputKind::Scene {
            let [width, height] = self.image_size(scene);
            options.extend(["--progress-lines".into(), "--discard".into()]);
            options.extend(["--size".into(), format!("{width}x{height}").into()]);
            about += &format!(", {width}×{height}");
            if let Some(samples) = self.samples {
                options.extend(["--samples".into(), samples.to_string().into()]);
                about += if samples == 1 { ", draft" } else { ", smooth" };
            }
        }
        for option in self.options.split_whitespace() {
            options.extend(["--export".into(), option.into()]);
            about += &format!(", {option}");
        }
        let command = if format.kind == OutputKind::Scene { "export" } else { "render" };
        Request { command, output, about, options }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> FormScene<'static> {
        FormScene {
            input: Path::new("plays/dance.rhai"),
            frames: 90,
            shown: [10, 200],
            playhead: 31,
            size: [640, 362],
        }
    }

    fn format(kind: OutputKind, extension: &str) -> Format {
        Format { kind, extension: extension.into(), about: String::new(), options: Vec::new() }
    }

    fn words(form: &RenderForm, format: &Format) -> String {
        let Request { command, output, options, .. } = form.request(&scene(), format);
        let options: Vec<String> = options.iter().map(|w| w.to_string_lossy().into_owned()).collect();
        format!("{command} {} {}", output.display(), options.join(" "))
    }

    #[test]
    fn an_output_that_is_taken_gets_a_number() {
        let folder = tempfile::tempdir().unwrap();
        let free = |name: &str, taken: &str| {
            let is_taken = |path: &Path| path == folder.path().join(taken);
            let free = free_output(&folder.path().join(name), is_taken);
            free.strip_prefix(folder.path()).unwrap().to_str().unwrap().replace('\\', "/")
        };
        assert_eq!(free("film.mp4", ""), "film_2.mp4");
        assert_eq!(free("film.mp4", "film_2.mp4"), "film_3.mp4");
        std::fs::write(folder.path().join("film_2.mp4"), "").unwrap();
        assert_eq!(free("film.mp4", "film_3.mp4"), "film_4.mp4");
        assert_eq!(free("film", ""), "film_2");
        // Numbered images go to another folder.
        assert_eq!(free("a_frames/%04d.png", ""), "a_frames_2/%04d.png");
        std::fs::create_dir(folder.path().join("a_frames_2")).unwrap();
        assert_eq!(free("a_frames/%04d.png", "a_frames_3/%04d.png"), "a_frames_4/%04d.png");
    }

    #[test]
    fn a_render_form_becomes_command_line_arguments() {
        let mut form = RenderForm::default();
        let film = format(OutputKind::Film, "mp4");
        let all = "--progress-lines --discard --size 640x362";
        assert_eq!(words(&form, &film), format!("render plays/dance.mp4 --frames 0..90 {all}"));
        form.range = Range::VisibleInTimeline;
        form.size = Size::Scaled(1, 4);
        form.samples = Some(1);
        form.options = " crf=30  speed=fast ".into();
        assert_eq!(
            words(&form, &film),
            "render plays/dance.mp4 --frames 10..90 --progress-lines --discard --size 160x90 --samples 1 \
             --export crf=30 --export speed=fast"
        );
        form.options.clear();
        let scenes = format(OutputKind::Scene, "glb");
        assert_eq!(words(&form, &scenes), "export plays/dance.glb --frames 10..90");
        form.range = Range::Playhead;
        form.size = Size::Chosen;
        let images = format(OutputKind::Images, "png");
        assert!(words(&form, &images).starts_with("render plays/dance_31.png --frames 31..32 "));
        form.range = Range::Chosen;
        form.chosen_frames = [80, 20];
        form.output = "elsewhere/%03d.png".into();
        assert!(words(&form, &images).starts_with("render elsewhere/%03d.png --frames 80..81 "));
        form.output.clear();
        assert!(words(&form, &images).starts_with("render plays/dance_frames/%04d.png "));
    }
}
