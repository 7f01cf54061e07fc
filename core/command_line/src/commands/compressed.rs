//! Size and error of compressed clips, for `info --compress` and `explain`.

use crate::failure::Failure;
use choreo_asset::Asset;
use choreo_bench::plots::{Cell, Table, bytes};
use choreo_motion::CompressionReport;
use choreo_stage::Stage;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Results of compressing each clip of a file: name, seconds, size and error.
pub(crate) struct CompressedClips(Vec<(String, f64, CompressionReport)>);

impl CompressedClips {
    pub(super) fn measure(asset: &Asset, tolerance_m: f64) -> Result<CompressedClips, Failure> {
        let compress_clip = |clip: &std::sync::Arc<choreo_motion::Clip>| {
            let (_, report) = clip
                .compressed(&asset.skeleton, tolerance_m)
                .map_err(|e| Failure::Usage(format!("--compress: {e}")))?;
            Ok((clip.name.clone(), clip.duration.as_secs(), report))
        };
        Ok(CompressedClips(asset.clips.iter().map(compress_clip).collect::<Result<_, Failure>>()?))
    }

    pub(super) fn text(&self) -> String {
        format!("\n{}", self.table().text())
    }

    fn table(&self) -> Table {
        let columns = [
            ("clip", "clip"),
            (">s", "seconds"),
            (">as it is", "bytes"),
            (">compressed", "compressed_bytes"),
            (">of dense floats 1 :", "of_dense"),
            (">error, mm", "worst_mm"),
        ];
        let mut table = Table::new("", &columns);
        let mut sum = CompressionReport::default();
        for (name, secs, report) in &self.0 {
            table.rows.push(table_row(name, Some(*secs), report));
            add_report(&mut sum, report);
        }
        if self.0.len() > 1 {
            table.rows.push(table_row("all", None, &sum));
        }
        table.notes.push(
            "dense floats: translation, rotation and scale of every joint at 30 Hz; error: of any joint, and 10 cm from it, in the model"
                .into(),
        );
        table
    }

    pub(super) fn json(&self) -> Value {
        self.table().json()
    }
}

fn table_row(name: &str, secs: Option<f64>, report: &CompressionReport) -> Vec<Cell> {
    let [before, after] = report.bytes;
    let of_dense = report.dense_bytes as f64 / after.max(1) as f64;
    vec![
        Cell::text(name),
        secs.map_or_else(Cell::empty, |s| Cell::number(format!("{s:.2}"), s)),
        Cell::number(bytes(before as f64), before as f64),
        Cell::number(bytes(after as f64), after as f64),
        Cell::number(format!("{of_dense:.1}"), of_dense),
        Cell::number(format!("{:.4}", report.worst_m * 1e3), report.worst_m * 1e3),
    ]
}

fn add_report(sum: &mut CompressionReport, report: &CompressionReport) {
    (0..2).for_each(|i| sum.bytes[i] += report.bytes[i]);
    sum.dense_bytes += report.dense_bytes;
    sum.worst_m = sum.worst_m.max(report.worst_m);
}

/// Totals of all compressed clips that a stage plays, as JSON.
pub(super) fn compression_totals_json(stage: &Stage) -> Value {
    let layers = stage.actors.iter().flat_map(|a| &a.layers);
    let clips = layers.flat_map(|l| &l.cues).map(|c| &c.clip);
    let clips: BTreeMap<usize, _> = clips.map(|c| (std::sync::Arc::as_ptr(c) as usize, c)).collect();
    let (mut sum, mut count) = (CompressionReport::default(), 0);
    for report in clips.values().filter_map(|c| c.compression()) {
        count += 1;
        add_report(&mut sum, &report);
    }
    json!({
        "clips": clips.len(), "compressed": count, "bytes": sum.bytes[1], "bytes_before": sum.bytes[0],
        "dense_bytes": sum.dense_bytes, "worst_mm": sum.worst_m * 1e3,
    })
}
