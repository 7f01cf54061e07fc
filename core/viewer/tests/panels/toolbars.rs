//! Toolbars in windows of several widths: one line each; entries without room are in the menu at its end.

use crate::place::Place;
use crate::place::mouse::Mouse;
use choreo_viewer::state::view::ViewCamera;
use egui::{Rect, Vec2, vec2};
use egui_kittest::kittest::{NodeT, Queryable};

const SCRIPT: &str = r#"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let ada = cast("ada", load("choreo:mannequin"));
ada.play(load("choreo:mannequin").clip("Walk"));
let ball = cast("ball", shape("sphere")).key("position", [[0.0, [0.0, 1.0, 0.0]], [2.0, [1.0, 1.0, 0.0]]]);
camera("wide").at(0.0, 1.0, 5.0).look_at([0.0, 1.0, 0.0]);
camera("near").at(0.0, 1.0, 3.0).look_at([0.0, 1.0, 0.0]).cut(2.0);
"#;

/// Entries of each toolbar; the first one fits at any width.
const TOOLBARS: [(&str, &[&str]); 4] = [
    ("top", &["File", "Edit", "Add", "Panels", "Appearance", "Shortcuts"]),
    (
        "viewport",
        &["script's camera", "camera", "free camera", "follow", "View", "full size", "Show", "Save image"],
    ),
    (
        "timeline",
        &[
            "First frame",
            "One frame back",
            "Play",
            "One frame forward",
            "Last frame",
            "Loop",
            "Snap",
            "seconds",
            "Whole",
        ],
    ),
    ("curves", &["Fit", "Speed", "Normalize", "Set key"]),
];

/// The viewport and the timeline one above the other, each as wide as the window; or the curve editor.
fn opened(width: f32, bottom: &str) -> Mouse {
    let mut place = Place::new(SCRIPT);
    let layout = serde_json::json!({
        "below": 0.5, "first": { "tabs": ["Viewport"] }, "second": { "tabs": [bottom] },
    });
    let settings = choreo_viewer::state::settings::Settings { layout: Some(layout), ..Default::default() };
    place.panels = choreo_viewer::panels::Panels::new(&settings);
    place.viewer.selection = Some(choreo_viewer::state::selection::Selected::Actor("ball".into()));
    let mut mouse = Mouse::new(place, vec2(width, 600.0));
    // The width of widgets that are not texts is known from the previous frame.
    mouse.desk.run();
    mouse
}

/// Rectangles of the widgets of this name that lie within the window.
fn places(mouse: &Mouse, name: &str, size: Vec2) -> Vec<Rect> {
    let window = Rect::from_min_size(egui::Pos2::ZERO, size);
    let named = mouse.desk.query_all_by_label(name).filter(|node| {
        // Tabs and rows can have the names of entries, too.
        let role = node.accesskit_node().role();
        !matches!(role, egui::accesskit::Role::Label | egui::accesskit::Role::Unknown)
    });
    named.map(|node| node.rect()).filter(|rect| window.contains_rect(*rect)).collect()
}

#[test]
fn each_toolbar_has_one_line_at_any_width() {
    for width in [300.0, 500.0, 800.0, 1600.0] {
        for bottom in ["Sequencer", "Curves"] {
            let mut mouse = opened(width, bottom);
            let size = vec2(width, 600.0);
            mouse.picture(&format!("toolbars_{width}_{bottom}"));
            let mores = places(&mouse, "more", size);
            let shown = TOOLBARS.iter().filter(|(name, _)| match *name {
                "timeline" => bottom == "Sequencer",
                "curves" => bottom == "Curves",
                _ => true,
            });
            for (name, entries) in shown {
                let found: Vec<(&str, Rect)> = entries
                    .iter()
                    .flat_map(|e| places(&mouse, e, size).into_iter().map(move |r| (*e, r)))
                    .collect();
                let line =
                    found.first().unwrap_or_else(|| panic!("{name} at {width}: {:#?}", mouse.labels())).1;
                for (entry, rect) in &found {
                    let off = (rect.center().y - line.center().y).abs();
                    assert!(off < 8.0, "{entry} of {name} at {width}: {rect:?} beside {line:?}");
                }
                let has_more = mores.iter().any(|more| (more.center().y - line.center().y).abs() < 8.0);
                let is_whole = found.len() >= entries.len();
                assert!(is_whole || has_more, "{name} at {width}: {found:?}, {mores:?}");
                match width {
                    300.0 => assert!(has_more, "{name}: {found:?}"),
                    1600.0 => assert!(is_whole && !has_more, "{name}: {found:?}, {mores:?}"),
                    _ => {}
                }
            }
        }
    }
}

/// Opens the overflow menu of the toolbar that contains an entry.
fn open_more(mouse: &mut Mouse, beside: &str) {
    let line = mouse.find(beside).center().y;
    let mores: Vec<Rect> = mouse.desk.get_all_by_label("more").map(|node| node.rect()).collect();
    let more =
        mores.into_iter().find(|more| (more.center().y - line).abs() < 8.0).expect("a menu in this line");
    mouse.click_at(more.center());
}

