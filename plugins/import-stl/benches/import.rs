//! How long importing takes: `cargo bench -p import-stl [-- FILE…]`, medians of 21 runs.

fn main() {
    choreo_import_testing::bench::run(
        &import_stl::StlImporter,
        &["stl/Spider_ascii.stl", "stl/Spider_binary.stl"],
    );
}
