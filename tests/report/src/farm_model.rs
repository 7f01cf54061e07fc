//! Discrete-event model of a render farm: machines open the scene, draw chunks and write segments, may fail or be slow, and share a storage
//! and a scheduler that serve requests one after another. `cargo xtask farm` predicts its cluster with it, and the section "farm" of the
//! report uses it for sizes that are too large to be tried.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, VecDeque};

/// Parameters of a film, its machines, and shared resources. Times are in seconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Farm {
    pub workers: usize,
    pub frames: u64,
    /// Number of frames in a chunk.
    pub chunk: u64,
    /// Seconds from the start of a task to its first frame, and seconds per frame.
    pub start: f64,
    pub frame: f64,
    /// Seconds of the scheduler between two tasks of one machine, and its seconds per task, which tasks of all machines wait for in turn.
    pub gap: f64,
    pub dispatch: f64,
    /// Bytes of the packed scene, bytes of a frame in a segment, and total bandwidth of the storage in bytes per second.
    pub scene_bytes: f64,
    pub frame_bytes: f64,
    pub storage: f64,
    /// Failures of a machine per hour, and seconds until its task runs elsewhere and it is available again.
    pub failures: f64,
    pub recovery: f64,
    /// Fraction of the machines that are slow, and the factor by which they are slower.
    pub stragglers: f64,
    pub slowness: f64,
    pub join: Join,
}

/// Method by which segments are joined into the film.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Join {
    /// One machine reads everything twice and writes it once. It handles this many bytes per second, and needs `fixed` seconds for anything
    /// else.
    One { bytes_per_second: f64, fixed: f64 },
    /// Groups of `group` segments are joined in parallel, level by level.
    Tree { bytes_per_second: f64, fixed: f64, group: usize },
    /// Groups are joined in parallel, and the storage concatenates their files to the film.
    Composed { bytes_per_second: f64, fixed: f64, group: usize },
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Outcome {
    /// Seconds until the last segment is written, and until the film is.
    pub rendered: f64,
    pub joined: f64,
    /// Time that all machines would need for drawing the frames alone, divided by the time until the last segment is written.
    pub efficiency: f64,
    pub failures: u64,
}

/// Next event of a machine.
#[derive(Clone, Copy, Debug)]
enum Event {
    /// The machine is free to take a chunk.
    Idle,
    /// The machine has read the scene, and draws this many frames.
    Loaded(u64),
    /// The machine has drawn the first number of frames and writes them; the second number is left in the chunk.
    Drawn(u64, u64),
}

struct Timed {
    at: f64,
    /// Events at the same time keep the order in which they were created.
    order: u64,
    worker: usize,
    event: Event,
}

impl PartialEq for Timed {
    fn eq(&self, other: &Timed) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Timed {}

impl PartialOrd for Timed {
    fn partial_cmp(&self, other: &Timed) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Timed {
    /// Reversed, so that the heap returns the earliest event first.
    fn cmp(&self, other: &Timed) -> Ordering {
        other.at.total_cmp(&self.at).then(other.order.cmp(&self.order))
    }
}

struct Run<'a> {
    farm: &'a Farm,
    random: u64,
    events: BinaryHeap<Timed>,
    events_added: u64,
    /// Chunks not yet taken, as numbers of frames.
    chunks: VecDeque<u64>,
    /// Times at which the storage and the scheduler become free.
    storage_free: f64,
    scheduler_free: f64,
    /// Machines without work.
    idle_workers: Vec<usize>,
    last_written_secs: f64,
    failures: u64,
}

impl Farm {
    /// A farm with one machine that draws one frame per second and waits for nothing.
    pub(crate) const ONE_MACHINE: Farm = Farm {
        workers: 1,
        frames: 100,
        chunk: 10,
        start: 2.0,
        frame: 1.0,
        gap: 0.0,
        dispatch: 0.0,
        scene_bytes: 0.0,
        frame_bytes: 0.0,
        storage: 1e9,
        failures: 0.0,
        recovery: 0.0,
        stragglers: 0.0,
        slowness: 1.0,
        join: Join::One { bytes_per_second: 1e8, fixed: 0.0 },
    };

