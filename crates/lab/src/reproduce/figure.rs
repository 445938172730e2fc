//! Figures of a paper and their page: a table of the paper's results and the measured ones, the figures in order, and a
//! file with all numbers.

use super::error::write_file;
use super::images::significant;
use super::measure::Estimate;
use super::page::{Block, Cell, Page, Table};
use super::{Options, ReproduceError};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::time::Duration;

/// The result of a figure.
pub struct Figure {
    /// Anchor on the page, and name in the file of numbers.
    pub id: &'static str,
    /// Heading.
    pub title: &'static str,
    /// Its row in the table at the top.
    pub summary: Summary,
    /// More rows: their subjects, and the rows.
    pub also: Vec<(&'static str, Summary)>,
    /// Its section.
    pub blocks: Vec<Block>,
    /// All measurements.
    pub numbers: Value,
}

/// A row of the table at the top.
pub struct Summary {
    /// Result of the paper.
    pub paper: String,
    /// Target.
    pub target: String,
    /// Measured result.
    pub measured: String,
    /// True if the target is reached.
    pub reached: bool,
    /// The reason, with numbers.
    pub reason: String,
}

/// The text of a page around its figures.
pub struct Study {
    /// Heading of the page.
    pub title: &'static str,
    /// First paragraph.
    pub intro: &'static str,
    /// Notes on the measurement.
    pub notes: &'static [&'static str],
    /// Name of the file with all numbers.
    pub numbers: &'static str,
}

/// A number with its standard error.
pub fn plus_minus(e: Estimate) -> String {
    format!("{} ± {}", significant(e.value), significant(e.error))
}

/// The reduction from 1 to `left`, in percent, with its standard error.
pub fn percent(left: Estimate) -> String {
    format!("{:+.1} ± {:.1} %", (left.value - 1.0) * 100.0, left.error * 100.0)
}

/// A number with its standard error for the file of numbers.
pub fn estimate_json(e: Estimate) -> Value {
    json!({ "value": e.value, "standard_error": e.error })
}

/// Writes `index.html` and the numbers into the folder of the page; returns the path of the page.
pub fn write(
    study: &Study,
    options: &Options,
    figures: &[Figure],
    elapsed: Duration,
) -> Result<PathBuf, ReproduceError> {
    // The summary table and the facts
    let threads = options.threads();
    let mut page = Page::new(study.title);
    page.push(Block::Text(study.intro.to_owned()));
    page.push(Block::Table(summaries(figures)));
    study.notes.iter().for_each(|text| page.push(Block::Note((*text).to_owned())));
    page.push(Block::Facts(vec![
        ("machine".to_owned(), format!("{threads} threads; {}", processor())),
        ("version".to_owned(), format!("{} {}", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"))),
        ("command".to_owned(), options.command.clone()),
        ("time".to_owned(), format!("{:.0} s", elapsed.as_secs_f64())),
        ("numbers".to_owned(), study.numbers.to_owned()),
    ]));

    // A section for each figure
    for f in figures {
        page.push(Block::section(f.id, f.title));
        page.extend(f.blocks.iter().cloned());
    }

    // The numbers as JSON
    let by_figure: serde_json::Map<String, Value> = figures.iter().map(|f| (f.id.to_owned(), f.json())).collect();
    let numbers = json!({
        "version": env!("CARGO_PKG_VERSION"), "command": options.command, "threads": threads,
        "processor": processor(), "seconds": elapsed.as_secs_f64(), "quick": options.quick, "figures": by_figure,
    });
    write_file(options.out.join(study.numbers), &format!("{numbers:#}\n"))?;
    let path = options.out.join("index.html");
    write_file(path.clone(), &page.html())?;
    Ok(path)
}

fn summaries(figures: &[Figure]) -> Table {
    let mut table = Table::new(&["figure", "paper", "target", "measured", "reached", "why"]);
    let mut row = |title: String, s: &Summary| {
        table.row([
            Cell::text(title),
            Cell::text(&s.paper),
            Cell::text(&s.target),
            Cell::text(&s.measured),
            Cell::verdict(s.reached, if s.reached { "yes" } else { "no" }),
            Cell::text(&s.reason),
        ]);
    };
    for f in figures {
        row(f.title.to_owned(), &f.summary);
        f.also.iter().for_each(|(about, s)| row(format!("{}: {about}", f.title), s));
    }
    table
}

impl Summary {
    fn json(&self) -> Value {
        json!({
            "paper": self.paper, "target": self.target, "measured": self.measured, "reached": self.reached,
            "reason": self.reason,
        })
    }
}

impl Figure {
    fn json(&self) -> Value {
        let also: serde_json::Map<String, Value> =
            self.also.iter().map(|(about, s)| ((*about).to_owned(), s.json())).collect();
        json!({ "title": self.title, "summary": self.summary.json(), "also": also, "numbers": self.numbers })
    }
}

/// The name of the processor, if available.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name =
        text.lines().find_map(|l| l.strip_prefix("model name")?.split_once(':').map(|(_, n)| n.trim().to_owned()));
    name.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}
