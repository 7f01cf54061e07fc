//! Exact-area antialiasing of outlines: each edge adds its signed area to the pixels that it crosses, and a running sum along
//! each row gives the coverage (R. Levien's accumulation buffer, as in font-rs).

use ttf_parser::OutlineBuilder;

/// Coverage of each pixel of a rectangle.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    /// Top left pixel of the rectangle in the image.
    pub at: [u32; 2],
    pub size: [u32; 2],
    /// Signed areas, `size[0] + 2` entries per row; their running sum along a row is the coverage.
    areas: Vec<f32>,
    /// Whether `areas` holds coverage itself, not areas to be summed.
    is_summed: bool,
}

impl Coverage {
    /// Zero coverage of the rectangle from `low` to `high` (pixels, y down), clipped to an image of size `image_size`.
    pub fn new(low: [f32; 2], high: [f32; 2], image_size: [u32; 2]) -> Coverage {
        let end = |v: f32, most: u32| (v.ceil().max(0.0) as u32).min(most);
        let begin = |v: f32, most: u32| (v.floor().max(0.0) as u32).min(most);
        let at = [begin(low[0], image_size[0]), begin(low[1], image_size[1])];
        let size = [0, 1].map(|i| end(high[i], image_size[i]).saturating_sub(at[i]));
        let areas = vec![0.0; (size[0] as usize + 2) * size[1] as usize];
        Coverage { at, size, areas, is_summed: false }
    }

    /// Coverage of the rectangle from `low` to `high`, pixels.
    pub fn rectangle(low: [f32; 2], high: [f32; 2], image_size: [u32; 2]) -> Coverage {
        let mut coverage = Coverage::new(low, high, image_size);
        let corners = [[low[0], low[1]], [low[0], high[1]], [high[0], high[1]], [high[0], low[1]]];
        for i in 0..4 {
            coverage.add_edge(corners[i], corners[(i + 1) % 4]);
        }
        coverage
    }

