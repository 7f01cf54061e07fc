//! Coverage is compared with areas in closed form and with supersampling; layout with expected line breaks and positions.

use choreo_text::*;
use std::f64::consts::PI;

fn sum(c: &Coverage) -> f64 {
    (0..c.size[1]).flat_map(|y| c.row(y).collect::<Vec<_>>()).map(f64::from).sum()
}

#[test]
fn the_coverage_of_a_rectangle_sums_to_its_area_at_any_position() {
    for (low, high) in [([1.25, 2.5], [7.75, 3.25]), ([0.0, 0.0], [10.0, 10.0]), ([3.1, 3.2], [3.3, 3.4])] {
        let c = Coverage::rectangle(low, high, [10, 10]);
        let area = f64::from(high[0] - low[0]) * f64::from(high[1] - low[1]);
        assert!((sum(&c) - area).abs() < 1e-5, "{low:?} {high:?}: {} instead of {area}", sum(&c));
    }
    // Half outside on each side, and wholly.
    for (low, high, area) in [
        ([-5.0, -5.0], [5.0, 5.0], 25.0),
        ([5.0, 5.0], [15.0, 15.0], 25.0),
        ([-5.0, 2.0], [15.0, 4.0], 20.0),
        ([20.0, 20.0], [30.0, 30.0], 0.0),
    ] {
        let c = Coverage::rectangle(low, high, [10, 10]);
        assert!((sum(&c) - area).abs() < 1e-5, "{low:?} {high:?}: {}", sum(&c));
    }
    let c = Coverage::rectangle([1.25, 0.0], [2.5, 1.0], [4, 1]);
    let row: Vec<f32> = c.row(0).collect();
    assert_eq!(row, [0.75, 0.5]);
}

#[test]
fn the_coverage_of_a_rounded_rectangle_sums_to_its_area() {
    for radius in [0.0f32, 1.5, 4.0, 90.0] {
        let c = Coverage::rounded([1.25, 2.5], [21.75, 14.25], radius, [30, 20]);
        // As large as the shorter side allows.
        let r = f64::from(radius).min(11.75 / 2.0);
        let area = 20.5 * 11.75 - (4.0 - PI) * r * r;
        assert!((sum(&c) - area).abs() < 2e-3 * area, "{radius}: {} instead of {area}", sum(&c));
    }
}

/// Steiner's formula: what is within w of a convex shape of area A and circumference C has the area A + C w + π w².
#[test]
fn an_outline_has_the_area_of_the_dilated_shape() {
    let font = Font::built_in();
    let layout = lay_out_text(&font, ".", &style(200.0));
    let at = [40.5, 60.25];
    let ink = |w: f32| sum(&layout.outline_coverage(&font, at, 1.0, w, [400, 400]));
    let plain = sum(&layout.coverage(&font, at, 1.0, [400, 400]));
    let (once, twice) = (ink(10.0), ink(20.0));
    let expected = 2.0 * PI * 10.0 * 10.0;
    let got = twice - 2.0 * once + plain;
    assert!((got - expected).abs() < 0.01 * expected, "{got} instead of {expected}");
    // The outline covers the inside of the letters, too, and coverage is at most 1 where strokes cross.
    let layout = lay_out_text(&font, "Ж", &style(60.0));
    let all = layout.outline_coverage(&font, at, 1.0, 3.0, [400, 400]);
    let letter = layout.coverage(&font, at, 1.0, [400, 400]);
    for (y, row) in (0..letter.size[1]).map(|y| (y, letter.row(y))) {
        let [dx, dy] = [0, 1].map(|i| letter.at[i] - all.at[i]);
        let outer: Vec<f32> = all.row(y + dy).collect();
        for (x, own) in row.enumerate() {
            assert!(outer[x + dx as usize] + 1e-6 >= own && outer[x + dx as usize] <= 1.0);
        }
    }
}

/// Polygons of every slope: pixel by pixel against the share of 64 × 64 points inside.
#[test]
fn coverage_of_triangles_matches_supersampling() {
    let triangles = [
        [[1.3, 1.1], [14.6, 3.7], [4.2, 13.9]],
        [[0.5, 0.5], [15.5, 1.0], [15.0, 1.5]],
        [[-6.0, 4.0], [9.0, -7.0], [22.0, 19.0]],
    ];
    for t in triangles {
        let mut c = Coverage::new([0.0, 0.0], [16.0, 16.0], [16, 16]);
        (0..3).for_each(|i| c.add_edge(t[i], t[(i + 1) % 3]));
        let side = |a: [f32; 2], b: [f32; 2], x: f64, y: f64| {
            (f64::from(b[0]) - f64::from(a[0])) * (y - f64::from(a[1]))
                - (f64::from(b[1]) - f64::from(a[1])) * (x - f64::from(a[0]))
        };
        let inside = |x: f64, y: f64| {
            let s = [0, 1, 2].map(|i| side(t[i], t[(i + 1) % 3], x, y) > 0.0);
            s == [true; 3] || s == [false; 3]
        };
        for y in 0..16u32 {
            for (x, got) in c.row(y).enumerate() {
                let points = (0..64).flat_map(|j| (0..64).map(move |i| (i, j)));
                let hits = points.filter(|(i, j)| {
                    inside(
                        x as f64 + (f64::from(*i) + 0.5) / 64.0,
                        f64::from(y) + (f64::from(*j) + 0.5) / 64.0,
                    )
                });
                let share = hits.count() as f64 / 4096.0;
                assert!((f64::from(got) - share).abs() < 0.02, "{t:?} at {x}, {y}: {got} instead of {share}");
            }
        }
    }
}

