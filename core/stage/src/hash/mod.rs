//! Content hashes of stages and snapshots: did a script give the same stage again?

mod cues;
mod flat;
mod goals;
mod stage;
