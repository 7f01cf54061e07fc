//! Pixel differences of two frames: metrics, the worst pixel, an image of the difference, and a verdict in words.

use choreo_plugin::Frame;
use thiserror::Error;

/// Difference of two frames, in 8-bit steps of the encoded values.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Mean over all pixels and channels.
    pub mean: f64,
    /// Largest difference of any channel.
    pub worst: u8,
    /// The pixel with the worst difference (the first of equals).
    pub worst_at: [u32; 2],
    /// Share of the pixels with a channel beyond the tolerance, 0..=1.
    pub share_beyond: f64,
    pub tolerance: u8,
    /// Peak signal-to-noise ratio in decibels; infinite for equal frames.
    pub psnr: f64,
    /// Structural similarity (SSIM) of luma, 1 = equal: the mean over 8×8 windows at full size and at half.
    pub ssim: f64,
    /// SSIM of the worst window, which reveals a small defect in a large image.
    pub worst_ssim: f64,
    /// Smallest box that contains all pixels beyond the tolerance: x, y, width, height.
    pub region: Option<[u32; 4]>,
}

#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum CompareError {
    #[error("the frames have different sizes: {0}x{1} and {2}x{3}")]
    Sizes(u32, u32, u32, u32),
    #[error("a frame of {0}x{1} pixels has {2} bytes instead of {3}")]
    Length(u32, u32, usize, usize),
}

/// Fails if the frames have different sizes, or a buffer does not have width × height × 4 bytes.
pub(crate) fn check_sizes(a: &Frame, b: &Frame) -> Result<(), CompareError> {
    for f in [a, b] {
        let expected = f.width as usize * f.height as usize * 4;
        if f.rgba.len() != expected {
            return Err(CompareError::Length(f.width, f.height, f.rgba.len(), expected));
        }
    }
    if [a.width, a.height] != [b.width, b.height] {
        return Err(CompareError::Sizes(a.width, a.height, b.width, b.height));
    }
    Ok(())
}

/// Compares two frames. A pixel counts as different if a channel differs by more than `tolerance` steps.
pub fn compare(a: &Frame, b: &Frame, tolerance: u8) -> Result<Comparison, CompareError> {
    check_sizes(a, b)?;
    let (mut sum, mut squares, mut worst, mut worst_at) = (0u64, 0u64, 0u8, [0; 2]);
    let (mut beyond, mut low, mut high) = (0u64, [u32::MAX; 2], [0u32; 2]);
    for (i, (p, q)) in a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4)).enumerate() {
        let at = [i as u32 % a.width, i as u32 / a.width];
        let mut largest = 0;
        for (x, y) in p.iter().zip(q) {
            let d = x.abs_diff(*y);
            sum += u64::from(d);
            squares += u64::from(d) * u64::from(d);
            largest = largest.max(d);
        }
        if largest > worst {
            (worst, worst_at) = (largest, at);
        }
        if largest > tolerance {
            beyond += 1;
            for k in 0..2 {
                low[k] = low[k].min(at[k]);
                high[k] = high[k].max(at[k]);
            }
        }
    }
    let values = a.rgba.len().max(1) as f64;
    let mean_square = squares as f64 / values;
    let (ssim, worst_ssim) = structural_similarity(a, b);
    Ok(Comparison {
        mean: sum as f64 / values,
        worst,
        worst_at,
        share_beyond: beyond as f64 / (values / 4.0),
        tolerance,
        psnr: if squares == 0 { f64::INFINITY } else { 10.0 * libm::log10(255.0 * 255.0 / mean_square) },
        ssim,
        worst_ssim,
        region: (beyond > 0).then(|| [low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1]),
    })
}

impl Comparison {
    /// The difference in words, as a viewer of the two images would describe it.
    pub(crate) fn verdict(&self) -> &'static str {
        match self {
            c if c.worst == 0 => "equal, bit for bit",
            c if c.worst <= 2 => "equal to the eye: rounding",
            c if c.worst <= 8 || c.worst_ssim > 0.98 => {
                "hard to distinguish: slightly different shading or filtering"
            }
            c if c.share_beyond < 0.002 && c.ssim > 0.99 => {
                "equal except for single pixels: edges or a small detail"
            }
            c if c.ssim > 0.95 => "similar, with a part that visibly differs",
            _ => "different images",
        }
    }
}

