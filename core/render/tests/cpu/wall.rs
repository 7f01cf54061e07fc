//! A quad that fills the image.

use crate::common::*;
use choreo_asset::Material;

/// A quad that fills the image, facing an orthographic camera: N = V = +Z.
pub(crate) fn wall(material: Material) -> Scene {
    let mut scene = Scene::ortho(2.0);
    scene.at(&asset(vec![quad(2.0, 2.0)], vec![material], vec![]), 0.0, 0.0, 0.0);
    scene
}

pub(crate) fn middle_pixel(scene: &Scene) -> [u8; 4] {
    pixel(&draw_at(scene, [5, 5], 1), 2, 2)
}
