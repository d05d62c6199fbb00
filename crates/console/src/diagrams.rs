//! Space-time diagrams of a recorded run.

use pictures::diagram::{Diagram, DiagramOptions, TooMuch};
use protocol::{Epoch, Tick};
use recording::{Header, Recording, RecordingError, Timelines};
use serde::Deserialize;

/// Most ticks in a diagram.
pub(crate) const MAX_WINDOW_TICKS: u64 = 4096;
/// Least and most width of a diagram, pixels.
const WIDTHS_PX: std::ops::RangeInclusive<f64> = 300.0..=4800.0;

/// A window, as the query string of a request states it.
#[derive(Debug, Clone, Copy, Deserialize)]
pub(crate) struct WindowQuery {
    /// The first tick.
    pub(crate) from: Tick,
    /// Number of ticks.
    pub(crate) count: u64,
    /// Most width, pixels.
    pub(crate) width: f64,
    /// Whether lost queries are drawn.
    #[serde(default)]
    pub(crate) queries: bool,
    /// The epoch; none for the last one.
    pub(crate) epoch: Option<Epoch>,
}

impl WindowQuery {
    /// Whether the request is within its limits.
    pub(crate) fn is_valid(&self) -> bool {
        (1..=MAX_WINDOW_TICKS).contains(&self.count) && WIDTHS_PX.contains(&self.width)
    }
}

/// Why there is no diagram.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DiagramError {
    /// The file is damaged.
    #[error(transparent)]
    Unreadable(#[from] RecordingError),
    /// The window has too much.
    #[error("{0}: show a shorter time")]
    TooMuch(#[from] TooMuch),
}

/// The diagram of a window, which ends with the last tick of the recording at the latest.
///
/// # Errors
/// [`DiagramError`] if the file is damaged or the window has too much.
pub(crate) fn draw(
    file: &Recording,
    timelines: &Timelines,
    window: WindowQuery,
) -> Result<String, DiagramError> {
    let from = window.from.min(file.len().saturating_sub(1));
    let to = from.saturating_add(window.count).min(file.len());
    let Header { run, seed, .. } = file.header();
    let options = DiagramOptions {
        title: format!("{run}, seed {seed}"),
        queries: window.queries,
        max_width_px: window.width,
        has_style: false,
        ..DiagramOptions::default()
    };

    let timeline = timelines.before(file, from)?;
    let mut diagram = Diagram::new(timeline, file.header().tick_s, from, options);
    file.for_events(from, to, |tick| {
        diagram.tick(tick.tick, &tick.events, &tick.awaited);
    })?;
    Ok(diagram.to_svg()?)
}
