//! Cuts between cameras. The next camera's cut is the end of a camera's bar; a camera with several cuts has several bars, its shots.

use super::{EditError, Step};
use crate::app::Viewer;
use crate::state::timeline::Bar;
use choreo_motion::Time;
use choreo_session::Scene;
use choreo_session::edit::set_call_time;

impl Viewer {
    /// The bar of the selection. If a camera has several, the clicked one, else the one at the playhead.
    ///
    /// # Errors
    /// The selected camera has several shots, none was clicked, and none is at the playhead.
    pub(crate) fn selected_bar(&self) -> Result<Option<Bar>, EditError> {
        let Some(what) = &self.selection else { return Ok(None) };
        let all: Vec<&Bar> = self.bars().filter(|bar| bar.what == *what).collect();
        let (Some(first), true) = (all.first(), all.len() > 1) else {
            return Ok(all.first().copied().cloned());
        };
        let now = self.playhead.time();
        let at_playhead = all.iter().copied().find(|bar| bar.start <= now && now < bar.end);
        let bar = self.selected_shot().or(at_playhead).ok_or_else(|| {
            let why = format!(
                "{} has several shots: click the bar of one, or move the playhead to it",
                first.label
            );
            EditError::refused_at(&first.place, &why)
        })?;
        Ok(Some(bar.clone()))
    }

    /// The bar that was clicked to select its camera, found in the present timeline.
    pub(crate) fn selected_shot(&self) -> Option<&Bar> {
        let shot =
            self.clicked_camera_bar.as_ref().filter(|shot| self.selection.as_ref() == Some(&shot.what))?;
        let all = || self.bars().filter(|bar| bar.what == shot.what);
        let is_there = |bar: &&Bar| bar.place == shot.place;
        let starts_at_same_time = |bar: &&Bar| bar.start == shot.start;
        // The position in the script identifies a moved bar, and the time one whose lines have moved.
        let same = all().find(|bar| is_there(bar) && starts_at_same_time(bar));
        same.or_else(|| all().find(is_there)).or_else(|| all().find(starts_at_same_time))
    }

    /// Whether a bar is selected. If one of several shots of a camera was clicked, only that one is.
    pub(crate) fn is_bar_selected(&self, bar: &Bar) -> bool {
        let is_this_or_other_camera = |shot: &Bar| shot.what != bar.what || shot == bar;
        self.is_selected(&bar.what) && self.selected_shot().is_none_or(is_this_or_other_camera)
    }

    /// Moves a cut. `index`: among the cuts of the stage.
    pub fn set_cut(&mut self, index: usize, secs: f64) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let step = self.cut_step(&scene, index, secs)?;
        self.apply_steps(vec![step])
    }

    /// Moves a cut, and all later cuts by the same time.
    pub fn ripple_cuts(&mut self, index: usize, secs: f64) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let cuts = &scene.stage.cuts;
        let first = cuts.get(index).ok_or(EditError::ObjectGone)?.at;
        let later = (0..cuts.len()).filter(|other| *other == index || cuts[*other].at > first);
        let by = secs - first.as_secs();
        let steps = later.map(|other| self.cut_step(&scene, other, cuts[other].at.as_secs() + by));
        let steps = steps.collect::<Result<_, _>>()?;
        self.apply_steps(steps)
    }

    /// Moves the end of a camera's bar, which is the next cut.
    pub(crate) fn set_camera_end(&mut self, bar: &Bar, secs: f64) -> Result<(), EditError> {
        let next = self.bars().find(|next| next.cut.is_some() && next.start == bar.end);
        let Some((next, cut)) = next.and_then(|next| Some((next, next.cut?))) else {
            let why = "the camera is active until the scene ends: no other camera takes over";
            return Err(EditError::refused_at(&bar.place, why));
        };
        self.check_start(&next.place, &next.label, secs)?;
        if secs <= bar.start.as_secs() {
            let shown = |secs: f64| self.time_text(Time::from_secs(secs));
            let (end, start) = (shown(secs), shown(bar.start.as_secs()));
            let why = format!("the shot would end at {end}, but it begins at {start}");
            return Err(EditError::refused_at(&bar.place, &why));
        }
        self.set_cut(cut, secs)
    }

    fn cut_step(&self, scene: &Scene, index: usize, secs: f64) -> Result<Step<'static>, EditError> {
        let place = scene.places.cuts.get(index).ok_or(EditError::ObjectGone)?.clone();
        let siblings = scene.places.cuts.iter().filter(|p| **p == place).count();
        let time = self.edit_time(secs);
        Ok(Step::new(place, siblings, move |text, line, column| set_call_time(text, line, column, time)))
    }
}
