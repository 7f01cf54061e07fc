//! Thumbnails as textures.

use crate::app::Viewer;
use crate::library::thumbnails::{SIZE, Subject, Thumbnail, ThumbnailState};
use choreo_asset::Asset;
use egui::{
    Align2, Color32, ColorImage, Context, FontId, Painter, Rect, TextureHandle, TextureOptions, Ui, pos2,
};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Largest number of textures; beyond it all are freed and uploaded again.
const MAX_TEXTURES: usize = 256;

/// Textures with the images that they were made from.
#[derive(Default)]
pub(super) struct ThumbnailTextures(BTreeMap<Subject, (Arc<Thumbnail>, Vec<TextureHandle>)>);

impl ThumbnailTextures {
    /// Draws the thumbnail of a subject into a rectangle, and returns its state. Previews play continuously.
    pub(super) fn show(
        &mut self,
        ui: &Ui,
        viewer: &mut Viewer,
        subject: &Subject,
        asset: Option<&Arc<Asset>>,
        place: Rect,
    ) -> ThumbnailState {
        let made = viewer.documents.thumbnails.get(subject, asset, || repaint_request(ui.ctx()));
        let painter = ui.painter_at(place);
        painter.rect_filled(place, 3.0, ui.visuals().extreme_bg_color);
        match &made {
            ThumbnailState::Waiting => draw_placeholder(&painter, place, "…", ui.visuals().weak_text_color()),
            ThumbnailState::Failed(_) => {
                draw_placeholder(&painter, place, "no image", ui.visuals().weak_text_color())
            }
            ThumbnailState::Ready(thumbnail) => {
                let number = shown_frame(ui, thumbnail);
                if let Some(texture) = self.textures(ui.ctx(), subject, thumbnail).get(number) {
                    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                    painter.image(texture.id(), place, whole, Color32::WHITE);
                }
            }
        }
        made
    }

    fn textures(&mut self, context: &Context, subject: &Subject, made: &Arc<Thumbnail>) -> &[TextureHandle] {
        let is_same = self.0.get(subject).is_some_and(|(of, _)| Arc::ptr_eq(of, made));
        if !is_same {
            if self.0.len() >= MAX_TEXTURES {
                self.0.clear();
            }
            let upload = |frame: &choreo_plugin::Frame| {
                let size = [frame.width as usize, frame.height as usize];
                // The window shows transparent pixels as opaque.
                let opaque: Vec<u8> =
                    frame.rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
                let image = ColorImage::from_rgba_unmultiplied(size, &opaque);
                context.load_texture("thumbnail", image, TextureOptions::LINEAR)
            };
            let textures = made.frames.iter().map(upload).collect();
            self.0.insert(subject.clone(), (made.clone(), textures));
        }
        self.0.get(subject).map(|(_, textures)| textures.as_slice()).unwrap_or_default()
    }
}

/// Height of a thumbnail with a given width.
pub(super) fn thumbnail_height(width: f32) -> f32 {
    (width * SIZE[1] as f32 / SIZE[0] as f32).round()
}

fn repaint_request(context: &Context) -> Box<dyn Fn() + Send> {
    let context = context.clone();
    Box::new(move || context.request_repaint())
}

fn draw_placeholder(painter: &Painter, place: Rect, text: &str, color: Color32) {
    painter.text(place.center(), Align2::CENTER_CENTER, text, FontId::proportional(12.0), color);
}

/// Index of the image of a preview that is due now.
fn shown_frame(ui: &Ui, thumbnail: &Thumbnail) -> usize {
    let count = thumbnail.frames.len();
    if count < 2 {
        return 0;
    }
    let frame_secs = thumbnail.secs / count as f64;
    let now = ui.input(|i| i.time);
    ui.ctx().request_repaint_after(std::time::Duration::from_secs_f64(frame_secs.clamp(0.02, 1.0)));
    ((now / frame_secs) as usize) % count
}
