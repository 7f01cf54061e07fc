//! 2D layers over and under the scene: text, images, panels, letterboxes; in painter's order.

use crate::stage::channel::Channel;
use choreo_asset::Image;
use choreo_motion::Time;
pub use choreo_text::{Align, Font};
use glam::{DVec2, Vec4};
use std::sync::Arc;

#[derive(Clone, Debug, PartialEq)]
pub struct Flat {
    pub content: FlatContent,
    /// Where its anchor stands, in shares of the picture: x from the left, y from the top.
    pub at: DVec2,
    /// Pixels beside that.
    pub offset: DVec2,
    /// Which point of its box, 0 to 1 from the left and from the top.
    pub anchor: DVec2,
    pub opacity: f64,
    /// Times its size, about its anchor.
    pub scale: f64,
    /// Behind the scene, over its background; else over everything, effects included.
    pub under: bool,
    pub start: Time,
    pub end: Option<Time>,
    /// How long it takes to come in and to go.
    pub fade: Time,
    /// [`Property::Translation`] (x and y as `at`), [`Property::Scale`] (the first number), [`Property::Opacity`].
    pub channels: Vec<Channel>,
}

#[derive(Clone, Debug, PartialEq)]
pub enum FlatContent {
    Text {
        words: String,
        font: Font,
        /// Of the font's em, in shares of the picture's height.
        size: f64,
        /// Lines are broken where they would be wider, in shares of the picture's width.
        width: Option<f64>,
        align: Align,
        /// In sizes.
        line_height: f64,
        /// Linear RGBA, not premultiplied.
        color: Vec4,
    },
    Picture {
        image: Arc<Image>,
        /// Of the image.
        hash: [u8; 32],
        fit: Fit,
    },
    /// Shares of the picture.
    Panel { size: DVec2, color: Vec4 },
    /// Bars that leave a picture so many times as wide as high.
    Bars { ratio: f64, color: Vec4 },
}

/// How large a picture is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fit {
    /// Share of the picture's height.
    Height(f64),
    /// Share of the picture's width.
    Width(f64),
    /// All of it is seen, as large as can be.
    Contain,
    /// It covers everything.
    Cover,
}

impl Flat {
    pub fn new(content: FlatContent) -> Flat {
        Flat {
            content,
            at: DVec2::splat(0.5),
            offset: DVec2::ZERO,
            anchor: DVec2::splat(0.5),
            opacity: 1.0,
            scale: 1.0,
            under: false,
            start: Time::ZERO,
            end: None,
            fade: Time::ZERO,
            channels: Vec::new(),
        }
    }

    /// How much of it is there at a time, by its span and fades.
    pub(crate) fn presence(&self, time: Time) -> f64 {
        if time < self.start || self.end.is_some_and(|end| time >= end) {
            return 0.0;
        }
        let share = |span: Time| match self.fade > Time::ZERO {
            true => (span.as_secs() / self.fade.as_secs()).clamp(0.0, 1.0),
            false => 1.0,
        };
        share(time - self.start) * self.end.map_or(1.0, |end| share(end - time))
    }
}

/// What a callback says of an flat for one frame.
#[derive(Clone, Debug, PartialEq)]
pub enum FlatEdit {
    At { flat: usize, at: DVec2 },
    Opacity { flat: usize, opacity: f64 },
    Words { flat: usize, words: String },
}