fn style(size: f32) -> Style {
    Style { size, width: None, align: Align::Left, line_height: 1.25 }
}

#[test]
fn glyph_area_grows_with_the_square_of_the_font_size() {
    // Twice the size, four times the area.
    let font = Font::built_in();
    let area = |size: f32| {
        let layout = lay_out_text(&font, "•", &style(size));
        sum(&layout.coverage(&font, [10.0, 10.0], 1.0, [400, 400]))
    };
    let (small, large) = (area(60.0), area(120.0));
    assert!((large / small - 4.0).abs() < 0.01, "{small} {large}");
    assert!(small > PI, "{small}");
    // The same larger by its factor.
    let layout = lay_out_text(&font, "•", &style(60.0));
    assert!((sum(&layout.coverage(&font, [10.0, 10.0], 2.0, [400, 400])) - large).abs() < 0.02 * large);
}

#[test]
fn lines_wrap_between_words_and_are_aligned() {
    let font = Font::built_in();
    let wide = lay_out_text(&font, "one two three", &style(20.0));
    assert_eq!(wide.lines, 1);
    let narrow = Style { width: Some(wide.size[0] * 0.6), ..style(20.0) };
    let wrapped = lay_out_text(&font, "one two three", &narrow);
    assert_eq!(wrapped.lines, 2);
    assert!((wrapped.size[1] - wide.size[1] - 25.0).abs() < 1e-3);
    assert_eq!(lay_out_text(&font, "one\ntwo\n", &style(20.0)).lines, 3);
    // A word that does not fit stands alone.
    assert_eq!(lay_out_text(&font, "a bbbbbbbbbbbb c", &Style { width: Some(15.0), ..style(20.0) }).lines, 3);
    // Right: the last column of the box is touched, the first is not.
    let right = Style { width: Some(200.0), align: Align::Right, ..style(20.0) };
    let layout = lay_out_text(&font, "H", &right);
    let c = layout.coverage(&font, [0.0, 0.0], 1.0, [200, 40]);
    let inked: Vec<usize> = (0..c.size[1])
        .flat_map(|y| c.row(y).enumerate().filter(|(_, v)| *v > 0.5).map(|(x, _)| x).collect::<Vec<_>>())
        .collect();
    assert!(inked.iter().min().unwrap() > &180, "{inked:?}");
}

#[test]
fn pairs_are_kerned() {
    let font = Font::built_in();
    let width = |text: &str| lay_out_text(&font, text, &style(100.0)).size[0];
    assert!(width("AV") < width("A") + width("V") - 1.0, "{} {} {}", width("AV"), width("A"), width("V"));
    assert!((width("HH") - 2.0 * width("H")).abs() < 0.01);
}

#[test]
fn invalid_fonts_are_errors_and_unusual_texts_are_laid_out() {
    assert!(Font::new("x", &b"nothing"[..]).unwrap_err().0.contains("is not a font"));
    assert_eq!(Font::built_in().missing("a b\n漢a漢"), ['漢']);
    // Empty and strange texts.
    for text in ["", "\n\n", "\u{0}\u{7f}", "   "] {
        let layout = lay_out_text(&Font::built_in(), text, &style(20.0));
        assert!(layout.size.iter().all(|s| s.is_finite()));
        layout.coverage(&Font::built_in(), [f32::NAN, 1e30], 1.0, [10, 10]);
    }
}

#[test]
fn missing_characters_are_drawn_in_a_fallback_font() {
    let emoji = Font::new("emoji", epaint_default_fonts::NOTO_EMOJI_REGULAR).unwrap();
    assert_eq!(emoji.missing("😀Ж"), ['Ж']);
    let ink = |font: &Font, text: &str| {
        let layout = lay_out_text(font, text, &style(60.0));
        (sum(&layout.coverage(font, [10.0, 10.0], 1.0, [400, 400])), layout.size[0])
    };
    let [(alone, width), (own, own_width), (both, both_width)] =
        [ink(&Font::built_in(), "Ж"), ink(&emoji, "😀"), ink(&emoji, "😀Ж")];
    // Its ink is that of the font which has it, as wide as there.
    assert!(alone > 50.0 && (both - own - alone).abs() < 0.5, "{both} of {own} and {alone}");
    assert!((both_width - own_width - width).abs() < 1e-3, "{both_width} of {own_width} and {width}");
    // No font of the tests has it: the sign of the text's own font.
    let found = fallbacks(&['Ж', '\u{10fffd}']);
    assert_eq!(
        found[0].as_ref().map(|f| (f.font.name.as_str(), f.file.is_none())),
        Some(("Ubuntu Light", true))
    );
    assert_eq!(found[1], None);
    assert!(needs_shaping('ش') && needs_shaping('क') && !needs_shaping('漢') && !needs_shaping('Ж'));
}

#[test]
fn system_fonts_are_used_only_if_built_in_fonts_lack_a_character() {
    // A letter of Hebrew, which the built-in fonts lack and DejaVu Sans has.
    let file = std::path::Path::new("/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf");
    if !file.is_file() {
        return eprintln!("SKIP 1: no DejaVu Sans on this system");
    }
    let found = fallbacks(&['א', 'é']);
    let of = |index: usize| found[index].as_ref().map(|f: &Fallback| f.file.is_some());
    assert_eq!((of(0), of(1)), (Some(true), Some(false)), "{found:?}");
}