    /// Coverage, 0 to 1, of the pixels in row `y` of the rectangle. Overlapping outlines of the same direction count once.
    pub fn row(&self, y: u32) -> impl Iterator<Item = f32> + '_ {
        let stride = self.size[0] as usize + 2;
        let row = &self.areas[y as usize * stride..(y as usize + 1) * stride];
        let mut sum = 0.0f32;
        row.iter().take(self.size[0] as usize).map(move |area| {
            sum = if self.is_summed { *area } else { sum + area };
            sum.abs().min(1.0)
        })
    }

    /// Coverage of a rectangle with rounded corners; `radius` in pixels.
    pub fn rounded(low: [f32; 2], high: [f32; 2], radius: f32, image_size: [u32; 2]) -> Coverage {
        let radius = radius.min(0.5 * (high[0] - low[0])).min(0.5 * (high[1] - low[1]));
        if radius.is_nan() || radius <= 0.0 {
            return Coverage::rectangle(low, high, image_size);
        }
        let mut coverage = Coverage::new(low, high, image_size);
        // Quarter circles as cubic Bézier curves, off by 0.03 % of the radius at most.
        let handle_offset = radius * (1.0 - 0.552_284_8);
        let mut add = |a, b| coverage.add_edge(a, b);
        let mut outline = OutlineFlattener::new(&mut add, [0.0; 2], 1.0);
        let ([x0, y0], [x1, y1]) = (low, high);
        // The outline has y up.
        outline.move_to(x0 + radius, -y0);
        outline.line_to(x1 - radius, -y0);
        outline.curve_to(x1 - handle_offset, -y0, x1, -(y0 + handle_offset), x1, -(y0 + radius));
        outline.line_to(x1, -(y1 - radius));
        outline.curve_to(x1, -(y1 - handle_offset), x1 - handle_offset, -y1, x1 - radius, -y1);
        outline.line_to(x0 + radius, -y1);
        outline.curve_to(x0 + handle_offset, -y1, x0, -(y1 - handle_offset), x0, -(y1 - radius));
        outline.line_to(x0, -(y0 + radius));
        outline.curve_to(x0, -(y0 + handle_offset), x0 + handle_offset, -y0, x0 + radius, -y0);
        outline.close();
        coverage
    }

    /// Coverage of this shape dilated by `distance` pixels. `edges`: the shape's edges; distances are measured from pixel
    /// centers.
    pub(crate) fn dilated(&self, edges: &[[[f32; 2]; 2]], distance: f32) -> Coverage {
        let [width, height] = self.size;
        let stride = width as usize + 2;
        let mut nearest = vec![f32::MAX; stride * height as usize];
        let reach = distance + 0.5;
        for [a, b] in edges {
            // Pixels whose centers can be near enough.
            let range = |i: usize, most: u32| {
                let first = a[i].min(b[i]) - reach - self.at[i] as f32 - 0.5;
                let last = a[i].max(b[i]) + reach - self.at[i] as f32 + 0.5;
                (first.ceil().max(0.0) as u32).min(most)..(last.ceil().max(0.0) as u32).min(most)
            };
            for y in range(1, height) {
                for x in range(0, width) {
                    let center = [x + self.at[0], y + self.at[1]].map(|v| v as f32 + 0.5);
                    let known = &mut nearest[y as usize * stride + x as usize];
                    *known = known.min(squared_distance(center, *a, *b));
                }
            }
        }
        for y in 0..height {
            let row = &mut nearest[y as usize * stride..(y as usize + 1) * stride];
            for (cell, own) in row.iter_mut().zip(self.row(y).chain([0.0; 2])) {
                *cell = own.max((reach - cell.sqrt()).clamp(0.0, 1.0));
            }
        }
        Coverage { areas: nearest, is_summed: true, ..*self }
    }

    /// Adds an edge of a closed outline, in pixels of the image.
    pub fn add_edge(&mut self, from: [f32; 2], to: [f32; 2]) {
        if !from.iter().chain(&to).all(|v| v.is_finite()) {
            return;
        }
        let [width, height] = self.size.map(|s| s as f32);
        let local = |p: [f32; 2]| [p[0] - self.at[0] as f32, p[1] - self.at[1] as f32];
        let (mut a, mut b) = (local(from), local(to));
        if a[1] == b[1] {
            return;
        }
        let direction = if a[1] < b[1] { 1.0 } else { -1.0 };
        if a[1] > b[1] {
            std::mem::swap(&mut a, &mut b);
        }
        let slope = (b[0] - a[0]) / (b[1] - a[1]);
        let stride = self.size[0] as usize + 2;
        let (top, bottom) = (a[1].max(0.0), b[1].min(height));
        let mut y = top;
        while y < bottom {
            let row = y.floor();
            let next = (row + 1.0).min(bottom);
            let (x0, x1) = (a[0] + (y - a[1]) * slope, a[0] + (next - a[1]) * slope);
            let cells = &mut self.areas[row as usize * stride..(row as usize + 1) * stride];
            add_edge_within_row(cells, width, [x0.min(x1), x0.max(x1)], (next - y) * direction);
            y = next;
        }
    }
}

/// Squared distance of a point from a line segment.
fn squared_distance(p: [f32; 2], a: [f32; 2], b: [f32; 2]) -> f32 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let length = along[0] * along[0] + along[1] * along[1];
    let share = if length > 0.0 { (to[0] * along[0] + to[1] * along[1]) / length } else { 0.0 };
    let off = [0, 1].map(|i| to[i] - along[i] * share.clamp(0.0, 1.0));
    off[0] * off[0] + off[1] * off[1]
}

