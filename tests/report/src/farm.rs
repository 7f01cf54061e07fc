//! Scaling of a render farm by simulation: chunk sizes, failures, stragglers, and the limits of a single join and a single storage.

use crate::Section;
use crate::farm_model::{Farm, Join};
use choreo_bench::plots::{Cell, Lines, Table};

/// The film in the plots: ten minutes in 4K with motion blur at 30 frames per second, 9 s per frame, as an MP4.
const EXAMPLE_FARM: Farm = Farm {
    workers: 1,
    frames: 18_000,
    chunk: 60,
    start: 3.0,
    frame: 9.0,
    gap: 1.0,
    dispatch: 0.005,
    scene_bytes: 200e6,
    frame_bytes: 0.25e6,
    storage: 1e9,
    failures: 0.02,
    recovery: 60.0,
    stragglers: 0.05,
    slowness: 2.0,
    join: Join::One { bytes_per_second: 200e6, fixed: 1.0 },
};

const WORKER_COUNTS: [usize; 5] = [1, 10, 100, 1000, 10_000];
const CHUNK_FRAMES: [u64; 11] = [1, 2, 4, 8, 15, 30, 60, 120, 240, 600, 1800];

include!("farm_measured.rs");

/// Cluster of `cargo xtask farm`: three nodes on one machine, 24 chunks.
const MEASURED_FARM: Farm = Farm {
    workers: 3,
    frames: 576,
    chunk: 24,
    start: START_SECS,
    frame: FRAME_SECS,
    gap: GAP_SECS,
    // The join job waits for Slurm like a render task.
    join: Join::One { bytes_per_second: 1e9, fixed: JOIN_SECS + GAP_SECS },
    ..Farm::ONE_MACHINE
};

/// The film on machines whose storage bandwidth grows with their number, as for object storage: 20 MB/s per machine, at least 1 GB/s.
fn farm_with_scaled_storage(workers: usize, chunk: u64) -> Farm {
    Farm { workers, chunk, storage: (20e6 * workers as f64).max(EXAMPLE_FARM.storage), ..EXAMPLE_FARM }
}

pub(crate) fn section() -> Result<Section, String> {
    let plot = Lines {
        title: "Efficiency of a farm against the length of its chunks".into(),
        x: "frames of a chunk".into(),
        y: "efficiency".into(),
        lines: WORKER_COUNTS
            .map(|workers| {
                let at = |chunk| (chunk as f64, farm_with_scaled_storage(workers, chunk).run().efficiency);
                (
                    if workers == 1 { "one machine".into() } else { format!("{workers} machines") },
                    CHUNK_FRAMES.map(at).to_vec(),
                )
            })
            .to_vec(),
    };
    let path = crate::folder().join("plots/farm.svg");
    std::fs::write(&path, plot.svg()).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(Section {
        title: "Render farms",
        text: TEXT
            .replace("{predicted}", &format!("{:.1}", MEASURED_FARM.run().joined))
            .replace("{measured}", &format!("{TOTAL_SECS:.1}")),
        choices: Vec::new(),
        tables: vec![best_chunk_table(), limits_table()],
        off_front: Vec::new(),
    })
}

const TEXT: &str = "\
How long should chunks be, and what limits a farm of ten thousand machines? A discrete-event model (`tests/report/src/farm_model.rs`) has machines that fetch the packed scene,
start, draw and write segments; a scheduler and a storage that serve one request after the other; failures, after which another machine goes on after the finished
frames; slow machines. `cargo xtask farm` measures start-up, chunk and join on its three Slurm nodes, and predicts the job with the same model: {predicted} s predicted, {measured} s
measured.

The film: ten minutes in 4K with motion blur, 18,000 frames of 9 s, 3 s to start, a scene of 200 MB, 0.25 MB a frame; a storage of 20 MB/s for each machine, 1 GB/s at least; machines
fail every 50 hours, and one of twenty is half as fast. Efficiency is the time that the frames alone would take on all machines, over the time until the last segment is written.

![Efficiency of a farm against the length of its chunks](plots/farm.svg)

