//! Output while the tests run: a bar on a terminal, failures as they happen, a line for each file, and the totals.

use crate::args::TestArgs;
use crate::failure::{Failure, print};
use choreo_test_runner::Outcome;
use choreo_test_runner::collect::Case;
use choreo_test_runner::report::terminal;
use choreo_test_runner::run::Report;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

pub(super) struct ProgressReporter {
    quiet: bool,
    /// Whether only the final report is printed.
    only_final_report: bool,
    bar: Option<ProgressBar>,
    /// Outcomes of the sections of the current file.
    file_outcomes: Vec<Outcome>,
    failed: usize,
    /// First error in writing the output.
    output_failure: Option<Failure>,
}

impl ProgressReporter {
    pub(super) fn new(args: &TestArgs, cases: &[Case]) -> ProgressReporter {
        use std::io::IsTerminal;
        let bar = (!args.quiet && !args.json && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::with_draw_target(
                Some(cases.len() as u64),
                ProgressDrawTarget::stderr_with_hz(10),
            );
            if let Ok(style) = ProgressStyle::with_template("{bar:32} {pos}/{len} sections{msg}, {elapsed}") {
                bar.set_style(style.progress_chars("█▌·"));
            }
            bar
        });
        ProgressReporter {
            quiet: args.quiet,
            only_final_report: args.json,
            bar,
            file_outcomes: Vec::new(),
            failed: 0,
            output_failure: None,
        }
    }

    pub(super) fn report(&mut self, outcome: &Outcome) {
        if self.file_outcomes.first().is_some_and(|first| first.file != outcome.file) {
            self.finish_file();
        }
        if outcome.has_failed() {
            self.failed += 1;
            self.print_text(&terminal::failure(outcome));
        }
        // Images of the section have been reported and written, and are released.
        self.file_outcomes.push(Outcome { checks: Vec::new(), ..outcome.clone() });
        if let Some(bar) = &self.bar {
            if self.failed > 0 {
                bar.set_message(format!(", {} failed", self.failed));
            }
            bar.inc(1);
        }
    }

    fn finish_file(&mut self) {
        let line = terminal::file_line(&std::mem::take(&mut self.file_outcomes));
        if !self.quiet && !line.is_empty() {
            self.print_text(&format!("{line}\n"));
        }
    }

    fn print_text(&mut self, text: &str) {
        if self.only_final_report || self.output_failure.is_some() {
            return;
        }
        let printed = match &self.bar {
            Some(bar) => bar.suspend(|| print(text)),
            None => print(text),
        };
        self.output_failure = printed.err();
    }

    pub(super) fn finish(mut self, report: &Report) -> Result<(), Failure> {
        self.finish_file();
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
        if !self.quiet || report.failure().is_some() {
            self.print_text(&terminal::summary(report));
        }
        self.output_failure.map_or(Ok(()), Err)
    }
}
