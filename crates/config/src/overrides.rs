//! `--set path=value`: changes to a file from the command line.

use crate::diagnostic::{FileError, Source};

/// What the command line changes of a scenario file.
#[derive(Debug, Clone, Default)]
pub struct Changes {
    /// Another seed.
    pub seed: Option<u64>,
    /// Another duration, simulated seconds.
    pub duration_s: Option<f64>,
    /// `path=value` pairs.
    pub set: Vec<Override>,
}

/// One change: where in the file, and what to write there.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    path: Vec<String>,
    value: toml::Value,
}

impl std::str::FromStr for Override {
    type Err = String;

    /// Reads `path=value`. The path's parts are joined by `.`; an element of a list is found by its `name` or by its
    /// position from 0: `robot.Butler.params.refiller=Vonda`. The value is written as in a scenario file; what is no
    /// TOML value is a text.
    fn from_str(text: &str) -> Result<Self, String> {
        let (path, value) = text
            .split_once('=')
            .ok_or_else(|| format!("{text:?} is not of the form path=value"))?;
        let path: Vec<String> = path.trim().split('.').map(str::to_owned).collect();
        if path.iter().any(String::is_empty) {
            return Err(format!("{text:?}: a part of the path is empty"));
        }

        if let Some(part) = path.iter().find(|part| !is_key(part)) {
            return Err(format!(
                "{text:?} is not of the form path=value: {part:?} is not a key"
            ));
        }

        let parsed = toml::from_str::<toml::Table>(&format!("value = {value}"));
        let parsed = parsed.ok().and_then(|mut table| table.remove("value"));

        Ok(Self {
            path,
            value: parsed.unwrap_or_else(|| toml::Value::String(value.trim().to_owned())),
        })
    }
}

/// Whether a part of a path is a key of TOML that needs no quotes, as all keys of our files and names of robots are.
fn is_key(part: &str) -> bool {
    part.chars()
        .all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'))
}

impl std::fmt::Display for Override {
    /// As it is read again, by another process of the same run.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.path.join("."), self.value)
    }
}

impl Changes {
    /// Whether the file stays as it is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.seed.is_none() && self.duration_s.is_none() && self.set.is_empty()
    }

    /// The file with the changes made, as a text of its own.
    ///
    /// # Errors
    /// [`FileError`] if the file is not TOML, or names the change whose path leads nowhere.
    pub fn apply(&self, source: &Source) -> Result<Source, FileError> {
        let mut root: toml::Table = source.parse()?;
        for change in &self.set {
            root = change.apply(root)?;
        }

        if let Some(seed) = self.seed {
            let seed = i64::try_from(seed).unwrap_or(i64::MAX);
            root.insert("seed".to_owned(), toml::Value::Integer(seed));
        }
        if let Some(duration_s) = self.duration_s {
            let duration = toml::Value::String(format!("{duration_s} s"));
            root.insert("duration".to_owned(), duration);
        }

        let text = toml::to_string(&root).map_err(|error| FileError::new(error.to_string()))?;
        Ok(Source {
            name: format!("{} (with the command line's changes)", source.name),
            text,
        })
    }
}

impl Override {
    fn apply(&self, table: toml::Table) -> Result<toml::Table, FileError> {
        let mut root = toml::Value::Table(table);
        set(&mut root, &self.path, &self.value)
            .map_err(|reason| FileError::new(format!("--set {}: {reason}", self.path.join("."))))?;
        match root {
            toml::Value::Table(table) => Ok(table),
            _ => unreachable!("a path has at least one part, so the root stays a table"),
        }
    }
}

fn set(at: &mut toml::Value, path: &[String], value: &toml::Value) -> Result<(), String> {
    let Some((first, rest)) = path.split_first() else {
        *at = value.clone();
        return Ok(());
    };

    let next = match at {
        toml::Value::Table(table) if rest.is_empty() => {
            table.insert(first.clone(), value.clone());
            return Ok(());
        }
        toml::Value::Table(table) => table
            .entry(first.clone())
            .or_insert_with(|| toml::Value::Table(toml::Table::new())),
        toml::Value::Array(list) => element(list, first)?,
        _ => {
            return Err(format!(
                "there is nothing below {first:?}: it is a single value"
            ));
        }
    };

    set(next, rest, value)
}

fn element<'a>(list: &'a mut [toml::Value], which: &str) -> Result<&'a mut toml::Value, String> {
    let is_named =
        |value: &toml::Value| value.get("name").and_then(toml::Value::as_str) == Some(which);
    let index = list
        .iter()
        .position(is_named)
        .or_else(|| which.parse().ok().filter(|index| *index < list.len()));
    let len = list.len();
    let found = index.and_then(|index| list.get_mut(index));
    found.ok_or_else(|| format!("none of the {len} elements is called or numbered {which:?}"))
}
