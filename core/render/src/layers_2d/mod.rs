//! FlatPicture layers: words, pictures, panels and bars, in one picture under the scene and one over it. Composed here alone, so that
//! both renderers show the same: what lies under is drawn like a background, what lies over is laid on the finished frame.

mod picture;

use choreo_plugin::Frame;
use choreo_stage::{Align, Font, Layer2dContent, Layer2dState, Snapshot, Stage};
use choreo_text::{Coverage, Style, lay_out};
use glam::{DVec2, Vec2, Vec4};
use picture::draw_picture;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Layers in one picture.
#[derive(Clone, PartialEq)]
pub struct FlatPicture {
    /// Of the whole picture, pixels.
    pub size: [u32; 2],
    /// What is not empty: first pixel, and pixels.
    pub at: [u32; 2],
    pub area: [u32; 2],
    /// Of that area: linear, premultiplied.
    pub pixels: Vec<Vec4>,
    /// Of all that it is made from.
    pub hash: [u8; 32],
}

impl fmt::Debug for FlatPicture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "FlatPicture({:?} pixels at {:?} of {:?})", self.area, self.at, self.size)
    }
}

/// Words of an effect, beside a place in the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatLabel {
    /// Shares of the picture, from its top left.
    pub at: DVec2,
    pub text: String,
    /// Of the font, and how far right of the place they begin, pixels.
    pub size: f32,
    pub beside: f32,
    /// Linear, straight alpha.
    pub color: Vec4,
}

/// Those under the scene and those over it, where there are any. Kept as long as they do not change.
pub fn flats(
    stage: &Stage,
    snapshot: &Snapshot,
    labels: &[FlatLabel],
    size: [u32; 2],
) -> [Option<Arc<FlatPicture>>; 2] {
    let [mut under, mut over] = [Vec::new(), Vec::new()];
    for state in &snapshot.layers_2d {
        let Some(layer_2d) = stage.layers_2d.get(state.layer_2d) else { continue };
        if layer_2d.under { under.push(state) } else { over.push(state) }
    }
    let layer_2d =
        |states: &[&Layer2dState], labels: &[FlatLabel]| match states.is_empty() && labels.is_empty() {
            true => None,
            false => layer_2d(stage, states, labels, size),
        };
    [layer_2d(&under, &[]), layer_2d(&over, labels)]
}

fn layer_2d(
    stage: &Stage,
    states: &[&Layer2dState],
    labels: &[FlatLabel],
    size: [u32; 2],
) -> Option<Arc<FlatPicture>> {
    static KEPT: Mutex<Vec<Arc<FlatPicture>>> = Mutex::new(Vec::new());
    const MOST: usize = 8;
    let hash = hash(stage, states, labels, size);
    let kept = || KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(known) = kept().iter().find(|layer_2d| layer_2d.hash == hash) {
        return Some(known.clone());
    }
    let mut canvas = Canvas::new(size);
    let mut taken = Vec::new();
    labels.iter().for_each(|label| canvas.label(label, &mut taken));
    for state in states {
        canvas.draw(&stage.layers_2d[state.layer_2d], state);
    }
    let made = Arc::new(canvas.finish(hash)?);
    let mut all = kept();
    all.insert(0, made.clone());
    all.truncate(MOST);
    Some(made)
}

