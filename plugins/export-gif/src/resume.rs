//! Resumes a GIF whose program was killed. The canvas is decoded from the file itself; the other state is a few bytes.

use std::io::{self, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// State besides the canvas that the next frame depends on.
#[derive(Debug, PartialEq)]
pub(crate) struct ResumeState {
    pub frames: u64,
    pub global_palette: bool,
    /// Mean squared error of the palette on the frame it was made for.
    pub made_for: f64,
    pub palette: Vec<[u8; 3]>,
}

impl ResumeState {
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut bytes = self.frames.to_le_bytes().to_vec();
        bytes.push(self.global_palette.into());
        bytes.extend(self.made_for.to_bits().to_le_bytes());
        bytes.extend(self.palette.as_flattened());
        bytes
    }

    pub(crate) fn read(bytes: &[u8]) -> Option<ResumeState> {
        let (frames, rest) = bytes.split_first_chunk::<8>()?;
        let (&global, rest) = rest.split_first()?;
        let (made_for, rest) = rest.split_first_chunk::<8>()?;
        let (palette, []) = rest.as_chunks::<3>() else { return None };
        // Indices are bytes, and the last one means "unchanged".
        (!palette.is_empty() && palette.len() < 256).then(|| ResumeState {
            frames: u64::from_le_bytes(*frames),
            global_palette: global != 0,
            made_for: f64::from_bits(u64::from_le_bytes(*made_for)),
            palette: palette.to_vec(),
        })
    }
}

/// The canvas of a player after the first `frames` frames.
pub(crate) fn canvas(so_far: &mut dyn Read, size: (u16, u16), frames: u64) -> Result<Vec<[u8; 3]>, String> {
    let failed = |e: gif::DecodingError| format!("the unfinished GIF cannot be read: {e}");
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(so_far).map_err(failed)?;
    let (width, height) = (usize::from(size.0), usize::from(size.1));
    if (decoder.width(), decoder.height()) != size {
        return Err(format!("the unfinished GIF is {}×{}", decoder.width(), decoder.height()));
    }
    let mut shown = vec![[0; 3]; width * height];
    for number in 0..frames {
        let frame = decoder.read_next_frame().map_err(failed)?;
        let frame = frame.ok_or_else(|| format!("the unfinished GIF ends at frame {number}"))?;
        let (left, columns) = (usize::from(frame.left), usize::from(frame.width).max(1));
        for (y, row) in frame.buffer.chunks(4 * columns).enumerate() {
            let at = (y + usize::from(frame.top)) * width + left;
            let Some(shown) = shown.get_mut(at..at + row.len() / 4) else { continue };
            for (shown, p) in shown.iter_mut().zip(row.as_chunks::<4>().0) {
                if p[3] > 0 {
                    *shown = [p[0], p[1], p[2]];
                }
            }
        }
    }
    Ok(shown)
}

/// A writer that discards its input until it is opened.
pub(crate) struct Gate {
    out: Box<dyn Write + Send>,
    is_open: Arc<AtomicBool>,
}

pub(crate) struct Opener(Arc<AtomicBool>);

impl Gate {
    pub(crate) fn closed(out: Box<dyn Write + Send>) -> (Gate, Opener) {
        let open = Arc::new(AtomicBool::new(false));
        (Gate { out, is_open: open.clone() }, Opener(open))
    }
}

impl Opener {
    pub(crate) fn open(self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Write for Gate {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.is_open.load(Ordering::Relaxed) { self.out.write(bytes) } else { Ok(bytes.len()) }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
