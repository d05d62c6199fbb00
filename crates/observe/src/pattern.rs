//! Events that match: a kind, and the values that some of its fields have.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use protocol::pattern::matches;
use protocol::{Event, RobotPattern, schemas};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::RunSetting;
use crate::words::{self, Word};

/// A set of events, in a file `{ event = "behavior", robot = "Butler", to = "EXCHANGE" }`. A field with a list of values matches
/// each of them; a field that is not named matches everything. Robots and sites are named as [`RobotPattern`]s, `"*"` for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, Value>", into = "Value")]
pub struct Pattern {
    kind: String,
    fields: BTreeMap<String, FieldValues>,
}

/// The values of a field that match.
#[derive(Debug, Clone, PartialEq)]
struct FieldValues {
    values: Vec<Value>,
    /// Whether the values are patterns of names.
    are_names: bool,
}

/// Every robot or site, as the value of a field.
const EVERY_NAME: &str = "*";
/// The field of events of sites that names one.
const SITE: &str = "site";
/// What a robot did to a site that there need not be.
const REFUSED: &str = "site_refused";

/// A pattern that no event can match.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PatternError {
    /// No kind of event is named.
    #[error(
        "a pattern names a kind of event: `event = \"behavior\"`; there are {}",
        all_kinds()
    )]
    NoKind,
    /// There is no such kind of event.
    #[error("there is no event \"{0}\"; there are {kinds}", kinds = all_kinds())]
    UnknownKind(String),
    /// Events of the kind have no such field.
    #[error("the event \"{kind}\" has no field `{field}`; it has {fields}")]
    UnknownField {
        /// The kind.
        kind: String,
        /// The field.
        field: String,
        /// The fields that it has.
        fields: String,
    },
    /// The list of values of a field is empty.
    #[error("`{field}` of the event \"{kind}\" is none of no values: name at least one")]
    NoValue {
        /// The kind.
        kind: String,
        /// The field.
        field: String,
    },
    /// A site, or a pattern of sites, that the run does not have.
    #[error("no site of this scenario is called {name}; {known}")]
    UnknownSite {
        /// The name or pattern.
        name: String,
        /// The sites that there are, in words.
        known: String,
    },
    /// The field never has the value.
    #[error("`{field}` of the event \"{kind}\" is never {value}{known}")]
    UnknownValue {
        /// The kind.
        kind: String,
        /// The field.
        field: String,
        /// The value, as JSON.
        value: String,
        /// What it can be, in words; empty if there is no list.
        known: String,
    },
}

/// What the field of an event can be.
#[derive(Debug, Clone, PartialEq)]
enum Domain {
    Robot,
    Site,
    Words(Vec<String>),
    /// One of these words, or a table.
    WordsOrTable(Vec<String>),
    Text,
    Number,
    Truth,
    Other,
}

/// The fields of every kind of event, from the schema of the record.
static KINDS: LazyLock<BTreeMap<String, BTreeMap<String, Domain>>> = LazyLock::new(kinds);

fn kinds() -> BTreeMap<String, BTreeMap<String, Domain>> {
    let schema: Value = serde_json::from_str(schemas::EVENT).unwrap_or_default();
    let mut kinds = BTreeMap::new();
    for variant in schema["oneOf"].as_array().into_iter().flatten() {
        let mut kind = String::new();
        let mut fields = BTreeMap::new();
        for (name, field) in variant["properties"].as_object().into_iter().flatten() {
            if name == "event" {
                kind = field["const"].as_str().unwrap_or_default().to_owned();
            } else if name == SITE {
                fields.insert(name.clone(), Domain::Site);
            } else {
                fields.insert(name.clone(), domain(&schema, field));
            }
        }

        kinds.insert(kind, fields);
    }

    kinds
}

fn domain(schema: &Value, field: &Value) -> Domain {
    if let Some(definition) = field["$ref"].as_str() {
        let name = definition.trim_start_matches("#/$defs/");
        if name == "RobotName" {
            return Domain::Robot;
        }
        return words(&schema["$defs"][name]);
    }

    let is = |wanted: &str| match &field["type"] {
        Value::String(one) => one == wanted,
        Value::Array(several) => several.iter().any(|one| one == wanted),
        _ => false,
    };
    if is("string") {
        Domain::Text
    } else if is("integer") || is("number") {
        Domain::Number
    } else if is("boolean") {
        Domain::Truth
    } else {
        Domain::Other
    }
}

