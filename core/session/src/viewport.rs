//! Viewport camera and view overrides of a frame, which are not part of the script or of its stage.

use crate::{FrameRequest, Scene};
use choreo_asset::Projection;
use choreo_motion::Time;
use choreo_stage::{
    CameraState, Channel, Constraint, ConstraintKind, Cut, EffectState, EffectTarget, EffectUse, Evaluator,
    Placement, Property, Rig, Snapshot, Stage, StageError, Target,
};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;
use std::sync::Arc;

#[derive(Clone, Debug, Default, PartialEq)]
pub enum ViewportCamera {
    /// The camera that the script has active at this time.
    #[default]
    Script,
    /// A camera of the stage by its index, active or not.
    Camera(usize),
    Free(CameraState),
    /// A camera that moves with an actor. `camera`: its state while the actor is at the origin.
    Following {
        actor: usize,
        camera: CameraState,
    },
}

/// Changes of a view that are not part of the script.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ViewOverrides {
    /// Indices of invisible actors.
    pub hidden: Vec<usize>,
    /// Index of the actor that is drawn with a selection outline.
    pub outlined: Option<usize>,
    /// Whether the ground has a grid, which closer surfaces hide.
    pub grid: bool,
    /// Muted layers, whose clips do not play: actor and layer.
    pub muted: Vec<(usize, usize)>,
    /// The object that is being dragged, with its current placement.
    pub placement: Option<PlacementOverride>,
}

/// Placement of an object that replaces its own at all times.
#[derive(Clone, Debug, PartialEq)]
pub enum PlacementOverride {
    /// Parent-space transform of an actor. `property`: the dragged property, whose keys are ignored.
    Actor {
        actor: usize,
        property: Property,
        to: Placement,
    },
    /// World-space target of a reach constraint: the actor, and the index of the constraint.
    Target {
        actor: usize,
        constraint: usize,
        to: DVec3,
    },
    Light {
        light: usize,
        to: DVec3,
    },
    /// Unit vector, world space.
    Sun {
        light: usize,
        direction: Vec3,
    },
    /// Rig that replaces that of a camera.
    Camera {
        camera: usize,
        rig: Rig,
    },
}

impl PlacementOverride {
    /// Writes the placement into the stage, and removes the keys of the property.
    fn apply_to(&self, stage: &mut Stage) {
        let unkeyed =
            |channels: &mut Vec<Channel>, property| channels.retain(|keys| keys.property != property);
        match self {
            PlacementOverride::Actor { actor, property, to } => {
                if let Some(actor) = stage.actors.get_mut(*actor) {
                    actor.transform = *to;
                    unkeyed(&mut actor.channels, *property);
                }
            }
            PlacementOverride::Target { actor, constraint, to } => {
                let constraints = stage.actors.get_mut(*actor).map(|actor| &mut actor.constraints);
                let found = constraints.and_then(|all| all.get_mut(*constraint));
                if let Some(Constraint { kind: ConstraintKind::Reach(reach), .. }) = found {
                    reach.target = Target::Point(*to - reach.offset.unwrap_or(DVec3::ZERO));
                }
            }
            PlacementOverride::Light { light, to } => {
                if let Some(light) = stage.lights.get_mut(*light) {
                    light.position = *to;
                    unkeyed(&mut light.channels, Property::Translation);
                }
            }
            PlacementOverride::Sun { light, direction } => {
                if let Some(light) = stage.lights.get_mut(*light) {
                    light.direction = *direction;
                    unkeyed(&mut light.channels, Property::Rotation);
                }
            }
            PlacementOverride::Camera { camera, rig } => {
                if let Some(camera) = stage.cameras.get_mut(*camera) {
                    camera.rig = rig.clone();
                    unkeyed(&mut camera.channels, Property::Translation);
                }
            }
        }
    }
}

/// Selection outline: width in pixels, and color in linear RGB.
const SELECTION_OUTLINE: [(&str, f64); 4] =
    [("width", 2.5), ("color_r", 1.0), ("color_g", 0.3), ("color_b", 0.04)];

/// Gray of the ground grids, which is visible on dark and on light ground.
const GRID_COLOR: [(&str, f64); 3] = [("color_r", 0.22), ("color_g", 0.22), ("color_b", 0.22)];
/// Smallest and largest cell of the grid, as powers of ten in metres.
const CELL_EXPONENTS: (i32, i32) = (-3, 3);

/// An effect that a view adds to those of the scene.
#[derive(Clone, Debug, PartialEq)]
struct Addition {
    plugin: &'static str,
    targets: Vec<EffectTarget>,
    parameters: &'static [(&'static str, f64)],
    /// Level of a grid: 0 for the finest visible grid, 1 for the next one, whose cells are ten times as wide. `None` for other effects.
    grid_level: Option<i32>,
}

