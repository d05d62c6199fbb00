//! Figures for papers: as SVG and PDF in the width of a column, in light colors, with their data as CSV and a Vega-Lite specification.

mod font;
mod pdf;
mod shapes;
mod sheet;
mod size;
mod svg;

use crate::data::DataTable;
use crate::page::{ChartPanel, Figure, Page};
use crate::palette::NAMED;
use crate::print::pdf::{POINTS_PER_MM, pdf};
use crate::print::shapes::{PrintedShape, PrintedText, shapes};
use crate::print::sheet::{Paint, Sheet, color};
use crate::print::size::PrintSize;
use crate::print::svg::svg;
use crate::shapes::SMALL_PX;
use crate::style::printed_sheet;
use crate::vega::{self, PanelView};

use crate::chart::{PANEL_PX, WIDE_PX};

/// Width of one column of a journal, millimeters.
const SINGLE_MM: f64 = 88.0;
/// Width of two columns, millimeters.
const DOUBLE_MM: f64 = 180.0;
/// Most height of a printed figure: that of a page, millimeters. What is higher is several files.
const MAX_HEIGHT_MM: f64 = 235.0;
/// Least size of letters, points.
pub const MIN_LETTERS_PT: f64 = 7.0;
/// Widths that a figure can be given, millimeters.
pub const WIDTHS_MM: std::ops::RangeInclusive<f64> = 86.0..=400.0;
/// Space between panels, pixels.
const GAP_PX: f64 = 24.0;
/// Height of the name of a panel, pixels.
const NAME_PX: f64 = 18.0;
/// Font of the name of a panel, pixels.
const NAME_FONT_PX: f64 = 12.0;

/// A file of a printed figure.
#[derive(Debug, Clone)]
pub struct PrintedPicture {
    /// As SVG.
    pub svg: String,
    /// The same as PDF.
    pub pdf: Vec<u8>,
}

/// A printed figure.
#[derive(Debug, Clone)]
pub struct PrintedFigure {
    /// Its pictures: one, or several if it is higher than a page.
    pub pictures: Vec<PrintedPicture>,
    /// Its width, millimeters.
    pub width_mm: f64,
    /// Its data, CSV.
    pub csv: String,
    /// A Vega-Lite specification over the data, JSON.
    pub spec: String,
}

impl Figure {
    /// Prints the figure; `None` if it has no panel. `name` is the name of its files without their ends. Without a width it has that of
    /// one column if it is one small panel, otherwise that of two. A figure whose letters would be too small in the given width has
    /// that of two columns.
    #[must_use]
    pub fn print(&self, name: &str, width_mm: Option<f64>) -> Option<PrintedFigure> {
        let is_wide = self.panels.iter().any(|panel| panel.is_wide);
        let fits =
            |width_px: f64, mm: f64| SMALL_PX / width_px * mm * POINTS_PER_MM >= MIN_LETTERS_PT;
        let (width_px, width_mm) = match width_mm {
            _ if self.panels.is_empty() => return None,
            Some(mm) if fits(WIDE_PX, mm) && (is_wide || self.panels.len() > 1) => (WIDE_PX, mm),
            Some(mm) if !is_wide => (PANEL_PX, mm),
            None if !is_wide && self.panels.len() == 1 => (PANEL_PX, SINGLE_MM),
            _ => (WIDE_PX, DOUBLE_MM),
        };

        let page_px = MAX_HEIGHT_MM / width_mm * width_px;
        let caption = self.caption.plain();
        let mut pictures = Vec::new();
        for panels in pages(&self.panels, width_px, page_px) {
            let (shapes, height_px) = compose(panels, width_px);
            let size = PrintSize {
                width_px,
                height_px,
                width_mm,
            };
            pictures.push(PrintedPicture {
                svg: svg(&shapes, &size, name, &caption),
                pdf: pdf(&shapes, &size, name),
            });
        }

        let mut table = DataTable::default();
        for (index, panel) in self.panels.iter().enumerate() {
            table.add(index + 1, &panel.heading, panel.chart.data());
        }
        let views = self.panels.iter().map(|panel| PanelView {
            heading: &panel.heading,
            chart: &panel.chart,
            is_wide: panel.is_wide,
        });
        let views: Vec<PanelView<'_>> = views.collect();
        Some(PrintedFigure {
            pictures,
            width_mm,
            csv: table.to_csv(),
            spec: vega::spec(&views, &format!("{name}.csv"), &caption),
        })
    }
}

impl Page {
    /// The figures of the page, printed, each with the name of its files. [`Figure::print`] explains the width.
    #[must_use]
    pub fn print_figures(&self, width_mm: Option<f64>) -> Vec<(String, PrintedFigure)> {
        let mut printed = Vec::new();
        for (index, (figure, _)) in self.figures.iter().enumerate() {
            let name = format!("figure-{}", index + 1);
            let figure = figure.print(&name, width_mm);
            printed.extend(figure.map(|figure| (name, figure)));
        }
        printed
    }
}

/// The panels of each page: as many as fit, in rows.
fn pages(panels: &[ChartPanel], width_px: f64, page_px: f64) -> Vec<&[ChartPanel]> {
    let mut pages = Vec::new();
    let mut first = 0;
    for next in 1..panels.len() {
        let (_, height_px) = layout(&panels[first..=next], width_px);
        if height_px > page_px {
            pages.push(&panels[first..next]);
            first = next;
        }
    }
    pages.push(&panels[first..]);
    pages
}

/// Where panels are put: beside each other if they are small, otherwise below each other; and the height of all.
fn layout(panels: &[ChartPanel], width_px: f64) -> (Vec<(f64, f64)>, f64) {
    let mut places = Vec::new();
    let mut x = 0.0;
    let mut top = 0.0;
    let mut row_px: f64 = 0.0;
    for panel in panels {
        let panel_px = if panel.is_wide { WIDE_PX } else { PANEL_PX };
        if x > 0.0 && x + panel_px > width_px + 0.1 {
            x = 0.0;
            top += row_px + GAP_PX;
            row_px = 0.0;
        }
        places.push((x, top));
        let name_px = if panel.heading.is_empty() {
            0.0
        } else {
            NAME_PX
        };
        row_px = row_px.max(name_px + panel.height_px());
        x += panel_px + GAP_PX;
    }
    (places, top + row_px)
}

/// All shapes of panels on white paper, and the height of them together.
fn compose(panels: &[ChartPanel], width_px: f64) -> (Vec<PrintedShape>, f64) {
    let style = printed_sheet();
    let sheet = Sheet::new(&style);
    let named = |wanted: &str| {
        let found = NAMED.iter().find(|(name, _)| *name == wanted);
        found
            .and_then(|(_, shade)| color(shade.light))
            .unwrap_or_default()
    };
    let (places, height_px) = layout(panels, width_px);
    let paper = Paint::filled(named("paper"));
    let mut all = vec![PrintedShape::rect(0.0, 0.0, width_px, height_px, paper)];

    for (panel, (x, mut y)) in panels.iter().zip(places) {
        if !panel.heading.is_empty() {
            let paint = Paint {
                font_px: NAME_FONT_PX,
                is_bold: true,
                ..Paint::filled(named("ink"))
            };
            all.push(PrintedShape::Text(PrintedText {
                x,
                y: y + NAME_FONT_PX,
                before: 0.0,
                is_upward: false,
                runs: vec![(paint, panel.heading.clone())],
            }));
            y += NAME_PX;
        }
        all.extend(shapes(panel.printed(), &sheet, (x, y)));
    }
    (all, height_px)
}
