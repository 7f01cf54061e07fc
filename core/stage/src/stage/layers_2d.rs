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
        /// Text, image, panel or bars.
        content: Layer2dContent,
    ) {
        /// Position of its anchor, as fractions of the image: x from the left, y from the top.
        at: DVec2 = DVec2::splat(0.5);
        /// Offset added to the position, pixels.
        offset: DVec2 = DVec2::ZERO;
        /// Anchor in the layer's box, 0 to 1 from the left and from the top.
        anchor: DVec2 = DVec2::splat(0.5);
        /// Opacity: 0 is invisible, 1 covers everything below.
        opacity: f64 = 1.0;
        /// Factor of its size, about its anchor.
        scale: f64 = 1.0;
        /// Whether the layer is drawn behind the scene, over its background; else it is drawn over everything, effects included.
        under: bool = false;
        /// Stage time at which the layer appears.
        start: Time = Time::ZERO;
        /// Stage time at which the layer disappears; `None`: never.
        end: Option<Time> = None;
        /// Duration of the fade-in and of the fade-out.
        fade: Time = Time::ZERO;
        /// Keyed [`Property::Translation`](crate::Property) (x and y as `at`), `Scale` (the first number) and `Opacity`.
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

/// Content of a 2D layer.
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
        /// Largest width of a line, as a share of the image's width; longer lines are wrapped.
        width: Option<f64>,
        align: Align,
        /// Line height, as a multiple of `size`.
        line_height: f64,
        /// Linear RGBA, not premultiplied.
        color: Vec4,
        /// Outline, drawn below the letters.
        outline: Option<TextOutline>,
        /// Panel, drawn below letters and outline.
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
    /// Letterbox bars that leave an image with this aspect ratio (width / height).
    Bars { ratio: f64, color: Vec4 },
}

/// A line around the letters of a text. Lengths are multiples of the text's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextOutline {
    /// Linear RGBA, not premultiplied.
    pub color: Vec4,
    /// Distance by which the outline extends beyond the letters.
    pub width: f64,
}

/// A rectangle as large as the lines of a text and a margin. Lengths are multiples of the text's size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextPanel {
    /// Linear RGBA, not premultiplied.
    pub color: Vec4,
    /// Margins: at the sides, and at the top and bottom.
    pub padding: DVec2,
    /// Radius of the rounded edges.
    pub radius: f64,
}

/// Size of an image in the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fit {
    /// Height, as a share of the frame's height.
    Height(f64),
    /// Width, as a share of the frame's width.
    Width(f64),
    /// The largest size at which the whole image is in the frame.
    Contain,
    /// The smallest size at which the image covers the whole frame.
    Cover,
}

impl Layer2d {
    /// Factor of the opacity at a time, by the layer's time span and fades, 0..=1.
    pub(crate) fn opacity_factor(&self, time: Time) -> f64 {
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
