//! The error of an exported video: the file is decoded again and compared with the original frames.

use crate::error::BenchError;
use choreo_plugin::Frame;
use openh264::decoder::Decoder;
use openh264::formats::YUVSource;

/// Limited-range BT.709 Y′CbCr 4:2:0 planes.
pub struct Planes {
    pub width: usize,
    pub height: usize,
    pub y: Vec<u8>,
    pub u: Vec<u8>,
    pub v: Vec<u8>,
}

/// The first image of an MP4 with one H.264 track, as `export-mp4` writes it.
pub(crate) fn first_picture(mp4: &[u8]) -> Result<Planes, BenchError> {
    let (sps, pps) = parameter_sets(mp4).ok_or(BenchError::Video("the MP4 has no avcC box"))?;
    let data = find_box(mp4, b"mdat").ok_or(BenchError::Video("the MP4 has no mdat box"))?;
    let mut annex_b = Vec::new();
    for nal in [sps, pps] {
        annex_b.extend_from_slice(&[0, 0, 0, 1]);
        annex_b.extend_from_slice(nal);
    }
    let mut rest = data;
    while let Some((length, tail)) = rest.split_first_chunk::<4>() {
        let Some((nal, tail)) = tail.split_at_checked(u32::from_be_bytes(*length) as usize) else { break };
        annex_b.extend_from_slice(&[0, 0, 0, 1]);
        annex_b.extend_from_slice(nal);
        rest = tail;
    }
    let mut decoder = Decoder::new()?;
    if let Some(picture) = decoder.decode(&annex_b)? {
        return Ok(planes(&picture));
    }
    let late = decoder.flush_remaining()?;
    late.first().map(planes).ok_or(BenchError::Video("the video holds no image"))
}

fn planes(picture: &impl YUVSource) -> Planes {
    let (width, height) = picture.dimensions();
    let (sy, su, sv) = picture.strides();
    let rows = |plane: &[u8], stride: usize, w: usize, h: usize| -> Vec<u8> {
        (0..h).flat_map(|row| plane[row * stride..][..w].iter().copied()).collect()
    };
    let (cw, ch) = (width.div_ceil(2), height.div_ceil(2));
    Planes {
        width,
        height,
        y: rows(picture.y(), sy, width, height),
        u: rows(picture.u(), su, cw, ch),
        v: rows(picture.v(), sv, cw, ch),
    }
}

/// Content of the first box with this name; boxes are searched for at any depth.
fn find_box<'a>(file: &'a [u8], name: &[u8; 4]) -> Option<&'a [u8]> {
    let at = file.windows(4).position(|w| w == name)?;
    let size = u32::from_be_bytes(*file.get(at.checked_sub(4)?..at)?.first_chunk::<4>()?) as usize;
    file.get(at + 4..(at - 4 + size).min(file.len()))
}

/// Sequence and picture parameter set of the `avcC` box (ISO/IEC 14496-15 §5.3.3.1.2): one of each, with 16-bit lengths.
fn parameter_sets(file: &[u8]) -> Option<(&[u8], &[u8])> {
    let avcc = find_box(file, b"avcC")?;
    let set = |from: &mut usize| {
        let length = usize::from(u16::from_be_bytes(*avcc.get(*from..)?.first_chunk::<2>()?));
        let set = avcc.get(*from + 2..*from + 2 + length)?;
        *from += 2 + length;
        Some(set)
    };
    let mut at = 6;
    let sps = set(&mut at)?;
    at += 1;
    let pps = set(&mut at)?;
    Some((sps, pps))
}

/// Converts planes to sRGB by the definition of BT.709, in f64. Chroma is interpolated linearly between its samples, which sit on the left
/// column of each pair and between its rows.
pub(crate) fn to_rgb(planes: &Planes, width: u32, height: u32) -> Frame {
    let (w, h) = (width as usize, height as usize);
    let (cw, ch) = (planes.width.div_ceil(2), planes.height.div_ceil(2));
    let mut rgba = Vec::with_capacity(w * h * 4);
    let chroma = |plane: &[u8], x: f64, y: f64| {
        let (x, y) = (x.clamp(0.0, cw as f64 - 1.0), y.clamp(0.0, ch as f64 - 1.0));
        let (x0, y0) = (x as usize, y as usize);
        let (x1, y1) = ((x0 + 1).min(cw - 1), (y0 + 1).min(ch - 1));
        let (fx, fy) = (x - x0 as f64, y - y0 as f64);
        let at = |x: usize, y: usize| f64::from(plane[y * cw + x]);
        let top = at(x0, y0) + (at(x1, y0) - at(x0, y0)) * fx;
        let bottom = at(x0, y1) + (at(x1, y1) - at(x0, y1)) * fx;
        top + (bottom - top) * fy
    };
    for row in 0..h {
        for column in 0..w {
            let luma = (f64::from(planes.y[row * planes.width + column]) - 16.0) / 219.0;
            let (x, y) = (column as f64 / 2.0, (row as f64 - 0.5) / 2.0);
            let cb = (chroma(&planes.u, x, y) - 128.0) / 224.0;
            let cr = (chroma(&planes.v, x, y) - 128.0) / 224.0;
            let r = luma + 1.5748 * cr;
            let b = luma + 1.8556 * cb;
            let g = (luma - 0.2126 * r - 0.0722 * b) / 0.7152;
            rgba.extend([r, g, b].map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8));
            rgba.push(255);
        }
    }
    Frame { width, height, rgba }
}
