//! Cuts between cameras: the next camera's cut is the end of a camera's bar.

use super::{EditError, Step};
use crate::app::Viewer;
use crate::state::timeline::Bar;
use choreo_motion::Time;
use choreo_session::Scene;
use choreo_session::edit::set_call;

impl Viewer {
    /// Moves a cut; `index` of the stage's cuts.
    pub fn set_cut(&mut self, index: usize, secs: f64) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let step = self.cut_step(&scene, index, secs)?;
        self.change_all(vec![step])
    }

    /// Moves a cut and, as far, all that come after it.
    pub fn ripple_cuts(&mut self, index: usize, secs: f64) -> Result<(), EditError> {
        let scene = self.scene.clone().ok_or(EditError::NothingShown)?;
        let cuts = &scene.stage.cuts;
        let first = cuts.get(index).ok_or(EditError::Gone)?.at;
        let later = (0..cuts.len()).filter(|other| *other == index || cuts[*other].at > first);
        let by = secs - first.as_secs();
        let steps = later.map(|other| self.cut_step(&scene, other, cuts[other].at.as_secs() + by));
        let steps = steps.collect::<Result<_, _>>()?;
        self.change_all(steps)
    }

    /// Moves the cut that ends the bar of a camera.
    pub(crate) fn set_camera_end(&mut self, bar: &Bar, secs: f64) -> Result<(), EditError> {
        let next = self.bars().find(|next| next.cut.is_some() && next.start == bar.end);
        let Some((next, cut)) = next.and_then(|next| Some((next, next.cut?))) else {
            let why = "it is on until the scene ends: no camera takes over from it";
            return Err(EditError::refused_at(&bar.place, why));
        };
        self.check_begins(&next.place, &next.label, secs)?;
        if secs <= bar.start.as_secs() {
            let shown = |secs: f64| self.shown_time(Time::from_secs(secs));
            let (end, start) = (shown(secs), shown(bar.start.as_secs()));
            let why = format!("it would end at {end}, where it begins at {start}");
            return Err(EditError::refused_at(&bar.place, &why));
        }
        self.set_cut(cut, secs)
    }

    fn cut_step(&self, scene: &Scene, index: usize, secs: f64) -> Result<Step<'static>, EditError> {
        let place = scene.places.cuts.get(index).ok_or(EditError::Gone)?.clone();
        let siblings = scene.places.cuts.iter().filter(|p| **p == place).count();
        let time = self.edit_time(secs);
        Ok(Step::new(place, siblings, move |text, line, column| set_call(text, line, column, time)))
    }
}
