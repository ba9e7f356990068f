//! What became of each stage, and the table at the end.

use std::time::Duration;

/// What became of a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It ran and found nothing wrong.
    Passed,
    /// It ran and found something wrong, or could not run where that is not allowed.
    Failed(String),
    /// It could not run, and why.
    Skipped(String),
}

/// One line of the table.
pub struct Row {
    /// Name of the stage.
    pub stage: &'static str,
    /// What became of it.
    pub outcome: Outcome,
    /// How long it took.
    pub time: Duration,
}

/// The table, one line a stage, then the counts alone on the last line.
pub fn render(rows: &[Row], colour: bool) -> String {
    let width = rows.iter().map(|row| row.stage.len()).max().unwrap_or(0).max("stage".len());
    let mut text = format!("{:width$}  {:7}  {:>7}\n", "stage", "result", "seconds");
    for row in rows {
        let (word, code, why) = match &row.outcome {
            Outcome::Passed => ("passed", 32, ""),
            Outcome::Failed(why) => ("FAILED", 31, why.as_str()),
            Outcome::Skipped(why) => ("SKIPPED", 33, why.as_str()),
        };
        let word = if colour { format!("\x1b[{code}m{word:7}\x1b[0m") } else { format!("{word:7}") };
        let line = format!("{:width$}  {word}  {:>7.1}  {why}", row.stage, row.time.as_secs_f64());
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text.push_str(&counts(rows));
    text.push('\n');
    text
}

/// `N passed, N failed`, and the skipped if there are any.
fn counts(rows: &[Row]) -> String {
    let count = |wanted: fn(&Outcome) -> bool| rows.iter().filter(|row| wanted(&row.outcome)).count();
    let passed = count(|outcome| matches!(outcome, Outcome::Passed));
    let failed = count(|outcome| matches!(outcome, Outcome::Failed(_)));
    match count(|outcome| matches!(outcome, Outcome::Skipped(_))) {
        0 => format!("{passed} passed, {failed} failed"),
        skipped => format!("{passed} passed, {failed} failed, {skipped} skipped"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(stage: &'static str, outcome: Outcome, seconds: f64) -> Row {
        Row { stage, outcome, time: Duration::from_secs_f64(seconds) }
    }

    #[test]
    fn the_table_ends_in_the_counts() {
        let mut rows = vec![
            row("fmt", Outcome::Passed, 0.26),
            row("bindings", Outcome::Failed("`cargo build` failed (exit status: 101)".into()), 123.44),
        ];
        let expected = "stage     result   seconds\n\
                        fmt       passed       0.3\n\
                        bindings  FAILED     123.4  `cargo build` failed (exit status: 101)\n\
                        1 passed, 1 failed\n";
        assert_eq!(render(&rows, false), expected);
        rows.push(row("browser", Outcome::Skipped("no chromium".into()), 0.0));
        assert!(render(&rows, true).ends_with("no chromium\n1 passed, 1 failed, 1 skipped\n"));
    }

    #[test]
    fn colour_changes_nothing_but_colour() {
        let rows = [row("fmt", Outcome::Passed, 1.0)];
        let plain = render(&rows, true).replace("\x1b[32m", "").replace("\x1b[0m", "");
        assert_eq!(plain, render(&rows, false));
    }
}
