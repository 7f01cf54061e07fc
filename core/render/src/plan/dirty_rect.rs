//! Dirty rectangle: the part of the frame that anything is drawn into. The rest is background, which needs neither samples nor depth.

use choreo_asset::Aabb;
use glam::{Mat4, Vec2, Vec4, Vec4Swizzles};

/// Largest share of the frame for which a rectangle is worth a copy of the background.
const LARGEST_SHARE: f32 = 0.7;
/// Edges of boxes are clipped at this distance in front of the camera.
const NEAR_CLIP_METRES: f32 = 1e-4;
/// Margin in pixels around each drawn box: half the width of points and lines, and rounding.
pub(crate) const MARGIN: f32 = 3.0;
/// Rectangles begin and end at multiples of this number of pixels: software rasterizers work in blocks.
const BLOCK: u32 = 4;

/// A rectangle in pixels, y down, that grows with each box that is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirtyRect {
    from: Vec2,
    to: Vec2,
}

impl DirtyRect {
    pub const NOTHING: DirtyRect = DirtyRect { from: Vec2::INFINITY, to: Vec2::NEG_INFINITY };
    pub const EVERYTHING: DirtyRect = DirtyRect { from: Vec2::NEG_INFINITY, to: Vec2::INFINITY };

    /// Adds the projection of a camera-relative box. `beyond`: margin around it in pixels.
    pub fn add(&mut self, b: Aabb, clip_from_relative: &Mat4, size: [u32; 2], beyond: f32) {
        let corners = b.corners().map(|c| *clip_from_relative * c.extend(1.0));
        if !corners.iter().all(|c| c.is_finite()) {
            *self = DirtyRect::EVERYTHING;
            return;
        }
        let size = Vec2::new(size[0] as f32, size[1] as f32);
        let around = Vec2::splat(beyond + MARGIN);
        let mut put = |c: Vec4| {
            let at = (c.xy() / c.w * 0.5 + 0.5) * size;
            self.from = self.from.min(at - around);
            self.to = self.to.max(at + around);
        };
        for (i, &a) in corners.iter().enumerate() {
            if a.w >= NEAR_CLIP_METRES {
                put(a);
            }
            for axis in [1, 2, 4].into_iter().filter(|axis| i & axis == 0) {
                let b = corners[i | axis];
                if (a.w >= NEAR_CLIP_METRES) != (b.w >= NEAR_CLIP_METRES) {
                    let at = a + (b - a) * ((NEAR_CLIP_METRES - a.w) / (b.w - a.w));
                    put(at.xyz().extend(NEAR_CLIP_METRES));
                }
            }
        }
    }

    /// Left, top, width and height in pixels of the frame; `None` if the rectangle is most of the frame.
    pub fn part_of(&self, size: [u32; 2]) -> Option<[u32; 4]> {
        let ends = |i: usize| {
            let last = size[i] as f32;
            // The rectangle is never empty, because a pass needs a pixel.
            let from = (self.from[i].clamp(0.0, last - 1.0) as u32) / BLOCK * BLOCK;
            let to = (self.to[i].clamp(0.0, last).ceil() as u32).next_multiple_of(BLOCK);
            [from, to.clamp(from + 1, size[i]) - from]
        };
        let ([x, width], [y, height]) = (ends(0), ends(1));
        let share = (width as f32 * height as f32) / (size[0] as f32 * size[1] as f32);
        (share <= LARGEST_SHARE).then_some([x, y, width, height])
    }

    /// Left top and right bottom of the part inside the frame, in pixels; `None` if it is empty.
    pub(crate) fn inside(&self, size: [u32; 2]) -> Option<[Vec2; 2]> {
        let whole = Vec2::new(size[0] as f32, size[1] as f32);
        let (from, to) = (self.from.max(Vec2::ZERO), self.to.min(whole));
        from.cmplt(to).all().then_some([from, to])
    }

