//! Layout of the panels as JSON: a tree of splits, `{"below": 0.66, "first": …, "second": …}`, and leaves, `{"tabs": ["Viewport"], "active": 0}`.
//! Floating panels are restored in a leaf of the main window.

use super::Tab;
use egui_dock::{DockState, Node, NodeIndex, Split, TabIndex, Tree};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Deepest nesting of splits that is accepted.
const MAX_DEPTH: usize = 12;

/// Fractions of splits chosen by the user. The dock clamps its own fractions in a small window and does not restore them.
#[derive(Default)]
pub(crate) struct SplitFractions {
    /// Fraction of each node of the main surface; `None` for leaves.
    chosen: Vec<Option<f32>>,
    /// Size of the window, points.
    size: egui::Vec2,
}

impl SplitFractions {
    pub(super) fn of(dock: &DockState<Tab>) -> Vec<Option<f32>> {
        let fraction = |node: &Node<Tab>| match node {
            Node::Vertical(split) | Node::Horizontal(split) => Some(split.fraction),
            Node::Leaf(_) | Node::Empty => None,
        };
        dock.main_surface().iter().map(fraction).collect()
    }

    /// Restores the chosen fractions if the size of the window has changed since the last frame.
    pub(super) fn restore(&mut self, dock: &mut DockState<Tab>, size: egui::Vec2) {
        if size != self.size {
            self.size = size;
            self.apply_to(dock);
        }
    }

    fn apply_to(&self, dock: &mut DockState<Tab>) {
        for (node, chosen) in dock.main_surface_mut().iter_mut().zip(&self.chosen) {
            if let (Node::Vertical(split) | Node::Horizontal(split), Some(chosen)) = (node, chosen) {
                split.fraction = *chosen;
            }
        }
    }

    /// Records fractions that the user has changed in a frame. `before`: fractions before the frame; `has_input`: whether a button or key is down.
    pub(super) fn record_changes(&mut self, dock: &DockState<Tab>, before: &[Option<f32>], has_input: bool) {
        let now = SplitFractions::of(dock);
        let same_nodes = self.chosen.len() == now.len()
            && self.chosen.iter().zip(&now).all(|(chosen, now)| chosen.is_some() == now.is_some());
        if !same_nodes {
            self.chosen = now;
        } else if has_input {
            for ((chosen, before), now) in self.chosen.iter_mut().zip(before).zip(now) {
                if *before != now {
                    *chosen = now;
                }
            }
        }
    }

    /// JSON of the dock's layout with the chosen fractions.
    pub(super) fn to_json(&self, dock: &DockState<Tab>) -> Value {
        let mut written = dock.clone();
        self.apply_to(&mut written);
        layout_json(&written)
    }
}

fn layout_json(dock: &DockState<Tab>) -> Value {
    let mut layout = node_json(dock.main_surface(), NodeIndex::root());
    let windows =
        dock.iter_all_tabs().filter(|(path, _)| !path.surface.is_main()).map(|(_, tab)| tab.title());
    let floating: Vec<&str> = windows.collect();
    if layout.is_null() {
        layout = json!({ "tabs": [] });
    }
    layout["floating"] = json!(floating);
    layout
}

fn node_json(tree: &Tree<Tab>, at: NodeIndex) -> Value {
    let split_json = |direction: &str, fraction: f32| json!({ direction: (f64::from(fraction) * 1e4).round() / 1e4, "first": node_json(tree, at.left()), "second": node_json(tree, at.right()) });
    match tree.iter().nth(at.0) {
        Some(Node::Leaf(leaf)) => {
            let titles: Vec<&str> = leaf.tabs.iter().map(|t| t.title()).collect();
            json!({ "tabs": titles, "active": leaf.active.0 })
        }
        Some(Node::Vertical(split)) => split_json("below", split.fraction),
        Some(Node::Horizontal(split)) => split_json("right", split.fraction),
        Some(Node::Empty) | None => Value::Null,
    }
}

/// Parses a layout. `None` if it is invalid.
pub(super) fn parse_layout(layout: &Value) -> Option<DockState<Tab>> {
    let mut seen = BTreeSet::new();
    let first = parse_tabs(first_leaf(layout, 0)?, &mut BTreeSet::new())?;
    let mut dock = DockState::new(first);
    build_tree(dock.main_surface_mut(), NodeIndex::root(), layout, &mut seen, 0)?;
    for tab in layout["floating"].as_array().into_iter().flatten().filter_map(tab) {
        if seen.insert(tab.title()) {
            dock.push_to_first_leaf(tab);
        }
    }
    Some(dock)
}

fn tab(title: &Value) -> Option<Tab> {
    let title = title.as_str()?;
    Tab::ALL.into_iter().find(|t| t.title() == title)
}

