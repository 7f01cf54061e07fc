//! Counts of elements of the stage, and of the parts of a planned frame.

use super::judge_error::JudgeError;
use super::snapshot_cache::SnapshotCache;
use choreo_asset::{Asset, Topology};
use choreo_motion::Time;
use choreo_render::commands::{RecordOptions, Recording, record};
use choreo_render::plan::motion_blur::plan_with;
use choreo_render::{Plan, PlanOptions as RenderOptions, SceneResources};
use choreo_script::testing::{Count, PlanCount, PlanOptions};
use std::sync::Arc;

pub(super) fn make_plan(
    snapshots: &mut SnapshotCache,
    options: &PlanOptions,
    time: Time,
) -> Result<Plan, JudgeError> {
    let resources = snapshots.resources();
    let stage = snapshots.stage.clone();
    let size = options.size.unwrap_or(stage.settings.size);
    let samples = options.samples.or(stage.settings.samples).unwrap_or(4);
    let effects = snapshots.registry.effects().to_vec();
    let options = RenderOptions { effects: &effects, ..RenderOptions::new(size, samples) };
    let at = |time| snapshots.at(time).map(|snapshot| (*snapshot).clone());
    let (_, mut plan) = plan_with(&resources, &stage, time, &options, at)?;
    // Counts refer to one image of one camera: sub-frames, earlier frames and dissolves are left out.
    (plan.subframes, plan.history, plan.dissolve) = (Vec::new(), Vec::new(), None);
    let recording = record_plan(&plan, &resources);
    plan.left_out.extend(recording.preskinning_left_out(&plan));
    Ok(plan)
}

/// Records a plan with the index counts that the renderers use, also for lines and points.
fn record_plan(plan: &Plan, resources: &SceneResources) -> Recording {
    let thirds = |primitive: u32| resources.primitives[primitive as usize].primitive().indices.len() / 3;
    record(plan, RecordOptions::default(), thirds)
}

pub(super) fn count_in_plan(
    snapshots: &mut SnapshotCache,
    options: &PlanOptions,
    what: PlanCount,
    time: Time,
) -> Result<usize, JudgeError> {
    let plan = make_plan(snapshots, options, time)?;
    let resources = snapshots.resources();
    let triangles = |primitive: u32| {
        let primitive = resources.primitives[primitive as usize].primitive();
        match primitive.topology {
            Topology::Triangles => primitive.indices.len() / 3,
            _ => 0,
        }
    };
    let counts = || record_plan(&plan, &resources).counts();
    Ok(match what {
        PlanCount::Passes => counts().passes + plan.post.len(),
        PlanCount::PostPasses => plan.post.len(),
        PlanCount::Pipelines => counts().distinct_pipelines,
        PlanCount::Draws => plan.draws.len(),
        PlanCount::Copies => plan.draws.iter().map(|d| d.instance_count as usize).sum(),
        PlanCount::Triangles => {
            plan.draws.iter().map(|d| triangles(d.primitive) * d.instance_count as usize).sum()
        }
        PlanCount::Lights => plan.lights.len(),
        PlanCount::JointMatrices => plan.joint_matrices.len(),
        PlanCount::Morphs => plan.morphs.len(),
        PlanCount::ShadowMaps => plan.shadow_maps.as_ref().map_or(0, |s| s.views.len()),
        PlanCount::OverlayTriangles => plan.overlay.vertices.len() / 3,
    })
}

pub(crate) fn count_stage(snapshots: &SnapshotCache, what: Count) -> usize {
    let stage = &snapshots.stage;
    let of_actors = |count: fn(&Asset) -> usize| stage.actors.iter().map(|a| count(&a.asset)).sum();
    match what {
        Count::Actors => stage.actors.len(),
        Count::Cameras => stage.cameras.len(),
        Count::Cuts => stage.cuts.len(),
        Count::Lights => stage.lights.len(),
        Count::Effects => stage.effects.len(),
        Count::Layers => stage.actors.iter().map(|a| a.layers.len()).sum(),
        Count::Cues => stage.actors.iter().flat_map(|a| &a.layers).map(|l| l.cues.len()).sum(),
        Count::Callbacks => stage.frame_callbacks.len(),
        Count::Assets => {
            let mut known: Vec<*const Asset> = stage.actors.iter().map(|a| Arc::as_ptr(&a.asset)).collect();
            known.sort_unstable();
            known.dedup();
            known.len()
        }
        Count::Joints => of_actors(|asset| asset.skeleton.len()),
        Count::Triangles => of_actors(|asset| {
            let of_mesh = |mesh: &choreo_asset::Mesh| -> usize {
                let triangles = mesh.primitives.iter().filter(|p| p.topology == Topology::Triangles);
                triangles.map(|p| p.indices.len() / 3).sum()
            };
            let meshes = asset.instances.iter().filter_map(|i| asset.meshes.get(i.mesh as usize));
            meshes.map(|mesh| of_mesh(mesh)).sum()
        }),
        Count::Vertices => of_actors(|asset| {
            let meshes = asset.instances.iter().filter_map(|i| asset.meshes.get(i.mesh as usize));
            meshes.flat_map(|mesh| &mesh.primitives).map(|p| p.positions.len()).sum()
        }),
        Count::Frames => stage.settings.fps.frames_in(stage.settings.length) as usize,
    }
}
