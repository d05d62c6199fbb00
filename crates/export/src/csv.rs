//! Tables as CSV (RFC 4180, with line feeds).
//!
//! A null is an empty field, an empty text is `""`. Numbers have the fewest digits that give the same bits again. The same rows
//! give the same bytes.

use std::borrow::Cow;
use std::io::Write;
use std::path::Path;

use config::FileError;

use crate::draft::{Draft, unwritable};

/// A value of a row: the text of its field; `None` is a null.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldValue<'a>(Option<Cow<'a, str>>);

impl From<u32> for FieldValue<'_> {
    fn from(number: u32) -> Self {
        Self(Some(Cow::Owned(number.to_string())))
    }
}

impl From<u64> for FieldValue<'_> {
    fn from(number: u64) -> Self {
        Self(Some(Cow::Owned(number.to_string())))
    }
}

/// With a point or an exponent, so that readers that infer types find a floating-point number.
impl From<f64> for FieldValue<'_> {
    fn from(number: f64) -> Self {
        Self(Some(Cow::Owned(format!("{number:?}"))))
    }
}

impl From<bool> for FieldValue<'_> {
    fn from(flag: bool) -> Self {
        Self::from(if flag { "true" } else { "false" })
    }
}

impl<'a> From<&'a str> for FieldValue<'a> {
    fn from(text: &'a str) -> Self {
        Self(Some(Cow::Borrowed(text)))
    }
}

impl From<String> for FieldValue<'_> {
    fn from(text: String) -> Self {
        Self(Some(Cow::Owned(text)))
    }
}

impl<'a, T: Into<FieldValue<'a>>> From<Option<T>> for FieldValue<'a> {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self(None), Into::into)
    }
}

/// A table that is being written. [`Draft::publish`] gives the file its name.
#[derive(Debug)]
pub struct CsvTable {
    columns: Vec<String>,
    draft: Draft,
}

impl CsvTable {
    /// Begins a table with the names of its columns.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be written.
    pub fn create(path: &Path, columns: Vec<String>) -> Result<Self, FileError> {
        let draft = Draft::create(path)?;
        let mut table = Self { columns, draft };
        let names = table.columns.clone();
        table.write(names.into_iter().map(FieldValue::from))?;
        Ok(table)
    }

    /// Adds a row: the values of the columns with these names, and null in all others.
    ///
    /// # Errors
    /// [`FileError`] if the file cannot be written.
    pub fn add<'a>(
        &mut self,
        cells: impl IntoIterator<Item = (&'a str, FieldValue<'a>)>,
    ) -> Result<(), FileError> {
        let mut row = vec![FieldValue(None); self.columns.len()];
        for (name, value) in cells {
            let place = self.columns.iter().position(|column| column == name);
            let Some(place) = place else {
                unreachable!("the table has no column {name}");
            };
            row[place] = value;
        }
        self.write(row)
    }

    /// Ends the table, which is complete and not yet under its name.
    #[must_use]
    pub fn finish(self) -> Draft {
        self.draft
    }

    fn write<'a>(
        &mut self,
        row: impl IntoIterator<Item = FieldValue<'a>>,
    ) -> Result<(), FileError> {
        let mut line = String::new();
        for (place, FieldValue(text)) in row.into_iter().enumerate() {
            if place > 0 {
                line.push(',');
            }
            match text {
                Some(text) if text.is_empty() || text.contains([',', '"', '\r', '\n']) => {
                    line.push_str(&format!("\"{}\"", text.replace('"', "\"\"")));
                }
                text => line.push_str(&text.unwrap_or_default()),
            }
        }

        line.push('\n');
        let written = self.draft.write_all(line.as_bytes());
        written.map_err(|error| unwritable(self.draft.path(), &error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_quoted_where_they_must_be_and_all_bits_of_numbers_are_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        let columns = ["real", "text"].map(str::to_owned).to_vec();
        let mut table = CsvTable::create(&path, columns).unwrap();
        for (number, text) in [
            (Some(0.1 + 0.2), Some("a \"b\",\r\nc")),
            (Some(7.0), Some("")),
            (Some(-0.0), None),
            (Some(5e-324), Some("é")),
            (Some(f64::MAX), Some("=1")),
            (None, Some("NA")),
        ] {
            let cells = [
                ("text", FieldValue::from(text)),
                ("real", FieldValue::from(number)),
            ];
            table.add(cells).unwrap();
        }
        table.finish().publish().unwrap();

        assert_eq!(
            std::fs::read_to_string(&path).unwrap(),
            "real,text\n\
             0.30000000000000004,\"a \"\"b\"\",\r\nc\"\n\
             7.0,\"\"\n\
             -0.0,\n\
             5e-324,é\n\
             1.7976931348623157e308,=1\n\
             ,NA\n"
        );
    }

    #[test]
    fn a_table_that_is_not_finished_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        drop(CsvTable::create(&path, vec!["number".to_owned()]).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