fn hash(stage: &Stage, states: &[&Layer2dState], labels: &[FlatLabel], size: [u32; 2]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    add(format!("{size:?}").as_bytes());
    labels.iter().for_each(|label| add(format!("{label:?}").as_bytes()));
    for state in states {
        let layer_2d = &stage.layers_2d[state.layer_2d];
        // Numbers are printed so that no two that differ look alike.
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

/// What is drawn on.
struct Canvas {
    size: [u32; 2],
    pixels: Vec<Vec4>,
    /// First and last pixels that were touched, the last not included.
    low: [u32; 2],
    high: [u32; 2],
}

impl Canvas {
    fn new(size: [u32; 2]) -> Canvas {
        let pixels = vec![Vec4::ZERO; size[0] as usize * size[1] as usize];
        Canvas { size, pixels, low: size, high: [0; 2] }
    }

    fn draw(&mut self, layer_2d: &choreo_stage::Layer2d, state: &Layer2dState) {
        let picture = DVec2::new(self.size[0].into(), self.size[1].into());
        let point = state.at * picture + layer_2d.offset;
        let factor = state.scale;
        let corner = |size: DVec2| point - layer_2d.anchor * size;
        match &layer_2d.content {
            Layer2dContent::Text { words, font, size, width, align, line_height, color } => {
                let words = state.words.as_deref().unwrap_or(words);
                let style = Style {
                    size: (size * picture.y) as f32,
                    width: width.map(|w| (w * picture.x) as f32),
                    align: *align,
                    line_height: *line_height as f32,
                };
                let laid = lay_out(font, words, &style);
                let at = corner(DVec2::new(laid.size[0].into(), laid.size[1].into()) * factor);
                let coverage = laid.coverage(font, [at.x as f32, at.y as f32], factor as f32, self.size);
                self.fill(&coverage, *color, state.opacity);
            }
            Layer2dContent::Picture { image, fit, .. } => {
                let box_of = picture::box_of(image, *fit, picture) * factor;
                draw_picture(self, image, corner(box_of), box_of, state.opacity);
            }
            Layer2dContent::Panel { size, color } => {
                let size = *size * picture * factor;
                self.rectangle(corner(size), size, *color, state.opacity);
            }
            Layer2dContent::Bars { ratio, color } => {
                let inside = DVec2::new(picture.x.min(picture.y * ratio), picture.y.min(picture.x / ratio));
                let bar = (picture - inside) * 0.5 * factor.min(1.0);
                let across =
                    if bar.x > bar.y { DVec2::new(bar.x, picture.y) } else { DVec2::new(picture.x, bar.y) };
                self.rectangle(DVec2::ZERO, across, *color, state.opacity);
                self.rectangle(picture - across, across, *color, state.opacity);
            }
        }
    }

    /// With a dark one behind it, to be read on anything. Left out where it would lie over one that is there: none could be read.
    fn label(&mut self, label: &FlatLabel, taken: &mut Vec<[Vec2; 2]>) {
        let font = Font::built_in();
        let style = Style { size: label.size, width: None, align: Align::Left, line_height: 1.25 };
        let laid = lay_out(&font, &label.text, &style);
        let picture = DVec2::new(self.size[0].into(), self.size[1].into());
        let at = (label.at * picture).as_vec2() + Vec2::new(label.beside, -0.5 * laid.size[1]);
        let place = [at, at + Vec2::from(laid.size)];
        if taken.iter().any(|[low, high]| place[0].cmplt(*high).all() && low.cmplt(place[1]).all()) {
            return;
        }
        taken.push(place);
        let behind = Vec4::new(0.0, 0.0, 0.0, label.color.w * 0.75);
        for (by, color) in [(1.0, behind), (0.0, label.color)] {
            let coverage = laid.coverage(&font, [at.x + by, at.y + by], 1.0, self.size);
            self.fill(&coverage, color, 1.0);
        }
    }

    fn rectangle(&mut self, at: DVec2, size: DVec2, color: Vec4, opacity: f32) {
        let to = at + size;
        let coverage = Coverage::rectangle([at.x as f32, at.y as f32], [to.x as f32, to.y as f32], self.size);
        self.fill(&coverage, color, opacity);
    }

    fn fill(&mut self, coverage: &Coverage, color: Vec4, opacity: f32) {
        self.blend(coverage, |_, _| color.truncate().extend(1.0) * (color.w * opacity));
    }

    /// Lays premultiplied colours over what is there, as much as is covered.
    fn blend(&mut self, coverage: &Coverage, color: impl Fn(u32, u32) -> Vec4) {
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

    /// `None` where nothing was drawn.
    fn finish(self, hash: [u8; 32]) -> Option<FlatPicture> {
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
        Some(FlatPicture { size, at: low, area, pixels: (low[1]..high[1]).flat_map(row).collect(), hash })
    }
}

impl FlatPicture {
    /// Premultiplied; nothing outside the area.
    pub fn pixel(&self, x: u32, y: u32) -> Vec4 {
        let (x, y) = (x.wrapping_sub(self.at[0]), y.wrapping_sub(self.at[1]));
        if x >= self.area[0] || y >= self.area[1] {
            return Vec4::ZERO;
        }
        self.pixels[(y * self.area[0] + x) as usize]
    }

    /// Lays it on a finished frame of its size.
    pub fn over(&self, frame: &mut Frame) {
        if [frame.width, frame.height] != self.size {
            return;
        }
        let decode = crate::scene_resources::mipmap::srgb_to_linear_table();
        for (row, pixels) in self.pixels.chunks_exact(self.area[0] as usize).enumerate() {
            let first = (self.at[1] as usize + row) * frame.width as usize + self.at[0] as usize;
            let (out, _) = frame.rgba[4 * first..4 * (first + pixels.len())].as_chunks_mut::<4>();
            for (out, source) in out.iter_mut().zip(pixels).filter(|(_, source)| source.w > 0.0) {
                let rest = 1.0 - source.w;
                for (channel, light) in source.truncate().to_array().into_iter().enumerate() {
                    let below = decode[out[channel] as usize];
                    out[channel] = crate::scene_resources::mipmap::linear_to_srgb8(light + below * rest);
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

    fn drawn(stage: &Stage, size: [u32; 2]) -> [Option<Arc<FlatPicture>>; 2] {
        flats(stage, &stage.at(choreo_motion::Time::ZERO).unwrap(), &[], size)
    }

    #[test]
    fn later_ones_lie_over_earlier_ones() {
        let mut stage = Stage::default();
        stage.layers_2d.push(panel(DVec2::ONE, Vec4::new(1.0, 0.0, 0.0, 1.0)));
        stage.layers_2d.push(panel(DVec2::new(0.5, 1.0), Vec4::new(0.0, 1.0, 0.0, 0.5)));
        let [under, over] = drawn(&stage, [8, 4]);
        assert!(under.is_none());
        let over = over.unwrap();
        assert_eq!(over.pixel(0, 0), Vec4::new(1.0, 0.0, 0.0, 1.0));
        assert_eq!(over.pixel(4, 2), Vec4::new(0.5, 0.5, 0.0, 1.0));
        // A frame below shows where it is see-through: half green over blue, in linear light.
        stage.layers_2d.remove(0);
        let mut frame = Frame { width: 8, height: 4, rgba: [0, 0, 255, 255].repeat(32) };
        drawn(&stage, [8, 4])[1].as_ref().unwrap().over(&mut frame);
        assert_eq!(frame.rgba[..4], [0, 0, 255, 255]);
        assert_eq!(frame.rgba[4 * 4..4 * 5], [0, 188, 188, 255]);
    }

    #[test]
    fn bars_leave_a_picture_of_their_ratio() {
        let mut stage = Stage::default();
        stage.layers_2d.push(Layer2d::new(Layer2dContent::Bars { ratio: 2.0, color: Vec4::W }));
        let layer_2d = drawn(&stage, [80, 60])[1].clone().unwrap();
        let dark = (0..60).filter(|y| layer_2d.pixel(40, *y).w > 0.5).count();
        assert_eq!(dark, 20, "80 wide, 2 to 1: 40 high");
        // Already of that ratio: nothing to draw.
        assert!(drawn(&stage, [80, 40])[1].is_none());
    }
}
