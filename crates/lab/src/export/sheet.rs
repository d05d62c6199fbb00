//! Tables for other programs: typed columns, written row by row as CSV, as Parquet, or as both.
//!
//! CSV (RFC 4180, with line feeds) has no types and writes a null as an empty field. Numbers have the fewest digits that give
//! the same bits again. Parquet has the types and the nulls. The same rows give the same bytes.

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use config::FileError;
use csv::Writer;
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{
    SerializedColumnWriter, SerializedFileWriter, SerializedRowGroupWriter,
};
use parquet::schema::types::{Type as SchemaType, TypePtr};

use super::draft::{Draft, unwritable};

/// Rows of a row group, which is what a table in Parquet keeps in memory.
const GROUP_ROWS: usize = 1 << 16;
/// A row group ends earlier if its texts have so many bytes.
const GROUP_BYTES: usize = 16 << 20;
/// What a Parquet file names as its writer; no version, so that a new one gives the same bytes.
const CREATED_BY: &str = "cars";

/// A file format of tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Comma-separated values.
    Csv,
    /// Apache Parquet, compressed with Snappy.
    Parquet,
}

impl Format {
    /// How the names of its files end.
    #[must_use]
    pub fn ending(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Parquet => "parquet",
        }
    }
}

/// The values of a column. Any of them may be null.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Type {
    /// Whole numbers of 64 bits.
    Integer,
    /// Floating-point numbers of 64 bits.
    Real,
    /// True or false.
    Flag,
    /// Unicode text.
    Text,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name, with the unit of its values.
    pub name: String,
    /// Its values.
    pub of: Type,
}

impl Column {
    /// A column.
    #[must_use]
    pub fn new(name: impl Into<String>, of: Type) -> Self {
        Self {
            name: name.into(),
            of,
        }
    }
}

/// A value of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Value<'a> {
    /// No value.
    Null,
    /// Of a column of [`Type::Integer`].
    Integer(i64),
    /// Of a column of [`Type::Real`].
    Real(f64),
    /// Of a column of [`Type::Flag`].
    Flag(bool),
    /// Of a column of [`Type::Text`].
    Text(Cow<'a, str>),
}

impl Value<'_> {
    fn is_of(&self, of: Type) -> bool {
        match self {
            Self::Null => true,
            Self::Integer(_) => of == Type::Integer,
            Self::Real(_) => of == Type::Real,
            Self::Flag(_) => of == Type::Flag,
            Self::Text(_) => of == Type::Text,
        }
    }

    /// As a field of CSV.
    fn to_field(&self) -> Cow<'_, str> {
        match self {
            Self::Null => Cow::Borrowed(""),
            Self::Integer(number) => Cow::Owned(number.to_string()),
            // With a point or an exponent, so that readers that infer types find a floating-point number.
            Self::Real(number) => Cow::Owned(format!("{number:?}")),
            Self::Flag(true) => Cow::Borrowed("true"),
            Self::Flag(false) => Cow::Borrowed("false"),
            Self::Text(text) => Cow::Borrowed(text),
        }
    }
}

impl From<u32> for Value<'_> {
    fn from(number: u32) -> Self {
        Self::Integer(number.into())
    }
}

/// A tick, a count or a seed: all of them are far below 2^63.
impl From<u64> for Value<'_> {
    fn from(number: u64) -> Self {
        Self::Integer(i64::try_from(number).unwrap_or(i64::MAX))
    }
}

impl From<f64> for Value<'_> {
    fn from(number: f64) -> Self {
        Self::Real(number)
    }
}

impl From<bool> for Value<'_> {
    fn from(flag: bool) -> Self {
        Self::Flag(flag)
    }
}

impl<'a> From<&'a str> for Value<'a> {
    fn from(text: &'a str) -> Self {
        Self::Text(Cow::Borrowed(text))
    }
}

impl From<String> for Value<'_> {
    fn from(text: String) -> Self {
        Self::Text(Cow::Owned(text))
    }
}