impl std::fmt::Display for Comparison {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}: mean {:.3}, worst {} at ({}, {}), {:.3} % of pixels beyond {}, PSNR {:.1} dB, SSIM {:.4} (worst window {:.3})",
            self.verdict(),
            self.mean,
            self.worst,
            self.worst_at[0],
            self.worst_at[1],
            self.share_beyond * 100.0,
            self.tolerance,
            self.psnr,
            self.ssim,
            self.worst_ssim
        )?;
        match self.region {
            Some([x, y, w, h]) => write!(f, ", within {w}x{h} at ({x}, {y})"),
            None => Ok(()),
        }
    }
}

/// Image of the difference: the first frame in dim gray, and over it the differing pixels in blue (1 or 2 steps), orange (3 to
/// 15), red (16 to 63) or white (64 and more).
pub fn difference_image(a: &Frame, b: &Frame) -> Result<Frame, CompareError> {
    compare(a, b, 0)?;
    let mut out = a.clone();
    for ((out, p), q) in out.rgba.chunks_exact_mut(4).zip(a.rgba.chunks_exact(4)).zip(b.rgba.chunks_exact(4))
    {
        let d = p.iter().zip(q).map(|(x, y)| x.abs_diff(*y)).max().unwrap_or(0);
        let gray = (luma(p) * 0.25) as u8;
        let color = match d {
            0 => [gray; 3],
            1..=2 => [0, 64, 255],
            3..=15 => [255, 96, 0],
            16..=63 => [255, 0, 0],
            _ => [255; 3],
        };
        out[..3].copy_from_slice(&color);
        out[3] = 255;
    }
    Ok(out)
}

/// Luma with ITU-R BT.709 weights on the encoded values, times 0.5 (transparent) to 1 (opaque), so that alpha counts.
fn luma(p: &[u8]) -> f64 {
    (0.2126 * f64::from(p[0]) + 0.7152 * f64::from(p[1]) + 0.0722 * f64::from(p[2]))
        * (0.5 + f64::from(p[3]) / 510.0)
}

/// Mean and worst SSIM (Wang et al., "Image Quality Assessment: From Error Visibility to Structural Similarity", 2004, eq. 13)
/// over 8×8 windows every 4 pixels, at full size and at half: the mean of both scales, and the worst window of either.
fn structural_similarity(a: &Frame, b: &Frame) -> (f64, f64) {
    let (mut w, mut h) = (a.width as usize, a.height as usize);
    let mut planes: [Vec<f64>; 2] = [a, b].map(|f| f.rgba.chunks_exact(4).map(luma).collect());
    let (mut total, mut worst, mut scales) = (0.0, 1.0f64, 0.0);
    for _ in 0..2 {
        if w == 0 || h == 0 {
            break;
        }
        let (mut sum, mut count) = (0.0, 0.0);
        for y in (0..h.saturating_sub(7).max(1)).step_by(4) {
            for x in (0..w.saturating_sub(7).max(1)).step_by(4) {
                let s = window_ssim(&planes, w, [x, y], [(x + 8).min(w), (y + 8).min(h)]);
                sum += s;
                count += 1.0;
                worst = worst.min(s);
            }
        }
        total += sum / count;
        scales += 1.0;
        planes = planes.map(|p| halve_plane(&p, w, h));
        (w, h) = (w / 2, h / 2);
    }
    if scales == 0.0 { (1.0, 1.0) } else { (total / scales, worst) }
}

fn window_ssim(planes: &[Vec<f64>; 2], width: usize, from: [usize; 2], to: [usize; 2]) -> f64 {
    let (mut sa, mut sb, mut saa, mut sbb, mut sab) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for y in from[1]..to[1] {
        for x in from[0]..to[0] {
            let (p, q) = (planes[0][y * width + x], planes[1][y * width + x]);
            sa += p;
            sb += q;
            saa += p * p;
            sbb += q * q;
            sab += p * q;
        }
    }
    let n = ((to[0] - from[0]) * (to[1] - from[1])) as f64;
    let (ma, mb) = (sa / n, sb / n);
    let (va, vb, cov) = (saa / n - ma * ma, sbb / n - mb * mb, sab / n - ma * mb);
    // (0.01 · 255)², (0.03 · 255)²
    const C1: f64 = 6.5025;
    const C2: f64 = 58.5225;
    ((2.0 * ma * mb + C1) * (2.0 * cov + C2)) / ((ma * ma + mb * mb + C1) * (va + vb + C2))
}

