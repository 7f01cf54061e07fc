//! How long importing takes: `cargo bench -p import-obj [-- FILE…]`, medians of 21 runs.

fn main() {
    let files = [
        "obj/spider.obj",
        "same-model-3-formats/barrel_large_decorated.obj",
        "same-model-3-formats/chest_gold.obj",
    ];
    choreo_import_testing::bench::run(&import_obj::ObjImporter, &files);
}
