//! Edit decision lists (CMX 3600): one event for each shot.

use crate::shots::shots;
use choreo_plugin::{ExportError, ExportedScene};
use std::io::Write;

/// Non-drop timecode of a frame: `fps` frames make a second, 30 also at 29.97 Hz.
fn timecode(frame: i64, fps: i64) -> String {
    let secs = frame / fps;
    format!("{:02}:{:02}:{:02}:{:02}", secs / 3600, secs / 60 % 60, secs % 60, frame % fps)
}

pub(crate) fn write(scene: &ExportedScene, media: &str, out: &mut dyn Write) -> Result<(), ExportError> {
    let fps = scene.fps.as_fps().round().max(1.0) as i64;
    let shots = shots(scene);
    if shots.len() > 999 {
        let what = format!("{} shots; an EDL has at most 999 events. .otio holds more", shots.len());
        return Err(ExportError::Format(what));
    }
    writeln!(out, "TITLE: {}\nFCM: NON-DROP FRAME\n", one_line(&scene.name))?;
    for (index, shot) in shots.iter().enumerate() {
        let [from, to] = [shot.frames.0, shot.frames.1].map(|frame| timecode(frame, fps));
        let event = index + 1;
        let before = index.checked_sub(1).map(|before| &shots[before]).filter(|_| shot.dissolve > 0);
        // All shots are parts of one video, the reel AX, so source and record times are equal.
        match before {
            None => writeln!(out, "{event:03}  AX       V     C        {from} {to} {from} {to}")?,
            Some(before) => {
                writeln!(out, "{event:03}  AX       V     C        {from} {from} {from} {from}")?;
                writeln!(
                    out,
                    "{event:03}  AX       V     D    {:03} {from} {to} {from} {to}",
                    shot.dissolve
                )?;
                writeln!(out, "* FROM CLIP NAME: {}", one_line(&before.camera))?;
            }
        }
        let name = if before.is_some() { "TO CLIP NAME" } else { "FROM CLIP NAME" };
        writeln!(out, "* {name}: {}\n* SOURCE FILE: {}", one_line(&shot.camera), one_line(media))?;
    }
    Ok(())
}

fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}
