//! Flat layers.

use super::writer::Writer;
use crate::{Fit, Flat, FlatContent};

impl Writer {
    pub(super) fn flat(&mut self, flat: &Flat) {
        let Flat { content, at, offset, anchor, opacity, scale, under, start, end, fade, channels } = flat;
        match content {
            FlatContent::Text { words, font, size, width, align, line_height, color } => {
                self.tag(0);
                self.text(words);
                self.bytes(&font.hash());
                self.f64(*size);
                self.option(width, |w, width| w.f64(*width));
                self.count(*align as usize);
                self.f64(*line_height);
                self.vec4(*color);
            }
            FlatContent::Picture { image: _, hash, fit } => {
                self.tag(1);
                self.bytes(hash);
                let (kind, share) = match fit {
                    Fit::Height(share) => (0, *share),
                    Fit::Width(share) => (1, *share),
                    Fit::Contain => (2, 0.0),
                    Fit::Cover => (3, 0.0),
                };
                self.tag(kind);
                self.f64(share);
            }
            FlatContent::Panel { size, color } => {
                self.tag(2);
                self.f64(size.x);
                self.f64(size.y);
                self.vec4(*color);
            }
            FlatContent::Bars { ratio, color } => {
                self.tag(3);
                self.f64(*ratio);
                self.vec4(*color);
            }
        }
        [at, offset, anchor].into_iter().flat_map(|v| v.to_array()).for_each(|v| self.f64(v));
        self.f64(*opacity);
        self.f64(*scale);
        self.flag(*under);
        self.time(*start);
        self.option(end, |w, end| w.time(*end));
        self.time(*fade);
        self.list(channels, |w, channel| w.channel(channel));
    }
}
