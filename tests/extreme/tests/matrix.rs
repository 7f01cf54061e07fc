//! Runs all extreme cases and prints their results as a table.

use choreo_bench::plots::{Cell, Table, quantity};
use std::process::ExitCode;

fn main() -> ExitCode {
    let filters: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let columns =
        [("case", "case"), ("measured", "what"), (">value", "value"), (">bound", "bound"), ("", "holds")];
    let mut table = Table::new("Stiff and extreme cases", &columns);
    let (mut passed, mut failed) = (0, 0);
    for case in
        extreme::all().filter(|c| filters.is_empty() || filters.iter().any(|f| c.name.contains(f.as_str())))
    {
        // A panic fails this case only.
        let value = std::panic::catch_unwind(case.run).unwrap_or(f64::NAN);
        let holds = case.holds(value);
        *(if holds { &mut passed } else { &mut failed }) += 1;
        table.rows.push(vec![
            Cell::text(case.name),
            Cell::text(case.measured),
            Cell::number(quantity(value), value),
            Cell::number(quantity(case.bound), case.bound),
            Cell::text(if holds { "" } else { "FAILED" }),
        ]);
    }
    println!("{}", table.text());
    let word = if failed == 0 { "ok" } else { "FAILED" };
    println!("test result: {word}. {passed} passed; {failed} failed; 0 ignored");
    ExitCode::from(u8::from(failed > 0))
}
