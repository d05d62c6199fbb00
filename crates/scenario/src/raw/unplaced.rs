//! Values that come from no place in a file.

use toml::Spanned;

/// A value that has no place in a file, because the table is written from a scenario.
pub(super) fn unplaced<T>(value: T) -> Spanned<T> {
    Spanned::new(0..0, value)
}
