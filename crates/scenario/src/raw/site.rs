//! `[[site]]` as written in the file.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range as Span;

use config::bulk::member;
use config::units::Length;
use config::{FileError, Source};
use protocol::RobotName;
use protocol::messages::{
    MAX_KNOWN_SITES, MAX_SITE_TEXT_BYTES, MAX_SITE_VARIABLES, MAX_SITES, MAX_SITES_BYTES, Point,
    Variable, site_bytes,
};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::super::checked::{to_wire, to_world};
use super::super::sites::{OnConflict, SiteSpec, SiteVariable};
use super::bulk_name::BulkName;
use super::numbers::positive;
use super::place::StartPlace;
use super::unplaced::unplaced;

/// Kind of a site that names none.
const KIND: &str = "site";

#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SiteTable {
    name: BulkName,
    /// So many sites, whose names are this one and a number.
    count: Option<usize>,
    kind: Option<Spanned<String>>,
    at: Spanned<StartPlace>,
    range: Option<Spanned<Length>>,
    /// Whether every robot knows where it is.
    known: Option<Spanned<bool>>,
    on_conflict: Option<OnConflict>,
    solid: Option<Spanned<bool>>,
    #[serde(default)]
    state: BTreeMap<Spanned<String>, Spanned<toml::Value>>,
}

/// A number with bounds.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct BoundedNumber {
    start: f64,
    min: Option<f64>,
    max: Option<f64>,
}

/// Where the tables of the sites are in the file, by name.
pub(super) type SiteSpans = BTreeMap<String, Span<usize>>;

/// The sites of a scenario, and where they are in the file.
pub(super) fn check(
    raw: Vec<Spanned<SiteTable>>,
    field_m: [f64; 2],
    sensing_range: Length,
    robots: &BTreeSet<RobotName>,
    source: &Source,
) -> Result<(BTreeMap<String, SiteSpec>, SiteSpans), FileError> {
    let mut sites = BTreeMap::new();
    let mut known = 0;
    let mut bytes = 0;
    let mut spans = SiteSpans::new();

    for entry in raw {
        let span = entry.span();
        let refuse = |reason: &str| FileError::at(source, Some(span.clone()), reason);
        let table = entry.into_inner();
        let spec = table.check(sensing_range, source)?;
        let base = table.name.name.as_str();
        let numbers = table.name.numbers(table.count).map_err(refuse)?;
        let count = numbers.clone().map_or(1, Iterator::count);
        if count > MAX_SITES - sites.len() {
            return Err(refuse(&format!("more than {MAX_SITES} sites")));
        }
        known += if spec.is_known { count } else { 0 };
        if known > MAX_KNOWN_SITES {
            let reason = format!(
                "more than {MAX_KNOWN_SITES} sites with known = true: robots can only sense the others"
            );
            let span = table.known.as_ref().map(Spanned::span);
            return Err(FileError::at(source, span, &reason));
        }

        for number in 1..=count {
            let name = match &numbers {
                Some(numbers) => RobotName::new(&member(base, numbers.start() + number - 1)),
                None => RobotName::new(base),
            };
            let name = name.map_err(|error| refuse(&error.to_string()))?;
            if robots.contains(&name) {
                return Err(refuse(&format!("a robot is called {name} as well")));
            }
            let place = match numbers {
                Some(_) => table.at.get_ref().member(number, count),
                None => table.at.get_ref().clone(),
            };
            let spec = spec.clone().placed(&place, field_m);
            let spec =
                spec.map_err(|reason| FileError::at(source, Some(table.at.span()), &reason))?;
            bytes += site_bytes(name.as_str(), &spec.kind, &spec.start());
            if bytes > MAX_SITES_BYTES {
                let reason = format!(
                    "the sites up to {name} take {bytes} bytes of a frame, more than the {MAX_SITES_BYTES} of all: fewer sites, fewer variables or shorter texts"
                );
                return Err(refuse(&reason));
            }
            if sites.insert(name.to_string(), spec).is_some() {
                return Err(refuse(&format!("a second site called {name}")));
            }
            spans.insert(name.to_string(), span.clone());
        }
    }
    Ok((sites, spans))
}

impl SiteTable {
    fn check(&self, sensing_range: Length, source: &Source) -> Result<SiteSpec, FileError> {
        if let Some(solid) = self.solid.as_ref().filter(|solid| *solid.get_ref()) {
            let reason = "a site is never solid: write an [[obstacle]] at the same place";
            return Err(FileError::at(source, Some(solid.span()), reason));
        }
        if let Some(kind) = &self.kind {
            check_word(kind.get_ref(), "a kind")
                .map_err(|reason| FileError::at(source, Some(kind.span()), &reason))?;
        }

        let kind = self.kind.as_ref().map(Spanned::get_ref);
        let range = positive(source, self.range.as_ref(), sensing_range, "the range")?;
        Ok(SiteSpec {
            kind: kind.map_or_else(|| KIND.to_owned(), Clone::clone),
            at: Point::default(),
            drawn: None,
            range_m: range.0,
            is_known: self.known.as_ref().is_some_and(|known| *known.get_ref()),
            on_conflict: self.on_conflict.unwrap_or_default(),
            state: self.check_state(source)?,
        })
    }

