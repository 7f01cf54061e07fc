//! Video pixels: sRGB-encoded RGBA to limited-range Y′CbCr with chroma at half resolution (4:2:0).
//!
//! Chroma sits where MPEG-2 and H.264 put it when a stream says nothing (H.264 Annex E, chroma_sample_loc_type 0):
//! on the left column of each 2×2 block, between its rows. It is filtered [1 2 1]/4 across and [1 1]/2 down.

/// Luma weights of red and blue (ITU-R BT.601-7 §2.5.1, BT.709-6 §3.2); green is the rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Matrix {
    /// Standard-definition video.
    Bt601,
    /// High-definition video.
    Bt709,
}

/// Three planes, each row `width` or `(width + 1) / 2` bytes, no padding. Reused from frame to frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Yuv420 {
    /// Width in pixels; even where `pad_to_even` was requested.
    pub width: usize,
    /// Rows; even where `pad_to_even` was requested.
    pub height: usize,
    /// Luma.
    pub y: Vec<u8>,
    /// Blue-difference chroma.
    pub u: Vec<u8>,
    /// Red-difference chroma.
    pub v: Vec<u8>,
    // One row pair, channels apart, so that the compiler turns the loops below into SIMD.
    rows: [[Vec<i16>; 3]; 2],
    sums: Vec<i16>,
    halves: [Vec<i16>; 3],
}

/// Weights of r, g, b in 1/2^15 of the output's range. Products of two i16 summed in i32 are one `pmaddwd` on x86, so
/// these are constants of that type.
struct Weights {
    y: [i16; 3],
    u: [i16; 3],
    v: [i16; 3],
}

// round(32768 × coefficient × 219/255) for luma and × 224/255 for chroma; each chroma row sums to 0, so that gray stays
// gray, and luma to 28142, so that white is 235.
const BT709: Weights =
    Weights { y: [5983, 20127, 2032], u: [-3298, -11094, 14392], v: [14392, -13073, -1319] };
const BT601: Weights =
    Weights { y: [8415, 16519, 3208], u: [-4857, -9535, 14392], v: [14392, -12051, -2341] };

impl Yuv420 {
    /// Converts an image of sRGB-encoded RGBA. `rgba` holds `width × height` pixels (both at least 1; rows beyond its end are left as they
    /// were). If `pad_to_even` is set, odd sizes grow by one column or row, repeated from the edge.
    ///
    /// ```
    /// use choreo_plugin::yuv::{Matrix, Yuv420};
    /// let mut yuv = Yuv420::default();
    /// yuv.convert(&[255; 16], 2, 2, Matrix::Bt709, false);
    /// assert_eq!((yuv.y, yuv.u, yuv.v), (vec![235; 4], vec![128], vec![128]));
    /// ```
    pub fn convert(&mut self, rgba: &[u8], width: usize, height: usize, matrix: Matrix, pad_to_even: bool) {
        let round = |n: usize| if pad_to_even { n.next_multiple_of(2) } else { n };
        (self.width, self.height) = (round(width), round(height));
        let (cw, ch) = (self.width.div_ceil(2), self.height.div_ceil(2));
        self.y.resize(self.width * self.height, 16);
        self.u.resize(cw * ch, 128);
        self.v.resize(cw * ch, 128);
        match matrix {
            Matrix::Bt601 => self.rows(
                rgba,
                width,
                height,
                |r, y| luma_row(r, BT601.y, y),
                |s, u, v| {
                    chroma_row(s, BT601.u, u);
                    chroma_row(s, BT601.v, v);
                },
            ),
            Matrix::Bt709 => self.rows(
                rgba,
                width,
                height,
                |r, y| luma_row(r, BT709.y, y),
                |s, u, v| {
                    chroma_row(s, BT709.u, u);
                    chroma_row(s, BT709.v, v);
                },
            ),
        }
    }