/// Adds the part of an edge that lies in one row, from `x0` to `x1` with the signed height `height`. Parts left of the row count
/// at its left side.
fn add_edge_within_row(cells: &mut [f32], width: f32, [x0, x1]: [f32; 2], height: f32) {
    if x0 >= width {
        return;
    }
    if x1 <= 0.0 {
        cells[0] += height;
        return;
    }
    if x0 < 0.0 || x1 > width {
        // Clip at both sides: each part gets its share of the height.
        let whole = x1 - x0;
        let left = (-x0).max(0.0) / whole;
        let right = (x1 - width).max(0.0) / whole;
        cells[0] += height * left;
        add_edge_within_row(
            cells,
            width,
            [x0.max(0.0), x1.min(width).max(x0.max(0.0))],
            height * (1.0 - left - right),
        );
        return;
    }
    let first = x0.floor();
    let last = x1.ceil();
    let i = first as usize;
    if last <= first + 1.0 {
        // The edge crosses one pixel: the area right of the edge's midpoint counts.
        let mean = 0.5 * (x0 + x1) - first;
        cells[i] += height * (1.0 - mean);
        cells[i + 1] += height * mean;
        return;
    }
    // The edge crosses several pixels: a triangle, strips whose areas grow evenly, and the rest.
    let step = 1.0 / (x1 - x0);
    let into = 1.0 - (x0 - first);
    let begin = 0.5 * step * into * into;
    let out = x1 - (last - 1.0);
    let end = 0.5 * step * out * out;
    let count = (last - first) as usize;
    cells[i] += height * begin;
    if count == 2 {
        cells[i + 1] += height * (1.0 - begin - end);
    } else {
        let second = step * (into + 0.5);
        cells[i + 1] += height * (second - begin);
        for cell in &mut cells[i + 2..i + count - 1] {
            *cell += height * step;
        }
        let before = second + (count as f32 - 3.0) * step;
        cells[i + count - 1] += height * (1.0 - before - end);
    }
    cells[i + count] += height * end;
}

/// Flattens a glyph's curves into straight edges.
pub(crate) struct OutlineFlattener<'a> {
    add: &'a mut dyn FnMut([f32; 2], [f32; 2]),
    origin: [f32; 2],
    scale: f32,
    start: [f32; 2],
    at: [f32; 2],
}

/// Largest distance between an edge and its curve in pixels.
const MAX_CURVE_ERROR: f32 = 0.02;

impl<'a> OutlineFlattener<'a> {
    /// `add` gets the two ends of each edge, in pixels.
    pub(crate) fn new(
        add: &'a mut dyn FnMut([f32; 2], [f32; 2]),
        origin: [f32; 2],
        scale: f32,
    ) -> OutlineFlattener<'a> {
        OutlineFlattener { add, origin, scale, start: origin, at: origin }
    }

    /// Pixel position of a point in font units, y up.
    fn to_pixels(&self, x: f32, y: f32) -> [f32; 2] {
        [self.origin[0] + x * self.scale, self.origin[1] - y * self.scale]
    }

    fn add_edge(&mut self, to: [f32; 2]) {
        (self.add)(self.at, to);
        self.at = to;
    }

    /// Number of even steps that approximate a curve with this second difference.
    fn step_count(bend: f32) -> usize {
        (bend / (8.0 * MAX_CURVE_ERROR)).sqrt().ceil().clamp(1.0, 64.0) as usize
    }
}

impl OutlineBuilder for OutlineFlattener<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        self.start = self.to_pixels(x, y);
        self.at = self.start;
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let to = self.to_pixels(x, y);
        self.add_edge(to);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let (a, b, c) = (self.at, self.to_pixels(x1, y1), self.to_pixels(x, y));
        let bend = [0, 1].map(|i| 2.0 * (a[i] - 2.0 * b[i] + c[i]).abs());
        let steps = Self::step_count(bend[0] + bend[1]);
        for s in 1..=steps {
            let t = s as f32 / steps as f32;
            let u = 1.0 - t;
            self.add_edge([0, 1].map(|i| u * u * a[i] + 2.0 * u * t * b[i] + t * t * c[i]));
        }
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let (a, b, c, d) = (self.at, self.to_pixels(x1, y1), self.to_pixels(x2, y2), self.to_pixels(x, y));
        let bend =
            [0, 1].map(|i| 6.0 * (a[i] - 2.0 * b[i] + c[i]).abs().max((b[i] - 2.0 * c[i] + d[i]).abs()));
        let steps = Self::step_count(bend[0] + bend[1]);
        for s in 1..=steps {
            let t = s as f32 / steps as f32;
            let u = 1.0 - t;
            self.add_edge([0, 1].map(|i| {
                u * u * u * a[i] + 3.0 * u * u * t * b[i] + 3.0 * u * t * t * c[i] + t * t * t * d[i]
            }));
        }
    }

    fn close(&mut self) {
        let start = self.start;
        self.add_edge(start);
    }
}
