//! Alpha to coverage: the samples of a pixel that the alpha test of a cut-out (leaves, hair) keeps. CPU reference of `COVERAGE` in
//! scene.wgsl.

use super::shade::ALL_SAMPLES;

/// Sample masks for 0 to 4 covered samples: the samples with the lowest numbers. Vulkan leaves the choice of samples to the device;
/// lavapipe chooses these. The number of samples is the same on every device, so a pixel of one surface resolves to the same color.
/// Where an edge of the mesh or a second cut-out shares the pixel, its color may differ by the weight of one sample.
const SAMPLE_MASKS: [u8; 5] = [0, 0b0001, 0b0011, 0b0111, 0b1111];

/// Covered samples of a quad's pixels, one bit each. The alpha is sharpened so that edges are one pixel wide, independent of the
/// texture's own gradient (B. Golus, "Anti-aliased Alpha Test: The Esoteric Alpha To Coverage", 2017).
pub(super) fn covered_samples(alpha: [f32; 4], cutoff: f32) -> [u8; 4] {
    if cutoff <= 0.0 {
        return [ALL_SAMPLES; 4];
    }
    std::array::from_fn(|i| {
        let (across, down) = (alpha[i | 1] - alpha[i & !1], alpha[i | 2] - alpha[i & !2]);
        let width = (across.abs() + down.abs()).max(1e-4);
        let share = ((alpha[i] - cutoff) / width + 0.5).clamp(0.0, 1.0);
        SAMPLE_MASKS[(share * 4.0 + 0.5) as usize]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn alpha_edge_covers_its_share_of_samples() {
        let count = |alpha: [f32; 4]| covered_samples(alpha, 0.5).map(u8::count_ones);
        assert_eq!(count([1.0; 4]), [4; 4]);
        assert_eq!(count([0.49; 4]), [0; 4]);
        // An edge through the middle of the left pixels, a steep one and a gentle one.
        assert_eq!(count([0.5, 1.5, 0.5, 1.5]), [2, 4, 2, 4]);
        assert_eq!(count([0.5, 0.52, 0.5, 0.52]), [2, 4, 2, 4]);
        // The same edges, a quarter of a pixel farther.
        assert_eq!(count([0.25, 1.25, 0.25, 1.25]), [1, 4, 1, 4]);
        assert_eq!(covered_samples([0.0; 4], 0.0), [ALL_SAMPLES; 4], "cutoff 0 removes no sample");
        assert_eq!(covered_samples([f32::NAN; 4], 0.5), [0; 4]);
    }
}
