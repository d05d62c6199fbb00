//! A triangular distribution as written in the file.

use serde::{Deserialize, Serialize};

/// Smallest, most likely and largest value.
#[derive(Debug, Clone, Copy, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Range<Q> {
    pub(super) min: Q,
    pub(super) mode: Q,
    pub(super) max: Q,
}
