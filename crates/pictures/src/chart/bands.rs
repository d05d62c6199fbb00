//! States over time: a row of bands for each robot or run.

use std::collections::BTreeMap;

use crate::markup::number;
use crate::diagram::{palette, shortened, width_px};

use crate::axis::draw_below;
use crate::canvas::{Chart, LABEL_PX, WIDE_PX};
use crate::number::fixed;
use crate::scale::Scale;

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

/// What the bands are about; each has its colors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Emotions.
    Emotion,
    /// Behaviors.
    Behavior,
}

impl State {
    /// The class of the color of a state of this name.
    #[must_use]
    pub fn class(self, name: &str) -> String {
        match self {
            Self::Emotion => format!("e{}", palette::emotion(name)),
            Self::Behavior => format!("b{}", palette::behavior(name)),
        }
    }
}

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
    pub state: State,
    /// End of the axis of time, simulated seconds.
    pub end_s: f64,
    /// The rows, from top to bottom.
    pub rows: Vec<BandRow>,
}

impl Bands {
    /// The chart as SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let count = self.rows.len().max(1) as f64;
        let row_px = (ROWS_PX / count).clamp(MIN_ROW_PX, ROW_PX);
        let left = self.labels_px();
        let top = 4.0;
        let bottom = top + row_px * count;
        let names = self.names();
        let key_top = bottom + 44.0;
        let height = key_top + key_rows(&names, left) as f64 * 18.0;

        let description = self.description();
        let mut chart = Chart::begin("bands", WIDE_PX, height, &self.title, &description);
        let scale = Scale::new(0.0, self.end_s, left, WIDE_PX - 12.0);
        draw_below(&mut chart, &scale, top, bottom, "simulated time, s");
        for (index, row) in self.rows.iter().enumerate() {
            let y = top + index as f64 * row_px;
            self.draw_row(&mut chart, &scale, row, (y, row_px));
        }
        self.draw_key(&mut chart, &names, left, key_top);
        chart.finish()
    }

    fn labels_px(&self) -> f64 {
        let mut widest: f64 = 40.0;
        for row in &self.rows {
            widest = widest.max(width_px(&shortened(&row.label, NAME_LETTERS), LABEL_PX));
        }
        widest.min(150.0) + 10.0
    }

    /// Time in each state over all rows, seconds.
    fn names(&self) -> Vec<(String, f64)> {
        let mut times = BTreeMap::new();
        for band in self.rows.iter().flat_map(|row| &row.bands) {
            *times.entry(band.name.clone()).or_insert(0.0) += band.end_s - band.begin_s;
        }
        let mut names: Vec<(String, f64)> = times.into_iter().collect();
        // A stable sort: equal times are in the order of names.
        names.sort_by(|a, b| b.1.total_cmp(&a.1));
        names
    }

    fn description(&self) -> String {
        let mut parts = Vec::new();
        for (name, time_s) in self.names().iter().take(12) {
            parts.push(format!("{name} {} s", fixed(*time_s, 1)));
        }
        format!("{} rows; in total {}", self.rows.len(), parts.join(", "))
    }

    fn draw_row(&self, chart: &mut Chart, scale: &Scale, row: &BandRow, (y, height): (f64, f64)) {
        let label = shortened(&row.label, NAME_LETTERS);
        let baseline = y + height / 2.0 + 4.0;
        let class = if height < LABEL_PX { "small" } else { "" };
        chart.text(class, scale.from_px - 8.0, baseline, "end", &label);

        let is_drawn_one_by_one = row.bands.len() <= MAX_BANDS;
        let bands = if is_drawn_one_by_one {
            row.bands.clone()
        } else {
            columns(&row.bands, scale)
        };
        let mut paths: BTreeMap<&str, (String, f64)> = BTreeMap::new();
        for band in &bands {
            let (path, time_s) = paths.entry(&band.name).or_default();
            let x = scale.at(band.begin_s);
            let width = number((scale.at(band.end_s) - x).max(0.1));
            let inner = number(height - 2.0);
            *path += &format!(
                "M{} {}h{width}v{inner}h-{width}z",
                number(x),
                number(y + 1.0)
            );
            *time_s += band.end_s - band.begin_s;
        }
        for (name, (path, time_s)) in paths {
            let share = 100.0 * time_s / self.end_s.max(f64::MIN_POSITIVE);
            let title = format!("{}: {name}, {time_s:.1} s ({share:.0} %)", row.label);
            chart.group("state", &title);
            chart.path(&self.state.class(name), &path);
            chart.close();
        }

        if height >= NAMED_PX {
            for band in &bands {
                let x = scale.at(band.begin_s);
                let width = scale.at(band.end_s) - x;
                if width_px(&band.name, LABEL_PX) + 8.0 <= width {
                    let class = format!("on-{}", self.state.class(&band.name));
                    chart.text(&class, x + 4.0, baseline, "start", &band.name);
                }
            }
        }
    }

    /// Names of the colors, with shares of the time.
    fn draw_key(&self, chart: &mut Chart, names: &[(String, f64)], left: f64, top: f64) {
        let total: f64 = names.iter().map(|(_, time_s)| time_s).sum();
        let mut x = left;
        let mut y = top + 10.0;

        for (name, time_s) in names {
            let text = key_text(name, time_s / total.max(f64::MIN_POSITIVE));
            let width = 16.0 + width_px(&text, LABEL_PX) + 12.0;
            if x + width > WIDE_PX && x > left {
                x = left;
                y += 18.0;
            }

            chart.rect(&self.state.class(name), x, y - 9.0, 11.0, 11.0);
            chart.text("", x + 16.0, y, "start", &text);
            x += width;
        }
    }
}

fn key_text(name: &str, share: f64) -> String {
    let name = shortened(name, NAME_LETTERS);
    if share < 0.01 {
        return format!("{name} < 1 %");
    }
    format!("{name} {:.0} %", share * 100.0)
}

/// Number of rows of the key.
fn key_rows(names: &[(String, f64)], left: f64) -> usize {
    let mut rows = 1;
    let mut x = left;
    for (name, _) in names {
        let width = 16.0 + width_px(&key_text(name, 1.0), LABEL_PX) + 12.0;
        if x + width > WIDE_PX && x > left {
            x = left;
            rows += 1;
        }
        x += width;
    }
    rows
}

/// Bands of whole columns: each column has the state that lasted longest in it.
fn columns(bands: &[Band], scale: &Scale) -> Vec<Band> {
    let column_s = (scale.to - scale.from) / (scale.to_px - scale.from_px) * COLUMN_PX;
    let mut columns: Vec<Band> = Vec::new();
    let mut next = 0;
    let mut begin_s = scale.from;
    while begin_s < scale.to {
        let end_s = begin_s + column_s;
        let mut times: BTreeMap<&str, f64> = BTreeMap::new();
        while let Some(band) = bands.get(next).filter(|band| band.begin_s < end_s) {
            let time_s = band.end_s.min(end_s) - band.begin_s.max(begin_s);
            *times.entry(&band.name).or_insert(0.0) += time_s;
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
