//! Record of the memory and objects that a viewer holds over a long time, and a check that nothing grows.

use super::viewer_process::ViewerProcess;
use serde_json::Value;

/// Memory in MB, objects and bytes on the device, threads, open files.
#[derive(Default)]
pub(crate) struct ResourceRecord {
    rows: Vec<[u64; 5]>,
}

impl ResourceRecord {
    /// Adds a row to the table. `shown`: report about the displayed image of the idle viewer.
    pub(crate) fn note(&mut self, minute: u64, actions: u64, viewer: &ViewerProcess, shown: &Value) {
        if self.rows.is_empty() {
            println!(
                "| minute | actions | versions | memory MB | on the device: objects, MB | threads | open files |\n\
                 |---|---|---|---|---|---|---|"
            );
        }
        let of = |name: &str| shown[name].as_u64().unwrap();
        let row = [
            viewer.status("VmRSS") / 1000,
            of("objects"),
            of("bytes"),
            viewer.status("Threads"),
            viewer.files() as u64,
        ];
        let [memory, objects, bytes, threads, files] = row;
        let (version, device) = (of("version"), bytes as f64 / 1e6);
        println!(
            "| {minute} | {actions} | {version} | {memory} | {objects}, {device:.1} | {threads} | {files} |"
        );
        self.rows.push(row);
    }

    /// Checks that no number grows like a leak. Hidden or selected objects change the numbers, but a leak grows with each of a thousand versions.
    pub(crate) fn assert_no_growth(&self) {
        let (first, second) = self.rows.split_at(self.rows.len().div_ceil(2));
        let most = |rows: &[[u64; 5]], n: usize| rows.iter().map(|row| row[n]).max().unwrap_or(0);
        let least = |rows: &[[u64; 5]], n: usize| rows.iter().map(|row| row[n]).min().unwrap_or(0);
        for (name, n, more) in
            [("objects", 1, 4), ("bytes on the device", 2, 0), ("threads", 3, 1), ("open files", 4, 0)]
        {
            let (then, now) = (most(first, n), least(second, n));
            assert!(
                second.is_empty() || now <= then + more,
                "{name}: {then} in the first half, {now} at least in the second"
            );
        }
        let (then, now) = (most(first, 0), least(second, 0));
        assert!(
            second.is_empty() || now <= then + then / 10,
            "memory: {then} MB in the first half, {now} at least in the second"
        );
    }
}