Short chunks cost starts, and long ones leave machines without work at the end: the best length falls with the number of machines. Starting takes 5 % with 7 frames here, which
`choreo farm` would choose: near the best for a hundred machines, while a few machines gain a little with longer chunks. A thousand have 18 frames each and gain with shorter ones (`--chunk`). With 1.8 frames for
each of ten thousand machines the scheduler (5 ms a task) and the start are the limit, and all wait for one slow machine.

From a thousand machines on, one shared storage is the limit, since each start reads the scene: a copy on each machine or an object storage removes it. One join moves the film three times (it
reads every segment twice). A tree of joins does not help, because its last join moves all bytes again. It helps to join groups in parallel and to let the storage compose the film from
their files (multipart copies of object storages), which MP4 and y4m allow, because their pieces are copied.";

/// Best chunk size for each number of machines.
fn best_chunk_table() -> Table {
    let columns = [
        (">machines", "machines"),
        (">best chunk", "chunk"),
        (">hours", "hours"),
        (">efficiency", "efficiency"),
        (">failures", "failures"),
    ];
    let mut table = Table::new("The best length of chunks, and its efficiency", &columns);
    for workers in WORKER_COUNTS {
        let of = |chunk| (chunk, farm_with_scaled_storage(workers, chunk).run());
        let Some((chunk, outcome)) =
            CHUNK_FRAMES.map(of).into_iter().min_by(|a, b| a.1.rendered.total_cmp(&b.1.rendered))
        else {
            continue;
        };
        table.rows.push(vec![
            Cell::count(workers),
            Cell::count(chunk as usize),
            Cell::number(format!("{:.2}", outcome.rendered / 3600.0), outcome.rendered / 3600.0),
            Cell::number(format!("{:.0} %", outcome.efficiency * 100.0), outcome.efficiency),
            Cell::count(outcome.failures as usize),
        ]);
    }
    table
}

/// Limits with ten thousand machines, and ways to remove them.
fn limits_table() -> Table {
    let columns = [
        ("with 10,000 machines, chunks of 2 frames", "what"),
        (">rendered, s", "rendered"),
        (">joined after, s", "joined"),
        (">efficiency", "efficiency"),
    ];
    let mut table = Table::new("Limits, and how to remove them", &columns);
    let one = Farm { workers: 10_000, chunk: 2, ..EXAMPLE_FARM };
    let objects = Farm { storage: 200e9, ..one };
    let calm = Farm { failures: 0.0, stragglers: 0.0, ..objects };
    let tree = Join::Tree { bytes_per_second: 200e6, fixed: 1.0, group: 64 };
    let composed = Join::Composed { bytes_per_second: 200e6, fixed: 1.0, group: 64 };
    // Formats that are encoded during the join store an image for each frame.
    let images = |farm: Farm| Farm { frame_bytes: 8e6, ..farm };
    for (name, farm) in [
        ("one storage of 1 GB/s, one join", one),
        ("the same, the scene on each machine before", Farm { scene_bytes: 0.0, ..one }),
        ("object storage, one join", objects),
        ("object storage, a tree of joins of 64", Farm { join: tree, ..objects }),
        ("object storage, joins of 64, composed by it", Farm { join: composed, ..objects }),
        ("the same, no failures and no slow machines", Farm { join: composed, ..calm }),
        ("images of 8 MB a frame, one storage, one join", images(one)),
        ("images of 8 MB a frame, object storage, composed", images(Farm { join: composed, ..objects })),
    ] {
        let outcome = farm.run();
        table.rows.push(vec![
            Cell::text(name),
            Cell::number(format!("{:.0}", outcome.rendered), outcome.rendered),
            Cell::number(
                format!("{:.0}", outcome.joined - outcome.rendered),
                outcome.joined - outcome.rendered,
            ),
            Cell::number(format!("{:.0} %", outcome.efficiency * 100.0), outcome.efficiency),
        ]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The model must predict the measured time of the cluster from the costs measured at the same time.
    #[test]
    fn the_measured_cluster_is_predicted_within_15_percent() {
        let predicted = MEASURED_FARM.run().joined;
        assert!((predicted / TOTAL_SECS - 1.0).abs() < 0.15, "{predicted} and {TOTAL_SECS}");
    }
}
