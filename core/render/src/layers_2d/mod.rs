//! 2D layers: text, images, panels and letterbox bars, composited into one image behind the scene and one in front of it. Both
//! renderers use the CPU for this, so that their frames show the same layers. The image behind the scene is drawn as a background;
//! the image in front is blended over the finished frame.

mod image;

use crate::scene_resources::mipmap::{linear_to_srgb8, srgb_to_linear_table};
use choreo_plugin::Frame;
use choreo_stage::{Align, Font, Layer2dContent, Layer2dState, Snapshot, Stage};
use choreo_text::{Coverage, Style, lay_out_text};
use glam::{DVec2, Vec2, Vec4};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Composited layers.
#[derive(Clone, PartialEq)]
pub struct LayerImage {
    /// Size of the frame in pixels.
    pub size: [u32; 2],
    /// First pixel of the area that is not empty.
    pub at: [u32; 2],
    /// Size of the area that is not empty.
    pub area: [u32; 2],
    /// Pixels of the area that is not empty: linear, premultiplied alpha.
    pub pixels: Vec<Vec4>,
    /// Hash of all inputs.
    pub hash: [u8; 32],
}

impl fmt::Debug for LayerImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "LayerImage({:?} pixels at {:?} of {:?})", self.area, self.at, self.size)
    }
}

/// Text that an effect draws next to a point of the frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ScreenLabel {
    /// Position as shares of the frame, from its top left.
    pub at: DVec2,
    pub text: String,
    /// Font size in pixels.
    pub size: f32,
    /// Distance from the point to the text in pixels.
    pub beside: f32,
    /// Linear, straight alpha.
    pub color: Vec4,
}

/// Composites the 2D layers behind the scene and in front of it; `None` if there are none. Results are cached by their inputs.
pub fn compose_layers(
    stage: &Stage,
    snapshot: &Snapshot,
    labels: &[ScreenLabel],
    size: [u32; 2],
) -> [Option<Arc<LayerImage>>; 2] {
    let [mut behind, mut in_front] = [Vec::new(), Vec::new()];
    for state in &snapshot.layers_2d {
        let Some(layer_2d) = stage.layers_2d.get(state.layer_2d) else { continue };
        if layer_2d.under { behind.push(state) } else { in_front.push(state) }
    }
    let composed =
        |states: &[&Layer2dState], labels: &[ScreenLabel]| match states.is_empty() && labels.is_empty() {
            true => None,
            false => compose_cached(stage, states, labels, size),
        };
    [composed(&behind, &[]), composed(&in_front, labels)]
}

fn compose_cached(
    stage: &Stage,
    states: &[&Layer2dState],
    labels: &[ScreenLabel],
    size: [u32; 2],
) -> Option<Arc<LayerImage>> {
    static CACHE: Mutex<Vec<Arc<LayerImage>>> = Mutex::new(Vec::new());
    const MAX_CACHED: usize = 8;
    let hash = input_hash(stage, states, labels, size);
    let cache = || CACHE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(cached) = cache().iter().find(|layer_2d| layer_2d.hash == hash) {
        return Some(cached.clone());
    }
    let mut canvas = Canvas::new(size);
    let mut occupied = Vec::new();
    labels.iter().for_each(|label| canvas.draw_label(label, &mut occupied));
    for state in states {
        canvas.draw_layer(&stage.layers_2d[state.layer_2d], state);
    }
    let composed = Arc::new(canvas.into_layer_image(hash)?);
    let mut cached = cache();
    cached.insert(0, composed.clone());
    cached.truncate(MAX_CACHED);
    Some(composed)
}

fn input_hash(stage: &Stage, states: &[&Layer2dState], labels: &[ScreenLabel], size: [u32; 2]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    add(format!("{size:?}").as_bytes());
    labels.iter().for_each(|label| add(format!("{label:?}").as_bytes()));
    for state in states {
        let layer_2d = &stage.layers_2d[state.layer_2d];
        // `Debug` prints different numbers as different texts.
        match &layer_2d.content {
            Layer2dContent::Picture { hash, fit, image: _ } => {
                add(hash);
                add(format!("{fit:?}").as_bytes());
            }
            Layer2dContent::Text { font, .. } => {
                add(&font.hash());
                add(format!("{:?}", layer_2d.content).as_bytes());
            }
            other => add(format!("{other:?}").as_bytes()),
        }
        let Layer2dState { layer_2d: _, at, opacity, scale, words } = state;
        let text =
            format!("{:?} {:?} {at:?} {opacity:?} {scale:?} {words:?}", layer_2d.offset, layer_2d.anchor);
        add(text.as_bytes());
    }
    *hasher.finalize().as_bytes()
}

