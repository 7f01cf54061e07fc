//! Flat layers.

use crate::hash::stage::write_channel;
use crate::stage::layers_2d::{Fit, Flat, FlatContent};
use choreo_asset::hash::Writer;

pub(super) fn write_flat(w: &mut Writer, flat: &Flat) {
    let Flat { content, at, offset, anchor, opacity, scale, under, start, end, fade, channels } = flat;
    match content {
        FlatContent::Text { words, font, size, width, align, line_height, color } => {
            w.tag(0);
            w.text(words);
            w.bytes(&font.hash());
            w.f64(*size);
            w.option(width, |w, width| w.f64(*width));
            w.count(*align as usize);
            w.f64(*line_height);
            w.vec4(*color);
        }
        FlatContent::Picture { image: _, hash, fit } => {
            w.tag(1);
            w.bytes(hash);
            let (kind, share) = match fit {
                Fit::Height(share) => (0, *share),
                Fit::Width(share) => (1, *share),
                Fit::Contain => (2, 0.0),
                Fit::Cover => (3, 0.0),
            };
            w.tag(kind);
            w.f64(share);
        }
        FlatContent::Panel { size, color } => {
            w.tag(2);
            w.f64(size.x);
            w.f64(size.y);
            w.vec4(*color);
        }
        FlatContent::Bars { ratio, color } => {
            w.tag(3);
            w.f64(*ratio);
            w.vec4(*color);
        }
    }
    [at, offset, anchor].into_iter().flat_map(|v| v.to_array()).for_each(|v| w.f64(v));
    w.f64(*opacity);
    w.f64(*scale);
    w.flag(*under);
    w.time(*start);
    w.option(end, |w, end| w.time(*end));
    w.time(*fade);
    w.list(channels, |w, channel| write_channel(w, channel));
}
