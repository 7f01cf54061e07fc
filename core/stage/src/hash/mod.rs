//! Content hashes of stages and snapshots: did a script give the same stage again?

mod constraints;
mod cues;
mod layers_2d;
mod stage;
