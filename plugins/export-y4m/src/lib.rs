//! Uncompressed YUV4MPEG2, the format in which video tools read frames from a pipe.

use choreo_plugin::yuv::{Matrix, Yuv420};
use choreo_plugin::{ExportError, Exporter, Frame, FrameSink, Manifest, Mark, VideoInfo};
use std::io::{Read, Write};
use std::num::NonZeroU64;
use std::sync::LazyLock;

/// The page of the documentation.
pub const README: &str = include_str!("../README.md");

pub static MANIFEST: LazyLock<Manifest> = LazyLock::new(|| {
    Manifest::new(
        "y4m",
        env!("CARGO_PKG_VERSION"),
        "Uncompressed video for pipes (choreo render … -o - | ffmpeg -i - …)",
    )
    .extensions(["y4m"])
    .magic(b"YUV4MPEG2 ")
    .text(
        "matrix",
        "auto: BT.709 from 720 lines or 1280 columns on, else BT.601, as players guess",
        "auto",
        &["auto", "bt601", "bt709"],
    )
});

pub struct Y4mExporter;

impl Exporter for Y4mExporter {
    fn manifest(&self) -> &Manifest {
        &MANIFEST
    }

    fn one_frame_per_file(&self) -> bool {
        false
    }

    fn begin(
        &self,
        info: &VideoInfo,
        mut out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        let mut header = format!(
            // C420mpeg2: chroma samples sited left, as `yuv` writes them. ffmpeg reads XCOLORRANGE; other readers skip X tags.
            "YUV4MPEG2 W{} H{} F{}:{} Ip A1:1 C420mpeg2 XCOLORRANGE=LIMITED",
            info.width, info.height, info.fps.num, info.fps.den
        );
        // X tags are the format's only place for text, and ffmpeg rejects header lines of more than 95 bytes. The tag therefore
        // holds only the id of the provenance.
        if let Some((_, id)) = info.provenance.iter().find(|(keyword, _)| keyword == "choreo:id") {
            let tag = format!(" XCHOREO={id}");
            header.extend(
                tag.chars().filter(|c| c.is_ascii_graphic() || *c == ' ').take(95 - header.len().min(95)),
            );
        }
        writeln!(out, "{header}")?;
        Ok(Box::new(Y4mSink::new(info, out)))
    }

    /// Frames do not depend on each other.
    fn piece(&self, _: &VideoInfo) -> Option<NonZeroU64> {
        Some(NonZeroU64::MIN)
    }

    fn resume(
        &self,
        info: &VideoInfo,
        _: &[Vec<u8>],
        _: &mut dyn Read,
        out: Box<dyn Write + Send>,
    ) -> Result<Box<dyn FrameSink>, ExportError> {
        Ok(Box::new(Y4mSink::new(info, out)))
    }
}

struct Y4mSink {
    out: Box<dyn Write + Send>,
    size: (u32, u32),
    matrix: Matrix,
    yuv: Yuv420,
}

impl Y4mSink {
    fn new(info: &VideoInfo, out: Box<dyn Write + Send>) -> Y4mSink {
        let matrix = match info.options.text("matrix") {
            Some("bt601") => Matrix::Bt601,
            Some("bt709") => Matrix::Bt709,
            _ if info.width >= 1280 || info.height >= 720 => Matrix::Bt709,
            _ => Matrix::Bt601,
        };
        Y4mSink { out, size: (info.width, info.height), matrix, yuv: Yuv420::default() }
    }
}

impl FrameSink for Y4mSink {
    fn frame(&mut self, frame: &Frame) -> Result<(), ExportError> {
        let (width, height) = (frame.width as usize, frame.height as usize);
        if (frame.width, frame.height) != self.size || frame.rgba.len() != width * height * 4 {
            return Err(ExportError::Format(format!(
                "a frame of {width}×{height} ({} bytes) in a video of {}×{}",
                frame.rgba.len(),
                self.size.0,
                self.size.1
            )));
        }
        self.yuv.convert(&frame.rgba, width, height, self.matrix, false);
        self.repeat(frame)
    }

    fn repeat(&mut self, _: &Frame) -> Result<(), ExportError> {
        self.out.write_all(b"FRAME\n")?;
        for plane in [&self.yuv.y, &self.yuv.u, &self.yuv.v] {
            self.out.write_all(plane)?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<u8>, ExportError> {
        self.out.flush()?;
        Ok(Vec::new())
    }

    /// No state is needed to resume, because frames do not depend on each other.
    fn mark(&mut self) -> Mark<'_> {
        Mark::Settled(Vec::new())
    }
}
