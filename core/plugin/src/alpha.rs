//! Conversion of frames from premultiplied to straight alpha, and to 16-bit sRGB.

use crate::{FloatFrame, Frame};
use choreo_asset::{linear_from_srgb, srgb_from_linear};
use std::borrow::Cow;

impl Frame {
    /// The pixels with straight alpha, as PNG, APNG and WebP store them.
    ///
    /// ```
    /// use choreo_plugin::Frame;
    /// // Half of white light.
    /// let half = Frame { width: 1, height: 1, rgba: vec![188, 188, 188, 128] };
    /// assert_eq!(half.straight()[..], [255, 255, 255, 128]);
    /// ```
    pub fn straight(&self) -> Cow<'_, [u8]> {
        let is_partial = |pixel: &[u8; 4]| !matches!(pixel[3], 0 | 255);
        let Some(first) = self.rgba.as_chunks::<4>().0.iter().position(is_partial) else {
            return Cow::Borrowed(&self.rgba);
        };
        let mut rgba = self.rgba.clone();
        let pixels = rgba.as_chunks_mut::<4>().0.iter_mut().skip(first);
        for [r, g, b, a] in pixels.filter(|pixel| is_partial(pixel)) {
            let alpha = f64::from(*a) / 255.0;
            for channel in [r, g, b] {
                let light = linear_from_srgb(f64::from(*channel) / 255.0) / alpha;
                *channel = (srgb_from_linear(light.min(1.0)) * 255.0).round() as u8;
            }
        }
        Cow::Owned(rgba)
    }
}

impl FloatFrame {
    /// Pixels as sRGB-encoded RGBA with 16 bits per channel; alpha is linear. `straight`: colors are divided by alpha before they are
    /// encoded.
    ///
    /// ```
    /// use choreo_plugin::{FloatFrame, glam::Vec4};
    /// let frame = FloatFrame { color: vec![Vec4::new(0.5, 0.25, 0.0, 0.5)], ..FloatFrame::new([1, 1]) };
    /// assert_eq!(frame.codes_16(true), [65535, 48192, 0, 32768]);
    /// assert_eq!(frame.codes_16(false)[0], 48192);
    /// ```
    pub fn codes_16(&self, straight: bool) -> Vec<u16> {
        let code = |value: f64| (value * 65535.0).round() as u16;
        let of_pixel = |color: &glam::Vec4| {
            let alpha = f64::from(color.w).clamp(0.0, 1.0);
            let divisor = if straight && alpha > 0.0 { alpha } else { 1.0 };
            let [r, g, b] = color
                .truncate()
                .to_array()
                .map(|light| code(srgb_from_linear((f64::from(light) / divisor).clamp(0.0, 1.0))));
            [r, g, b, code(alpha)]
        };
        self.color.iter().flat_map(of_pixel).collect()
    }
}
