//! Division of a film into chunks of frames of about equal cost.

/// First and last frame of a chunk.
pub(crate) type Chunk = (u64, u64);

/// Time that a machine needs for the frames of a film.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FilmCost {
    /// Seconds until the first frame: opening the scene, starting the renderer, and the extra cost of a frame without a previous one.
    pub start_secs: f64,
    /// Seconds of some frames, as (frame number, seconds), sorted by number. The cost of other frames is interpolated.
    pub frames: Vec<(u64, f64)>,
}

/// Largest share of its time that a machine may spend on starting.
const MAX_START_SHARE: f64 = 0.05;

impl FilmCost {
    fn frame_secs(&self, frame: u64) -> f64 {
        let after = self.frames.partition_point(|(at, _)| *at < frame);
        match (after.checked_sub(1).map(|before| self.frames[before]), self.frames.get(after)) {
            (Some((a, from)), Some(&(b, to))) => from + (to - from) * (frame - a) as f64 / (b - a) as f64,
            (Some((_, cost)), None) | (None, Some(&(_, cost))) => cost,
            (None, None) => 0.0,
        }
    }

    /// Seconds of all frames, drawn one after another.
    pub(super) fn total_secs(&self, frames: u64) -> f64 {
        (0..frames).map(|frame| self.frame_secs(frame)).sum()
    }
}

/// Chunks of one length; the last one may be shorter.
pub(crate) fn chunks_of_length(frames: u64, length: u64) -> Vec<Chunk> {
    let length = length.max(1);
    (0..frames.div_ceil(length)).map(|i| (i * length, ((i + 1) * length).min(frames) - 1)).collect()
}

/// The multiple of `piece` that is nearest to `length`, so that the film's pieces can be copied when it is joined. If that is 0, `length`
/// itself.
pub(crate) fn nearest_multiple_of_piece(length: u64, piece: u64) -> u64 {
    match (length + piece / 2) / piece {
        0 => length,
        pieces => pieces * piece,
    }
}

/// The largest number of chunks, at most `max_chunks`, that have about equal cost and of which each spends no more than 5 % on starting. Chunks
/// end at ends of pieces, unless they are much shorter than a piece.
pub(crate) fn chunks_of_equal_cost(frames: u64, piece: u64, cost: &FilmCost, max_chunks: u64) -> Vec<Chunk> {
    let total = cost.total_secs(frames);
    let min_chunk_secs = cost.start_secs * (1.0 - MAX_START_SHARE) / MAX_START_SHARE;
    let count = if min_chunk_secs > 0.0 { (total / min_chunk_secs) as u64 } else { frames };
    let count = count.clamp(1, frames.min(max_chunks).max(1));
    let align =
        if nearest_multiple_of_piece(frames / count, piece).is_multiple_of(piece) { piece } else { 1 };
    let sum = |spent: &mut f64, frame| {
        *spent += cost.frame_secs(frame);
        Some(*spent)
    };
    let spent: Vec<f64> = (0..frames).scan(0.0, sum).collect();
    let mut chunks = Vec::new();
    let mut first = 0;
    for chunk in 1..=count {
        // The tolerance accepts sums that rounding has made slightly smaller.
        let share = total * (chunk as f64 / count as f64 - 1e-9);
        let end = spent.partition_point(|sum| *sum < share) as u64 + 1;
        let end = if chunk == count { frames } else { (end + align / 2) / align * align };
        if end > first && (end < frames || chunk == count) {
            chunks.push((first, end - 1));
            first = end;
        }
    }
    chunks
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The chunks follow each other from the first frame to the last.
    fn assert_covers_all_frames(chunks: &[Chunk], frames: u64) {
        let mut next = 0;
        for (first, last) in chunks {
            assert!(*first == next && last >= first, "{chunks:?}");
            next = last + 1;
        }
        assert_eq!(next, frames, "{chunks:?}");
    }

    /// Compares costs with sums that the test computes itself.
    #[test]
    fn chunks_have_equal_costs_and_spend_at_most_5_percent_on_starting() {
        let rising = FilmCost { start_secs: 0.5, frames: vec![(0, 0.1), (999, 2.1)] };
        let seconds = |(first, last): &Chunk| -> f64 {
            (*first..=*last).map(|frame| 0.1 + 2.0 * frame as f64 / 999.0).sum()
        };
        let chunks = chunks_of_equal_cost(1000, 1, &rising, 10_000);
        assert_covers_all_frames(&chunks, 1000);
        assert_eq!(chunks.len(), (1100.0 / 9.5) as usize);
        let (worst, best) =
            chunks.iter().map(seconds).fold((0.0f64, f64::MAX), |(w, b), s| (w.max(s), b.min(s)));
        assert!(worst < best + 2.1 * 2.0 && best > 9.5 - 2.1 * 2.0, "{best} to {worst} s");
        // The last frames cost more, so their chunks are shorter.
        let last = chunks[chunks.len() - 2];
        assert!(chunks[0].1 > 40 && last.1 - last.0 < 6, "{chunks:?}");
        assert_eq!(chunks_of_equal_cost(1000, 1, &rising, 7).len(), 7);
    }

    #[test]
    fn chunks_end_at_ends_of_pieces_unless_they_are_far_shorter() {
        let even = |start| FilmCost { start_secs: start, frames: vec![(0, 1.0)] };
        for (start, piece) in [(2.0, 24), (1.0, 24), (5.0, 7), (0.6, 20)] {
            let chunks = chunks_of_equal_cost(1000, piece, &even(start), 1000);
            assert_covers_all_frames(&chunks, 1000);
            assert!(chunks.iter().rev().skip(1).all(|(_, last)| (last + 1) % piece == 0), "{chunks:?}");
        }
        let short = chunks_of_equal_cost(1000, 120, &even(0.5), 1000);
        assert_covers_all_frames(&short, 1000);
        assert_eq!(short.len(), 105);
    }

    #[test]
    fn extreme_costs_give_one_chunk_or_one_chunk_per_frame() {
        let cost = |start, frame| FilmCost { start_secs: start, frames: vec![(0, frame)] };
        assert_eq!(chunks_of_equal_cost(1, 24, &cost(1.0, 1.0), 1000), [(0, 0)]);
        assert_eq!(chunks_of_equal_cost(50, 24, &cost(100.0, 0.01), 1000), [(0, 49)]);
        assert_covers_all_frames(&chunks_of_equal_cost(50, 1, &cost(0.0, 1.0), 1000), 50);
        assert_eq!(chunks_of_equal_cost(50, 1, &cost(0.0, 1.0), 1000).len(), 50);
        assert_eq!(chunks_of_equal_cost(50, 1, &cost(1.0, 0.0), 1000), [(0, 49)]);
        assert_covers_all_frames(&chunks_of_equal_cost(50, 100, &cost(0.0, 0.0), 1000), 50);
        assert_eq!(chunks_of_length(60, 24), [(0, 23), (24, 47), (48, 59)]);
        assert_eq!(chunks_of_length(48, 24), [(0, 23), (24, 47)]);
        assert_eq!(
            [
                nearest_multiple_of_piece(11, 24),
                nearest_multiple_of_piece(12, 24),
                nearest_multiple_of_piece(40, 24),
                nearest_multiple_of_piece(5, 1)
            ],
            [11, 24, 48, 5]
        );
    }
}
