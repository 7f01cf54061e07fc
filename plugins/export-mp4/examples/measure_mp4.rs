//! Time, size and error at several qualities on real frames:
//! `cargo run --release -p export-mp4 --example measure_mp4 -- FOLDER-OF-PNGS [FOLDER-FOR-THE-FILES]`

use choreo_plugin::yuv::{Matrix, Yuv420};
use choreo_plugin::{Exporter, Frame, OptionValue, VideoInfo};
use std::io::Write;
use std::sync::{Arc, Mutex};

#[derive(Clone, Default)]
struct Count(Arc<Mutex<usize>>);

impl Write for Count {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        *self.0.lock().unwrap() += bytes.len();
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

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
    for path in paths.iter().take(120) {
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
    let (width, height) = (frames[0].width, frames[0].height);
    let n = frames.len() as f64;
    let mut yuv = Yuv420::default();
    let start = cpu_secs();
    for frame in &frames {
        yuv.convert(&frame.rgba, width as usize, height as usize, Matrix::Bt709, true);
    }
    println!(
        "{n} frames of {width}×{height}; RGB to 4:2:0 {:.2} CPU ms a frame",
        (cpu_secs() - start) * 1e3 / n
    );
    for quality in [30.0, 50.0, 60.0, 75.0, 95.0, 96.0, 97.0, 98.0, 99.0, 100.0] {
        let mut info = VideoInfo {
            width,
            height,
            fps: choreo_motion::FrameRate { num: 30, den: 1 },
            frames: frames.len() as u64,
            provenance: vec![],
            options: Default::default(),
        };
        info.options.0.insert("quality".into(), OptionValue::Number(quality));
        let count = Count::default();
        let start = cpu_secs();
        let mut sink = export_mp4::Mp4Exporter.begin(&info, Box::new(count.clone())).unwrap();
        for frame in &frames {
            sink.frame(frame).unwrap();
        }
        let head = sink.finish().unwrap().len();
        let (secs, bytes) = ((cpu_secs() - start), (head + *count.0.lock().unwrap()) as f64);
        let rate = bytes * 8.0 / (n / 30.0) / 1e6;
        println!(
            "quality {quality:3}: {:6.2} CPU ms a frame, {:7.0} kB, {rate:5.2} Mbit/s",
            secs * 1e3 / n,
            bytes / 1e3
        );
    }
}
