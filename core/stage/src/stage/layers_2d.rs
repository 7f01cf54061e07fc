//! 2D layers over and under the scene: text, images, panels, letterboxes; in painter's order.

use crate::stage::channel::Channel;
use crate::stage::described::{FieldType, described};
use choreo_asset::Image;
use choreo_motion::Time;
pub use choreo_text::{Align, Font};
use glam::{DVec2, Vec4};
use std::sync::Arc;

described! {
    /// A 2D layer, by default in the middle of the image for the whole time.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Layer2d(
        /// The picture or text.
        content: Layer2dContent,
    ) {
        /// Position of its anchor, as fractions of the image: x from the left, y from the top.
        at: DVec2 = DVec2::splat(0.5);
        /// Pixels added to that.
        offset: DVec2 = DVec2::ZERO;
        /// Which point of its box, 0 to 1 from the left and from the top.
        anchor: DVec2 = DVec2::splat(0.5);
        /// 0 is invisible, 1 covers what is below.
        opacity: f64 = 1.0;
        /// Times its size, about its anchor.
        scale: f64 = 1.0;
        /// Behind the scene, over its background; else over everything, effects included.
        under: bool = false;
        /// Time from which it is there.
        start: Time = Time::ZERO;
        /// Time at which it has ended; `None`: it stays.
        end: Option<Time> = None;
        /// Duration of the fade-in and of the fade-out.
        fade: Time = Time::ZERO;
        /// [`Property::Translation`](crate::Property) (x and y as `at`), `Scale` (the first number) and `Opacity`.
        channels: Vec<Channel> = Vec::new();
    }
    fields {
        /// [x, y] as fractions of the image from its top left corner
        at: at, FieldType::Pair, keys "position" Translation;
        /// [x, y] in pixels
        offset: offset, FieldType::Pair;
        opacity: opacity, FieldType::Number(0.0, 1.0, ""), keys "opacity" Opacity;
        scale: scale, FieldType::Number(0.0, 1000.0, ""), keys "scale" Scale;
        from: start, FieldType::Time;
        until: end, FieldType::Time;
        fade: fade, FieldType::Duration;
        under: under, FieldType::Flag;
    }
}

/// Picture or text of a 2D layer.
#[allow(missing_docs, reason = "the documentation of each variant names its fields")]
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "a stage has few 2D layers, most of them texts")]
pub enum Layer2dContent {
    /// Lines of text.
    Text {
        words: String,
        font: Font,
        /// Size of the font's em, as a fraction of the image's height.
        size: f64,
        /// Lines are broken where they would be wider, in shares of the image's width.
        width: Option<f64>,
        align: Align,
        /// Line height in sizes.
        line_height: f64,
        /// Linear RGBA, not premultiplied.
        color: Vec4,
        /// Below the letters.
        outline: Option<TextOutline>,
        /// Below both.
        panel: Option<TextPanel>,
    },
    /// An image.
    Picture {
        image: Arc<Image>,
        /// Hash of the image.
        hash: [u8; 32],
        fit: Fit,
    },
    /// A rectangle of one color; its size in shares of the image.
    Panel { size: DVec2, color: Vec4 },
    /// Bars that leave an image with this aspect ratio.
    Bars { ratio: f64, color: Vec4 },
}

/// A line around the letters of a text. Lengths are in sizes of the text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextOutline {
    /// Linear RGBA, not premultiplied.
    pub color: Vec4,
    /// How far it reaches beyond the letters.
    pub width: f64,
}

/// A rectangle as large as the lines of a text and a margin. Lengths are in sizes of the text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextPanel {
    /// Linear RGBA, not premultiplied.
    pub color: Vec4,
    /// Margin at the sides, and at the top and the bottom.
    pub padding: DVec2,
    /// Radius with which it is rounded.
    pub radius: f64,
}

/// How large an image is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fit {
    /// Share of the image's height.
    Height(f64),
    /// Share of the image's width.
    Width(f64),
    /// All of it is seen, as large as can be.
    Contain,
    /// It covers everything.
    Cover,
}

impl Layer2d {
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

/// A change of a 2D layer by a callback, for one frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Layer2dEdit {
    /// Moves its anchor.
    At(DVec2),
    /// Replaces its opacity.
    Opacity(f64),
    /// Replaces the words of a text.
    Words(String),
}
