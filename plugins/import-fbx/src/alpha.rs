//! Alpha mode of a material from its image: masked where nearly every texel is clear or solid, else blended.

use choreo_asset::{AlphaMode, Image};

/// Source of a material's alpha.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Alpha {
    /// The alpha of the base color.
    Constant,
    /// The alpha channel of the base color texture.
    OfTexture,
}

/// Share of half-transparent texels above which they are more than antialiased edges, so that the material is blended.
const SOFT_SHARE: f64 = 0.1;

pub(crate) fn alpha_mode(image: &Image) -> AlphaMode {
    let mut clear = 0usize;
    let mut soft = 0usize;
    for alpha in image.rgba.chunks_exact(4).map(|p| p[3]) {
        match alpha {
            0..=15 => clear += 1,
            240..=255 => {}
            _ => soft += 1,
        }
    }
    let all = image.rgba.len() / 4;
    match (clear, soft) {
        (0, 0) => AlphaMode::Opaque,
        _ if soft as f64 > SOFT_SHARE * all as f64 => AlphaMode::Blend,
        _ => AlphaMode::Mask(0.5),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(alphas: &[u8]) -> Image {
        let rgba = alphas.iter().flat_map(|a| [1, 2, 3, *a]).collect();
        Image { name: String::new(), width: alphas.len() as u32, height: 1, rgba, file: None }
    }

    #[test]
    fn alpha_images_are_masked_or_blended_by_their_values() {
        assert_eq!(alpha_mode(&image(&[255; 8])), AlphaMode::Opaque);
        assert_eq!(alpha_mode(&image(&[255, 255, 0, 0])), AlphaMode::Mask(0.5));
        assert_eq!(alpha_mode(&image(&[128; 8])), AlphaMode::Blend);
    }
}
