//! Colors of a frame: a histogram, a palette by median cut, and a lookup table from color to palette entry.
//!
//! Heckbert, "Color Image Quantization for Frame Buffer Display" (1982). The box with the largest summed squared error is split
//! next, where that error falls most (Wu 1991, in one dimension).

/// Six bits a channel: 262 144 cells. Dithering hides the bits below.
const BITS: usize = 6;
const CELLS: usize = 1 << (3 * BITS);

#[derive(Clone, Copy)]
struct Cell {
    color: [u8; 3],
    count: u32,
}

/// A color quantizer. Its buffers are reused from frame to frame.
pub(crate) struct Quantizer {
    counts: Vec<u32>,
    /// Palette entry + 1 for each cell; 0 = not looked up yet.
    nearest: Vec<u16>,
    cells: Vec<Cell>,
    pub palette: Vec<[u8; 3]>,
    /// Mean squared error of the palette on the frame it was made for.
    made_for: f64,
}

fn key(c: [u8; 3]) -> usize {
    let cut = |c: u8| usize::from(c) >> (8 - BITS);
    cut(c[0]) << (2 * BITS) | cut(c[1]) << BITS | cut(c[2])
}

/// The representative color of a cell.
fn center(key: usize) -> [u8; 3] {
    [key >> (2 * BITS), key >> BITS, key].map(|bits| {
        let top = (bits & ((1 << BITS) - 1)) as u8;
        // Bits are repeated in the low ones, so that 0 stays 0 and the largest cell becomes 255.
        top << (8 - BITS) | top >> (2 * BITS - 8)
    })
}

impl Quantizer {
    pub(crate) fn new() -> Quantizer {
        Quantizer {
            counts: vec![0; CELLS],
            nearest: vec![0; CELLS],
            cells: Vec::new(),
            palette: Vec::new(),
            made_for: 0.0,
        }
    }

    /// Restores an earlier palette and its error at that time.
    pub(crate) fn restore(&mut self, palette: Vec<[u8; 3]>, made_for: f64) {
        (self.palette, self.made_for) = (palette, made_for);
        self.nearest.fill(0);
    }

    /// Mean squared error of the palette on the frame it was made for.
    pub(crate) fn made_for(&self) -> f64 {
        self.made_for
    }

    /// Prepares the palette for a frame. True where a new palette was made; false where the last one is still good enough: an
    /// unchanged palette keeps still parts of the image identical to the bit.
    pub(crate) fn prepare(&mut self, rgba: &[u8], colors: usize) -> bool {
        self.counts.fill(0);
        for p in rgba.as_chunks::<4>().0 {
            self.counts[key([p[0], p[1], p[2]])] += 1;
        }
        self.cells.clear();
        for (k, &count) in self.counts.iter().enumerate() {
            if count > 0 {
                self.cells.push(Cell { color: center(k), count });
            }
        }
        if !self.palette.is_empty() && self.error() <= 1.5 * self.made_for + 4.0 {
            return false;
        }
        self.palette = median_cut(&mut self.cells, colors);
        self.nearest.fill(0);
        self.made_for = self.error();
        true
    }

    /// Mean squared distance between the frame's colors and their palette entries.
    fn error(&mut self) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for i in 0..self.cells.len() {
            let Cell { color, count } = self.cells[i];
            let entry = usize::from(self.entry(color));
            sum += f64::from(distance(color, self.palette[entry])) * f64::from(count);
            total += f64::from(count);
        }
        if total > 0.0 { sum / total } else { 0.0 }
    }

    /// Index of the palette entry nearest to the cell of a color; the palette must not be empty. The cell decides, not the color,
    /// so the result does not depend on which of the cell's colors is requested first.
    pub(crate) fn entry(&mut self, color: [u8; 3]) -> u8 {
        let k = key(color);
        if self.nearest[k] == 0 {
            let color = center(k);
            let best = (0..self.palette.len()).min_by_key(|&i| distance(self.palette[i], color)).unwrap_or(0);
            self.nearest[k] = best as u16 + 1;
        }
        (self.nearest[k] - 1) as u8
    }
}

fn distance(a: [u8; 3], b: [u8; 3]) -> u32 {
    let d = |i: usize| u32::from(a[i].abs_diff(b[i])).pow(2);
    // Weighted by visibility, roughly with the luma weights of BT.601.
    2 * d(0) + 4 * d(1) + d(2)
}

/// Makes a palette of at most `colors` entries (≥ 1), fewer where the frame has fewer colors.
fn median_cut(cells: &mut [Cell], colors: usize) -> Vec<[u8; 3]> {
    struct Range {
        start: usize,
        end: usize,
        error: f64,
        axis: usize,
    }
    fn measure_range(cells: &[Cell], start: usize, end: usize) -> Range {
        const WEIGHTS: [f64; 3] = [2.0, 4.0, 1.0];
        let (mut n, mut sum, mut squares) = (0.0, [0.0; 3], [0.0; 3]);
        for cell in &cells[start..end] {
            let count = f64::from(cell.count);
            n += count;
            for axis in 0..3 {
                let c = f64::from(cell.color[axis]);
                sum[axis] += count * c;
                squares[axis] += count * c * c;
            }
        }
        let error: [f64; 3] = std::array::from_fn(|a| (squares[a] - sum[a] * sum[a] / n) * WEIGHTS[a]);
        let axis = (0..3).max_by(|&a, &b| error[a].total_cmp(&error[b])).unwrap_or(0);
        Range { start, end, error: if end - start > 1 { error.iter().sum() } else { 0.0 }, axis }
    }
    let mut ranges = vec![measure_range(cells, 0, cells.len())];
    while ranges.len() < colors {
        let Some(worst) = (0..ranges.len()).max_by(|&a, &b| ranges[a].error.total_cmp(&ranges[b].error))
        else {
            break;
        };
        let Range { start, end, error, axis } = ranges[worst];
        if error <= 0.0 {
            break;
        }
        let part = &mut cells[start..end];
        part.sort_unstable_by_key(|c| (c.color[axis], c.color));
        // The cut with the least squared error maximizes Σ(sum²/n) over both sides.
        let total: (f64, f64) = part.iter().fold((0.0, 0.0), |(n, s), c| {
            (n + f64::from(c.count), s + f64::from(c.count) * f64::from(c.color[axis]))
        });
        let (mut n, mut s, mut best) = (0.0, 0.0, (f64::NEG_INFINITY, 1));
        for (i, cell) in part[..part.len() - 1].iter().enumerate() {
            n += f64::from(cell.count);
            s += f64::from(cell.count) * f64::from(cell.color[axis]);
            let gain = s * s / n + (total.1 - s) * (total.1 - s) / (total.0 - n);
            if gain > best.0 {
                best = (gain, i + 1);
            }
        }
        let middle = start + best.1;
        ranges[worst] = measure_range(cells, start, middle);
        ranges.push(measure_range(cells, middle, end));
    }
    let mean = |r: &Range| {
        let (mut n, mut sum) = (0u64, [0u64; 3]);
        for cell in &cells[r.start..r.end] {
            n += u64::from(cell.count);
            for (sum, c) in sum.iter_mut().zip(cell.color) {
                *sum += u64::from(cell.count) * u64::from(c);
            }
        }
        sum.map(|s| ((s + n / 2) / n.max(1)) as u8)
    };
    ranges.iter().map(mean).collect()
}
