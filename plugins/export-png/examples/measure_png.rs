//! Time and size of each filter and compression on real frames:
//! `cargo run --release -p export-png --example measure_png -- FOLDER-OF-PNGS`

use choreo_plugin::{Exporter, Frame, VideoInfo};

/// CPU time of this thread in seconds (Linux), which excludes other load on the machine.
fn cpu_secs() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
}

fn load(folder: &str) -> Vec<Frame> {
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    paths.retain(|p| p.extension().is_some_and(|e| e == "png"));
    paths.sort();
    let mut frames = Vec::new();
    for path in paths.iter().take(60) {
        let mut decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap()));
        decoder.set_transformations(png::Transformations::ALPHA | png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut rgba = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut rgba).unwrap();
        frames.push(Frame { width: info.width, height: info.height, rgba });
    }
    frames
}

fn main() {
    let frames = load(&std::env::args().nth(1).expect("the folder of PNG frames"));
    let n = frames.len() as f64;
    let (w, h) = (frames[0].width, frames[0].height);
    let rgb: Vec<Vec<u8>> = frames
        .iter()
        .map(|f| f.rgba.as_chunks::<4>().0.iter().flat_map(|p| [p[0], p[1], p[2]]).collect())
        .collect();
    println!("{n} frames of {w}×{h}, CPU ms and kB a frame");
    let report = |name: &str, start: f64, bytes: usize| {
        println!("{name:<24} {:7.2} ms {:8.0} kB", (cpu_secs() - start) * 1e3 / n, bytes as f64 / n / 1e3);
    };
    use png::{DeflateCompression::*, Filter::*};
    for (name, compression, filter) in [
        ("ultra fast, none", FdeflateUltraFast, NoFilter),
        ("ultra fast, sub", FdeflateUltraFast, Sub),
        ("ultra fast, up", FdeflateUltraFast, Up),
        ("ultra fast, avg", FdeflateUltraFast, Avg),
        ("ultra fast, paeth", FdeflateUltraFast, Paeth),
        ("ultra fast, adaptive", FdeflateUltraFast, Adaptive),
        ("level 1, up", Level(1), Up),
        ("level 1, paeth", Level(1), Paeth),
        ("level 6, adaptive", Level(6), Adaptive),
    ] {
        let (start, mut bytes) = (cpu_secs(), 0);
        for pixels in &rgb {
            let mut out = Vec::new();
            let mut encoder = png::Encoder::new(&mut out, w, h);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_deflate_compression(compression);
            encoder.set_filter(filter);
            encoder.write_header().unwrap().write_image_data(pixels).unwrap();
            bytes += out.len();
        }
        report(name, start, bytes);
    }
    let start = cpu_secs();
    for frame in &frames {
        let fps = choreo_motion::FrameRate { num: 30, den: 1 };
        let info = VideoInfo {
            width: w,
            height: h,
            fps,
            frames: 1,
            provenance: vec![],
            options: Default::default(),
        };
        let mut sink = export_png::PngExporter.begin(&info, Box::new(std::io::sink())).unwrap();
        sink.frame(frame).unwrap();
    }
    report("the exporter", start, 0);
}
