//! Tables for people.

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{CellAlignment, ContentLineStyle, LineStyle, Table, TableStyle};

/// Rounded corners, lines between columns, and one line below the head.
const STYLE: TableStyle = UTF8_FULL_CONDENSED
    .header_lines(ContentLineStyle::new('│', '│', '│'))
    .header_separator(LineStyle::new('├', '─', '┼', '┤'))
    .content_lines(ContentLineStyle::new('│', '│', '│'))
    .with_rounded_corners();

/// Rows as a table with a head; a cell may have several lines. Columns from number `first_right` on are aligned to the right.
#[must_use]
pub fn table<H, R>(head: H, rows: R, first_right: usize) -> String
where
    H: IntoIterator<Item: ToString>,
    R: IntoIterator<Item: IntoIterator<Item: ToString>>,
{
    let mut table = Table::new();
    table.load_style(STYLE).set_header(texts(head));
    for row in rows {
        table.add_row(texts(row));
    }

    for column in table.column_iter_mut().skip(first_right) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.to_string()
}

fn texts(cells: impl IntoIterator<Item: ToString>) -> Vec<String> {
    cells.into_iter().map(|cell| cell.to_string()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_have_lines_and_columns_of_numbers_are_aligned_to_the_right() {
        let rows = [["Butler", "10\n5 lost"], ["Ö", "  7"]];
        let expected = "\
╭────────┬────────╮
│ robot  │ counts │
├────────┼────────┤
│ Butler │     10 │
│        │ 5 lost │
│ Ö      │      7 │
╰────────┴────────╯";
        assert_eq!(table(["robot", "counts"], rows, 1), expected);
    }
}