/// Panels of a leaf, each only once in the layout.
fn parse_tabs(leaf: &Value, seen: &mut BTreeSet<&'static str>) -> Option<Vec<Tab>> {
    let all: Vec<Tab> =
        leaf["tabs"].as_array()?.iter().filter_map(tab).filter(|t| seen.insert(t.title())).collect();
    (!all.is_empty()).then_some(all)
}

fn first_leaf(layout: &Value, depth: usize) -> Option<&Value> {
    if depth > MAX_DEPTH {
        return None;
    }
    match layout.get("first") {
        Some(first) => first_leaf(first, depth + 1),
        None => Some(layout),
    }
}

/// Builds the part of the tree at `at`, which already holds the first leaf of that part.
fn build_tree(
    tree: &mut Tree<Tab>,
    at: NodeIndex,
    layout: &Value,
    seen: &mut BTreeSet<&'static str>,
    depth: usize,
) -> Option<()> {
    if depth > MAX_DEPTH {
        return None;
    }
    for (direction, split) in [("below", Split::Below), ("right", Split::Right)] {
        let Some(fraction) = layout.get(direction).and_then(Value::as_f64) else { continue };
        if !(0.01..=0.99).contains(&fraction) {
            return None;
        }
        // The first leaf of the second part is read here for the split, and again when that part is built.
        let second = parse_tabs(first_leaf(&layout["second"], depth)?, &mut BTreeSet::new())?;
        let [old, new] = tree.split(at, split, fraction as f32, Node::leaf_with(second));
        build_tree(tree, old, &layout["first"], seen, depth + 1)?;
        return build_tree(tree, new, &layout["second"], seen, depth + 1);
    }
    let all = parse_tabs(layout, seen)?;
    let active = (layout["active"].as_u64().unwrap_or(0) as usize).min(all.len() - 1);
    let leaf = tree.leaf_mut(at).ok()?;
    leaf.tabs = all;
    leaf.active = TabIndex(active);
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::panels::Panels;

    #[test]
    fn a_written_layout_is_read_back_unchanged() {
        let mut panels = Panels::default();
        panels.set_open(Tab::Explain, false);
        panels.set_open(Tab::Viewport(1), true);
        panels.bring_to_front(Tab::Messages);
        let written = layout_json(&panels.dock);
        let again = parse_layout(&written).unwrap();
        assert_eq!(layout_json(&again), written);
        assert!(again.find_tab(&Tab::Explain).is_none() && again.find_tab(&Tab::Viewport(1)).is_some());
        let place = again.find_tab(&Tab::Messages).unwrap();
        assert_eq!(again.leaf(place.node_path()).unwrap().active, place.tab);
    }

    /// A window made small and then large again has the sizes that the user chose, on the screen and in the settings.
    #[test]
    fn a_small_window_does_not_change_the_layout() {
        let mut panels = Panels::default();
        let mut viewer = crate::app::Viewer::new("x.rhai");
        let context = egui::Context::default();
        let mut shown_at = |panels: &mut Panels, width: f32| {
            for _ in 0..4 {
                let size = egui::vec2(width, 0.6 * width);
                let input = egui::RawInput {
                    screen_rect: Some(egui::Rect::from_min_size(egui::Pos2::ZERO, size)),
                    ..Default::default()
                };
                let mut output = context.run_ui(input, |ui| panels.show(ui, &mut viewer, &[], 0.0));
                output.textures_delta.clear();
            }
            SplitFractions::of(&panels.dock)
        };
        let large = shown_at(&mut panels, 1600.0);
        let kept = panels.settings();
        assert_ne!(shown_at(&mut panels, 420.0), large, "panels keep their least size");
        assert_eq!(panels.settings(), kept);
        assert_eq!(shown_at(&mut panels, 1600.0), large);
    }

    #[test]
    fn an_invalid_layout_is_rejected() {
        let leaf = json!({ "tabs": ["Viewport"] });
        let nested = (0..40).fold(
            leaf.clone(),
            |inner, _| json!({ "right": 0.5, "first": inner, "second": { "tabs": ["Script"] } }),
        );
        for bad in [
            json!({}),
            json!({ "tabs": [] }),
            json!({ "tabs": ["Nothing"] }),
            json!({ "right": 7.0, "first": leaf, "second": leaf }),
            json!({ "right": 0.5, "first": leaf }),
            // The same panel occurs twice.
            json!({ "right": 0.5, "first": leaf, "second": leaf }),
            nested,
        ] {
            assert!(parse_layout(&bad).is_none(), "{bad}");
        }
        assert!(parse_layout(&leaf).is_some());
    }
}