/// The words of an enumeration, whose other values are tables.
fn words(definition: &Value) -> Domain {
    let mut words = Vec::new();
    let mut has_tables = false;
    for variant in definition["oneOf"].as_array().into_iter().flatten() {
        match variant["const"].as_str() {
            Some(word) => words.push(word.to_owned()),
            None => has_tables = true,
        }
    }

    match (words.is_empty(), has_tables) {
        (true, _) => Domain::Other,
        (false, true) => Domain::WordsOrTable(words),
        (false, false) => Domain::Words(words),
    }
}

fn all_kinds() -> String {
    let names: Vec<&str> = KINDS.keys().map(String::as_str).collect();
    names.join(", ")
}

impl Domain {
    fn has(&self, value: &Value) -> bool {
        match self {
            Self::Robot | Self::Site => value
                .as_str()
                .is_some_and(|name| RobotPattern::new(name).is_ok()),
            Self::Words(words) => words.iter().any(|word| value == word),
            Self::WordsOrTable(words) => {
                value.is_object() || words.iter().any(|word| value == word)
            }
            Self::Text => value.is_string(),
            Self::Number => value.is_number(),
            Self::Truth => value.is_boolean(),
            Self::Other => true,
        }
    }

    /// What it can be, to be appended to an error.
    fn known(&self) -> String {
        match self {
            Self::Robot => {
                ": it is the name of a robot, or a pattern such as \"S*\" or \"S{1..9}\"".to_owned()
            }
            Self::Site => {
                ": it is the name of a site, or a pattern such as \"T*\" or \"T{1..9}\"".to_owned()
            }
            Self::Words(words) => format!(": it is one of {}", words.join(", ")),
            Self::WordsOrTable(words) => {
                format!(": it is one of {}, or a table", words.join(", "))
            }
            Self::Text => ": it is a text".to_owned(),
            Self::Number => ": it is a number".to_owned(),
            Self::Truth => ": it is true or false".to_owned(),
            Self::Other => String::new(),
        }
    }
}

impl TryFrom<BTreeMap<String, Value>> for Pattern {
    type Error = PatternError;

    fn try_from(mut table: BTreeMap<String, Value>) -> Result<Self, PatternError> {
        let kind = match table.remove("event") {
            Some(Value::String(kind)) => kind,
            _ => return Err(PatternError::NoKind),
        };
        let Some(known) = KINDS.get(&kind) else {
            return Err(PatternError::UnknownKind(kind));
        };

        let mut fields = BTreeMap::new();
        for (field, value) in table {
            let Some(domain) = known.get(&field) else {
                let names: Vec<&str> = known.keys().map(String::as_str).collect();
                return Err(PatternError::UnknownField {
                    kind,
                    field,
                    fields: names.join(", "),
                });
            };
            let values = match value {
                Value::Array(several) => several,
                one => vec![one],
            };
            if values.is_empty() {
                return Err(PatternError::NoValue { kind, field });
            }
            if let Some(value) = values.iter().find(|value| !domain.has(value)) {
                return Err(PatternError::UnknownValue {
                    kind,
                    field,
                    value: value.to_string(),
                    known: domain.known(),
                });
            }
            let are_names = matches!(domain, Domain::Robot | Domain::Site);
            fields.insert(field, FieldValues { values, are_names });
        }
        Ok(Self { kind, fields })
    }
}

impl TryFrom<Value> for Pattern {
    type Error = PatternError;

    fn try_from(value: Value) -> Result<Self, PatternError> {
        match value {
            Value::Object(fields) => Self::try_from(fields.into_iter().collect::<BTreeMap<_, _>>()),
            _ => Err(PatternError::NoKind),
        }
    }
}

impl From<Pattern> for Value {
    fn from(pattern: Pattern) -> Self {
        let mut table = serde_json::Map::new();
        table.insert("event".to_owned(), Self::String(pattern.kind));
        for (field, FieldValues { mut values, .. }) in pattern.fields {
            let value = match values.len() {
                1 => values.remove(0),
                _ => Self::Array(values),
            };
            table.insert(field, value);
        }
        Self::Object(table)
    }
}

