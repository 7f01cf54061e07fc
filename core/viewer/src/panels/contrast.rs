//! Tests the contrast of both themes: WCAG 2.2 requires 4.5 to 1 for text (1.4.3) and 3 to 1 for controls and their states (1.4.11).

use super::bars::{
    DISABLED_OPACITY, ERROR_BAR_COLOR, WARNING_BAR_COLOR, disabled_text_color, outline_colors,
};
use super::sequencer::{BAR_COLORS, bar_color};
use super::set_colors;
use egui::{Color32, Theme, Visuals};

/// Relative luminance, WCAG 2.2.
fn luminance(color: Color32) -> f64 {
    let linear = |c: u8| {
        let c = f64::from(c) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
    };
    0.2126 * linear(color.r()) + 0.7152 * linear(color.g()) + 0.0722 * linear(color.b())
}

fn contrast_ratio(a: Color32, b: Color32) -> f64 {
    let (a, b) = (luminance(a), luminance(b));
    (a.max(b) + 0.05) / (a.min(b) + 0.05)
}

/// Text colors and their backgrounds.
fn text_colors(visuals: &Visuals) -> Vec<(&'static str, Color32, Color32)> {
    let widgets = &visuals.widgets;
    let mut pairs = vec![
        ("strong text", visuals.strong_text_color(), visuals.panel_fill),
        ("a selected entry", visuals.selection.stroke.color, visuals.selection.bg_fill),
        ("a button", widgets.inactive.fg_stroke.color, widgets.inactive.weak_bg_fill),
        ("a button under the mouse", widgets.hovered.fg_stroke.color, widgets.hovered.weak_bg_fill),
        ("a button that is pressed", widgets.active.fg_stroke.color, widgets.active.weak_bg_fill),
        ("an open menu", widgets.open.fg_stroke.color, widgets.open.weak_bg_fill),
    ];
    let grounds = [visuals.panel_fill, visuals.window_fill, visuals.extreme_bg_color, visuals.faint_bg_color];
    for ground in grounds.into_iter().filter(Color32::is_opaque) {
        pairs.extend([
            ("text", visuals.text_color(), ground),
            ("weak text", visuals.weak_text_color(), ground),
            ("an error", visuals.error_fg_color, ground),
            ("a warning", visuals.warn_fg_color, ground),
            ("a link", visuals.hyperlink_color, ground),
            ("text of a button without a frame", widgets.inactive.fg_stroke.color, ground),
        ]);
    }
    let style = egui_dock::Style::from_egui(&egui::Style { visuals: visuals.clone(), ..Default::default() });
    let tab = &style.tab;
    for (name, one) in [
        ("the tab in front", &tab.active),
        ("a tab behind", &tab.inactive),
        ("a tab under the mouse", &tab.hovered),
        ("the tab with the keyboard", &tab.focused),
    ] {
        pairs.push((name, one.text_color, one.bg_fill));
    }
    pairs
}

#[test]
fn both_themes_meet_wcag_aa_contrast() {
    // Ground truth: the examples of the standard.
    assert!((contrast_ratio(Color32::BLACK, Color32::WHITE) - 21.0).abs() < 1e-9);
    assert!((contrast_ratio(Color32::from_rgb(0x77, 0x77, 0x77), Color32::WHITE) - 4.48).abs() < 0.005);
    let context = egui::Context::default();
    let mut faults = Vec::new();
    for (theme, light) in [(Theme::Dark, false), (Theme::Light, true)] {
        set_colors(&context, light);
        let visuals = context.style_of(theme).visuals.clone();
        for (name, text, ground) in text_colors(&visuals) {
            let ratio = contrast_ratio(text, ground);
            if ratio < 4.5 {
                faults.push(format!("{theme:?}: {name}: {ratio:.2}, {text:?} on {ground:?}"));
            }
        }
        // Edges that make controls visible: the frame of a field, the mark of a checkbox.
        for (name, edge) in [
            ("the mark of a checkbox", visuals.widgets.inactive.fg_stroke.color),
            ("the outline of the keyboard's place", visuals.selection.stroke.color),
        ] {
            let ratio = contrast_ratio(edge, visuals.panel_fill);
            if ratio < 3.0 {
                faults.push(format!("{theme:?}: {name}: {ratio:.2}"));
            }
        }
    }
    // Names of bars are white; those of disabled bars are drawn on the panel, two thirds of which show through.
    let bars = (0..2 * BAR_COLORS.len()).map(bar_color);
    for ground in bars.chain([ERROR_BAR_COLOR, WARNING_BAR_COLOR]) {
        let ratio = contrast_ratio(Color32::WHITE, ground);
        if ratio < 4.5 {
            faults.push(format!("a bar: {ratio:.2}, white on {ground:?}"));
        }
        for theme in [Theme::Dark, Theme::Light] {
            let visuals = context.style_of(theme).visuals.clone();
            let ground = visuals.panel_fill.blend(ground.gamma_multiply(DISABLED_OPACITY));
            let ratio = contrast_ratio(disabled_text_color(&visuals), ground);
            if ratio < 4.5 {
                faults.push(format!("{theme:?}: a bar that is off: {ratio:.2}, on {ground:?}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Outlines on the timeline: of a selected bar, of a dragged bar, and of the rest of a clip that is cut short.
#[test]
fn outlines_stand_out_from_bars_and_rows() {
    let context = egui::Context::default();
    let mut faults = Vec::new();
    for (theme, light) in [(Theme::Dark, false), (Theme::Light, true)] {
        set_colors(&context, light);
        let visuals = context.style_of(theme).visuals.clone();
        let rows = [visuals.panel_fill, visuals.panel_fill.blend(visuals.faint_bg_color)];
        let bars: Vec<Color32> =
            (0..2 * BAR_COLORS.len()).map(bar_color).chain([ERROR_BAR_COLOR, WARNING_BAR_COLOR]).collect();
        let disabled_bars = bars.iter().map(|bar| rows[0].blend(bar.gamma_multiply(DISABLED_OPACITY)));
        let [outer, inner] = outline_colors(&visuals);
        for row in rows {
            let ratio = contrast_ratio(outer, row);
            if ratio < 3.0 {
                faults.push(format!("{theme:?}: an outline: {ratio:.2}, {outer:?} on {row:?}"));
            }
        }
        for bar in bars.iter().copied().chain(disabled_bars) {
            let ratio = contrast_ratio(inner, bar).max(contrast_ratio(outer, bar));
            if ratio < 3.0 {
                faults.push(format!("{theme:?}: an outline: {ratio:.2} on the bar {bar:?}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
