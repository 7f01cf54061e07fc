//! Markers of the sequencer besides bars: keys, entrances and exits, events of actors, named times of clips, foot contacts; problems until
//! they are resolved.

use crate::place::{Desk, Place};
use choreo_motion::Time;
use choreo_viewer::state::events::EventKind;
use choreo_viewer::state::selection::Selected;
use choreo_viewer::state::timeline::Timeline;
use egui::{Key, Modifiers, pos2, vec2};
use egui_kittest::kittest::{NodeT, Queryable};

const SCRIPT: &str = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
let moves = load("choreo:mannequin");
let walk = moves.clip("Walk").marker("heel", 0.2);
let ada = cast("ada", moves);
ada.play(walk).from(0.5).until(2.0);
ada.key("position", [[0.0, [0, 0, 0]], [1.0, [0.5, 0, 0]], [3.0, [1, 0, 0]]]);
ada.look_at([0.0, 1.5, 5.0]).from(1.0).until(2.5);
let bob = cast("bob", moves).at(1.0, 0.0, 0.0).key("visible", [[0.0, true], [1.5, false], [3.0, true]]);
camera("wide").at(0.0, 1.0, 4.0).look_at([0.0, 1.0, 0.0]);
text("Hello there").from(0.8).until(3.2);
marker("turn", 2.2);
"##;

fn harness_with_script() -> Desk {
    Place::new(SCRIPT).harness(vec2(1500.0, 1000.0))
}

fn row<'a>(timeline: &'a Timeline, label: &str) -> &'a choreo_viewer::state::timeline::Row {
    timeline.rows.iter().find(|row| row.label == label).unwrap_or_else(|| panic!("no row {label}"))
}

#[test]
fn rows_have_their_events_at_the_right_times() {
    let place = Place::new(SCRIPT);
    let timeline = &place.viewer.timeline;
    let events_of = |label: &str| -> Vec<(f64, EventKind, String)> {
        let events = &row(timeline, label).events;
        events.iter().map(|e| (e.at.as_secs(), e.kind, e.label.replace('\n', ", "))).collect()
    };
    // The walk is as long as its file states; the heel marker comes once per round.
    let round =
        place.viewer.scene.as_ref().unwrap().stage.actors[0].layers[0].cues[0].clip.duration.as_secs();
    let heels = (0..).map(|n| 0.5 + 0.2 + f64::from(n) * round).take_while(|t| *t < 2.0);
    let mut expected: Vec<(f64, EventKind, String)> =
        heels.map(|t| (t, EventKind::Marker, "heel of Walk".to_string())).collect();
    assert!(!expected.is_empty());
    expected.extend([
        (0.0, EventKind::Key, "position".into()),
        (1.0, EventKind::Constraint, "position, look begins".into()),
        (2.5, EventKind::Constraint, "look ends".into()),
        (3.0, EventKind::Key, "position".into()),
    ]);
    expected.sort_by(|a, b| a.0.total_cmp(&b.0));
    let found = events_of("ada");
    assert_eq!(found.len(), expected.len(), "{found:?} for {expected:?}");
    for (found, expected) in found.iter().zip(&expected) {
        assert!((found.0 - expected.0).abs() < 1e-6, "{found:?} for {expected:?}");
        assert_eq!((found.1, &found.2), (expected.1, &expected.2));
    }
    let entrance = |at, what: &str| (at, EventKind::Visibility, what.to_string());
    assert_eq!(events_of("bob"), [entrance(1.5, "goes"), entrance(3.0, "appears")]);
    let hello = "\u{201c}Hello there\u{201d}";
    let titles: Vec<(f64, f64, &str)> = row(timeline, "titles")
        .bars
        .iter()
        .map(|bar| (bar.start.as_secs(), bar.end.as_secs(), bar.label.as_str()))
        .collect();
    assert_eq!(titles, [(0.8, 3.2, hello)]);
}

#[test]
fn clicking_an_event_seeks_to_it_and_hovering_names_it() {
    let mut desk = harness_with_script();
    let at = desk.get_by_label("event position, look begins on ada").rect().center();
    desk.hover_at(at);
    desk.run_steps(40);
    desk.get_by_label_contains("look begins\n1.000 s\na.rhai:4");
    desk.get_by_label("event position, look begins on ada").click();
    desk.run();
    assert_eq!(desk.state().viewer.playhead.frame(), 25);
    assert_eq!(desk.state().viewer.selection, Some(Selected::Actor("ada".into())));
    // Previous and next of all ends of bars, events and markers.
    let mut frames = Vec::new();
    for key in [Key::ArrowDown, Key::ArrowDown, Key::ArrowUp, Key::ArrowUp, Key::ArrowUp] {
        desk.key_press_modifiers(Modifiers::NONE, key);
        desk.run();
        frames.push(desk.state().viewer.playhead.frame());
    }
    let viewer = &desk.state().viewer;
    let fps = viewer.playhead.fps();
    let all = viewer.timeline.rows.iter().flat_map(|row| {
        row.events.iter().map(|e| e.at).chain(row.bars.iter().flat_map(|bar| [bar.start, bar.draggable_end]))
    });
    let mut all: Vec<i64> = all
        .chain([Time::from_secs(2.2)])
        .map(|t| (t.as_secs() * fps.as_fps() + 1e-9).floor() as i64)
        .collect();
    all.sort_unstable();
    all.dedup();
    let here = all.iter().position(|f| *f == 25).unwrap();
    assert_eq!(frames, [1i64, 2, 1, 0, -1].map(|step| all[(here as i64 + step) as usize]), "{all:?}");
}

