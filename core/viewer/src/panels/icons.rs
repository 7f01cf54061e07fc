//! Icons of buttons, from the Phosphor font. Each has a name for screen readers and tests, and a tooltip.

use super::hint::Hint;
use egui::{Button, FontDefinitions, Response, RichText, Ui, WidgetInfo, WidgetType};

egui_phosphor::subset! {
    #[allow(dead_code, reason = "the macro makes more than is used")]
    mod font {
        use regular::{
            ARROW_LINE_LEFT, ARROW_LINE_RIGHT, ARROW_UP, ARROWS_CLOCKWISE, ARROWS_OUT_CARDINAL, ARROWS_OUT_LINE_HORIZONTAL,
            CAMERA, CARET_DOWN, CARET_LEFT, CARET_RIGHT, CROSSHAIR, EYE, EYE_SLASH, FOLDER, FRAME_CORNERS, LOCK_SIMPLE,
            LOCK_SIMPLE_OPEN, MAGNET, PAUSE, PLAY, PLUS, REPEAT, RESIZE, SKIP_BACK, SKIP_FORWARD, SPEAKER_HIGH,
            SPEAKER_SLASH, STAR, TRASH, X,
        };
    }
}
pub(super) use font::regular::*;

/// Fonts of the window: those of egui, and the icons for characters that these lack.
pub(super) fn fonts() -> FontDefinitions {
    let mut fonts = FontDefinitions::default();
    font::regular::add_to_fonts(&mut fonts);
    fonts
}

/// A button within a line of text.
pub(super) fn small_button(ui: &mut Ui, icon: &str, name: &str, hint: &str) -> Response {
    set_name_and_hint(ui.small_button(icon), name, hint)
}

/// A small toggle button, which is faint while it is off.
pub(super) fn small_toggle_button(ui: &mut Ui, icon: &str, on: bool, name: &str, hint: &str) -> Response {
    let text = RichText::new(icon).size(12.0);
    let text = if on { text.strong() } else { text.weak() };
    let response = ui.add(Button::selectable(on, text).small()).hint(hint);
    response.widget_info(|| WidgetInfo::selected(WidgetType::Checkbox, true, on, name));
    response
}

fn set_name_and_hint(response: Response, name: &str, hint: &str) -> Response {
    let enabled = response.enabled();
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, enabled, name));
    response.hint(name_and_hint(name, hint))
}

/// Name and hint in one line.
pub(super) fn name_and_hint(name: &str, hint: &str) -> String {
    if hint.is_empty() { name.to_string() } else { format!("{name}: {hint}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_icon_has_a_glyph_and_text_glyphs_are_unchanged() {
        // The icon font comes after a single text font, since egui ignores glyphs of the font that its replacement glyph comes from.
        // Other fonts of egui have glyphs at some of the icons' code points.
        let mut text_and_icons = fonts();
        let is_kept = |name: &String| name == "Ubuntu-Light" || name == font::regular::FONT_NAME;
        text_and_icons.families.values_mut().for_each(|names| names.retain(is_kept));
        let context = egui::Context::default();
        context.set_fonts(text_and_icons);
        let mut ran = 0;
        let mut output = context.run_ui(egui::RawInput::default(), |ui| {
            let font = egui::FontId::proportional(14.0);
            let icons = [
                ARROW_LINE_LEFT,
                ARROW_LINE_RIGHT,
                ARROW_UP,
                ARROWS_CLOCKWISE,
                ARROWS_OUT_CARDINAL,
                ARROWS_OUT_LINE_HORIZONTAL,
                CAMERA,
                CARET_DOWN,
                CARET_LEFT,
                CARET_RIGHT,
                CROSSHAIR,
                EYE,
                EYE_SLASH,
                FOLDER,
                FRAME_CORNERS,
                LOCK_SIMPLE,
                LOCK_SIMPLE_OPEN,
                MAGNET,
                PAUSE,
                PLAY,
                PLUS,
                REPEAT,
                RESIZE,
                SKIP_BACK,
                SKIP_FORWARD,
                SPEAKER_HIGH,
                SPEAKER_SLASH,
                STAR,
                TRASH,
                X,
            ];
            ui.fonts_mut(|fonts| {
                for icon in icons {
                    assert!(fonts.has_glyphs(&font, icon), "{icon:?}");
                }
                assert!(
                    !fonts.has_glyphs(&font, egui_phosphor::regular::GHOST),
                    "an icon that is not embedded"
                );
            });
            ran += 1;
        });
        output.textures_delta.clear();
        context.set_fonts(fonts());
        let mut output = context.run_ui(egui::RawInput::default(), |ui| {
            let font = egui::FontId::proportional(14.0);
            ui.fonts_mut(|fonts| ('a'..='z').for_each(|c| assert!(fonts.glyph_width(&font, c) > 1.0, "{c}")));
            ran += 1;
        });
        output.textures_delta.clear();
        assert!(ran >= 2);
    }
}