/// Image that layers are drawn into.
struct Canvas {
    size: [u32; 2],
    pixels: Vec<Vec4>,
    /// First changed pixel, and the end of the changed area (exclusive).
    low: [u32; 2],
    high: [u32; 2],
}

impl Canvas {
    fn new(size: [u32; 2]) -> Canvas {
        let pixels = vec![Vec4::ZERO; size[0] as usize * size[1] as usize];
        Canvas { size, pixels, low: size, high: [0; 2] }
    }

    fn draw_layer(&mut self, layer_2d: &choreo_stage::Layer2d, state: &Layer2dState) {
        if let Layer2dContent::Text { outline, panel, .. } = &layer_2d.content
            && (outline.is_some() || panel.is_some())
            && state.opacity < 1.0
        {
            // Text, outline and panel fade together, as one image.
            let mut whole = Canvas::new(self.size);
            whole.draw_layer(layer_2d, &Layer2dState { opacity: 1.0, ..state.clone() });
            return self.blend_canvas(&whole, state.opacity);
        }
        let frame = DVec2::new(self.size[0].into(), self.size[1].into());
        let point = state.at * frame + layer_2d.offset;
        let factor = state.scale;
        let corner = |size: DVec2| point - layer_2d.anchor * size;
        match &layer_2d.content {
            Layer2dContent::Text { words, font, size, width, align, line_height, color, outline, panel } => {
                let words = state.words.as_deref().unwrap_or(words);
                let style = Style {
                    size: (size * frame.y) as f32,
                    width: width.map(|w| (w * frame.x) as f32),
                    align: *align,
                    line_height: *line_height as f32,
                };
                let layout = lay_out_text(font, words, &style);
                let at = corner(DVec2::new(layout.size[0].into(), layout.size[1].into()) * factor);
                let em = size * frame.y * factor;
                if let Some(panel) = panel {
                    let margin = panel.padding * em;
                    let ends = layout.longest_line_ends.map(|end| f64::from(end) * factor);
                    let low = at + DVec2::new(ends[0], 0.0) - margin;
                    let high = at + DVec2::new(ends[1], f64::from(layout.size[1]) * factor) + margin;
                    let [low, high] = [low, high].map(|p| [p.x as f32, p.y as f32]);
                    let radius = (panel.radius * em) as f32;
                    self.fill_coverage(
                        &Coverage::rounded(low, high, radius, self.size),
                        panel.color,
                        state.opacity,
                    );
                }
                let at = [at.x as f32, at.y as f32];
                if let Some(outline) = outline {
                    let distance = (outline.width * em) as f32;
                    let around = layout.outline_coverage(font, at, factor as f32, distance, self.size);
                    self.fill_coverage(&around, outline.color, state.opacity);
                }
                let coverage = layout.coverage(font, at, factor as f32, self.size);
                self.fill_coverage(&coverage, *color, state.opacity);
            }
            Layer2dContent::Picture { image, fit, .. } => {
                let size = image::fitted_size(image, *fit, frame) * factor;
                image::draw_image(self, image, corner(size), size, state.opacity);
            }
            Layer2dContent::Panel { size, color } => {
                let size = *size * frame * factor;
                self.fill_rectangle(corner(size), size, *color, state.opacity);
            }
            Layer2dContent::Bars { ratio, color } => {
                let inside = DVec2::new(frame.x.min(frame.y * ratio), frame.y.min(frame.x / ratio));
                let bar = (frame - inside) * 0.5 * factor.min(1.0);
                let bar_size =
                    if bar.x > bar.y { DVec2::new(bar.x, frame.y) } else { DVec2::new(frame.x, bar.y) };
                self.fill_rectangle(DVec2::ZERO, bar_size, *color, state.opacity);
                self.fill_rectangle(frame - bar_size, bar_size, *color, state.opacity);
            }
        }
    }