impl Pattern {
    /// The kind of its events.
    #[must_use]
    pub fn kind(&self) -> &str {
        &self.kind
    }

    /// Whether an event is one of the set.
    #[must_use]
    pub fn matches(&self, event: &Event) -> bool {
        if event.kind() != self.kind {
            return false;
        }
        if self.fields.is_empty() {
            return true;
        }

        let Ok(event) = serde_json::to_value(event) else {
            return false;
        };
        self.fields
            .iter()
            .all(|(field, wanted)| wanted.has(&event[field]))
    }

    /// Whether its events have this field, with the name of a robot.
    pub(crate) fn has_robot(&self, field: &str) -> bool {
        KINDS[&self.kind].get(field) == Some(&Domain::Robot)
    }

    /// Whether its events have a field with the name of a robot, of which it says nothing.
    pub(crate) fn leaves_open(&self, field: &str) -> bool {
        self.has_robot(field) && !self.fields.contains_key(field)
    }

    /// The words that robots choose and that it names.
    pub(crate) fn words(&self) -> Vec<Word> {
        let (kind, of, fields): (_, _, &[&str]) = match self.kind.as_str() {
            "emotion" => (words::WordKind::Emotion, "robot", &["from", "to"]),
            "behavior" => (words::WordKind::Behavior, "robot", &["from", "to"]),
            "command_sent" => (words::WordKind::Command, "from", &["command"]),
            _ => return Vec::new(),
        };

        let texts = |field: &str| {
            let wanted = self.fields.get(field).into_iter();
            wanted.flat_map(|wanted| wanted.texts().map(str::to_owned))
        };
        let mut named = Vec::new();
        for field in fields {
            for word in texts(field) {
                named.push(Word {
                    kind,
                    robots: texts(of).collect(),
                    word,
                });
            }
        }
        named
    }

    /// The expectations that it names.
    pub(crate) fn expectations(&self) -> impl Iterator<Item = &str> {
        let is_about_them = self.kind == "judged";
        let wanted = self.fields.get("expectation");
        let wanted = wanted.filter(|_| is_about_them).into_iter();
        wanted.flat_map(FieldValues::texts)
    }

    /// The robots that the pattern names, or patterns of them. An event of a run can match only if its roster has them.
    pub fn robots(&self) -> impl Iterator<Item = &str> {
        self.names(Domain::Robot)
    }

    /// Checks that a run has the sites that it names. What was refused because there is no such site can have any name.
    ///
    /// # Errors
    /// [`PatternError::UnknownSite`].
    pub fn check_sites(&self, setting: &RunSetting) -> Result<(), PatternError> {
        if self.kind == REFUSED {
            return Ok(());
        }
        for name in self.names(Domain::Site) {
            if !setting.has_site(name) {
                return Err(PatternError::UnknownSite {
                    name: name.to_owned(),
                    known: setting.sites_in_words(),
                });
            }
        }
        Ok(())
    }

    /// The values of fields with names of this kind, but for those that stand for all.
    fn names(&self, domain: Domain) -> impl Iterator<Item = &str> {
        let domains = &KINDS[&self.kind];
        let named = self
            .fields
            .iter()
            .filter(move |(field, _)| domains[*field] == domain);
        named.flat_map(|(_, wanted)| wanted.texts())
    }
}

impl FieldValues {
    fn has(&self, value: &Value) -> bool {
        if self.are_names {
            let name = value.as_str().unwrap_or_default();
            let mut patterns = self.values.iter().filter_map(Value::as_str);
            return patterns.any(|pattern| matches(pattern, name));
        }
        self.values.iter().any(|wanted| equal(wanted, value))
    }

    /// Its texts, but for the one that stands for all names.
    fn texts(&self) -> impl Iterator<Item = &str> {
        let texts = self.values.iter().filter_map(Value::as_str);
        texts.filter(|text| !(self.are_names && *text == EVERY_NAME))
    }
}

