//! A matrix of shaded cells: transitions between states, or a measure over two factors.

use crate::chart::{PANEL_PX, WIDE_PX, begin, end};
use crate::labels::{shortened, widest_px, width_px};
use crate::markup::Markup;
use crate::palette::{StateLook, level};
use crate::shapes::{LABEL_PX, Pixel, SMALL_PX};

/// Most rows and columns that are drawn.
const MOST: usize = 24;
/// Most letters of a label.
const LABEL_LETTERS: usize = 22;
/// Width of a cell, pixels.
const CELL_PX: f64 = 46.0;
/// Height of a cell, pixels.
const ROW_PX: f64 = 26.0;

/// The name of a row or a column.
#[derive(Debug, Clone)]
pub struct MatrixLabel {
    /// The name.
    pub text: String,
    /// What the area beside it looks like; none if it has no color.
    pub look: Option<StateLook>,
}

impl From<&str> for MatrixLabel {
    fn from(text: &str) -> Self {
        Self {
            text: text.to_owned(),
            look: None,
        }
    }
}

/// A cell.
#[derive(Debug, Clone)]
pub struct MatrixCell {
    /// How dark it is, from 0 to 1.
    pub share: f64,
    /// The number in it.
    pub text: String,
    /// A smaller number below, or nothing.
    pub remark: String,
}

/// A matrix. Cells that are `None` stay empty.
#[derive(Debug, Clone)]
pub struct Matrix {
    /// Name of the chart.
    pub title: String,
    /// What the rows are.
    pub rows_title: String,
    /// What the columns are.
    pub columns_title: String,
    /// The rows, from top to bottom.
    pub rows: Vec<MatrixLabel>,
    /// The columns, from left to right.
    pub columns: Vec<MatrixLabel>,
    /// The cells, row by row.
    pub cells: Vec<Vec<Option<MatrixCell>>>,
}

impl Matrix {
    /// Whether its numbers need the width of the page.
    #[must_use]
    pub fn is_wide(&self) -> bool {
        let cell_px = self.cell_px(PANEL_PX);
        let mut cells = self.cells.iter().flatten().flatten();
        cells.any(|cell| !fits(cell, cell_px))
    }

    /// Where the cells begin.
    fn left(&self) -> f64 {
        labels_px(&self.rows).clamp(50.0, 130.0) + 20.0
    }

    /// Width of a cell in a chart of this width.
    fn cell_px(&self, width: f64) -> f64 {
        let columns = self.columns.len().clamp(1, MOST) as f64;
        ((width - self.left() - 2.0) / columns).min(CELL_PX)
    }

    /// The chart as SVG. Rows and columns after the 24th are left out.
    #[must_use]
    pub fn draw(&self) -> String {
        let rows = &self.rows[..self.rows.len().min(MOST)];
        let columns = &self.columns[..self.columns.len().min(MOST)];
        let width = if self.is_wide() { WIDE_PX } else { PANEL_PX };
        let left = self.left();
        let is_upward = labels_px(columns) > CELL_PX - 4.0;
        // Colors are between the names and the cells.
        let has_colors = columns.iter().any(|label| label.look.is_some());
        let names_px = if has_colors { 18.0 } else { 6.0 };
        let top = if is_upward {
            labels_px(columns).clamp(30.0, 150.0) + names_px + 14.0
        } else {
            38.0
        };
        let cell_px = self.cell_px(width);
        let height = top + rows.len() as f64 * ROW_PX + 6.0;

        let [of_rows, of_columns] = [&self.rows_title, &self.columns_title];
        let description = format!(
            "{} rows ({of_rows}) and {} columns ({of_columns}); darker cells are larger",
            self.rows.len(),
            self.columns.len()
        );
        let mut svg = begin("matrix", width, height, &self.title, &description);
        let end_px = left - 6.0;
        svg.text("muted", end_px, top - 5.0, "end", &format!("{of_rows} ↓"));
        svg.text(
            "muted",
            end_px,
            top - 19.0,
            "end",
            &format!("{of_columns} →"),
        );
        for (index, label) in columns.iter().enumerate() {
            let middle = left + (index as f64 + 0.5) * cell_px;
            let text = shortened(&label.text, LABEL_LETTERS);
            if is_upward {
                svg.upward("", middle + 4.0, top - names_px, "start", &text);
            } else {
                svg.text("", middle, top - names_px, "middle", &text);
            }
            if let Some(look) = &label.look {
                svg.state(look, "", (middle - 5.0, top - 12.0), (10.0, 8.0));
            }
        }
        for (index, label) in rows.iter().enumerate() {
            let middle = top + (index as f64 + 0.5) * ROW_PX;
            if let Some(look) = &label.look {
                svg.state(look, "", (left - 14.0, middle - 5.0), (8.0, 10.0));
            }
            let end_px = left - if label.look.is_some() { 20.0 } else { 8.0 };
            let text = shortened(&label.text, LABEL_LETTERS);
            svg.text("", end_px, middle + 4.0, "end", &text);
        }

        for (row, cells) in self.cells.iter().take(rows.len()).enumerate() {
            for (column, cell) in cells.iter().take(columns.len()).enumerate() {
                let x = left + column as f64 * cell_px;
                let y = top + row as f64 * ROW_PX;
                let title = format!("{} → {}", rows[row].text, columns[column].text);
                draw_cell(&mut svg, cell.as_ref(), &title, (x, y), cell_px);
            }
        }
        end(svg)
    }
}

fn labels_px(labels: &[MatrixLabel]) -> f64 {
    let labels = labels.iter().take(MOST);
    widest_px(labels.map(|label| &label.text), LABEL_LETTERS)
}

/// Whether the number of a cell is shown in this width.
fn fits(cell: &MatrixCell, width: f64) -> bool {
    width_px(&cell.text, LABEL_PX) <= width + 4.0
}

fn draw_cell(svg: &mut Markup, cell: Option<&MatrixCell>, title: &str, (x, y): Pixel, width: f64) {
    let Some(cell) = cell else {
        svg.rect("none", (x, y), width, ROW_PX);
        return;
    };

    let level = level(cell.share);
    let title = format!("{title}: {} {}", cell.text, cell.remark);
    svg.group("cell", title.trim_end());
    svg.rect(&format!("box h{level}"), (x, y), width, ROW_PX);
    let middle = x + width / 2.0;
    if fits(cell, width) {
        let up = if cell.remark.is_empty() { 0.0 } else { 4.0 };
        let class = format!("on-h{level}");
        svg.text(&class, middle, y + 17.0 - up, "middle", &cell.text);
        if !cell.remark.is_empty() && width_px(&cell.remark, SMALL_PX) <= width + 2.0 {
            let class = format!("small {class}");
            svg.text(&class, middle, y + 22.5, "middle", &cell.remark);
        }
    }
    svg.close("g");
}