    fn check_state(&self, source: &Source) -> Result<BTreeMap<String, SiteVariable>, FileError> {
        let mut state = BTreeMap::new();
        for (key, value) in &self.state {
            let refuse = |span, reason: &str| FileError::at(source, Some(span), reason);
            check_word(key.get_ref(), "a key of the state")
                .map_err(|reason| refuse(key.span(), &reason))?;
            if state.len() == MAX_SITE_VARIABLES {
                let reason = format!("more than {MAX_SITE_VARIABLES} variables of a site");
                return Err(refuse(key.span(), &reason));
            }
            let variable = variable(value.get_ref().clone())
                .map_err(|reason| refuse(value.span(), &reason))?;
            state.insert(key.get_ref().clone(), variable);
        }
        Ok(state)
    }

    /// A site, written out.
    pub(super) fn of(name: &str, spec: &SiteSpec) -> Option<Self> {
        let mut state = BTreeMap::new();
        for (key, variable) in &spec.state {
            state.insert(unplaced(key.clone()), unplaced(to_toml(variable)));
        }
        Some(Self {
            name: RobotName::new(name).ok()?.into(),
            count: None,
            kind: Some(unplaced(spec.kind.clone())),
            at: unplaced(StartPlace::of(to_world(spec.at), spec.drawn)),
            range: Some(unplaced(Length(spec.range_m))),
            known: spec.is_known.then_some(unplaced(true)),
            on_conflict: Some(spec.on_conflict),
            solid: None,
            state,
        })
    }

    /// Makes a place that follows from the seed any place again.
    pub(super) fn forget_place(&mut self) {
        self.at.as_mut().forget();
    }
}

impl SiteSpec {
    /// The site at a place, which is inside the field.
    fn placed(mut self, place: &StartPlace, field_m: [f64; 2]) -> Result<Self, String> {
        let [width_m, height_m] = field_m;
        let (at, drawn) = place.resolve();
        self.at = to_wire(at);
        self.drawn = drawn;
        let is_inside = (0.0..=width_m).contains(&at.x) && (0.0..=height_m).contains(&at.y);
        if is_inside || drawn.is_some() {
            return Ok(self);
        }
        Err(format!(
            "{} m, {} m is outside the field, which is {width_m} m by {height_m} m",
            at.x, at.y
        ))
    }
}

/// Checks a word that paths and conditions name.
pub(super) fn check_word(word: &str, what: &str) -> Result<(), String> {
    let is_plain = word
        .chars()
        .all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if is_plain && !word.is_empty() && word.len() <= protocol::MAX_NAME_LEN {
        return Ok(());
    }
    Err(format!(
        "{what} is a word of 1 to {} letters, digits, '_' and '-'",
        protocol::MAX_NAME_LEN
    ))
}

fn variable(value: toml::Value) -> Result<SiteVariable, String> {
    let start = match value {
        toml::Value::Boolean(flag) => Variable::Flag(flag),
        toml::Value::Integer(number) => Variable::Number(number as f64),
        toml::Value::Float(number) => Variable::Number(number),
        toml::Value::String(text) if text.len() > MAX_SITE_TEXT_BYTES => {
            return Err(format!(
                "{} bytes of text, more than the {MAX_SITE_TEXT_BYTES} of a site",
                text.len()
            ));
        }
        toml::Value::String(text) => Variable::from(text),
        toml::Value::Table(table) => return bounded(table),
        _ => return Err(EXPECTED.to_owned()),
    };
    if start.as_f64().is_some_and(|number| !number.is_finite()) {
        return Err("not a finite number".to_owned());
    }
    Ok(SiteVariable {
        start,
        min: None,
        max: None,
    })
}

const EXPECTED: &str = "a variable of a site is a number, a text, true, false, or a number with bounds such as \
                        { start = 30, min = 0, max = 30 }";

fn bounded(table: toml::Table) -> Result<SiteVariable, String> {
    let number: BoundedNumber = table
        .try_into()
        .map_err(|error: toml::de::Error| format!("{EXPECTED}: {}", error.message()))?;
    let BoundedNumber { start, min, max } = number;

    let bounds = [Some(start), min, max];
    if !bounds.iter().flatten().all(|number| number.is_finite()) {
        return Err("not a finite number".to_owned());
    }
    if min.is_some_and(|min| start < min) || max.is_some_and(|max| start > max) {
        return Err(format!("the start, {start}, is outside the bounds"));
    }
    Ok(SiteVariable {
        start: Variable::Number(start),
        min,
        max,
    })
}

fn to_toml(variable: &SiteVariable) -> toml::Value {
    let start = match &variable.start {
        Variable::Flag(flag) => toml::Value::Boolean(*flag),
        Variable::Number(number) => toml::Value::Float(*number),
        Variable::Text(text) => toml::Value::String(text.to_string()),
    };
    if variable.min.is_none() && variable.max.is_none() {
        return start;
    }

    let mut table = toml::Table::new();
    table.insert("start".to_owned(), start);
    for (key, bound) in [("min", variable.min), ("max", variable.max)] {
        if let Some(bound) = bound {
            table.insert(key.to_owned(), toml::Value::Float(bound));
        }
    }
    toml::Value::Table(table)
}