impl<'a, T: Into<Value<'a>>> From<Option<T>> for Value<'a> {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Null, Into::into)
    }
}

/// A table that is being written, to a file for each format.
pub struct Sheet {
    columns: Vec<Column>,
    files: Vec<SheetFile>,
}

enum SheetFile {
    Csv(Box<Writer<Draft>>),
    Parquet(Box<ParquetFile>),
}

impl Sheet {
    /// Begins the table `name` in a folder.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be written.
    pub fn create(
        folder: &Path,
        name: &str,
        formats: &[Format],
        columns: Vec<Column>,
    ) -> Result<Self, FileError> {
        let mut files = Vec::new();
        for format in formats {
            let draft = Draft::create(&folder.join(format!("{name}.{}", format.ending())))?;
            files.push(match format {
                Format::Csv => SheetFile::csv(draft, &columns)?,
                Format::Parquet => SheetFile::Parquet(Box::new(ParquetFile::new(draft, &columns)?)),
            });
        }

        Ok(Self { columns, files })
    }

    /// Adds a row: the values of the columns with these names, and null in all others.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be written.
    pub fn add<'a>(
        &mut self,
        cells: impl IntoIterator<Item = (&'a str, Value<'a>)>,
    ) -> Result<(), FileError> {
        let mut row = vec![Value::Null; self.columns.len()];
        for (name, value) in cells {
            let place = self.columns.iter().position(|column| column.name == name);
            let Some(place) = place else {
                unreachable!("the table has no column {name}");
            };
            assert!(
                value.is_of(self.columns[place].of),
                "{value:?} in the column {name}"
            );
            row[place] = value;
        }

        for file in &mut self.files {
            file.add(&row)?;
        }
        Ok(())
    }

    /// Ends the table. Its files are complete and not yet under their names.
    ///
    /// # Errors
    /// [`FileError`] if a file cannot be written.
    pub fn finish(self) -> Result<Vec<Draft>, FileError> {
        let mut drafts = Vec::new();
        for file in self.files {
            drafts.push(file.finish()?);
        }
        Ok(drafts)
    }
}

impl SheetFile {
    fn csv(draft: Draft, columns: &[Column]) -> Result<Self, FileError> {
        let mut writer = Writer::from_writer(draft);
        let written = writer.write_record(columns.iter().map(|column| column.name.as_str()));
        written.map_err(|error| unwritable(writer.get_ref().path(), &error))?;
        Ok(Self::Csv(Box::new(writer)))
    }

    fn add(&mut self, row: &[Value]) -> Result<(), FileError> {
        match self {
            Self::Csv(writer) => {
                let written = write_record(writer, row);
                written.map_err(|error| unwritable(writer.get_ref().path(), &error))
            }
            Self::Parquet(file) => file.add(row),
        }
    }

    fn finish(self) -> Result<Draft, FileError> {
        match self {
            Self::Csv(writer) => writer.into_inner().map_err(|error| {
                let reason = error.error().to_string();
                unwritable(error.into_inner().get_ref().path(), &reason)
            }),
            Self::Parquet(file) => file.finish(),
        }
    }
}

/// Writes a row as CSV.
fn write_record(writer: &mut Writer<Draft>, row: &[Value]) -> Result<(), csv::Error> {
    for value in row {
        writer.write_field(value.to_field().as_bytes())?;
    }
    // Ends the record.
    writer.write_record(None::<&[u8]>)
}

/// A table in Parquet: rows are kept by column until they make a row group.
struct ParquetFile {
    writer: SerializedFileWriter<Draft>,
    columns: Vec<Cells>,
    rows: usize,
    /// Bytes of the texts in these rows.
    text_bytes: usize,
}

/// The cells of a column in the row group that is being filled.
struct Cells {
    /// 1 for a value, 0 for a null: the definition levels of an optional column.
    levels: Vec<i16>,
    values: Values,
}