    /// Draws a label with a dark shadow, so that it is readable on any background. A label that would overlap an earlier one is left
    /// out. `occupied`: bounds of the labels drawn so far.
    fn draw_label(&mut self, label: &ScreenLabel, occupied: &mut Vec<[Vec2; 2]>) {
        let font = Font::built_in();
        let style = Style { size: label.size, width: None, align: Align::Left, line_height: 1.25 };
        let layout = lay_out_text(&font, &label.text, &style);
        let frame = DVec2::new(self.size[0].into(), self.size[1].into());
        let at = (label.at * frame).as_vec2() + Vec2::new(label.beside, -0.5 * layout.size[1]);
        let bounds = [at, at + Vec2::from(layout.size)];
        if occupied.iter().any(|[low, high]| bounds[0].cmplt(*high).all() && low.cmplt(bounds[1]).all()) {
            return;
        }
        occupied.push(bounds);
        let shadow = Vec4::new(0.0, 0.0, 0.0, label.color.w * 0.75);
        for (offset, color) in [(1.0, shadow), (0.0, label.color)] {
            let coverage = layout.coverage(&font, [at.x + offset, at.y + offset], 1.0, self.size);
            self.fill_coverage(&coverage, color, 1.0);
        }
    }

    fn fill_rectangle(&mut self, at: DVec2, size: DVec2, color: Vec4, opacity: f32) {
        let to = at + size;
        let coverage = Coverage::rectangle([at.x as f32, at.y as f32], [to.x as f32, to.y as f32], self.size);
        self.fill_coverage(&coverage, color, opacity);
    }

    fn fill_coverage(&mut self, coverage: &Coverage, color: Vec4, opacity: f32) {
        self.blend_pixels(coverage, |_, _| color.truncate().extend(1.0) * (color.w * opacity));
    }

    /// Blends premultiplied colors over the canvas, weighted by coverage.
    fn blend_pixels(&mut self, coverage: &Coverage, color: impl Fn(u32, u32) -> Vec4) {
        for row in 0..coverage.size[1] {
            let y = coverage.at[1] + row;
            for (column, covered) in (0..).zip(coverage.row(row)).filter(|(_, covered)| *covered > 0.0) {
                let x = coverage.at[0] + column;
                let source = color(x, y) * covered;
                let pixel = &mut self.pixels[y as usize * self.size[0] as usize + x as usize];
                *pixel = source + *pixel * (1.0 - source.w);
                self.low = [self.low[0].min(x), self.low[1].min(y)];
                self.high = [self.high[0].max(x + 1), self.high[1].max(y + 1)];
            }
        }
    }

    /// Blends another canvas over this one.
    fn blend_canvas(&mut self, other: &Canvas, opacity: f32) {
        for y in other.low[1]..other.high[1] {
            let row = y as usize * self.size[0] as usize;
            for x in other.low[0]..other.high[0] {
                let source = other.pixels[row + x as usize] * opacity;
                let pixel = &mut self.pixels[row + x as usize];
                *pixel = source + *pixel * (1.0 - source.w);
            }
        }
        self.low = [0, 1].map(|i| self.low[i].min(other.low[i]));
        self.high = [0, 1].map(|i| self.high[i].max(other.high[i]));
    }

    /// Crops the canvas to the changed area; `None` if nothing was drawn.
    fn into_layer_image(self, hash: [u8; 32]) -> Option<LayerImage> {
        let Canvas { size, pixels, low, high } = self;
        if low[0] >= high[0] || low[1] >= high[1] {
            return None;
        }
        let width = size[0] as usize;
        let row = |y: u32| {
            let first = y as usize * width;
            pixels[first + low[0] as usize..first + high[0] as usize].iter().copied()
        };
        let area = [high[0] - low[0], high[1] - low[1]];
        Some(LayerImage { size, at: low, area, pixels: (low[1]..high[1]).flat_map(row).collect(), hash })
    }
}

