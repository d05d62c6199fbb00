//! Tables of numbers, which can be copied.

use crate::markup::Markup;

use crate::number::fixed;

/// A column of a table.
#[derive(Debug, Clone)]
pub struct Column {
    /// Its head, with the unit.
    pub name: String,
    /// Whether it has numbers, which stand at its right.
    pub is_number: bool,
}

impl Column {
    /// A column of texts.
    #[must_use]
    pub fn text(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            is_number: false,
        }
    }

    /// A column of numbers.
    #[must_use]
    pub fn number(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            is_number: true,
        }
    }
}

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
    /// A text.
    #[must_use]
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }
}

/// A table. The first cell of each row is its head.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// An empty table.
    #[must_use]
    pub fn new(columns: Vec<Column>) -> Self {
        Self {
            columns,
            rows: Vec::new(),
        }
    }

    /// Writes the table.
    pub(crate) fn write(&self, markup: &mut Markup) {
        markup
            .tag("div")
            .with("class", "scroll")
            .with("tabindex", "0")
            .with("role", "region")
            .with("aria-label", "Table")
            .open();
        markup.tag("table").open();
        markup.tag("thead").open();
        markup.tag("tr").open();
        for column in &self.columns {
            let mut tag = markup.tag("th").with("scope", "col");
            if column.is_number {
                tag = tag.with("class", "number");
            }
            tag.content(&column.name);
        }
        markup.close("tr");
        markup.close("thead");

        markup.tag("tbody").open();
        for row in &self.rows {
            markup.tag("tr").open();
            for (index, cell) in row.iter().enumerate() {
                let name = if index == 0 { "th" } else { "td" };
                let is_number = self
                    .columns
                    .get(index)
                    .is_some_and(|column| column.is_number);
                write_cell(markup, name, is_number, cell);
            }
            markup.close("tr");
        }
        markup.close("tbody");
        markup.close("table");
        markup.close("div");
    }
}

fn write_cell(markup: &mut Markup, name: &'static str, is_number: bool, cell: &Cell) {
    let mut tag = markup.tag(name);
    if name == "th" {
        tag = tag.with("scope", "row");
    }
    if is_number {
        tag = tag.with("class", "number");
    }

    match cell {
        Cell::Text(text) => tag.content(text),
        Cell::Count(count) => tag.content(&count.to_string()),
        Cell::Empty => tag.content(""),
        Cell::Code(text) => {
            tag.open();
            markup.tag("code").content(text);
            markup.close(name);
        }
        Cell::Number(value, decimals) => {
            tag.open();
            markup
                .tag("data")
                .with("value", &format!("{value:?}"))
                .content(&fixed(*value, *decimals));
            markup.close(name);
        }
    }
}