/// The values that are not null.
enum Values {
    Integer(Vec<i64>),
    Real(Vec<f64>),
    Flag(Vec<bool>),
    Text(Vec<ByteArray>),
}

impl ParquetFile {
    fn new(draft: Draft, columns: &[Column]) -> Result<Self, FileError> {
        let path = draft.path().to_owned();
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_created_by(CREATED_BY.to_owned())
            .build();
        let writer = schema(columns)
            .and_then(|schema| SerializedFileWriter::new(draft, schema, Arc::new(properties)))
            .map_err(|error| unwritable(&path, &error))?;

        Ok(Self {
            writer,
            columns: columns.iter().map(|column| Cells::of(column.of)).collect(),
            rows: 0,
            text_bytes: 0,
        })
    }

    fn add(&mut self, row: &[Value]) -> Result<(), FileError> {
        for (cells, value) in self.columns.iter_mut().zip(row) {
            cells.add(value);
            if let Value::Text(text) = value {
                self.text_bytes += text.len();
            }
        }
        self.rows += 1;

        if self.rows >= GROUP_ROWS || self.text_bytes >= GROUP_BYTES {
            self.write_group()?;
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Draft, FileError> {
        if self.rows > 0 {
            self.write_group()?;
        }

        let path = self.writer.inner().path().to_owned();
        self.writer
            .into_inner()
            .map_err(|error| unwritable(&path, &error))
    }

    /// Writes the rows so far.
    fn write_group(&mut self) -> Result<(), FileError> {
        let written = write_cells(&mut self.writer, &self.columns);
        written.map_err(|error| unwritable(self.writer.inner().path(), &error))?;

        for cells in &mut self.columns {
            cells.clear();
        }
        self.rows = 0;
        self.text_bytes = 0;
        Ok(())
    }
}

impl Cells {
    fn of(of: Type) -> Self {
        Self {
            levels: Vec::new(),
            values: match of {
                Type::Integer => Values::Integer(Vec::new()),
                Type::Real => Values::Real(Vec::new()),
                Type::Flag => Values::Flag(Vec::new()),
                Type::Text => Values::Text(Vec::new()),
            },
        }
    }

    fn add(&mut self, value: &Value) {
        self.levels.push(i16::from(*value != Value::Null));
        match (&mut self.values, value) {
            (_, Value::Null) => {}
            (Values::Integer(values), Value::Integer(number)) => values.push(*number),
            (Values::Real(values), Value::Real(number)) => values.push(*number),
            (Values::Flag(values), Value::Flag(flag)) => values.push(*flag),
            (Values::Text(values), Value::Text(text)) => values.push(text.as_ref().into()),
            _ => unreachable!("a table checks the types of its rows"),
        }
    }

    fn clear(&mut self) {
        self.levels.clear();
        match &mut self.values {
            Values::Integer(values) => values.clear(),
            Values::Real(values) => values.clear(),
            Values::Flag(values) => values.clear(),
            Values::Text(values) => values.clear(),
        }
    }

    fn write(&self, writer: &mut SerializedColumnWriter<'_>) -> Result<usize, ParquetError> {
        let levels = Some(self.levels.as_slice());
        match &self.values {
            Values::Integer(values) => writer
                .typed::<Int64Type>()
                .write_batch(values, levels, None),
            Values::Real(values) => writer
                .typed::<DoubleType>()
                .write_batch(values, levels, None),
            Values::Flag(values) => writer.typed::<BoolType>().write_batch(values, levels, None),
            Values::Text(values) => writer
                .typed::<ByteArrayType>()
                .write_batch(values, levels, None),
        }
    }
}

/// Writes a row group.
fn write_cells(
    writer: &mut SerializedFileWriter<Draft>,
    columns: &[Cells],
) -> Result<(), ParquetError> {
    let mut group: SerializedRowGroupWriter<'_, Draft> = writer.next_row_group()?;
    for cells in columns {
        let Some(mut column) = group.next_column()? else {
            unreachable!("the schema has a column for each column");
        };

        cells.write(&mut column)?;
        column.close()?;
    }

    group.close()?;
    Ok(())
}

/// The columns as Parquet describes them; all are optional.
fn schema(columns: &[Column]) -> Result<TypePtr, ParquetError> {
    let mut fields = Vec::new();
    for column in columns {
        let (physical, logical) = match column.of {
            Type::Integer => (Physical::INT64, None),
            Type::Real => (Physical::DOUBLE, None),
            Type::Flag => (Physical::BOOLEAN, None),
            Type::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let field = SchemaType::primitive_type_builder(&column.name, physical)
            .with_repetition(Repetition::OPTIONAL)
            .with_logical_type(logical)
            .build()?;
        fields.push(Arc::new(field));
    }

    let schema = SchemaType::group_type_builder("table")
        .with_fields(fields)
        .build()?;
    Ok(Arc::new(schema))
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::fs::File;

    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::{Field, RowAccessor};

    /// Rows of two columns, every third text of which is null.
    fn write(folder: &Path, formats: &[Format], texts: usize, text: &str) {
        let columns = vec![
            Column::new("number", Type::Integer),
            Column::new("text", Type::Text),
        ];
        let mut sheet = Sheet::create(folder, "table", formats, columns).unwrap();
        for number in 0..texts as u64 {
            let text = (!number.is_multiple_of(3)).then_some(text);
            let cells = [("text", text.into()), ("number", number.into())];
            sheet.add(cells).unwrap();
        }
        for draft in sheet.finish().unwrap() {
            draft.publish().unwrap();
        }
    }

    /// The row groups of a table that was written; its rows must be the ones that were.
    fn read(folder: &Path, rows: usize, text: &str) -> usize {
        let file = File::open(folder.join("table.parquet")).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        let mut count = 0;
        for row in reader.get_row_iter(None).unwrap() {
            let row = row.unwrap();
            assert_eq!(row.get_long(0).unwrap(), count);
            let found: Vec<&Field> = row.get_column_iter().map(|(_, field)| field).collect();
            let expected = match count % 3 {
                0 => Field::Null,
                _ => Field::Str(text.to_owned()),
            };
            assert_eq!(*found[1], expected);
            count += 1;
        }
        assert_eq!(count, rows as i64);
        reader.num_row_groups()
    }

    #[test]
    fn a_long_table_has_several_row_groups() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &[Format::Parquet], GROUP_ROWS + 1, "text");
        assert_eq!(read(folder.path(), GROUP_ROWS + 1, "text"), 2);

        let long = "x".repeat(GROUP_BYTES / 4);
        write(folder.path(), &[Format::Parquet], 8, &long);
        assert_eq!(read(folder.path(), 8, &long), 2);

        write(folder.path(), &[Format::Parquet], 0, "");
        assert_eq!(read(folder.path(), 0, ""), 0);
    }

    #[test]
    fn fields_of_csv_are_quoted_where_they_must_be() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &[Format::Csv], 2, "a \"b\",\r\nc");
        let text = std::fs::read_to_string(folder.path().join("table.csv")).unwrap();
        assert_eq!(text, "number,text\n0,\n1,\"a \"\"b\"\",\r\nc\"\n");
    }

    #[test]
    fn numbers_have_a_point_or_an_exponent_and_all_their_bits() {
        let fields = [
            (0.1 + 0.2, "0.30000000000000004"),
            (7.0, "7.0"),
            (-0.0, "-0.0"),
            (5e-324, "5e-324"),
            (f64::MAX, "1.7976931348623157e308"),
        ];
        for (number, field) in fields {
            assert_eq!(Value::from(number).to_field(), field);
        }
    }

    #[test]
    fn a_table_that_is_not_finished_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let columns = vec![Column::new("number", Type::Real)];
        let formats = [Format::Csv, Format::Parquet];
        let mut sheet = Sheet::create(folder.path(), "table", &formats, columns).unwrap();
        sheet.add([("number", 1.0.into())]).unwrap();
        drop(sheet);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
