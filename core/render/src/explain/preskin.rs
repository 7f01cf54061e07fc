//! What is posed once for all passes, for [`crate::explain`].

use crate::commands::{Command, Recording};
use crate::explain::{Kind, Parts};
use crate::plan::Draw;
use std::collections::BTreeSet;

/// Of a body as the compute stage reads it.
const JOB_BYTES: u64 = 64;

impl Parts<'_> {
    /// The compute stage, its pipelines, and where it leaves the vertices.
    pub fn poses(&mut self, recording: &Recording) {
        let read: BTreeSet<u32> = recording.posed.iter().flat_map(|b| b.instances.iter().copied()).collect();
        let is_read =
            |d: &&Draw| (d.first_instance..d.first_instance + d.instance_count).any(|i| read.contains(&i));
        let draws: Vec<Draw> = self.all_draws().filter(is_read).copied().collect();
        let askers = self.actors(draws.iter());
        let (bodies, vertices) = recording.posed_vertices(self.catalog);
        let plural = if bodies == 1 { "mesh" } else { "meshes" };
        let what = format!("poses of {bodies} {plural}, {vertices} vertices, once for all passes");
        self.add(Kind::Pass, what, None, askers.clone());
        let mut known = BTreeSet::new();
        for command in &recording.commands {
            let Command::Pose { variant, .. } = command else { continue };
            if known.insert(*variant) {
                let what = format!("poses {}", variant.switches().join(" "));
                self.add(Kind::Pipeline, what, None, askers.clone());
            }
        }
        let bytes = recording.posed_bytes(self.catalog);
        self.add(Kind::FrameData, "posed vertices".into(), Some(bytes), askers.clone());
        let bytes = JOB_BYTES * bodies as u64;
        self.add(Kind::FrameData, "meshes to be posed".into(), Some(bytes), askers);
    }
}
