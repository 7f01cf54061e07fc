//! Posed vertices of an actor.

use crate::snapshot::ActorState;
use choreo_asset::{Asset, PlacementSelection, PosedInstance, posed_meshes_by};
use glam::DAffine3;

/// All mesh instances of an actor in world space. Empty where the actor was not posed (invisible).
pub fn posed_meshes(asset: &Asset, actor: &ActorState) -> Vec<PosedInstance> {
    let ActorState { model_from_joint, morph_weights, world_from_model, .. } = actor;
    let how = (actor.skinning, PlacementSelection::First(actor.copies));
    posed_meshes_by(how, asset, model_from_joint, morph_weights, *world_from_model)
}

/// All posed mesh instances in model space, for the character itself without the placements of its copies.
pub(crate) fn posed_meshes_in_model_space(asset: &Asset, actor: &ActorState) -> Vec<PosedInstance> {
    let ActorState { model_from_joint, morph_weights, .. } = actor;
    let how = (actor.skinning, PlacementSelection::Once);
    posed_meshes_by(how, asset, model_from_joint, morph_weights, DAffine3::IDENTITY)
}
