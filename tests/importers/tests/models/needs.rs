//! Parts that a caller does not request are left out, and all else is the same.

use choreo_asset::Asset;
use choreo_importer_kit_testing::assets;
use choreo_plugin::ImportScope;
use importers::{SAMPLES, import, import_whole, samples};

fn image_names_and_sizes(asset: &Asset) -> Vec<(String, u32, u32)> {
    asset.images.iter().map(|i| (i.name.clone(), i.width, i.height)).collect()
}

/// `choreo info` opens files like this: images have their sizes and no pixels.
#[test]
fn images_without_pixels_have_the_same_names_and_sizes() {
    let Some(folder) = assets(SAMPLES) else { return };
    let mut told = 0;
    for name in samples(&folder) {
        let path = folder.join(&name);
        let asset = import(&path, ImportScope::NO_PIXELS).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(
            image_names_and_sizes(&asset),
            image_names_and_sizes(&import_whole(&path)),
            "{}",
            name.display()
        );
        assert!(asset.images.iter().all(|i| i.rgba.is_empty()), "{}", name.display());
        told += asset.images.len();
    }
    assert!(told > 5, "{told} images in all samples");
}
