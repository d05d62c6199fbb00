//! The data of charts as a table.

/// A row: names of columns with their values, empty if there is none.
pub(crate) type DataRow = Vec<(&'static str, String)>;

/// A number with all its digits; nothing if it is none.
pub(crate) fn digits(value: f64) -> String {
    match value.is_finite() {
        true => (value + 0.0).to_string(),
        false => String::new(),
    }
}

/// A table of the rows of several charts, with all their columns.
#[derive(Debug, Default)]
pub(crate) struct DataTable {
    columns: Vec<&'static str>,
    rows: Vec<DataRow>,
}

impl DataTable {
    /// Adds the rows of a panel.
    pub(crate) fn add(&mut self, panel: usize, heading: &str, rows: Vec<DataRow>) {
        for row in rows {
            let mut whole = vec![
                ("panel", panel.to_string()),
                ("heading", heading.to_owned()),
            ];
            whole.extend(row);
            for (column, _) in &whole {
                if !self.columns.contains(column) {
                    self.columns.push(column);
                }
            }
            self.rows.push(whole);
        }
    }

    /// The table as CSV (RFC 4180, with line feeds).
    pub(crate) fn to_csv(&self) -> String {
        let mut csv = self.columns.join(",") + "\n";
        for row in &self.rows {
            let value = |column: &&str| {
                let found = row.iter().find(|(name, _)| name == column);
                found.map_or(String::new(), |(_, value)| quoted(value))
            };
            let values: Vec<String> = self.columns.iter().map(value).collect();
            csv += &values.join(",");
            csv.push('\n');
        }
        csv
    }
}

fn quoted(value: &str) -> String {
    if value.contains([',', '"', '\n', '\r']) {
        return format!("\"{}\"", value.replace('"', "\"\""));
    }
    value.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_all_columns_of_its_rows() {
        let mut table = DataTable::default();
        table.add(1, "a, b", vec![vec![("x", digits(0.1))]]);
        table.add(
            2,
            "\"",
            vec![vec![("y", digits(f64::NAN)), ("x", digits(-0.0))]],
        );
        let csv = "panel,heading,x,y\n1,\"a, b\",0.1,\n2,\"\"\"\",0,\n";
        assert_eq!(table.to_csv(), csv);
    }
}
