//! The area in which two frames differ.

/// The smallest rectangle that holds all differing pixels of two RGBA images of the same size: left, top, and the exclusive right and
/// bottom. `None` if all pixels are equal.
///
/// ```
/// use choreo_plugin::changed_area;
/// let before = [0; 4 * 3 * 2];
/// let mut now = before;
/// now[4 * 4] = 255;
/// assert_eq!(changed_area(&before, &now, 3), Some([1, 1, 2, 2]));
/// assert_eq!(changed_area(&before, &before, 3), None);
/// ```
pub fn changed_area(before: &[u8], now: &[u8], width: usize) -> Option<[usize; 4]> {
    let rows = || before.chunks_exact(width * 4).zip(now.chunks_exact(width * 4)).enumerate();
    let top = rows().find(|(_, (a, b))| a != b)?.0;
    let (mut left, mut right, mut bottom) = (width, 0, top);
    for (y, (a, b)) in rows().skip(top).filter(|(_, (a, b))| a != b) {
        bottom = y + 1;
        let differs = |x: &usize| a[x * 4..x * 4 + 4] != b[x * 4..x * 4 + 4];
        left = (0..left).find(differs).unwrap_or(left);
        right = (right..width).rev().find(differs).map_or(right, |x| x + 1);
    }
    Some([left, top, right, bottom])
}
