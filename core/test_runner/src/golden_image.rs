//! Golden images in files beside the tests: PNG files that record the class of device on which they were accepted.

use choreo_files::{FileError, Folder, WriteError, write_whole_beneath};
use choreo_plugin::Frame;
use std::path::{Path, PathBuf};

/// Largest golden image in bytes that is not marked as large: golden images stay in version control forever.
pub const MAX_BYTES: usize = 40 << 10;
/// Largest number of bytes that are read from a file: no test image is larger.
const MAX_FILE_BYTES: u64 = 64 << 20;

/// Keyword of the PNG text that holds the class of the device.
const DEVICE_KEYWORD: &str = "choreo:device";

#[derive(Clone, Debug, PartialEq)]
pub struct GoldenImage {
    pub frame: Frame,
    /// Class of the device; empty if the file does not state it, because `choreo test` did not write it.
    pub device: String,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GoldenImageError {
    Missing,
    /// Reason, without the file's name.
    Damaged(String),
}

/// Reason why bytes are not a golden image, without the file's name.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    #[error("it ends too early")]
    Truncated,
    #[error(transparent)]
    Png(png::DecodingError),
    #[error("a test image cannot have {0}x{1} pixels")]
    Dimensions(u32, u32),
    #[error("its pixels need more memory than the program can address")]
    TooLarge,
    #[error("its color type is {0:?}; a golden image is RGB or grayscale, with or without alpha")]
    Pixels(png::ColorType),
}

impl From<png::DecodingError> for DecodeError {
    fn from(error: png::DecodingError) -> DecodeError {
        match error {
            png::DecodingError::IoError(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
                DecodeError::Truncated
            }
            error => DecodeError::Png(error),
        }
    }
}

/// Error of writing a golden image.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot write: {error}", place.display())]
pub struct WriteGoldenImageError {
    place: PathBuf,
    error: WriteError,
}

/// Path of a golden image: for "start" of `tests/suite/walk.rhai`, `tests/suite/pictures/walk/start.png`.
pub fn path_of(test_file: &Path, name: &str) -> PathBuf {
    let stem = test_file.file_stem().unwrap_or_default();
    test_file.with_file_name("pictures").join(stem).join(format!("{name}.png"))
}

/// Reads and decodes a golden image; also returns the bytes of its file.
pub fn read(path: &Path) -> Result<(GoldenImage, Vec<u8>), GoldenImageError> {
    let bytes = read_golden_image(path).map_err(|error| match error.is_missing() {
        true => GoldenImageError::Missing,
        false => GoldenImageError::Damaged(error.to_string()),
    })?;
    decode(&bytes).map(|stored| (stored, bytes)).map_err(|e| GoldenImageError::Damaged(e.to_string()))
}

/// Reads the bytes of a golden image. Links may only lead to files below the test's folder.
fn read_golden_image(path: &Path) -> Result<Vec<u8>, FileError> {
    // Paths have the form FOLDER/pictures/FILE/NAME.png, as in `path_of`.
    let Some(folder) = path.ancestors().nth(3) else { return choreo_files::read(path, MAX_FILE_BYTES) };
    let inside = path.strip_prefix(folder).unwrap_or(path);
    Folder::open(folder)?.read(inside, MAX_FILE_BYTES)
}

/// Decodes a PNG with 8 bits per channel.
pub fn decode(bytes: &[u8]) -> Result<GoldenImage, DecodeError> {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::normalize_to_color8() | png::Transformations::ALPHA);
    let mut reader = decoder.read_info()?;
    let (width, height) = (reader.info().width, reader.info().height);
    if u64::from(width) * u64::from(height) > crate::painter::MAX_PIXELS {
        return Err(DecodeError::Dimensions(width, height));
    }
    let mut pixels = vec![0; reader.output_buffer_size().ok_or(DecodeError::TooLarge)?];
    let info = reader.next_frame(&mut pixels)?;
    pixels.truncate(info.buffer_size());
    let rgba = match info.color_type {
        png::ColorType::Rgba => pixels,
        png::ColorType::GrayscaleAlpha => {
            pixels.as_chunks::<2>().0.iter().flat_map(|[v, a]| [*v, *v, *v, *a]).collect()
        }
        other => return Err(DecodeError::Pixels(other)),
    };
    let info = reader.info();
    let device = info
        .uncompressed_latin1_text
        .iter()
        .filter(|t| t.keyword == DEVICE_KEYWORD)
        .map(|t| t.text.clone())
        .chain(
            info.utf8_text.iter().filter(|t| t.keyword == DEVICE_KEYWORD).filter_map(|t| t.get_text().ok()),
        )
        .next();
    Ok(GoldenImage { frame: Frame { width, height, rgba }, device: device.unwrap_or_default() })
}

/// Encodes a PNG with the strongest compression, since images are written once and kept. `texts`: keywords and texts.
pub fn encode(frame: &Frame, texts: &[(&str, &str)]) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, frame.width, frame.height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::High);
    encoder.set_filter(png::Filter::Adaptive);
    for (keyword, text) in texts {
        match text.chars().all(|c| matches!(c, ' '..='~')) {
            true => encoder.add_text_chunk(keyword.to_string(), text.to_string()),
            false => encoder.add_itxt_chunk(keyword.to_string(), text.to_string()),
        }?;
    }
    let opaque = frame.rgba.as_chunks::<4>().0.iter().all(|p| p[3] == 255);
    encoder.set_color(if opaque { png::ColorType::Rgb } else { png::ColorType::Rgba });
    let mut writer = encoder.write_header()?;
    let rgb: Vec<u8>;
    let data = if opaque {
        rgb = frame.rgba.as_chunks::<4>().0.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
        &rgb
    } else {
        &frame.rgba
    };
    writer.write_image_data(data)?;
    writer.finish()?;
    Ok(bytes)
}