fn halve_plane(p: &[f64], w: usize, h: usize) -> Vec<f64> {
    let at = |x: usize, y: usize| p[y * w + x];
    (0..h / 2)
        .flat_map(|y| (0..w / 2).map(move |x| (2 * x, 2 * y)))
        .map(|(x, y)| (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) * 0.25)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image with some structure.
    fn test_image() -> Frame {
        let (width, height) = (64, 48);
        let rgba = (0..width * height)
            .flat_map(|i| {
                let (x, y) = (i % width, i / width);
                [(x * 4) as u8, (y * 5) as u8, if (x / 8 + y / 8) % 2 == 0 { 200 } else { 40 }, 255]
            })
            .collect();
        Frame { width, height, rgba }
    }

    #[test]
    fn identical_frames_have_no_difference() {
        let c = compare(&test_image(), &test_image(), 0).unwrap();
        assert_eq!((c.mean, c.worst, c.share_beyond, c.region), (0.0, 0, 0.0, None));
        assert_eq!((c.psnr, c.verdict()), (f64::INFINITY, "equal, bit for bit"));
        assert!((c.ssim - 1.0).abs() < 1e-12 && (c.worst_ssim - 1.0).abs() < 1e-12);
    }

    #[test]
    fn single_changed_pixel_is_located() {
        let (a, mut b) = (test_image(), test_image());
        let at = (20 * 64 + 10) * 4;
        b.rgba[at + 1] ^= 0x80;
        let c = compare(&a, &b, 3).unwrap();
        assert_eq!((c.worst, c.worst_at, c.region), (128, [10, 20], Some([10, 20, 1, 1])));
        assert!((c.share_beyond - 1.0 / (64.0 * 48.0)).abs() < 1e-12);
        assert!((c.mean - 128.0 / (64.0 * 48.0 * 4.0)).abs() < 1e-12);
        // 10·log10(255² / (128² / 12288))
        assert!((c.psnr - 46.8810).abs() < 1e-3, "{}", c.psnr);
        assert_eq!(c.verdict(), "equal except for single pixels: edges or a small detail");
        let d = difference_image(&a, &b).unwrap();
        assert_eq!(d.rgba[at..at + 4], [255; 4]);
        assert_eq!(d.rgba.chunks_exact(4).filter(|p| p[..3] == [255; 3]).count(), 1);
    }

    #[test]
    fn larger_faults_give_stronger_verdicts() {
        let a = test_image();
        let changed = |f: &dyn Fn(usize, u8) -> u8| Frame {
            rgba: a.rgba.iter().enumerate().map(|(i, v)| if i % 4 == 3 { *v } else { f(i, *v) }).collect(),
            ..a.clone()
        };
        let rounding = compare(&a, &changed(&|i, v| v ^ (i as u8 & 1)), 1).unwrap();
        assert_eq!((rounding.share_beyond, rounding.verdict()), (0.0, "equal to the eye: rounding"));
        let darker = compare(&a, &changed(&|_, v| v.saturating_sub(5)), 3).unwrap();
        assert_eq!(darker.verdict(), "hard to distinguish: slightly different shading or filtering");
        // Color channels swapped in the right half.
        let mut part = a.clone();
        for (i, p) in part.rgba.chunks_exact_mut(4).enumerate() {
            if i % 64 >= 56 && i / 64 < 8 {
                p.swap(0, 1);
            }
        }
        let part = compare(&a, &part, 3).unwrap();
        assert_eq!(part.verdict(), "similar, with a part that visibly differs", "{part}");
        assert_eq!(part.region, Some([56, 0, 8, 8]));
        let mut upside_down = a.clone();
        upside_down.rgba = a.rgba.chunks_exact(64 * 4).rev().flatten().copied().collect();
        assert_eq!(compare(&a, &upside_down, 3).unwrap().verdict(), "different images");
    }

    #[test]
    fn different_sizes_and_wrong_buffer_lengths_are_errors() {
        let a = test_image();
        let small = Frame { width: 1, height: 1, rgba: vec![0; 4] };
        let e = compare(&a, &small, 0).unwrap_err().to_string();
        assert_eq!(e, "the frames have different sizes: 64x48 and 1x1");
        let short = Frame { rgba: vec![0; 8], ..a.clone() };
        let e = compare(&a, &short, 0).unwrap_err().to_string();
        assert_eq!(e, "a frame of 64x48 pixels has 8 bytes instead of 12288");
        let empty = Frame { width: 0, height: 0, rgba: vec![] };
        assert_eq!(compare(&empty, &empty, 0).unwrap().worst, 0);
    }
}
