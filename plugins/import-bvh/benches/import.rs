//! How long importing takes: `cargo bench -p import-bvh [-- FILE…]`, medians and best of 21 runs.

fn main() {
    let files = ["bvh/walk01.bvh", "bvh/mocopi-mobile-arm-raise-turn.bvh"];
    choreo_import_testing::bench::run(&import_bvh::BvhImporter, &files);
}
