//! Thumbnails stored in the cache folder as PNG files, with the clips of a model in a text chunk.

use super::thumbnails::{ClipEntry, Thumbnail};
use choreo_files::write_whole_beneath;
use choreo_plugin::Frame;
use choreo_script::{content_of, hex};
use serde_json::{Value, json};
use std::fs::File;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Keyword of the text chunk with the clips.
const CLIPS_KEYWORD: &str = "choreo clips";
/// Largest thumbnail file, bytes.
const MAX_FILE_BYTES: u64 = 1 << 22;
/// Largest total size of the cached thumbnails, bytes: some thousands of them.
pub(super) const MAX_CACHE_BYTES: u64 = 64 << 20;

/// Cache file of a thumbnail, named after the content of the displayed file, so that a changed file gets a new one.
pub(super) fn path(cache: &Path, shown_file: &Path, clip: Option<&str>) -> Option<PathBuf> {
    let name = hex(&content_of(shown_file)?[..16]);
    // The name of a clip may contain characters that a file name must not.
    let clip = hex(clip.unwrap_or("").as_bytes());
    let version = env!("CARGO_PKG_VERSION");
    Some(cache.join("thumbnails").join(format!("{version}-{name}-{clip:.60}.png")))
}

pub(super) fn read(file: &Path) -> Option<Thumbnail> {
    let bytes = choreo_files::read(file, MAX_FILE_BYTES).ok()?;
    // The modification time marks the last use. Without write permission it does not change.
    let _ = File::options().append(true).open(file).and_then(|file| file.set_modified(SystemTime::now()));
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().ok()?;
    let mut rgba = vec![0; reader.output_buffer_size().filter(|size| *size as u64 <= MAX_FILE_BYTES)?];
    let info = reader.next_frame(&mut rgba).ok()?;
    if (info.color_type, info.bit_depth) != (png::ColorType::Rgba, png::BitDepth::Eight) {
        return None;
    }
    let (width, height) = (info.width, info.height);
    let text = reader.info().utf8_text.iter().find(|text| text.keyword == CLIPS_KEYWORD)?.get_text().ok()?;
    let clips: Vec<Value> = serde_json::from_str(&text).ok()?;
    let clips = clips.iter().filter_map(|clip| {
        Some(ClipEntry { name: clip["name"].as_str()?.to_string(), secs: clip["secs"].as_f64()? })
    });
    Some(Thumbnail {
        frames: vec![Frame { width, height, rgba }],
        secs: 0.0,
        clips: clips.collect(),
        note: None,
    })
}

/// Writes a thumbnail. Errors are ignored, since the image is then drawn again the next time.
pub(super) fn write(file: &Path, thumbnail: &Thumbnail) {
    let (Some(bytes), Some(folder), Some(name)) = (encode_png(thumbnail), file.parent(), file.file_name())
    else {
        return;
    };
    let _ = write_whole_beneath(folder, name.as_ref(), &bytes);
}

/// Deletes the least recently used thumbnails until the others have at most `max_bytes` bytes in total.
pub(super) fn delete_oldest(folder: &Path, max_bytes: u64) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let image = |entry: std::fs::DirEntry| {
        let (path, about) = (entry.path(), entry.metadata().ok()?);
        let is_image = about.is_file() && path.extension().is_some_and(|extension| extension == "png");
        Some((about.modified().ok()?, about.len(), path)).filter(|_| is_image)
    };
    let mut images: Vec<_> = entries.flatten().filter_map(image).collect();
    images.sort();
    let mut bytes: u64 = images.iter().map(|(_, bytes, _)| bytes).sum();
    for (_, own, path) in images {
        if bytes <= max_bytes {
            return;
        }
        // Another viewer may have deleted the file.
        let _ = std::fs::remove_file(path);
        bytes -= own;
    }
}

fn encode_png(thumbnail: &Thumbnail) -> Option<Vec<u8>> {
    let frame = thumbnail.frames.first()?;
    let clips: Vec<Value> =
        thumbnail.clips.iter().map(|clip| json!({ "name": clip.name, "secs": clip.secs })).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, frame.width, frame.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.add_itxt_chunk(CLIPS_KEYWORD.to_string(), Value::from(clips).to_string()).ok()?;
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(&frame.rgba).ok()?;
    writer.finish().ok()?;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_recently_used_thumbnails_are_deleted_first() {
        let folder = tempfile::tempdir().unwrap();
        let image = |secs: u8| {
            let frame = Frame { width: 8, height: 8, rgba: vec![secs; 256] };
            let file = folder.path().join(format!("{secs}.png"));
            write(&file, &Thumbnail { frames: vec![frame], secs: 0.0, clips: Vec::new(), note: None });
            let then = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(u64::from(secs));
            File::options().append(true).open(&file).unwrap().set_modified(then).unwrap();
            std::fs::metadata(&file).unwrap().len()
        };
        let sizes: Vec<u64> = (0..6).map(image).collect();
        std::fs::write(folder.path().join("notes.txt"), vec![0; 5000]).unwrap();
        // The second oldest file is read, and so becomes the most recently used.
        assert!(read(&folder.path().join("1.png")).is_some());
        delete_oldest(folder.path(), sizes[5] + sizes[4] + sizes[1]);
        let mut left: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["1.png", "4.png", "5.png", "notes.txt"]);
        delete_oldest(folder.path(), u64::MAX);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 4);
    }

    #[test]
    fn written_thumbnails_are_read_again_and_garbage_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let shown_file = folder.path().join("a.glb");
        std::fs::write(&shown_file, "one").unwrap();
        let file = path(folder.path(), &shown_file, Some("Walk: ü/é")).unwrap();
        let frame = Frame { width: 2, height: 1, rgba: vec![1, 2, 3, 255, 4, 5, 6, 255] };
        let clips = vec![ClipEntry { name: "Läuft".into(), secs: 1.25 }];
        let thumbnail = Thumbnail { frames: vec![frame], secs: 0.0, clips, note: None };
        write(&file, &thumbnail);
        assert_eq!(read(&file), Some(thumbnail));
        std::fs::write(&shown_file, "two").unwrap();
        assert_ne!(
            path(folder.path(), &shown_file, Some("Walk: ü/é")),
            Some(file.clone()),
            "another content"
        );
        for length in 0..30 {
            let bytes = std::fs::read(&file).unwrap();
            std::fs::write(folder.path().join("cut"), &bytes[..length * bytes.len() / 40]).unwrap();
            assert_eq!(read(&folder.path().join("cut")), None, "{length}");
        }
    }
}
