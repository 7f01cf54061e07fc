//! Panel layouts for different tasks.

use super::Tab;
use egui_dock::{DockState, NodeIndex};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Preset {
    /// The initial layout.
    General,
    Scripting,
    Animating,
    Lighting,
    Testing,
}

impl Preset {
    pub(super) const ALL: [Preset; 5] =
        [Preset::General, Preset::Scripting, Preset::Animating, Preset::Lighting, Preset::Testing];

    pub(super) fn name(self) -> &'static str {
        match self {
            Preset::General => "Default",
            Preset::Scripting => "Scripting",
            Preset::Animating => "Animating",
            Preset::Lighting => "Lighting",
            Preset::Testing => "Testing",
        }
    }

    pub(crate) fn dock(self) -> DockState<Tab> {
        use Tab::{
            Assets, Curves, Explain, Inspector, Messages, Performance, Render, Script, Sequencer, Tests,
            Tree, Viewport,
        };
        let root = NodeIndex::root();
        let mut dock = DockState::new(vec![Viewport(0)]);
        let surface = dock.main_surface_mut();
        match self {
            Preset::General => {
                let below = vec![Sequencer, Curves, Messages, Explain, Performance];
                let [above, _] = surface.split_below(root, 0.66, below);
                let [middle, _] = surface.split_right(above, 0.72, vec![Inspector, Script, Render, Tests]);
                surface.split_left(middle, 0.2, vec![Tree, Assets]);
            }
            // The script next to the image, with messages below the script.
            Preset::Scripting => {
                let [image, text] = surface.split_right(root, 0.5, vec![Script]);
                surface.split_below(text, 0.72, vec![Messages, Explain, Performance]);
                surface.split_below(image, 0.7, vec![Sequencer]);
            }
            // The timeline and its curves take half of the window.
            Preset::Animating => {
                let [above, below] = surface.split_below(root, 0.5, vec![Sequencer]);
                surface.split_below(below, 0.5, vec![Curves]);
                surface.split_right(above, 0.72, vec![Inspector, Tree]);
            }
            // A second viewport to inspect the lights, next to the image of the camera.
            Preset::Lighting => {
                let [above, _] = surface.split_below(root, 0.8, vec![Sequencer]);
                let [image, _] = surface.split_right(above, 0.74, vec![Inspector]);
                let [image, _] = surface.split_left(image, 0.2, vec![Tree]);
                let _ = surface.split_right(image, 0.5, vec![Viewport(1)]);
            }
            Preset::Testing => {
                let [image, _] = surface.split_right(root, 0.45, vec![Tests, Render]);
                surface.split_below(image, 0.5, vec![Script, Messages]);
            }
        }
        dock
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_preset_shows_an_image_and_no_panel_twice() {
        for preset in Preset::ALL {
            let dock = preset.dock();
            let titles: Vec<&str> = dock.iter_all_tabs().map(|(_, tab)| tab.title()).collect();
            assert!(titles.contains(&"Viewport"), "{titles:?}");
            assert_eq!(titles.iter().collect::<BTreeSet<_>>().len(), titles.len(), "{titles:?}");
        }
    }
}
