//! The text of an OBJ file and, behind a zero byte, of what lies beside it under any name: its MTL, or a texture.
#![no_main]

use choreo_fuzz::{SingleFile, import};
use import_obj::ObjImporter;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut parts = bytes.splitn(2, |b| *b == 0);
    let (obj, beside) = (parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    import(&ObjImporter, "fuzz.obj", obj, &SingleFile(beside));
});