impl LayerImage {
    /// Linear, premultiplied color of a pixel; zero outside the area.
    pub fn pixel(&self, x: u32, y: u32) -> Vec4 {
        let (x, y) = (x.wrapping_sub(self.at[0]), y.wrapping_sub(self.at[1]));
        if x >= self.area[0] || y >= self.area[1] {
            return Vec4::ZERO;
        }
        self.pixels[(y * self.area[0] + x) as usize]
    }

    /// Blends the layers over a linear, premultiplied image.
    pub(crate) fn blend_over_floats(&self, size: [u32; 2], image: &mut [Vec4]) {
        if size != self.size {
            return;
        }
        for (row, pixels) in self.pixels.chunks_exact(self.area[0] as usize).enumerate() {
            let first = (self.at[1] as usize + row) * size[0] as usize + self.at[0] as usize;
            let out = image[first..].iter_mut().zip(pixels);
            out.for_each(|(out, source)| *out = *source + *out * (1.0 - source.w));
        }
    }

    /// Blends the layers over a finished frame of the same size.
    pub fn blend_over(&self, frame: &mut Frame) {
        if [frame.width, frame.height] != self.size {
            return;
        }
        let decode = srgb_to_linear_table();
        for (row, pixels) in self.pixels.chunks_exact(self.area[0] as usize).enumerate() {
            let first = (self.at[1] as usize + row) * frame.width as usize + self.at[0] as usize;
            let (out, _) = frame.rgba[4 * first..4 * (first + pixels.len())].as_chunks_mut::<4>();
            for (out, source) in out.iter_mut().zip(pixels).filter(|(_, source)| source.w > 0.0) {
                let rest = 1.0 - source.w;
                for (channel, light) in source.truncate().to_array().into_iter().enumerate() {
                    let below = decode[out[channel] as usize];
                    out[channel] = linear_to_srgb8(light + below * rest);
                }
                let alpha = source.w * 255.0 + f32::from(out[3]) * rest;
                out[3] = alpha.round().clamp(0.0, 255.0) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use choreo_stage::Layer2d;

    fn panel(size: DVec2, color: Vec4) -> Layer2d {
        Layer2d::new(Layer2dContent::Panel { size, color })
    }

    fn composed_at_start(stage: &Stage, size: [u32; 2]) -> [Option<Arc<LayerImage>>; 2] {
        compose_layers(stage, &stage.at(choreo_motion::Time::ZERO).unwrap(), &[], size)
    }

    #[test]
    fn later_layers_are_blended_over_earlier_layers() {
        let mut stage = Stage::default();
        stage.layers_2d.push(panel(DVec2::ONE, Vec4::new(1.0, 0.0, 0.0, 1.0)));
        stage.layers_2d.push(panel(DVec2::new(0.5, 1.0), Vec4::new(0.0, 1.0, 0.0, 0.5)));
        let [under, over] = composed_at_start(&stage, [8, 4]);
        assert!(under.is_none());
        let over = over.unwrap();
        assert_eq!(over.pixel(0, 0), Vec4::new(1.0, 0.0, 0.0, 1.0));
        assert_eq!(over.pixel(4, 2), Vec4::new(0.5, 0.5, 0.0, 1.0));
        // The frame below is visible through transparent pixels: half green over blue, in linear light.
        stage.layers_2d.remove(0);
        let mut frame = Frame { width: 8, height: 4, rgba: [0, 0, 255, 255].repeat(32) };
        composed_at_start(&stage, [8, 4])[1].as_ref().unwrap().blend_over(&mut frame);
        assert_eq!(frame.rgba[..4], [0, 0, 255, 255]);
        assert_eq!(frame.rgba[4 * 4..4 * 5], [0, 188, 188, 255]);
    }

    #[test]
    fn letterbox_bars_leave_an_area_of_their_aspect_ratio() {
        let mut stage = Stage::default();
        stage.layers_2d.push(Layer2d::new(Layer2dContent::Bars { ratio: 2.0, color: Vec4::W }));
        let layer_2d = composed_at_start(&stage, [80, 60])[1].clone().unwrap();
        let dark = (0..60).filter(|y| layer_2d.pixel(40, *y).w > 0.5).count();
        assert_eq!(dark, 20, "the area of 2:1 in 80×60 pixels is 40 pixels high");
        // The frame already has that ratio, so there are no bars.
        assert!(composed_at_start(&stage, [80, 40])[1].is_none());
    }
}