    pub(crate) fn run(&self) -> Outcome {
        let count = self.frames.div_ceil(self.chunk.max(1));
        let length = |i: u64| self.chunk.min(self.frames - i * self.chunk);
        let mut run = Run {
            farm: self,
            random: 1,
            events: BinaryHeap::new(),
            events_added: 0,
            chunks: (0..count).map(length).collect(),
            storage_free: 0.0,
            scheduler_free: 0.0,
            idle_workers: Vec::new(),
            last_written_secs: 0.0,
            failures: 0,
        };
        (0..self.workers).for_each(|worker| run.add(0.0, worker, Event::Idle));
        while let Some(Timed { at, worker, event, .. }) = run.events.pop() {
            run.handle_event(at, worker, event);
        }
        let ideal = self.frames as f64 * self.frame / self.workers as f64;
        let joined = run.last_written_secs + self.join(count as f64);
        Outcome {
            rendered: run.last_written_secs,
            joined,
            efficiency: ideal / run.last_written_secs,
            failures: run.failures,
        }
    }

    fn join(&self, segments: f64) -> f64 {
        let bytes = self.frames as f64 * self.frame_bytes;
        match self.join {
            Join::One { bytes_per_second, fixed } => fixed + 3.0 * bytes / bytes_per_second,
            Join::Composed { bytes_per_second, fixed, group } => {
                let groups = (segments / group as f64).ceil();
                2.0 * fixed + 3.0 * bytes / (bytes_per_second * groups).min(self.storage)
            }
            Join::Tree { bytes_per_second, fixed, group } => {
                let (mut seconds, mut parts) = (0.0, segments);
                while parts > 1.0 {
                    parts = (parts / group as f64).ceil();
                    // Joins of one level run in parallel, limited by the storage.
                    let rate = (bytes_per_second * parts).min(self.storage);
                    seconds += fixed + 3.0 * bytes / rate;
                }
                seconds
            }
        }
    }
}

impl Run<'_> {
    fn add(&mut self, at: f64, worker: usize, event: Event) {
        self.events_added += 1;
        self.events.push(Timed { at, order: self.events_added, worker, event });
    }

    fn handle_event(&mut self, at: f64, worker: usize, event: Event) {
        let farm = *self.farm;
        match event {
            Event::Idle => match self.chunks.pop_front() {
                None => self.idle_workers.push(worker),
                Some(frames) => {
                    let begun = completion_time(&mut self.scheduler_free, at, farm.dispatch) + farm.gap;
                    let loaded =
                        completion_time(&mut self.storage_free, begun, farm.scene_bytes / farm.storage);
                    self.add(loaded.max(begun), worker, Event::Loaded(frames));
                }
            },
            Event::Loaded(frames) => {
                // Slow machines are distributed evenly.
                let (a, b) = (worker as f64 * farm.stragglers, (worker + 1) as f64 * farm.stragglers);
                let slowness = if b.floor() > a.floor() { farm.slowness } else { 1.0 };
                let (start, frame) = (farm.start * slowness, farm.frame * slowness);
                let end = start + frames as f64 * frame;
                let fails = if farm.failures > 0.0 {
                    -3600.0 / farm.failures * (1.0 - self.random_unit()).ln()
                } else {
                    f64::MAX
                };
                if fails >= end {
                    return self.add(at + end, worker, Event::Drawn(frames, 0));
                }
                // Finished frames stay in the folder; a free machine takes the remaining ones.
                self.failures += 1;
                let done = (((fails - start) / frame).max(0.0) as u64).min(frames - 1);
                self.add(at + fails, worker, Event::Drawn(done, frames - done));
            }
            Event::Drawn(done, left) => {
                let written = completion_time(
                    &mut self.storage_free,
                    at,
                    done as f64 * farm.frame_bytes / farm.storage,
                );
                self.last_written_secs = self.last_written_secs.max(written);
                let mut back = written;
                if left > 0 {
                    back += farm.recovery;
                    self.chunks.push_front(left);
                    if let Some(other) = self.idle_workers.pop() {
                        self.add(back, other, Event::Idle);
                    }
                }
                self.add(back, worker, Event::Idle);
            }
        }
    }