/// Encodes a golden image. `device`: class of the device that drew it. `name`: file and section, for readers who find the file alone.
pub fn encode_accepted(frame: &Frame, device: &str, name: &str) -> Result<Vec<u8>, png::EncodingError> {
    encode(frame, &[(DEVICE_KEYWORD, device), ("choreo:test", name)])
}

/// Writes the bytes of an image to its [`path_of`], and follows no links below the test's folder.
pub fn write(test_file: &Path, name: &str, bytes: &[u8]) -> Result<(), WriteGoldenImageError> {
    let (folder, place) = (test_file.parent().unwrap_or(Path::new("")), path_of(test_file, name));
    let beneath = place.strip_prefix(folder).unwrap_or(&place);
    write_whole_beneath(folder, beneath, bytes).map_err(|error| WriteGoldenImageError { place, error })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(alpha: u8) -> Frame {
        let rgba =
            (0..20 * 10).flat_map(|i| [(i * 3) as u8, i as u8, 7, alpha.max((i % 2) as u8 * 255)]).collect();
        Frame { width: 20, height: 10, rgba }
    }

    #[test]
    fn encoded_images_decode_to_the_same_pixels_and_device() {
        for alpha in [255, 0] {
            let bytes = encode_accepted(&frame(alpha), "vulkan:ä/1", "a.rhai > b").unwrap();
            let stored = decode(&bytes).unwrap();
            assert_eq!(stored, GoldenImage { frame: frame(alpha), device: "vulkan:ä/1".into() });
        }
        assert_eq!(decode(&encode(&frame(255), &[]).unwrap()).unwrap().device, "");
    }

    #[test]
    fn truncated_files_are_errors_and_damaged_files_never_panic() {
        let bytes = encode_accepted(&frame(255), "cpu", "t").unwrap();
        // The last 12 bytes are the end chunk (IEND), which has no content.
        for cut in 0..bytes.len() - 12 {
            assert!(decode(&bytes[..cut]).is_err(), "cut at {cut}");
        }
        for at in 0..bytes.len() {
            let mut broken = bytes.clone();
            broken[at] ^= 0x10;
            // A fault in a text or in the end chunk does not change the pixels.
            let is_error_or_unchanged = decode(&broken).map_or(true, |stored| stored.frame == frame(255));
            assert!(is_error_or_unchanged, "byte {at}");
        }
    }

    #[test]
    fn writing_a_golden_image_creates_its_folders_and_replaces_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let test = dir.path().join("walk.rhai");
        assert_eq!(read(&path_of(&test, "start")), Err(GoldenImageError::Missing));
        write(&test, "start", b"one").unwrap();
        write(&test, "start", b"two").unwrap();
        assert_eq!(std::fs::read(dir.path().join("pictures/walk/start.png")).unwrap(), b"two");
        assert_eq!(std::fs::read_dir(dir.path().join("pictures/walk")).unwrap().count(), 1);
    }

    /// The link replaces each folder of the path in turn, then the image itself.
    #[test]
    #[cfg(unix)]
    fn golden_images_are_not_written_through_symbolic_links() {
        let dir = tempfile::tempdir().unwrap();
        let far = dir.path().join("far");
        std::fs::create_dir_all(far.join("walk")).unwrap();
        let test = dir.path().join("suite/walk.rhai");
        for name in ["pictures", "pictures/walk", "pictures/walk/start.png"] {
            let link = dir.path().join("suite").join(name);
            std::fs::create_dir_all(link.parent().unwrap()).unwrap();
            std::os::unix::fs::symlink(&far, &link).unwrap();
            let expected = format!(
                "{}: cannot write: {} is a symbolic link to {}; remove it",
                path_of(&test, "start").display(),
                link.display(),
                far.display()
            );
            assert_eq!(write(&test, "start", b"one").unwrap_err().to_string(), expected);
            std::fs::remove_file(&link).unwrap();
        }
        assert_eq!(std::fs::read_dir(far.join("walk")).unwrap().count(), 0);
    }

    #[cfg(unix)]
    #[test]
    fn golden_images_are_not_read_through_links_or_pipes() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let image = |name: &str| path_of(&dir.path().join("tests/a.rhai"), name);
        let bytes = encode_accepted(&frame(255), "cpu", "t").unwrap();
        std::fs::write(dir.path().join("secret.png"), &bytes).unwrap();
        write(&dir.path().join("tests/a.rhai"), "good", &bytes).unwrap();
        symlink("../../../secret.png", image("out")).unwrap();
        symlink("good.png", image("within")).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(image("pipe")).status().unwrap().success());
        let damaged = |why: &str| Err(GoldenImageError::Damaged(why.into()));
        assert_eq!(read(&image("out")), damaged("it leads out of the folder"));
        assert_eq!(read(&image("pipe")), damaged("it is a pipe or device, not a regular file"));
        assert!(read(&image("good")).is_ok() && read(&image("within")).is_ok());
        // The folder of the images can be a link too.
        std::fs::rename(dir.path().join("tests/pictures"), dir.path().join("pictures")).unwrap();
        symlink("../pictures", dir.path().join("tests/pictures")).unwrap();
        assert_eq!(read(&image("good")), damaged("it leads out of the folder"));
    }
}
