//! Tables: the paper's values beside ours.
use crate::effect::rounded;
use crate::number::figures;
use crate::statistics::{Estimate, Paired, Summary};
use crate::wrap::wrapped;
use std::fmt;

/// One field.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cell {
    /// Nothing: not printed in the paper, or no such number.
    None,
    /// The paper's printed value; the only constants that a table may have.
    Paper(f64),
    /// A number of ours.
    Number(f64),
    /// A sample of ours, of which mean and deviation are shown.
    Mean(Summary),
    /// A sample of ours, of which median and quartiles are shown.
    Median(Summary),
    /// So many of all.
    Share {
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
    },
    /// A paired comparison.
    Test(Paired),
    /// An effect with its 95 % interval.
    Effect(Estimate),
    /// Words.
    Words(String),
}

impl Cell {
    /// A number, or nothing when it is none.
    #[must_use]
    pub fn number(value: f64) -> Self {
        if value.is_finite() { Self::Number(value) } else { Self::None }
    }

    /// A number that may be missing.
    #[must_use]
    pub fn maybe(value: Option<f64>) -> Self {
        value.map_or(Self::None, Self::number)
    }

    /// An effect, or nothing when there is none.
    #[must_use]
    pub fn estimate(estimate: Estimate) -> Self {
        if estimate.value.is_finite() { Self::Effect(estimate) } else { Self::None }
    }

    /// Words.
    #[must_use]
    pub fn words(text: impl Into<String>) -> Self {
        Self::Words(text.into())
    }

    /// True when every number in it is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        match self {
            Self::Effect(e) => e.value.is_finite(),
            Self::None | Self::Share { .. } | Self::Words(_) => true,
            Self::Paper(value) | Self::Number(value) => value.is_finite(),
            Self::Mean(s) | Self::Median(s) => {
                [s.mean, s.sd, s.least, s.q1, s.median, s.q3, s.most].iter().all(|v| v.is_finite())
            }
            Self::Test(test) => test.p.is_finite(),
        }
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("-"),
            Self::Paper(value) | Self::Number(value) => f.write_str(&figures(*value)),
            Self::Mean(s) => write!(f, "{} ± {}", figures(s.mean), figures(s.sd)),
            Self::Median(s) => write!(f, "{} [{}, {}]", figures(s.median), figures(s.q1), figures(s.q3)),
            Self::Share { count, of } => write!(f, "{count}/{of}"),
            Self::Effect(Estimate { value, interval: [low, high] }) => {
                write!(f, "{} [{}, {}]", rounded(*value), rounded(*low), rounded(*high))
            }
            Self::Test(t) => write!(f, "{}:{}, p = {}", t.less, t.more, figures(t.p)),
            Self::Words(text) => f.write_str(text),
        }
    }
}

/// One line.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Row {
    /// What it is about.
    pub label: String,
    /// A field for every column.
    pub cells: Vec<Cell>,
}

/// A table.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Table {
    /// What it shows.
    pub name: String,
    /// Unit of its values; empty where columns have units of their own.
    pub unit: String,
    /// What to know when reading it: runs, budget, how cells are to be read.
    pub note: String,
    /// Heading of the labels, then of the cells.
    pub columns: Vec<String>,
    /// The lines.
    pub rows: Vec<Row>,
}

impl Table {
    /// An empty table; the first column is that of the labels.
    #[must_use]
    pub fn new(name: &str, unit: &str, note: &str, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|c| (*c).to_owned()).collect();
        Self {
            name: name.to_owned(),
            unit: unit.to_owned(),
            note: note.to_owned(),
            columns,
            rows: Vec::new(),
        }
    }

    /// Adds a line.
    pub fn row(&mut self, label: impl Into<String>, cells: Vec<Cell>) {
        self.rows.push(Row { label: label.into(), cells });
    }

    /// Name with unit.
    #[must_use]
    pub fn title(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) }
    }

    fn lines(&self) -> Vec<Vec<String>> {
        let heading = self.columns.clone();
        let row = |r: &Row| {
            std::iter::once(r.label.clone()).chain(r.cells.iter().map(Cell::to_string)).collect::<Vec<_>>()
        };
        std::iter::once(heading).chain(self.rows.iter().map(row)).collect()
    }

    /// As Markdown.
    #[must_use]
    pub fn markdown(&self) -> String {
        let mut lines = self.lines().into_iter().map(|cells| {
            let cells: Vec<String> = cells.iter().map(|c| c.replace('|', "\\|")).collect();
            format!("| {} |", cells.join(" | "))
        });
        let heading = lines.next().unwrap_or_default();
        let rule = format!("|{}", "---|".repeat(self.columns.len()));
        let body: Vec<String> = lines.collect();
        format!("**{}.** {}\n\n{heading}\n{rule}\n{}\n", self.title(), self.note, body.join("\n"))
    }
}

impl Table {
    /// As text of so many columns: a wide table continues below, with its labels repeated.
    #[must_use]
    pub fn text(&self, columns: usize) -> String {
        let mut text = wrapped(&self.title(), columns, "  ");
        if !self.note.is_empty() {
            text += &wrapped(&format!("  {}", self.note), columns, "  ");
        }
        let lines = self.lines();
        let width = |column: usize| {
            lines.iter().filter_map(|l| l.get(column)).map(|c| c.chars().count()).max().unwrap_or(0)
        };
        let most = columns.saturating_sub(2);
        // Headings are broken into lines as narrow as the fields below allow.
        let body = |column: usize| {
            lines.iter().skip(1).filter_map(|l| l.get(column)).map(|c| c.chars().count()).max().unwrap_or(0)
        };
        let label_width = width(0).min(most / 3);
        let widths: Vec<usize> =
            (1..self.columns.len()).map(|c| body(c).max(HEADING.min(width(c)))).collect();
        let mut from = 0;
        while from < widths.len() {
            let mut used = label_width;
            let fits = widths[from..].iter().take_while(|w| {
                used += *w + 2;
                used <= most
            });
            let to = from + fits.count().max(1);
            for line in &lines {
                text += &fields(line, label_width, (from, &widths[from..to]));
            }
            from = to;
        }
        text
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text(COLUMNS))
    }
}

/// Columns where no terminal states them.
const COLUMNS: usize = 120;
/// Most columns of a heading whose fields are narrow.
const HEADING: usize = 16;

/// A line whose fields may take several: labels to the left, figures to the right.
fn fields(line: &[String], label_width: usize, (from, widths): (usize, &[usize])) -> String {
    let parts = |text: &str, width: usize| -> Vec<String> {
        wrapped(text, width.max(1), "").lines().map(str::to_owned).collect()
    };
    let label = parts(line.first().map_or("", String::as_str), label_width);
    let fields = line.iter().skip(1 + from).zip(widths).map(|(field, width)| parts(field, *width));
    let fields: Vec<Vec<String>> = fields.collect();
    let high = fields.iter().map(Vec::len).chain([label.len()]).max().unwrap_or(1);
    let mut text = String::new();
    for i in 0..high {
        let part = |parts: &[String]| parts.get(i).cloned().unwrap_or_default();
        let mut out = format!("  {:<label_width$}", part(&label));
        for (field, width) in fields.iter().zip(widths) {
            out += &format!("  {:>width$}", part(field));
        }
        text += out.trim_end();
        text.push('\n');
    }
    text
}
