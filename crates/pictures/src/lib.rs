//! Pictures of runs and experiments as text: the space-time diagram ([`diagram`]), charts ([`Bands`], [`Matrix`], [`Floor`],
//! [`Intervals`], [`Trend`], [`Steps`], [`OutcomeCurve`]), and the page around them with its figures and tables ([`Page`]).
//!
//! Pure: plain data in, SVG or HTML out. The same data give the same bytes. Every text is escaped.

mod axis;
mod chart;
mod data;
pub mod diagram;
mod labels;
mod markup;
mod number;
mod page;
mod palette;
mod print;
mod scale;
mod shapes;
mod style;
mod table;
mod vega;

pub use chart::PlottedEstimate;
pub use chart::bands::{Band, BandRow, Bands};
pub use chart::course::{CourseLine, TimeCourse};
pub use chart::floor::Floor;
pub use chart::intervals::{IntervalRow, Intervals};
pub use chart::matrix::{Matrix, MatrixCell, MatrixLabel};
pub use chart::outcome::OutcomeCurve;
pub use chart::steps::{Curve, CurveStep, Steps};
pub use chart::trend::{Trend, TrendLine, TrendPoint};
pub use labels::width_px;
pub use number::{decimals_for, fixed};
pub use page::{ChartPanel, Figure, Page, Text};
pub use palette::{StateLook, state_look};
pub use print::{MIN_LETTERS_PT, PrintedFigure, PrintedPicture, WIDTHS_MM};
pub use scale::round_range;
pub use style::style;
pub use table::{Cell, Table};
pub use vega::Chart;
