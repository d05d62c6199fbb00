//! The parts of a report as text: charts as SVG ([`Bands`], [`Matrix`], [`Floor`], [`Intervals`], [`Trend`], [`Steps`]), and
//! figures, tables and the page around them ([`Page`]).
//!
//! Pure: plain data in, text out. The same data give the same bytes. Every text is escaped.

mod axis;
mod bands;
mod chart;
mod floor;
mod intervals;
mod labels;
mod matrix;
mod number;
mod page;
mod palette;
mod scale;
mod steps;
mod style;
mod table;
mod trend;

pub use bands::{Band, BandRow, Bands, State};
pub use floor::Floor;
pub use intervals::{Estimate, IntervalRow, Intervals};
pub use matrix::{Matrix, MatrixCell, MatrixLabel};
pub use number::{decimals_for, fixed};
pub use page::{Figure, Page, Panel, Part};
pub use palette::{ARM_SHADES, ARMS, HEAT_SHADES, LEVELS};
pub use scale::round_range;
pub use steps::{Curve, Step, Steps};
pub use table::{Cell, Column, Table};
pub use trend::{Trend, TrendLine, TrendPoint};
