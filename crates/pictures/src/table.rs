//! Tables of numbers, which can be copied.

use crate::markup::Markup;
use crate::number::fixed;

/// A cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A text.
    Text(String),
    /// Text of a command or a file.
    Code(String),
    /// A whole number.
    Count(u64),
    /// A number, shown with so many decimals; the page has it with all.
    Number(f64, usize),
    /// Nothing.
    Empty,
}

impl Cell {
    /// Whether the column of the cell has numbers, which stand at its right.
    fn is_number(&self) -> bool {
        matches!(self, Self::Count(_) | Self::Number(..))
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<u64> for Cell {
    fn from(count: u64) -> Self {
        Self::Count(count)
    }
}

impl From<usize> for Cell {
    fn from(count: usize) -> Self {
        Self::Count(count as u64)
    }
}

/// A table. The first cell of each row is its head.
#[derive(Debug, Clone, Default)]
pub struct Table {
    columns: Vec<String>,
    /// The rows.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// An empty table with these columns, whose names have their units and are separated by ` | `.
    #[must_use]
    pub fn new(columns: &str) -> Self {
        Self {
            columns: columns.split(" | ").map(str::to_owned).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl Into<Vec<Cell>>) {
        self.rows.push(cells.into());
    }

    /// Writes the table.
    pub(crate) fn write(&self, markup: &mut Markup) {
        let mut classes = vec![""; self.columns.len()];
        for row in &self.rows {
            for (class, cell) in classes.iter_mut().zip(row) {
                if cell.is_number() {
                    *class = "number";
                }
            }
        }

        markup
            .tag("div")
            .class("scroll")
            .with("tabindex", "0")
            .with("role", "region")
            .with("aria-label", "Table")
            .open();
        for element in ["table", "thead", "tr"] {
            markup.tag(element).open();
        }
        for (column, class) in self.columns.iter().zip(&classes) {
            let tag = markup.tag("th").with("scope", "col");
            tag.class(class).content(column);
        }
        markup.close("tr");
        markup.close("thead");

        markup.tag("tbody").open();
        for row in &self.rows {
            markup.tag("tr").open();
            for (index, (cell, class)) in row.iter().zip(&classes).enumerate() {
                write_cell(markup, index == 0, class, cell);
            }
            markup.close("tr");
        }
        for element in ["tbody", "table", "div"] {
            markup.close(element);
        }
    }
}

fn write_cell(markup: &mut Markup, is_head: bool, class: &str, cell: &Cell) {
    let element = if is_head { "th" } else { "td" };
    let mut tag = markup.tag(element);
    if is_head {
        tag = tag.with("scope", "row");
    }
    let tag = tag.class(class);

    match cell {
        Cell::Text(text) => tag.content(text),
        Cell::Count(count) => tag.content(&count.to_string()),
        Cell::Empty => tag.content(""),
        Cell::Code(text) => {
            tag.open();
            markup.tag("code").content(text);
            markup.close(element);
        }
        Cell::Number(value, decimals) => {
            tag.open();
            let data = markup.tag("data").with("value", &format!("{value:?}"));
            data.content(&fixed(*value, *decimals));
            markup.close(element);
        }
    }
}
