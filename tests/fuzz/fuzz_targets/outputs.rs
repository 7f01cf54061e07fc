//! PNG, MP4, GIF and y4m as `choreo info` and `--resume` read them, and PNG as the stored image of a test.
#![no_main]

use choreo_test_runner::golden_image::{decode, encode};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let media = choreo_command_line::output::media::read(bytes);
    if let Some(media) = &media {
        let told: usize = media.provenance.iter().map(|(k, v)| k.len() + v.len()).sum();
        // A byte that is no text is shown by three.
        assert!(told <= 3 * bytes.len() + 100 && !media.format.is_empty());
    }
    let whole = choreo_command_line::output::media::read_complete_image(bytes);
    assert!(whole.is_none() || whole == media);
    match decode(bytes) {
        Ok(stored) => {
            let frame = stored.frame;
            assert_eq!(frame.rgba.len() as u64, u64::from(frame.width) * u64::from(frame.height) * 4);
            if frame.rgba.len() < 1 << 14 {
                let again = decode(&encode(&frame, &[]).expect("a frame is a PNG")).expect("our own PNG");
                assert_eq!(again.frame, frame);
            }
        }
        Err(text) => assert!(!text.is_empty()),
    }
});