#[test]
fn buttons_without_room_work_from_the_overflow_menu() {
    let mut mouse = opened(300.0, "Sequencer");
    // A button, which closes the menu.
    assert!(mouse.desk.state().viewer.in_seconds);
    open_more(&mut mouse, "First frame");
    mouse.picture("toolbars_more_timeline");
    mouse.click("seconds");
    assert!(!mouse.desk.state().viewer.in_seconds);
    assert!(mouse.desk.query_by_label("Next event").is_none(), "the menu is closed");
    // A field that is typed into.
    open_more(&mut mouse, "First frame");
    mouse.type_into("time of the playhead", "2");
    assert_eq!(mouse.desk.state().viewer.playhead.frame(), 50);
    mouse.desk.key_press(egui::Key::Escape);
    mouse.desk.run();
    // A toggle shows its state.
    open_more(&mut mouse, "script's camera");
    let is_on = |mouse: &Mouse, name: &str| {
        mouse.desk.get_by_label(name).accesskit_node().toggled() == Some(egui::accesskit::Toggled::True)
    };
    assert!(is_on(&mouse, "Move") && !is_on(&mouse, "Turn"));
    mouse.click("Turn");
    open_more(&mut mouse, "script's camera");
    mouse.picture("toolbars_more_viewport");
    assert!(is_on(&mouse, "Turn"));
    // A submenu.
    let grid = mouse.desk.state().viewer.views[0].overlays.grid;
    mouse.menu(&["Show", "Grid"]);
    assert_ne!(mouse.desk.state().viewer.views[0].overlays.grid, grid);
    // The menus of the window.
    open_more(&mut mouse, "File");
    mouse.menu(&["Appearance", "Light"]);
    assert!(mouse.desk.state().panels.light);
}

/// Entries keep their places, so that a repeated click meets the same entry.
#[test]
fn viewport_toolbar_entries_keep_their_places() {
    const ENTRIES: [&str; 6] =
        ["free camera", "into the script", "follow", "full size", "Show", "Save image"];
    let mut mouse = opened(1600.0, "Sequencer");
    let all = |mouse: &Mouse| ENTRIES.map(|entry| places(mouse, entry, vec2(1600.0, 600.0)));
    let before = all(&mouse);
    assert!(before.iter().all(|found| !found.is_empty()), "{before:?}");
    let view = |mouse: &Mouse| mouse.find("View").left();
    let left = view(&mouse);
    mouse.click("free camera");
    assert_eq!((all(&mouse), view(&mouse)), (before.clone(), left), "free");
    mouse.click("Top view");
    assert_eq!(all(&mouse), before, "from above");
    mouse.desk.state_mut().viewer.views[0].camera = ViewCamera::Named("near".into());
    mouse.look();
    assert_eq!((all(&mouse), view(&mouse)), (before, left), "a camera of the script");
}

/// A playback range, a tempo and the unit of times move no button.
#[test]
fn timeline_toolbar_entries_keep_their_places() {
    const ENTRIES: [&str; 9] = [
        "One frame forward",
        "Last frame",
        "Loop",
        "Snap",
        "beats a minute",
        "time of the playhead",
        "Previous event",
        "Next event",
        "Whole",
    ];
    for width in [1600.0, 900.0] {
        let mut mouse = opened(width, "Sequencer");
        let size = vec2(width, 600.0);
        let all = |mouse: &Mouse| ENTRIES.map(|entry| places(mouse, entry, size));
        let before = all(&mouse);
        let first = places(&mouse, "first beat", size);
        assert!(width < 1000.0 || before.iter().all(|found| !found.is_empty()), "{before:?}");
        mouse.click("seconds");
        assert_eq!(all(&mouse), before, "times as frames, {width}");
        let seek = |mouse: &mut Mouse, secs: f64| {
            mouse.desk.state_mut().viewer.playhead.seek(choreo_motion::Time::from_secs(secs));
            mouse.desk.run();
        };
        for (secs, key) in [(1.0, egui::Key::I), (2.0, egui::Key::O)] {
            seek(&mut mouse, secs);
            mouse.desk.key_press(key);
            mouse.desk.run();
        }
        seek(&mut mouse, 0.0);
        assert_eq!(places(&mouse, "1.00 to 2.04 s", size).len(), 1, "the part that is played, {width}");
        assert_eq!(all(&mouse), before, "a part that is played, {width}");
        mouse.desk.state_mut().viewer.tempo.beats_per_minute = 90.0;
        mouse.desk.run();
        assert_eq!((all(&mouse), places(&mouse, "first beat", size)), (before, first), "a tempo, {width}");
    }
}

#[test]
fn overlays_are_toggled_in_one_menu() {
    for width in [1600.0, 300.0] {
        let mut mouse = opened(width, "Sequencer");
        if width < 500.0 {
            open_more(&mut mouse, "script's camera");
        }
        let overlays = |mouse: &Mouse| mouse.desk.state().viewer.views[0].overlays;
        let before = overlays(&mouse);
        mouse.menu(&["Show", "Bounds", "Safe areas"]);
        assert_eq!(
            [overlays(&mouse).bounds, overlays(&mouse).safe_areas],
            [!before.bounds, !before.safe_areas]
        );
        mouse.click_at(egui::pos2(width - 20.0, 580.0));
        assert!(mouse.desk.query_by_label("Safe areas").is_none(), "a click beside it closes it");
    }
}

/// The menu shows the chosen speed; the script is unchanged.
#[test]
fn the_timeline_menu_sets_the_playback_speed() {
    let size = vec2(1600.0, 600.0);
    let mut mouse = opened(size.x, "Sequencer");
    mouse.menu(&["1×", "0.5×"]);
    let state = mouse.desk.state();
    assert_eq!((state.viewer.playhead.speed(), state.text().as_str()), (0.5, SCRIPT));
    assert_eq!(places(&mouse, "0.5×", size).len(), 1);
    mouse.menu(&["0.5×", "1×"]);
    assert_eq!(mouse.desk.state().viewer.playhead.speed(), 1.0);
}
