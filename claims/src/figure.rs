//! A picture: panels of curves, as SVG.
use crate::chart::{Area, Drawn, FilledArea, Panel, draw_panel, palette};
use plotters::prelude::{IntoDrawingArea, IntoFont, SVGBackend, WHITE};

/// A picture.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Figure {
    /// Name of its file.
    pub file: String,
    /// What it shows.
    pub title: String,
    /// The picture; not in the data, where it would only be in the way.
    #[serde(skip)]
    pub svg: String,
}

/// Width of a panel and height of one, px.
const PANEL_PX: (u32, u32) = (620, 380);
const TITLE_PX: u32 = 40;

impl Figure {
    /// Draws panels beside and below each other. A picture that cannot be drawn is an empty one: the numbers stand in
    /// the tables.
    #[must_use]
    pub fn of(file: &str, title: &str, columns: u32, panels: &[Panel]) -> Self {
        let columns = columns.max(1);
        let rows = u32::try_from(panels.len()).unwrap_or(1).div_ceil(columns).max(1);
        let mut svg = String::new();
        {
            let size = (PANEL_PX.0 * columns, PANEL_PX.1 * rows + TITLE_PX);
            let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            if draw(&root, title, [rows, columns], panels).is_err() {
                return Self { file: file.to_owned(), title: title.to_owned(), svg: String::new() };
            }
        }
        Self { file: file.to_owned(), title: title.to_owned(), svg }
    }
}

fn draw(root: &Area<'_>, title: &str, [rows, columns]: [u32; 2], panels: &[Panel]) -> Drawn {
    root.fill(&WHITE)?;
    let body = root.titled(title, ("sans-serif", 20).into_font())?;
    let split = |n: u32| usize::try_from(n).unwrap_or(1);
    for (area, panel) in body.split_evenly((split(rows), split(columns))).iter().zip(panels) {
        draw_panel(area, panel)?;
    }
    Ok(root.present()?)
}

impl Panel {
    /// Adds a curve with its spread: (x, [low, middle, high]).
    pub fn spread(&mut self, label: &str, points: &[(f64, [f64; 3])]) {
        let colour = palette(self.curves.len());
        let upper = points.iter().map(|(x, [_, _, high])| (*x, *high));
        let lower = points.iter().rev().map(|(x, [low, _, _])| (*x, *low));
        self.filled_areas.push(FilledArea { points: upper.chain(lower).collect(), colour, opacity: 0.15 });
        self.line(label, points.iter().map(|(x, [_, middle, _])| (*x, *middle)).collect());
    }
}
