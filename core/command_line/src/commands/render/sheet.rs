//! `choreo render --sheet`: a contact sheet, one image with a grid of frames.

use crate::commands::render::stages::draw_label;
use crate::failure::Failure;
use crate::output::target::Target;
use choreo_motion::Time;
use choreo_plugin::Frame;

/// Number of frames on a sheet if none are chosen.
const DEFAULT_FRAME_COUNT: i64 = 12;
/// Longer side of a frame in pixels if no size is given.
const DEFAULT_CELL_SIDE: u32 = 384;
/// Width of the gaps between frames.
const GAP_PIXELS: u32 = 4;
/// Color of the gaps, sRGB.
const GAP_COLOR: [u8; 4] = [32, 32, 32, 255];

/// Frame numbers in the middle of equal parts of the film: films often begin and end in black.
pub(crate) fn evenly_spread_frames(total: i64) -> Vec<i64> {
    let count = DEFAULT_FRAME_COUNT.min(total.max(1));
    (0..count).map(|i| (2 * i + 1) * total / (2 * count)).map(|frame| frame.min(total - 1).max(0)).collect()
}

/// Size of one frame in pixels, with the aspect ratio of the stage.
pub(crate) fn cell_size(stage: [u32; 2]) -> [u32; 2] {
    let larger = f64::from(stage[0].max(stage[1]));
    let scale = (f64::from(DEFAULT_CELL_SIDE) / larger).min(1.0);
    stage.map(|side| ((f64::from(side) * scale).round() as u32).max(1))
}

pub(crate) fn check_is_one_image(target: &Target, is_one_image: bool) -> Result<(), Failure> {
    match target {
        Target::File(_) if is_one_image => Ok(()),
        _ => Err(Failure::Usage(format!(
            "--sheet makes one image: -o sheet.png, not {}",
            target.display_name()
        ))),
    }
}

/// Caption of a frame: its number and time.
pub(crate) fn caption((number, time): (i64, Time)) -> String {
    format!("{number}: {:.3} s", time.as_secs())
}

/// Composes the sheet row by row; each frame has its caption in the top left corner.
pub(crate) fn compose(frames: Vec<(String, Frame)>) -> Frame {
    let [width, height] = frames.first().map_or([1, 1], |(_, frame)| [frame.width, frame.height]);
    let columns = column_count(frames.len() as u32, [width, height]);
    let rows = (frames.len() as u32).div_ceil(columns);
    let [w, h] =
        [(columns, width), (rows, height)].map(|(count, side)| count * (side + GAP_PIXELS) + GAP_PIXELS);
    let mut sheet = Frame { width: w, height: h, rgba: GAP_COLOR.repeat(w as usize * h as usize) };
    for (index, (text, mut frame)) in (0..).zip(frames) {
        draw_label(&mut frame, &text, (width as f32 / 16.0).min(height as f32 / 12.0));
        let (left, top) = (
            index % columns * (width + GAP_PIXELS) + GAP_PIXELS,
            index / columns * (height + GAP_PIXELS) + GAP_PIXELS,
        );
        let row_bytes = 4 * width as usize;
        for (y, row) in (top..).zip(frame.rgba.chunks_exact(row_bytes)) {
            let at = 4 * (y as usize * w as usize + left as usize);
            sheet.rgba[at..at + row_bytes].copy_from_slice(row);
        }
    }
    sheet
}

/// Number of columns for a sheet whose width is about 1.5 times its height.
fn column_count(count: u32, [width, height]: [u32; 2]) -> u32 {
    let columns = (f64::from(count) * 1.5 * f64::from(height) / f64::from(width)).sqrt().round() as u32;
    columns.clamp(1, count.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_frames_are_in_the_middle_of_equal_parts() {
        assert_eq!(evenly_spread_frames(1), [0]);
        assert_eq!(evenly_spread_frames(3), [0, 1, 2]);
        assert_eq!(evenly_spread_frames(120), [5, 15, 25, 35, 45, 55, 65, 75, 85, 95, 105, 115]);
    }

    #[test]
    fn cells_keep_the_aspect_ratio() {
        assert_eq!(cell_size([1280, 720]), [384, 216]);
        assert_eq!(cell_size([720, 1280]), [216, 384]);
        assert_eq!(cell_size([64, 32]), [64, 32]);
    }

    #[test]
    fn frames_lie_row_by_row_with_gaps_between() {
        let frame =
            |n: u8| (caption((i64::from(n), Time::ZERO)), Frame { width: 3, height: 2, rgba: vec![n; 24] });
        let sheet = compose((1..=4).map(frame).collect());
        assert_eq!([sheet.width, sheet.height], [2 * 7 + 4, 2 * 6 + 4]);
        let pixel = |x: u32, y: u32| sheet.rgba[4 * (y * sheet.width + x) as usize];
        assert_eq!([pixel(4, 4), pixel(6, 5), pixel(11, 4), pixel(4, 10), pixel(13, 11)], [1, 1, 2, 3, 4]);
        assert_eq!([pixel(0, 0), pixel(7, 4), pixel(4, 6), pixel(17, 15)], [32; 4]);
    }
}