/// Numbers are equal as numbers: 1 is 1.0.
fn equal(wanted: &Value, value: &Value) -> bool {
    match (wanted.as_f64(), value.as_f64()) {
        (Some(wanted), Some(value)) => wanted == value,
        _ => wanted == value,
    }
}

impl std::fmt::Display for Pattern {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.kind)?;
        for (place, (field, wanted)) in self.fields.iter().enumerate() {
            let mut values: Vec<String> = wanted.values.iter().map(plain).collect();
            if wanted.are_names && wanted.texts().next().is_none() {
                values = vec!["of every name".to_owned()];
            }
            let comma = if place > 0 { ", " } else { " with " };
            write!(f, "{comma}{field} {}", values.join(" or "))?;
        }
        Ok(())
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => protocol::plain::escape_line(text),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use protocol::RobotName;

    use super::*;

    fn pattern(text: &str) -> Result<Pattern, String> {
        #[derive(Deserialize)]
        struct File {
            pattern: Pattern,
        }
        let file: Result<File, _> = toml::from_str(&format!("pattern = {text}"));
        file.map(|file| file.pattern)
            .map_err(|error| error.message().to_owned())
    }

    fn enters(robot: &str, to: &str) -> Event {
        Event::Behavior {
            robot: RobotName::new(robot).unwrap(),
            from: None,
            to: to.to_owned(),
        }
    }

    #[test]
    fn a_pattern_matches_by_kind_and_fields() {
        let any = pattern("{ event = 'behavior' }").unwrap();
        assert!(any.matches(&enters("A", "X")));
        assert!(!any.matches(&Event::Lost {
            robot: RobotName::new("A").unwrap()
        }));

        let one = pattern("{ event = 'behavior', robot = 'A', to = ['X', 'Y'] }").unwrap();
        assert!(one.matches(&enters("A", "Y")));
        assert!(!one.matches(&enters("B", "Y")));
        assert!(!one.matches(&enters("A", "Z")));
        assert_eq!(one.robots().collect::<Vec<_>>(), ["A"]);
        assert_eq!(one.to_string(), "behavior with robot A, to X or Y");

        let every = pattern("{ event = 'behavior', robot = '*', to = 'X' }").unwrap();
        assert!(every.matches(&enters("A", "X")) && every.matches(&enters("B", "X")));
        assert!(!every.matches(&enters("A", "Y")));
        assert_eq!(every.robots().count(), 0);
        assert!(any.leaves_open("robot") && !every.leaves_open("robot"));
        assert!(!any.leaves_open("to"));
        let written = Value::from(every.clone());
        assert_eq!(Pattern::try_from(written), Ok(every));
    }

    #[test]
    fn numbers_and_truths_match() {
        let cut = Event::LinkCut {
            from: RobotName::new("A").unwrap(),
            to: RobotName::new("B").unwrap(),
            commands: true,
            queries: false,
        };
        assert!(
            pattern("{ event = 'link_cut', commands = true }")
                .unwrap()
                .matches(&cut)
        );
        assert!(
            !pattern("{ event = 'link_cut', queries = true }")
                .unwrap()
                .matches(&cut)
        );

        let delivered = Event::CommandDelivered {
            from: RobotName::new("A").unwrap(),
            to: RobotName::new("B").unwrap(),
            seq: 3,
        };
        let third = "{ event = 'command_delivered', seq = 3 }";
        assert!(pattern(third).unwrap().matches(&delivered));
        assert_eq!(pattern(third).unwrap().robots().count(), 0);
    }

    #[test]
    fn what_no_event_can_match_is_refused() {
        for (text, reason) in [
            ("{ robot = 'A' }", "names a kind of event"),
            (
                "{ event = 'behaviour' }",
                "there is no event \"behaviour\"; there are behavior",
            ),
            (
                "{ event = 'behavior', who = 'A' }",
                "no field `who`; it has from, robot, to",
            ),
            (
                "{ event = 'behavior', robot = 'A/B' }",
                "never \"A/B\": it is the name",
            ),
            ("{ event = 'behavior', robot = 3 }", "never 3"),
            (
                "{ event = 'command_dropped', because = 'los' }",
                "it is one of loss, burst",
            ),
            ("{ event = 'fault', begins = 1 }", "it is true or false"),
        ] {
            let error = pattern(text).unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
    }
}
