//! Indexing with one bounds check for many indices instead of a branch for each.

/// Indices, and the largest index of the list that they are a part of.
#[derive(Clone, Copy)]
pub(crate) struct Indices<'a> {
    all: &'a [u16],
    largest: u16,
}

impl<'a> Indices<'a> {
    #[inline(always)]
    pub(crate) fn new(all: &'a [u16]) -> Self {
        // The fold has no early exit, so that it is vectorized.
        Indices { all, largest: all.iter().copied().fold(0, u16::max) }
    }

    /// A part of the indices. Panics if the range is beyond the last one.
    #[inline(always)]
    pub(crate) fn subrange(&self, range: std::ops::Range<usize>) -> Self {
        Indices { all: &self.all[range], largest: self.largest }
    }

    #[inline(always)]
    pub(crate) fn as_slice(&self) -> &'a [u16] {
        self.all
    }
}

/// Items, and indices that are known to be in range.
#[derive(Clone, Copy)]
pub(crate) struct Indexed<'a, T> {
    items: &'a [T],
    indices: &'a [u16],
}

impl<'a, T> Indexed<'a, T> {
    /// Panics if the largest index is out of range.
    #[inline(always)]
    pub(crate) fn new(items: &'a [T], Indices { all, largest }: Indices<'a>) -> Self {
        assert!(
            usize::from(largest) < items.len() || all.is_empty(),
            "joint {largest} is out of range: {} joints",
            items.len()
        );
        Indexed { items, indices: all }
    }

    /// The item of index number `at`. Panics beyond the last index.
    #[inline(always)]
    pub(crate) fn get(&self, at: usize) -> &'a T {
        // SAFETY: as in `get_four`.
        unsafe { self.items.get_unchecked(usize::from(self.indices[at])) }
    }

    /// The items of four indices, the first of which is at `4 * four`. Panics beyond the last index.
    ///
    /// One load replaces four, and no index is checked by itself: kernels that gather wait for loads more than for
    /// arithmetic (skinning by four joints took 3.4 ns a vertex with both, else 4.0).
    #[inline(always)]
    pub(crate) fn get_four(&self, four: usize) -> [&'a T; 4] {
        let indices = &self.indices.as_chunks::<4>().0[four];
        // SAFETY: both are eight bytes, and any eight are a number.
        let packed_indices = unsafe { std::mem::transmute::<[u16; 4], u64>(indices.map(u16::to_le)) }.to_le();
        let (a, b, c, d) = (
            packed_indices & 0xFFFF,
            (packed_indices >> 16) & 0xFFFF,
            (packed_indices >> 32) & 0xFFFF,
            packed_indices >> 48,
        );
        // SAFETY: `new` has compared the largest of these indices with the length of this list, which is borrowed, as they are,
        // and so has not changed since.
        unsafe {
            [
                self.items.get_unchecked(a as usize),
                self.items.get_unchecked(b as usize),
                self.items.get_unchecked(c as usize),
                self.items.get_unchecked(d as usize),
            ]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Indexed, Indices};

    #[test]
    fn items_are_found_by_their_indices() {
        let items = [10, 11, 12, 13];
        let indexed = Indexed::new(&items, Indices::new(&[3, 0, 1, 1, 2, 3, 0, 0]));
        assert_eq!(indexed.get_four(0).map(|i| *i), [13, 10, 11, 11]);
        assert_eq!(indexed.get_four(1).map(|i| *i), [12, 13, 10, 10]);
        assert!(Indexed::<i32>::new(&[], Indices::new(&[])).indices.is_empty());
        let many = vec![7u8; 70_000];
        assert_eq!(Indexed::new(&many, Indices::new(&[u16::MAX; 4])).get_four(0), [&7; 4]);
        let part = Indices::new(&[9, 3, 0, 1, 1]).subrange(1..5);
        assert_eq!(Indexed::new(&many, part).get_four(0), [&7; 4]);
    }

    #[test]
    #[should_panic(expected = "joint 2 is out of range: 2 joints")]
    fn an_index_beyond_the_list_panics() {
        // The largest is not in this part.
        Indexed::new(&[1, 2], Indices::new(&[0, 1, 2, 0]).subrange(0..2));
    }

    #[test]
    #[should_panic(expected = "joint 0 is out of range: 0 joints")]
    fn an_index_into_an_empty_list_panics() {
        Indexed::<u8>::new(&[], Indices::new(&[0]));
    }
}
