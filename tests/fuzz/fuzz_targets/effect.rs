//! WGSL of effects, through the preprocessor and the compiler. Errors name a file and a line that is there.
#![no_main]

use choreo_render::RenderError;
use choreo_render::shader::{ShaderSources, compile, preprocess};
use libfuzzer_sys::{Corpus, fuzz_target};

fuzz_target!(|bytes: &[u8]| -> Corpus {
    let Ok(text) = std::str::from_utf8(bytes) else { return Corpus::Reject };
    for on in [&[][..], &["SKIN", "LIT", "MORPH"]] {
        match preprocess(text, on) {
            Ok(out) => assert_eq!(out.lines().count(), text.lines().count(), "lines stay"),
            Err(error) => assert!(error.line >= 1 && error.line <= text.lines().count()),
        }
    }
    let files = ShaderSources::default().post("fuzz", text).expect("the template is in the program");
    let entries = [("post_fs", naga::ShaderStage::Fragment)];
    match compile(&files, &[], &entries, false) {
        Ok(entries) => assert!(!entries[0].words.is_empty()),
        Err(RenderError::Shader { file, text }) => assert!(!file.is_empty() && !text.is_empty()),
        Err(other) => panic!("{other}"),
    }
    Corpus::Keep
});