impl Addition {
    /// Parameters of the effect. `view_distance`: distance from the camera to what it shows, metres.
    fn parameters(&self, view_distance: f64) -> Vec<(String, f64)> {
        let mut all: Vec<(&str, f64)> = self.parameters.to_vec();
        if let Some(grid_level) = self.grid_level {
            let (cell, opacity) = grid_cell(view_distance, grid_level);
            // A small height above the ground avoids z-fighting with a floor at the same height.
            all.extend([
                ("cell", cell),
                ("opacity", opacity),
                ("fade", 40.0 * cell),
                ("height", 0.01 * cell),
            ]);
        }
        all.into_iter().map(|(name, value)| (name.to_string(), value)).collect()
    }
}

/// Cell size in metres and opacity of a ground grid, where `grid_level` is 0 for the finest and 1 for the next coarser one. Cells are 1 m wide at a
/// distance of 2 to 20 m, and change by powers of ten elsewhere. The finest grid fades out before the next one takes its place, as in Blender.
fn grid_cell(view_distance: f64, grid_level: i32) -> (f64, f64) {
    let exponent = libm::log10(view_distance.max(1e-9) / 2.0)
        .clamp(f64::from(CELL_EXPONENTS.0), f64::from(CELL_EXPONENTS.1));
    let power = libm::floor(exponent);
    let fading = ((1.0 - (exponent - power)) / 0.3).min(1.0);
    let cell = libm::pow(10.0, power + f64::from(grid_level));
    (cell, if grid_level == 0 { 0.45 * fading } else { 0.45 })
}

/// Distance from the camera to what it shows, metres: to the nearest visible actor, else to the origin. In parallel projection it follows from the
/// height of the view.
fn view_distance(snapshot: &Snapshot) -> f64 {
    if let Projection::Orthographic { height, .. } = snapshot.camera.projection {
        return f64::from(height) * 1.4;
    }
    let eye = snapshot.camera.world_from_view.translation;
    let visible = snapshot.actors.iter().filter(|actor| actor.visible);
    let nearest =
        visible.map(|actor| (actor.world_from_model.translation - eye).length()).min_by(f64::total_cmp);
    nearest.unwrap_or(eye.length())
}

/// A stage without muted layers and with the dragged object, and the overrides that it was made for.
struct ModifiedStage {
    muted: Vec<(usize, usize)>,
    placement: Option<PlacementOverride>,
    stage: Arc<Stage>,
}

/// Evaluators of the scene that a view shows, one per camera.
#[derive(Default)]
pub(crate) struct ViewEvaluators {
    scene: Option<Arc<Scene>>,
    /// The stage with muted layers and the dragged object applied, if there are any.
    modified_stage: Option<ModifiedStage>,
    /// Evaluator of the stage with the cameras that the script has active.
    script_evaluator: Option<Evaluator>,
    /// Evaluators of the stage with one camera active all the time, by camera.
    cameras: BTreeMap<usize, Evaluator>,
    /// The stage with the effects that the view adds.
    stage_with_effects: Option<(Vec<Addition>, Arc<Stage>)>,
    /// Evaluators without the drag of an actor.
    before_drag: Option<Box<ViewEvaluators>>,
}

impl ViewEvaluators {
    pub(crate) fn at(&mut self, request: &FrameRequest, time: Time) -> Result<Snapshot, StageError> {
        let FrameRequest { scene, camera, overrides, .. } = request;
        self.set_scene(request);
        let stage = self.base_stage(scene);
        let mut snapshot = match camera {
            ViewportCamera::Camera(camera) if *camera < scene.stage.cameras.len() => {
                let of_camera = self.cameras.entry(*camera).or_insert_with(|| {
                    let cuts = vec![Cut::new(Time::ZERO, *camera)];
                    Evaluator::new(Arc::new(Stage { cuts, ..(*stage).clone() }))
                });
                of_camera.at(time)
            }
            _ => {
                let changed = self.modified_stage.is_some();
                let own = || if changed { Evaluator::new(stage.clone()) } else { scene.evaluator.clone() };
                self.script_evaluator.get_or_insert_with(own).at(time)
            }
        }?;
        if !matches!(camera, ViewportCamera::Script) {
            snapshot.dissolve = None;
        }
        match camera {
            ViewportCamera::Free(camera) => snapshot.camera = *camera,
            ViewportCamera::Following { actor, camera } => {
                let at = snapshot.actors.get(*actor).map_or(DVec3::ZERO, |a| a.world_from_model.translation);
                snapshot.camera = *camera;
                snapshot.camera.world_from_view.translation += at;
            }
            ViewportCamera::Script | ViewportCamera::Camera(_) => {}
        }
        for hidden in &overrides.hidden {
            if let Some(actor) = snapshot.actors.get_mut(*hidden) {
                actor.visible = false;
            }
        }
        if let Some(request) = before_drag(request) {
            let Snapshot { camera, dissolve, .. } =
                self.before_drag.get_or_insert_default().at(&request, time)?;
            (snapshot.camera, snapshot.dissolve) = (camera, dissolve);
        }
        let view_distance = view_distance(&snapshot);
        for (index, addition) in additions(request).into_iter().enumerate() {
            let parameters = addition.parameters(view_distance);
            let effect = EffectState { effect: scene.stage.effects.len() + index, parameters };
            snapshot.dissolve.iter_mut().for_each(|dissolve| dissolve.effects.push(effect.clone()));
            snapshot.effects.push(effect);
        }
        Ok(snapshot)
    }

