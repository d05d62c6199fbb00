//! States over time: a row of bands for each robot or run.

use std::collections::BTreeMap;

use timeline::{StateKind, StateOrder};

use crate::axis::draw_below;
use crate::chart::{WIDE_PX, begin, end};
use crate::labels::{in_rows, shortened, widest_px, width_px};
use crate::markup::{Markup, number};
use crate::number::fixed;
use crate::palette::{StateLook, state_look};
use crate::scale::Scale;
use crate::shapes::{LABEL_PX, hatching};

/// Height of a row of a few, pixels.
const ROW_PX: f64 = 20.0;
/// Height of a row of many, pixels.
const MIN_ROW_PX: f64 = 8.0;
/// Rows that are higher than this have names in their bands.
const NAMED_PX: f64 = 14.0;
/// Height of all rows together above which rows are lower, pixels.
const ROWS_PX: f64 = 560.0;
/// Bands that are not at least this wide are drawn as the state that lasted longest in a column of this width, pixels.
const COLUMN_PX: f64 = 1.0;
/// Most bands of a row that are drawn one by one.
const MAX_BANDS: usize = 600;
/// Most letters of a name.
const NAME_LETTERS: usize = 24;
/// Height of a row of the key, pixels.
const KEY_ROW_PX: f64 = 18.0;

/// A state and when it lasted.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// Name of the state.
    pub name: String,
    /// Beginning, simulated seconds.
    pub begin_s: f64,
    /// End, simulated seconds.
    pub end_s: f64,
}

/// The states of one robot in one run.
#[derive(Debug, Clone)]
pub struct BandRow {
    /// Name at the left.
    pub label: String,
    /// The bands, in their order.
    pub bands: Vec<Band>,
}

/// A chart of states over time.
#[derive(Debug, Clone)]
pub struct Bands {
    /// Name of the chart.
    pub title: String,
    /// Which states they are.
    pub kind: StateKind,
    /// End of the axis of time, simulated seconds.
    pub end_s: f64,
    /// The rows, from top to bottom.
    pub rows: Vec<BandRow>,
    /// The emotions and behaviors of all that is shown together, which have their colors by it.
    pub names: StateOrder,
}

impl Bands {
    /// The chart as SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let count = self.rows.len().max(1) as f64;
        let row_px = (ROWS_PX / count).clamp(MIN_ROW_PX, ROW_PX);
        let left = labels_px(self.rows.iter().map(|row| &row.label));
        let top = 4.0;
        let bottom = top + row_px * count;

        let names = self.names();
        let total_s: f64 = names.iter().map(|(_, time_s)| time_s).sum();
        let mut keys = Vec::new();
        for (name, time_s) in &names {
            keys.push(key_text(name, time_s / total_s.max(f64::MIN_POSITIVE)));
        }
        let widths = keys.iter().map(|key| width_px(key, LABEL_PX) + 28.0);
        let places = in_rows(widths, left, WIDE_PX);
        let key_top = bottom + 44.0;
        let rows = places.last().map_or(1, |(_, row)| row + 1);
        let height = key_top + rows as f64 * KEY_ROW_PX;