    /// Next random number in 0..1 (splitmix64).
    fn random_unit(&mut self) -> f64 {
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Completion time of a request to a resource that serves one request after another.
fn completion_time(free: &mut f64, at: f64, seconds: f64) -> f64 {
    *free = free.max(at) + seconds;
    *free
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE_MACHINE: Farm = Farm::ONE_MACHINE;

    fn assert_near(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-9 * b.abs(), "{a} and {b}");
    }

    /// Closed forms: chunks in rounds, and a storage or scheduler as the bottleneck.
    #[test]
    fn simple_farms_take_the_time_of_the_closed_form() {
        assert_near(ONE_MACHINE.run().rendered, 10.0 * 12.0);
        assert_near(ONE_MACHINE.run().efficiency, 100.0 / 120.0);
        assert_near(Farm { workers: 3, ..ONE_MACHINE }.run().rendered, 4.0 * 12.0);
        assert_near(Farm { workers: 1000, ..ONE_MACHINE }.run().rendered, 12.0);
        assert_near(Farm { gap: 0.5, ..ONE_MACHINE }.run().rendered, 125.0);
        // The last frame waits for all others to be written.
        let storage = Farm { workers: 10, frame_bytes: 1e9, start: 0.0, ..ONE_MACHINE };
        assert_near(storage.run().rendered, 10.0 + 100.0);
        let scene = Farm { workers: 10, scene_bytes: 5e9, ..ONE_MACHINE };
        assert_near(scene.run().rendered, 50.0 + 12.0);
        assert_near(Farm { workers: 10, dispatch: 3.0, ..ONE_MACHINE }.run().rendered, 30.0 + 12.0);
        // One machine of two is three times slower: it makes 3 chunks while the other makes 7 (84 s), the third ends at 108 s.
        assert_near(Farm { workers: 2, stragglers: 0.5, slowness: 3.0, ..ONE_MACHINE }.run().rendered, 108.0);
        let join = Farm { frame_bytes: 1e6, storage: 1e12, ..ONE_MACHINE }.run();
        assert_near(join.joined - join.rendered, 3.0);
        let tree = Join::Tree { bytes_per_second: 1e8, fixed: 0.1, group: 4 };
        let tree = Farm { frame_bytes: 1e6, storage: 1e12, join: tree, ..ONE_MACHINE }.run();
        // 10 segments become 3, and these 1.
        assert_near(tree.joined - tree.rendered, 0.1 + 1.0 + 0.1 + 3.0);
        let composed = Join::Composed { bytes_per_second: 1e8, fixed: 0.1, group: 4 };
        let composed = Farm { frame_bytes: 1e6, storage: 1e12, join: composed, ..ONE_MACHINE }.run();
        assert_near(composed.joined - composed.rendered, 0.1 + 1.0 + 0.1);
    }

    /// Failures cost only the work that is thrown away, and no frame is lost. With resumed chunks, each failure costs a start, the
    /// recovery, and half a frame on average.
    #[test]
    fn each_failure_costs_one_restart() {
        let farm = Farm { frames: 200_000, chunk: 100, failures: 6.0, recovery: 30.0, ..ONE_MACHINE };
        let outcome = farm.run();
        let calm = 2000.0 * 102.0;
        let expected = calm + outcome.failures as f64 * (2.0 + 30.0 + 0.5);
        assert!(
            outcome.failures > 300 && (outcome.rendered / expected - 1.0).abs() < 0.002,
            "{outcome:?} {expected}"
        );
        assert_eq!(farm.run(), outcome);
    }
}