    /// The stage with all view overrides and the effects that the view adds.
    pub(crate) fn stage(&mut self, request: &FrameRequest) -> Arc<Stage> {
        self.set_scene(request);
        self.with_additions(request).unwrap_or_else(|| self.base_stage(&request.scene))
    }

    fn set_scene(&mut self, request: &FrameRequest) {
        let (scene, ViewOverrides { muted, placement, .. }) = (&request.scene, &request.overrides);
        let is_plain = muted.is_empty() && placement.is_none();
        let is_same = self
            .modified_stage
            .as_ref()
            .map_or(is_plain, |now| now.muted == *muted && now.placement == *placement);
        if self.scene.as_ref().is_some_and(|s| Arc::ptr_eq(s, scene)) && is_same {
            return;
        }
        let changed = || {
            let mut stage = (*scene.stage).clone();
            for (actor, layer) in muted {
                let layer = stage.actors.get_mut(*actor).and_then(|a| a.layers.get_mut(*layer));
                layer.into_iter().for_each(|layer| layer.cues.clear());
            }
            placement.iter().for_each(|placement| placement.apply_to(&mut stage));
            ModifiedStage { muted: muted.clone(), placement: placement.clone(), stage: Arc::new(stage) }
        };
        let modified_stage = (!is_plain).then(changed);
        let before_drag = self.before_drag.take();
        *self = ViewEvaluators {
            scene: Some(scene.clone()),
            modified_stage,
            before_drag,
            ..ViewEvaluators::default()
        };
    }

    /// The scene's stage without muted layers and with the dragged object.
    fn base_stage(&self, scene: &Scene) -> Arc<Stage> {
        self.modified_stage.as_ref().map_or_else(|| scene.stage.clone(), |changed| changed.stage.clone())
    }

    /// The stage with the effects that the view adds. `None` if there are none.
    fn with_additions(&mut self, request: &FrameRequest) -> Option<Arc<Stage>> {
        let additions = additions(request);
        if additions.is_empty() {
            return None;
        }
        if self.stage_with_effects.as_ref().is_none_or(|(of, _)| *of != additions) {
            let mut stage = (*self.base_stage(&request.scene)).clone();
            stage.effects.extend(additions.iter().map(|addition| EffectUse {
                plugin: addition.plugin.into(),
                on: addition.targets.clone(),
                ..EffectUse::default()
            }));
            self.stage_with_effects = Some((additions, Arc::new(stage)));
        }
        self.stage_with_effects.as_ref().map(|(_, stage)| stage.clone())
    }
}

/// The same request without the drag of an actor. The frame uses its camera, because the drag is measured through the camera: a camera that follows
/// or frames the actor must not move with it.
fn before_drag(request: &FrameRequest) -> Option<FrameRequest> {
    let Some(PlacementOverride::Actor { .. }) = request.overrides.placement else { return None };
    let muted = request.overrides.muted.clone();
    Some(FrameRequest { overrides: ViewOverrides { muted, ..ViewOverrides::default() }, ..request.clone() })
}

/// The effects that a view adds, if the program has them.
fn additions(request: &FrameRequest) -> Vec<Addition> {
    let FrameRequest { scene, overrides, .. } = request;
    let actor = overrides.outlined.filter(|actor| *actor < scene.stage.actors.len());
    let outline = actor.map(|actor| Addition {
        plugin: "outline",
        targets: vec![EffectTarget { actor, material: None }],
        parameters: &SELECTION_OUTLINE,
        grid_level: None,
    });
    let grid = |grid_level| Addition {
        plugin: "grid",
        targets: Vec::new(),
        parameters: &GRID_COLOR,
        grid_level: Some(grid_level),
    };
    let grid = [0, 1].into_iter().filter(|_| overrides.grid).map(grid);
    outline.into_iter().chain(grid).filter(|added| scene.registry.effect(added.plugin).is_some()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_cells_change_by_powers_of_ten_without_a_jump() {
        for (view_distance, cell) in
            [(5.0, 1.0), (2.01, 1.0), (19.9, 1.0), (0.5, 0.1), (0.05, 0.01), (60.0, 10.0), (1e9, 1000.0)]
        {
            let (fine, _) = grid_cell(view_distance, 0);
            let (coarse, _) = grid_cell(view_distance, 1);
            assert!((fine / cell - 1.0).abs() < 1e-9, "{view_distance}: {fine}");
            assert!((coarse / fine - 10.0).abs() < 1e-9, "{view_distance}: {coarse}");
        }
        assert_eq!(grid_cell(0.0, 0).0, 0.001);
        // When the cell size changes, the grid that disappears is invisible, and the other one does not change.
        let (before, after) = (20.0 - 1e-6, 20.0 + 1e-6);
        assert!(grid_cell(before, 0).1 < 1e-6);
        assert_eq!(grid_cell(before, 1), grid_cell(after, 0));
        assert_eq!(grid_cell(5.0, 0).1, 0.45, "at human scale it does not fade");
    }
}
