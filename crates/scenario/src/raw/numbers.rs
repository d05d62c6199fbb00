//! Numbers as written in the file: triangular distributions, and what must be positive.

use config::{FileError, Source};
use serde::{Deserialize, Serialize};
use toml::Spanned;
use world::Triangular;

/// Smallest, most likely and largest value.
#[derive(Debug, Clone, Copy, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table with `min`, `mode` and `max`"
)]
pub(super) struct Range<Q> {
    pub(super) min: Q,
    pub(super) mode: Q,
    pub(super) max: Q,
}

/// A distribution in SI units, or its default.
pub(super) fn triangular<Q: Copy + Into<f64>>(
    source: &Source,
    raw: Option<&Spanned<Range<Q>>>,
    default: Range<Q>,
) -> Result<Triangular, FileError> {
    let span = raw.map(Spanned::span);
    let Range { min, mode, max } = raw.map_or(default, |range| *range.get_ref());
    Triangular::new(min.into(), mode.into(), max.into())
        .map_err(|error| FileError::at(source, span, &error.to_string()))
}

/// A value that must be positive and finite, or its default.
pub(super) fn positive<T: Copy + Into<f64>>(
    source: &Source,
    value: Option<&Spanned<T>>,
    default: T,
    what: &str,
) -> Result<T, FileError> {
    let Some(spanned) = value else {
        return Ok(default);
    };

    let value = *spanned.get_ref();
    let number: f64 = value.into();
    if number > 0.0 && number.is_finite() {
        return Ok(value);
    }
    let text = format!("{what} must be more than zero");
    Err(FileError::at(source, Some(spanned.span()), &text))
}
