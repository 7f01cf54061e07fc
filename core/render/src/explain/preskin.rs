//! Costs of pre-skinning.

use crate::commands::{Command, Recording};
use crate::explain::{CostKind, Costs};
use crate::vulkan::preskin::Job;
use std::collections::BTreeSet;

impl Costs<'_> {
    /// Adds the compute pass, its pipelines, and the buffers of its vertices.
    pub(crate) fn add_preskinning(&mut self, recording: &Recording) {
        let preskinned: BTreeSet<u32> =
            recording.preskinned.iter().flat_map(|b| b.instances.iter().copied()).collect();
        let drawn = self.plan.all_draws().filter(|d| {
            (d.first_instance..d.first_instance + d.instance_count).any(|i| preskinned.contains(&i))
        });
        let requested_by = self.requested_by_actors(drawn);
        let (meshes, vertices) = recording.preskinned_vertices(self.resources);
        let plural = if meshes == 1 { "mesh" } else { "meshes" };
        let what = format!("pre-skinning of {meshes} {plural}, {vertices} vertices");
        self.add(CostKind::Pass, what, None, requested_by.clone());
        let mut variants = BTreeSet::new();
        for command in &recording.commands {
            let Command::Preskin { variant, .. } = command else { continue };
            if variants.insert(*variant) {
                let what = format!("pre-skinning {}", variant.switches().join(" "));
                self.add(CostKind::Pipeline, what, None, requested_by.clone());
            }
        }
        let bytes = recording.preskinned_bytes(self.resources);
        self.add(CostKind::FrameData, "pre-skinned vertices".into(), Some(bytes), requested_by.clone());
        let bytes = (size_of::<Job>() * meshes) as u64;
        self.add(CostKind::FrameData, "parameters of pre-skinning".into(), Some(bytes), requested_by);
    }
}
