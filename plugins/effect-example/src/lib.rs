//! Fades the image to shades of one color. The effect to copy for a look of your own.

#[doc(hidden)]
pub mod files;

use choreo_wgsl_effect::{EffectError, WgslEffect};

/// The effect, parsed from the WGSL text that both renderers run.
///
/// # Errors
/// The text has an error; the error states its place.
pub fn example() -> Result<WgslEffect, EffectError> {
    WgslEffect::from_text("example.wgsl", include_str!("example.wgsl"))
}

#[cfg(test)]
mod tests {
    use super::example;
    use choreo_plugin::PixelEffect;
    use choreo_plugin::glam::{Vec2, Vec4};

    fn color_of(color: Vec4, amount: f32, warmth: f32) -> Vec4 {
        let effect = example().unwrap_or_else(|e| panic!("{e}"));
        let mut colors = [color];
        effect.pixels(&mut colors, &[Vec2::ZERO], &[amount, warmth, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        colors[0]
    }

    #[test]
    fn zero_amount_changes_nothing_and_gray_keeps_its_brightness() {
        let color = Vec4::new(0.1, 0.2, 0.3, 0.5);
        assert_eq!(color_of(color, 0.0, 0.0), color);
        let white = color_of(Vec4::ONE, 1.0, 0.0);
        assert!(white.abs_diff_eq(Vec4::ONE, 1e-6), "{white}");
    }

    #[test]
    fn warm_shades_have_more_red_than_blue() {
        let shade = color_of(Vec4::new(0.5, 0.5, 0.5, 1.0), 1.0, 1.0);
        assert!(shade.abs_diff_eq(Vec4::new(0.6, 0.5, 0.4, 1.0), 1e-6), "{shade}");
    }
}
