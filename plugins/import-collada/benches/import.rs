//! How long importing takes: `cargo bench -p import-collada [-- FILE…]`, medians of 21 runs.

fn main() {
    let files = [
        "dae/walk.dae",
        "dae/pab/walk.dae",
        "dae/pab/skeleton.dae",
        "dae/cordless_drill/meshes/cordless_drill.dae",
    ];
    choreo_import_testing::bench::run(&import_collada::ColladaImporter, &files);
}
