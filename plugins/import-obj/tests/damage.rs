//! Files cut off and with bits turned over: in a process of its own, since the memory of the whole process is measured.

use choreo_import_testing::{assets, damage};
use import_obj::ObjImporter;

const ROOM: &str = include_str!("data/room.obj");

#[test]
fn truncated_and_flipped() {
    let mut cases = vec![("room.obj", ROOM.as_bytes().to_vec(), 1000)];
    if let Some(folder) = assets(2) {
        for name in ["obj/spider.obj", "same-model-3-formats/chest_gold.obj"] {
            cases.push((name, std::fs::read(folder.join(name)).unwrap(), damage::flips()));
        }
    }
    for (name, bytes, flips) in cases {
        let outcome = damage::run(&ObjImporter, name, &bytes, flips);
        assert!(outcome.refused > 0 && outcome.read > 0, "{name}: {outcome:?}");
    }
}
