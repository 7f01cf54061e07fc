//! ID mattes: the names of the actors or materials in each pixel and their shares, from several samples per pixel.

use choreo_plugin::{IdMatte, IdShare};
use rayon::prelude::*;

/// Number of the name (actor or material) in each pixel, one image for each sample; 0 where nothing is drawn.
pub(super) struct IdSamples(pub Vec<Vec<u32>>);

impl IdSamples {
    /// The names in each pixel, sorted by share. Names with equal shares are in the order of their numbers.
    pub(super) fn matte(&self, names: Vec<String>) -> IdMatte {
        let IdSamples(samples) = self;
        let pixels = samples.first().map_or(0, Vec::len);
        let rank_count = samples.len().min(IdMatte::MOST_RANKS);
        let share = 1.0 / samples.len().max(1) as f32;
        let pixel_shares = |pixel: usize| {
            let mut counts: Vec<(u32, u32)> = Vec::with_capacity(samples.len());
            for number in samples.iter().map(|sample| sample[pixel]).filter(|number| *number > 0) {
                match counts.iter_mut().find(|(known, _)| *known == number) {
                    Some((_, count)) => *count += 1,
                    None => counts.push((number, 1)),
                }
            }
            counts.sort_unstable_by_key(|(number, count)| (u32::MAX - count, *number));
            let mut shares = [IdShare::default(); IdMatte::MOST_RANKS];
            for (out, (number, count)) in shares.iter_mut().zip(counts) {
                *out = IdShare { number, share: count as f32 * share };
            }
            shares
        };
        let all: Vec<[IdShare; IdMatte::MOST_RANKS]> =
            (0..pixels).into_par_iter().map(pixel_shares).collect();
        let rank = |rank: usize| all.iter().map(|shares| shares[rank]).collect();
        IdMatte { names, ranks: (0..rank_count).map(rank).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_ranked_by_their_shares() {
        let matte = |samples: &[u32]| {
            let samples = IdSamples(samples.iter().map(|number| vec![*number]).collect());
            let ranks = samples.matte(Vec::new()).ranks;
            ranks.iter().map(|rank| (rank[0].number, rank[0].share)).collect::<Vec<_>>()
        };
        assert_eq!(matte(&[3]), [(3, 1.0)]);
        assert_eq!(matte(&[0, 2, 7, 7]), [(7, 0.5), (2, 0.25), (0, 0.0), (0, 0.0)]);
        assert_eq!(matte(&[4, 1, 4, 1]), [(1, 0.5), (4, 0.5), (0, 0.0), (0, 0.0)]);
        let many: Vec<u32> = (1..=16).collect();
        assert_eq!(matte(&many).len(), IdMatte::MOST_RANKS);
    }
}