    fn rows(
        &mut self,
        rgba: &[u8],
        width: usize,
        height: usize,
        luma: impl Fn(&[Vec<i16>; 3], &mut [u8]),
        chroma: impl Fn(&[Vec<i16>; 3], &mut [u8], &mut [u8]),
    ) {
        let (cw, ch) = (self.width.div_ceil(2), self.height.div_ceil(2));
        for cy in 0..ch {
            for half in 0..2 {
                // An odd last row pairs with itself.
                let row = (2 * cy + half).min(height.saturating_sub(1));
                let Some(pixels) = rgba.get(row * width * 4..(row + 1) * width * 4) else { return };
                split_row(pixels, self.width, &mut self.rows[half]);
                let out = 2 * cy + half;
                if let Some(y) = self.y.get_mut(out * self.width..(out + 1) * self.width) {
                    luma(&self.rows[half], y);
                }
            }
            let [upper, lower] = &self.rows;
            for ((upper, lower), out) in upper.iter().zip(lower).zip(&mut self.halves) {
                out.resize(cw, 0);
                halve_horizontally(upper, lower, &mut self.sums, out);
            }
            let span = cy * cw..(cy + 1) * cw;
            chroma(&self.halves, &mut self.u[span.clone()], &mut self.v[span]);
        }
    }
}

fn split_row(pixels: &[u8], padded: usize, out: &mut [Vec<i16>; 3]) {
    let width = pixels.len() / 4;
    let [r, g, b] = out;
    for plane in [&mut *r, &mut *g, &mut *b] {
        plane.resize(padded, 0);
    }
    for (((p, r), g), b) in pixels.as_chunks::<4>().0.iter().zip(&mut *r).zip(&mut *g).zip(&mut *b) {
        // Shifts of whole pixels process four at once in SIMD registers; single bytes would have to be gathered.
        let p = u32::from_le_bytes(*p) as i32;
        *r = (p & 255) as i16;
        *g = (p >> 8 & 255) as i16;
        *b = (p >> 16 & 255) as i16;
    }
    if padded > width && width > 0 {
        for plane in [r, g, b] {
            plane[width] = plane[width - 1];
        }
    }
}

/// Adds two rows and filters them [1 2 1] at every second column: 8 times the mean. The edges repeat their last column.
fn halve_horizontally(upper: &[i16], lower: &[i16], sums: &mut Vec<i16>, out: &mut [i16]) {
    sums.clear();
    sums.extend(upper.iter().zip(lower).map(|(a, b)| a + b));
    let (Some(&first), Some(&last)) = (sums.first(), sums.last()) else { return };
    if sums.len() % 2 == 1 {
        sums.push(last);
    }
    let pairs = sums.as_chunks::<2>().0;
    out[0] = 3 * first + pairs[0][1];
    for ((out, before), here) in out[1..].iter_mut().zip(pairs).zip(&pairs[1..]) {
        *out = before[1] + 2 * here[0] + here[1];
    }
}

#[inline(always)]
fn luma_row([r, g, b]: &[Vec<i16>; 3], w: [i16; 3], out: &mut [u8]) {
    for (((y, &r), &g), &b) in out.iter_mut().zip(r).zip(g).zip(b) {
        let sum = product(r, w[0]) + product(g, w[1]) + product(b, w[2]);
        *y = ((sum + (16 << 15) + (1 << 14)) >> 15) as u8;
    }
}

/// Converts one row of chroma. The channels hold 8 times the mean, as [`halve_horizontally`] writes them.
#[inline(always)]
fn chroma_row([r, g, b]: &[Vec<i16>; 3], w: [i16; 3], out: &mut [u8]) {
    for (((c, &r), &g), &b) in out.iter_mut().zip(r).zip(g).zip(b) {
        let sum = product(r, w[0]) + product(g, w[1]) + product(b, w[2]);
        *c = ((sum + (128 << 18) + (1 << 17)) >> 18) as u8;
    }
}