        let description = self.description(&names);
        let mut svg = begin("bands", WIDE_PX, height, &self.title, &description);
        let scale = Scale::new(0.0, self.end_s, left, WIDE_PX - 12.0);
        draw_below(&mut svg, &scale, top, bottom, "simulated time, s");
        for (index, row) in self.rows.iter().enumerate() {
            let y = top + index as f64 * row_px;
            self.draw_row(&mut svg, &scale, row, y, row_px);
        }
        for (((name, _), key), (x, row)) in names.iter().zip(keys).zip(places) {
            let y = key_top + 10.0 + row as f64 * KEY_ROW_PX;
            svg.state(&self.look(name), "", (x, y - 9.0), (11.0, 11.0));
            svg.text("", x + 16.0, y, "start", &key);
        }
        end(svg)
    }

    fn look(&self, name: &str) -> StateLook {
        state_look(self.kind, name, &self.names)
    }

    /// Time in each state over all rows, seconds, the longest first.
    fn names(&self) -> Vec<(&str, f64)> {
        let mut times: BTreeMap<&str, f64> = BTreeMap::new();
        for band in self.rows.iter().flat_map(|row| &row.bands) {
            *times.entry(&band.name).or_default() += band.end_s - band.begin_s;
        }
        let mut names: Vec<(&str, f64)> = times.into_iter().collect();
        // A stable sort: equal times are in the order of names.
        names.sort_by(|a, b| b.1.total_cmp(&a.1));
        names
    }

    fn description(&self, names: &[(&str, f64)]) -> String {
        let mut parts = Vec::new();
        for (name, time_s) in names.iter().take(12) {
            parts.push(format!("{name} {} s", fixed(*time_s, 1)));
        }
        format!("{} rows; in total {}", self.rows.len(), parts.join(", "))
    }

    fn draw_row(&self, svg: &mut Markup, scale: &Scale, row: &BandRow, y: f64, height: f64) {
        let label = shortened(&row.label, NAME_LETTERS);
        let baseline = y + height / 2.0 + 4.0;
        let class = if height < LABEL_PX { "small" } else { "" };
        svg.text(class, scale.begin_px() - 8.0, baseline, "end", &label);

        let columns = (row.bands.len() > MAX_BANDS).then(|| columns(&row.bands, scale));
        let bands = columns.as_ref().unwrap_or(&row.bands);
        let mut names = Markup::default();
        let mut over = String::new();
        let mut paths: BTreeMap<&str, (String, f64)> = BTreeMap::new();
        for band in bands {
            let (path, time_s) = paths.entry(&band.name).or_default();
            let x = scale.at(band.begin_s);
            let width = (scale.at(band.end_s) - x).max(0.1);
            let (top, inner) = (number(y + 1.0), number(height - 2.0));
            let across = number(width);
            *path += &format!("M{} {top}h{across}v{inner}h-{across}z", number(x));
            *time_s += band.end_s - band.begin_s;
            let kind = self.look(&band.name).hatching;
            if kind > 0 {
                over += &hatching(kind, (x, y + 1.0), (width, height - 2.0));
            }
            if height >= NAMED_PX && width_px(&band.name, LABEL_PX) + 8.0 <= width {
                let class = format!("on-{}", self.look(&band.name).class());
                names.text(&class, x + 4.0, baseline, "start", &band.name);
            }
        }
        for (name, (path, time_s)) in paths {
            let share = 100.0 * time_s / self.end_s.max(f64::MIN_POSITIVE);
            let title = format!("{}: {name}, {time_s:.1} s ({share:.0} %)", row.label);
            svg.group("state", &title);
            svg.path(&self.look(name).class(), &path);
            svg.close("g");
        }
        if !over.is_empty() {
            svg.path("over", &over);
        }
        svg.add(&names.finish());
    }
}

/// Where rows with these names begin, pixels.
pub(crate) fn labels_px<'a>(labels: impl IntoIterator<Item = &'a String>) -> f64 {
    widest_px(labels, NAME_LETTERS).clamp(40.0, 150.0) + 10.0
}

/// The name of a color with the share of the time.
fn key_text(name: &str, share: f64) -> String {
    let name = shortened(name, NAME_LETTERS);
    if share < 0.01 {
        return format!("{name} < 1 %");
    }
    format!("{name} {:.0} %", share * 100.0)
}

/// Bands of whole columns: each column has the state that lasted longest in it.
fn columns(bands: &[Band], scale: &Scale) -> Vec<Band> {
    let (from_s, to_s) = scale.range();
    let column_s = (to_s - from_s) / (scale.end_px() - scale.begin_px()) * COLUMN_PX;
    let mut columns: Vec<Band> = Vec::new();
    let mut next = 0;
    let mut begin_s = from_s;
    while begin_s < to_s {
        let end_s = begin_s + column_s;
        let mut times: BTreeMap<&str, f64> = BTreeMap::new();
        while let Some(band) = bands.get(next).filter(|band| band.begin_s < end_s) {
            let time_s = band.end_s.min(end_s) - band.begin_s.max(begin_s);
            *times.entry(&band.name).or_default() += time_s;
            if band.end_s > end_s {
                break;
            }
            next += 1;
        }

        let longest = times.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((name, _)) = longest {
            match columns.last_mut() {
                Some(last) if last.name == name && last.end_s >= begin_s => last.end_s = end_s,
                _ => columns.push(Band {
                    name: name.to_owned(),
                    begin_s,
                    end_s,
                }),
            }
        }
        begin_s = end_s;
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_have_the_state_that_lasts_longest() {
        let mut bands = Vec::new();
        for index in 0..6000_u32 {
            let name = if index % 3 == 0 { "B" } else { "A" };
            let begin_s = f64::from(index) * 0.1;
            bands.push(Band {
                name: name.to_owned(),
                begin_s,
                end_s: begin_s + 0.1,
            });
        }
        let scale = Scale::new(0.0, 600.0, 0.0, 300.0);
        let columns = columns(&bands, &scale);
        assert!(columns.len() <= 600);
        assert!(columns.iter().all(|band| band.name == "A"), "{columns:?}");
    }
}