#[test]
fn the_foot_strip_shows_the_foot_contacts() {
    let mut desk = harness_with_script();
    let strip = desk.get_by_label("feet of ada").rect();
    // At some time of the walk a foot is on the ground.
    let down = (0..60).find_map(|step| {
        let x = strip.left() + strip.width() * (0.13 + 0.005 * step as f32);
        desk.hover_at(pos2(x, strip.center().y));
        desk.run_steps(40);
        let node = desk.query_all_by_label_contains("on the floor, ").next()?;
        let text = node.accesskit_node().label().or(node.accesskit_node().value())?;
        Some((x, text))
    });
    let (x, text) = down.unwrap();
    let first = text.lines().next().unwrap();
    let (name, times) = first.split_once(" on the floor, ").unwrap();
    assert!(name.contains("Foot") || name.contains("Toe"), "{text}");
    let times: Vec<f64> = times.split(" to ").map(|t| t.trim_end_matches(" s").parse().unwrap()).collect();
    let now = f64::from((x - strip.left()) / strip.width()) * 4.0;
    assert!(times[0] <= now && now <= times[1], "{text} at {now}");
    desk.drag_at(pos2(x, strip.center().y));
    desk.run();
    desk.drop_at(pos2(x, strip.center().y));
    desk.run();
    let frame = desk.state().viewer.playhead.frame();
    let starts: Vec<i64> = text
        .lines()
        .map(|l| l.split_once("floor, ").unwrap().1.split(' ').next().unwrap().parse::<f64>().unwrap())
        .map(|t| (t * 25.0 + 1e-6).floor() as i64)
        .collect();
    assert!(starts.contains(&frame), "{frame} of {starts:?}");
}

#[test]
fn problem_markers_stay_until_the_problem_is_fixed() {
    let mut desk = harness_with_script();
    let marked = |desk: &Desk| {
        let viewer = &desk.state().viewer;
        let rows = viewer.timeline.rows.iter().filter(|row| viewer.severity(&row.place).is_some());
        let bars = viewer.timeline.rows.iter().flat_map(|row| &row.bars);
        let bars = bars.filter(|bar| viewer.severity(&bar.place).is_some());
        (rows.map(|r| r.label.clone()).collect::<Vec<_>>(), bars.map(|b| b.label.clone()).collect::<Vec<_>>())
    };
    assert_eq!(marked(&desk), (vec![], vec![]));
    desk.state_mut().load_faulty(&SCRIPT.replace(".from(0.5).until(2.0)", ".from(0.5).untill(2.0)"));
    desk.run();
    assert_eq!(marked(&desk), (vec![], vec!["Walk".to_string()]));
    desk.state_mut().load_faulty(&SCRIPT.replace("cast(\"bob\", moves)", "cast(\"bob\", movs)"));
    desk.run();
    assert_eq!(marked(&desk), (vec!["bob".to_string()], vec![]));
    // All events of the last good version are still there.
    desk.get_by_label("event goes on bob");
    desk.state_mut().reload_with(SCRIPT);
    desk.run();
    assert_eq!(marked(&desk), (vec![], vec![]));
}

/// Buttons move into the menu before the ruler leaves the window, at twice the scale on a small screen.
#[test]
fn the_whole_ruler_is_visible_in_a_narrow_window() {
    let desk = Place::new(SCRIPT).harness(vec2(640.0, 600.0));
    let ruler = desk.get_by_label("time").rect();
    assert!(ruler.right() <= 640.0 && ruler.width() > 300.0, "{ruler:?}");
    let more: Vec<_> = desk.get_all_by_label("more").map(|node| node.rect().right()).collect();
    assert!(!more.is_empty() && more.iter().all(|right| *right <= 640.0), "{more:?}");
}

/// Effects that are active at once have separate rows with their own keys: dragging a key changes no other effect.
#[test]
fn keys_of_effects_are_in_the_rows_of_their_effects() {
    let script = r##"stage(#{ size: [64, 36], fps: 25, length: 4.0 });
effect("vignette").key("strength", [[0.0, 0.1], [2.0, 0.9]]);
effect("bloom").key("strength", [[1.0, 0.0], [2.0, 0.2]]);
"##;
    let place = Place::new(script);
    let rows = place.viewer.timeline.rows.iter().filter(|row| row.label.starts_with("effects"));
    let rows: Vec<(Vec<&str>, Vec<f64>)> = rows
        .map(|row| {
            let bars = row.bars.iter().map(|bar| bar.label.as_str()).collect();
            (bars, row.events.iter().map(|event| event.at.as_secs()).collect())
        })
        .collect();
    assert_eq!(rows, [(vec!["vignette"], vec![0.0, 2.0]), (vec!["bloom"], vec![1.0, 2.0])]);
    for row in place.viewer.timeline.rows.iter().filter(|row| row.label.starts_with("effects")) {
        let own = |key: &choreo_viewer::state::keyed::KeyRef| row.bars.iter().any(|bar| bar.what == key.what);
        assert!(row.events.iter().flat_map(|event| event.key_refs()).all(|key| own(&key)));
    }
}