#[inline(always)]
fn product(a: i16, b: i16) -> i32 {
    i32::from(a) * i32::from(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition in f64: E′Y = Kr R + Kg G + Kb B, Cb = (B − Y) / 2(1 − Kb), quantized to 16..235 and 16..240.
    fn reference_ycbcr([r, g, b]: [f64; 3], matrix: Matrix) -> [f64; 3] {
        let (kr, kb) = match matrix {
            Matrix::Bt601 => (0.299, 0.114),
            Matrix::Bt709 => (0.2126, 0.0722),
        };
        let y = kr * r + (1.0 - kr - kb) * g + kb * b;
        let (cb, cr) = ((b - y) / (2.0 * (1.0 - kb)), (r - y) / (2.0 * (1.0 - kr)));
        [16.0 + 219.0 * y / 255.0, 128.0 + 224.0 * cb / 255.0, 128.0 + 224.0 * cr / 255.0]
    }

    #[test]
    fn flat_colors_match_the_definition_to_rounding() {
        let mut yuv = Yuv420::default();
        let mut worst = 0.0f64;
        for matrix in [Matrix::Bt601, Matrix::Bt709] {
            for step in 0..4096u32 {
                let c = [(step & 15) * 17, (step >> 4 & 15) * 17, (step >> 8) * 17].map(|c| c as u8);
                let rgba = [c[0], c[1], c[2], 255].repeat(6);
                yuv.convert(&rgba, 3, 2, matrix, true);
                let expected = reference_ycbcr(c.map(f64::from), matrix);
                for (plane, expected) in [&yuv.y, &yuv.u, &yuv.v].into_iter().zip(expected) {
                    for &value in plane {
                        worst = worst.max((f64::from(value) - expected).abs());
                    }
                }
            }
        }
        assert!(worst < 0.51, "worst error {worst} levels");
    }

    #[test]
    fn white_black_and_gray_have_neutral_chroma() {
        let mut yuv = Yuv420::default();
        for (gray, luma) in [(0u8, 16u8), (255, 235)] {
            yuv.convert(&[gray; 16], 2, 2, Matrix::Bt709, false);
            assert_eq!((yuv.y[0], yuv.u[0], yuv.v[0]), (luma, 128, 128));
        }
    }

    #[test]
    fn odd_sizes_repeat_their_last_column_and_row() {
        let rgba: Vec<u8> = (0..15u8).flat_map(|i| [i * 16, i * 16, i * 16, 255]).collect();
        let mut yuv = Yuv420::default();
        yuv.convert(&rgba, 5, 3, Matrix::Bt709, true);
        assert_eq!((yuv.width, yuv.height, yuv.u.len()), (6, 4, 6));
        for row in 0..3 {
            assert_eq!(yuv.y[row * 6 + 5], yuv.y[row * 6 + 4]);
        }
        assert_eq!(yuv.y[18..24], yuv.y[12..18]);
        yuv.convert(&rgba, 5, 3, Matrix::Bt709, false);
        assert_eq!((yuv.width, yuv.height, yuv.y.len(), yuv.u.len()), (5, 3, 15, 6));
        yuv.convert(&rgba[..4], 1, 1, Matrix::Bt709, false);
        assert_eq!((yuv.y.len(), yuv.u.len()), (1, 1));
    }

    /// A column of pure red beside black: the chroma of the left-sited sample at column 2k weighs columns 1 2 1.
    #[test]
    fn chroma_samples_lie_on_the_left_column() {
        let row = |red: usize| (0..8).flat_map(move |x| [if x == red { 255u8 } else { 0 }, 0, 0, 255]);
        let full = reference_ycbcr([255.0, 0.0, 0.0], Matrix::Bt709)[2] - 128.0;
        let mut yuv = Yuv420::default();
        for (red, share) in [(3usize, [0.0, 0.25, 0.25, 0.0]), (4, [0.0, 0.0, 0.5, 0.0])] {
            let rgba: Vec<u8> = row(red).chain(row(red)).collect();
            yuv.convert(&rgba, 8, 2, Matrix::Bt709, false);
            for (value, share) in yuv.v.iter().zip(share) {
                assert!((f64::from(*value) - 128.0 - share * full).abs() < 0.51, "{:?}", yuv.v);
            }
        }
    }
}
