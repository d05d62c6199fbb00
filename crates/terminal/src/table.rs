//! Tables for people.

use comfy_table::presets::UTF8_FULL_CONDENSED;
use comfy_table::{
    CellAlignment, ColumnConstraint, ContentArrangement, ContentLineStyle, LineStyle, Table,
    TableStyle,
};

/// Widest table, characters: every terminal shows as many.
const MAX_WIDTH: usize = 80;
/// Characters beside the content of a cell: a line and two spaces.
const BESIDE: usize = 3;

/// Rounded corners, lines between columns, and one line below the head.
const STYLE: TableStyle = UTF8_FULL_CONDENSED
    .header_lines(ContentLineStyle::new('│', '│', '│'))
    .header_separator(LineStyle::new('├', '─', '┼', '┤'))
    .content_lines(ContentLineStyle::new('│', '│', '│'))
    .with_rounded_corners();

/// Rows as a table with a head; a cell may have several lines. Columns from number `first_right` on are aligned to the right.
///
/// What is wider than a terminal of 80 columns is several tables, one below the other, which all begin with the first `keys` columns.
/// Only words are wrapped in a table, and only if one column beside the keys is still too wide.
#[must_use]
pub fn table<H, R>(head: H, rows: R, keys: usize, first_right: usize) -> String
where
    H: IntoIterator<Item: ToString>,
    R: IntoIterator<Item: IntoIterator<Item: ToString>>,
{
    let mut lines = vec![texts(head)];
    lines.extend(rows.into_iter().map(texts));
    let widths: Vec<usize> = (0..lines[0].len())
        .map(|column| width(lines.iter().filter_map(|line| line.get(column))))
        .collect();

    let mut tables = Vec::new();
    for columns in groups(&widths, keys) {
        tables.push(one_table(&lines, &widths, &columns, first_right));
    }
    tables.join("\n")
}

/// Width of the widest line of these cells, characters.
fn width<'a>(cells: impl Iterator<Item = &'a String>) -> usize {
    let lines = cells.flat_map(|cell| cell.lines());
    lines.map(|line| line.chars().count()).max().unwrap_or(0)
}

/// The columns of each table: the keys, and as many others as fit, at least one.
fn groups(widths: &[usize], keys: usize) -> Vec<Vec<usize>> {
    let keys: Vec<usize> = (0..keys.min(widths.len())).collect();
    let mut groups = Vec::new();
    let mut group = keys.clone();
    for column in keys.len()..widths.len() {
        let is_full = columns_width(&group, widths) + widths[column] + BESIDE > MAX_WIDTH;
        if is_full && group.len() > keys.len() {
            groups.push(std::mem::replace(&mut group, keys.clone()));
        }
        group.push(column);
    }
    groups.push(group);
    groups
}

/// Width of a table of these columns, characters.
fn columns_width(columns: &[usize], widths: &[usize]) -> usize {
    let cells: usize = columns.iter().map(|column| widths[*column] + BESIDE).sum();
    cells + 1
}

fn one_table(
    lines: &[Vec<String>],
    widths: &[usize],
    columns: &[usize],
    first_right: usize,
) -> String {
    let mut table = Table::new();
    let cells = |line: &Vec<String>| -> Vec<String> {
        let cells = columns.iter().map(|column| line.get(*column).cloned());
        cells.map(Option::unwrap_or_default).collect()
    };
    table.load_style(STYLE).set_header(cells(&lines[0]));
    for line in &lines[1..] {
        table.add_row(cells(line));
    }

    let is_too_wide = columns_width(columns, widths) > MAX_WIDTH;
    if is_too_wide {
        table.set_content_arrangement(ContentArrangement::Dynamic);
        table.set_width(MAX_WIDTH as u16);
    }
    for (column, of_table) in columns.iter().zip(table.column_iter_mut()) {
        if *column >= first_right {
            of_table.set_cell_alignment(CellAlignment::Right);
            if is_too_wide {
                of_table.set_constraint(ColumnConstraint::ContentWidth);
            }
        }
    }
    table.to_string()
}

fn texts(cells: impl IntoIterator<Item: ToString>) -> Vec<String> {
    cells.into_iter().map(|cell| cell.to_string()).collect()
}

/// A text whose lines fit a terminal of 80 columns: lines without a space in front are joined to paragraphs, others are continued below what
/// several spaces set off.
#[must_use]
pub fn wrapped(text: &str) -> String {
    let mut paragraphs: Vec<String> = Vec::new();
    let mut is_open = false;
    for line in text.lines() {
        let is_prose = !line.is_empty() && !line.starts_with(' ');
        match paragraphs.last_mut() {
            Some(last) if is_prose && is_open => *last += &format!(" {line}"),
            _ => paragraphs.push(line.to_owned()),
        }
        is_open = is_prose;
    }

    let mut lines = Vec::new();
    for paragraph in paragraphs {
        let leading = paragraph.len() - paragraph.trim_start().len();
        let gap = paragraph[leading..].find("  ").filter(|_| leading > 0);
        // From the gap on to the next word.
        let next = gap.map(|gap| {
            let after = &paragraph[leading + gap..];
            leading + gap + (after.len() - after.trim_start().len())
        });
        let indent = next.map_or(leading, |next| paragraph[..next].chars().count());
        let begin: String = paragraph.chars().take(indent).collect();
        let mut line = begin;
        let mut is_begun = false;
        for word in paragraph
            .chars()
            .skip(indent)
            .collect::<String>()
            .split_whitespace()
        {
            let has_room = line.chars().count() + 1 + word.chars().count() <= MAX_WIDTH;
            if is_begun && has_room {
                line.push(' ');
            } else if is_begun {
                lines.push(std::mem::replace(&mut line, " ".repeat(indent)));
            }
            line += word;
            is_begun = true;
        }
        lines.push(line);
    }
    lines.join("\n")
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
        assert_eq!(table(["robot", "counts"], rows, 1, 1), expected);
    }

    #[test]
    fn a_wide_table_is_several_with_the_same_keys_and_whole_numbers() {
        let number = "-1234.5 [-2345.6, -345.7]";
        let row = ["Leguin", number, number, number, number];
        let text = table(["robot", "a", "b", "c", "d"], [row], 1, 1);
        assert!(
            text.lines().all(|line| line.chars().count() <= MAX_WIDTH),
            "{text}"
        );
        assert_eq!(text.matches(number).count(), 4);
        assert_eq!(text.matches("Leguin").count(), 2);

        // A column of words that is too wide alone is wrapped, a number beside it is not.
        let words = "words ".repeat(30);
        let text = table(["what", "n"], [[words.as_str(), number]], 1, 1);
        assert!(
            text.lines().all(|line| line.chars().count() <= MAX_WIDTH),
            "{text}"
        );
        assert!(text.contains(number));
        assert_eq!(text.matches("words").count(), 30);
    }

    #[test]
    fn long_lines_are_wrapped_below_what_they_explain() {
        let words = "word ".repeat(20);
        let text = format!("{words}\nof a paragraph\n\n  name   {words}\n");
        let wrapped = wrapped(&text);
        assert!(
            wrapped
                .lines()
                .all(|line| line.chars().count() <= MAX_WIDTH),
            "{wrapped}"
        );
        assert!(
            wrapped.contains("word of a paragraph\n\n  name   word word"),
            "{wrapped}"
        );
        assert!(wrapped.contains("\n         word"), "{wrapped}");
        assert_eq!(wrapped.matches("word").count(), 40);
    }
}