    /// First and last column, first and last row of the screen tiles that the rectangle touches; `None` if it lies outside the
    /// frame. `side`: side of a tile in pixels.
    pub(crate) fn tiles(&self, size: [u32; 2], side: u32) -> Option<[[u32; 2]; 2]> {
        let ends = |i: usize| {
            let last = size[i] as f32;
            let seen = self.to[i] >= 0.0 && self.from[i] < last;
            seen.then(|| [self.from[i], self.to[i]].map(|v| v.clamp(0.0, last - 1.0) as u32 / side))
        };
        Some([ends(0)?, ends(1)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    const SIZE: [u32; 2] = [400, 200];

    /// A view 57° high, twice as wide as high; y down, as in images.
    fn view() -> Mat4 {
        let row = Vec4::new;
        let [up, right] = [1.83, 0.915];
        let rows = [row(right, 0.0, 0.0, 0.0), row(0.0, -up, 0.0, 0.0), row(0.0, 0.0, 0.0, 0.1), -Vec4::Z];
        Mat4::from_cols_array_2d(&rows.map(|r| r.to_array())).transpose()
    }

    fn around(at: Vec3, half: f32) -> Aabb {
        Aabb { min: at - half, max: at + half }
    }

    #[test]
    fn rectangles_contain_every_visible_point_of_their_box() {
        let boxes = [
            around(Vec3::new(1.0, 0.5, -6.0), 0.5),
            around(Vec3::new(-2.0, -0.5, -9.0), 0.2),
            // A floor that reaches behind the camera.
            Aabb { min: Vec3::new(-3.0, -1.1, -8.0), max: Vec3::new(3.0, -1.0, 5.0) },
        ];
        for b in boxes {
            let mut rect = DirtyRect::NOTHING;
            rect.add(b, &view(), SIZE, 0.0);
            let Some([x, y, w, h]) = rect.part_of(SIZE) else { panic!("{b:?} covers little") };
            for i in 0..1000 {
                let share = Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32) / 9.0;
                let c = view() * (b.min + (b.max - b.min) * share).extend(1.0);
                let at = (c.xy() / c.w * 0.5 + 0.5) * Vec2::new(400.0, 200.0);
                if c.w < 0.1 || at.cmplt(Vec2::ZERO).any() || at.x >= 400.0 || at.y >= 200.0 {
                    continue;
                }
                let (dx, dy) = (at.x - x as f32, at.y - y as f32);
                assert!(dx >= 0.0 && dy >= 0.0 && dx <= w as f32 && dy <= h as f32, "{b:?}: {at}");
            }
        }
    }

    #[test]
    fn a_rectangle_of_nan_or_most_of_the_frame_is_the_whole_frame() {
        let mut rect = DirtyRect::NOTHING;
        assert_eq!(rect.part_of(SIZE), Some([396, 196, 1, 1]), "of nothing a pixel");
        rect.add(around(Vec3::new(0.0, 0.0, -2.0), 1.5), &view(), SIZE, 0.0);
        assert_eq!(rect.part_of(SIZE), None);
        let mut rect = DirtyRect::NOTHING;
        rect.add(around(Vec3::new(f32::NAN, 0.0, -6.0), 1.0), &view(), SIZE, 0.0);
        assert_eq!(rect.part_of(SIZE), None);
        assert_eq!(DirtyRect::EVERYTHING.part_of(SIZE), None);
        // An image of one pixel has no smaller part.
        assert_eq!(DirtyRect::NOTHING.part_of([1, 1]), None);
    }

    #[test]
    fn more_boxes_never_shrink_the_rectangle() {
        let mut rect = DirtyRect::NOTHING;
        rect.add(around(Vec3::new(1.0, 0.0, -9.0), 0.3), &view(), SIZE, 0.0);
        let one = rect.part_of(SIZE).unwrap();
        rect.add(around(Vec3::new(-1.0, 0.0, -9.0), 0.3), &view(), SIZE, 2.0);
        let two = rect.part_of(SIZE).unwrap();
        assert!(two[0] < one[0] && two[0] + two[2] >= one[0] + one[2] && two[3] >= one[3], "{one:?} {two:?}");
    }
}
