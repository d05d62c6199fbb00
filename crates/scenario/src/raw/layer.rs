//! `[[layer]]` as written in the file.

use std::collections::BTreeMap;
use std::ops::Range as Span;

use config::units::Length;
use config::{FileError, Source};
use protocol::messages::{
    MAX_LAYER_CELLS, MAX_LAYER_VALUE, MAX_LAYERS, MAX_SENSED_CELLS, Point, cell_center,
};
use serde::{Deserialize, Serialize};
use toml::Spanned;

use super::super::checked::{to_wire, to_world};
use super::super::layers::{LayerSpec, Peak};
use super::numbers::positive;
use super::place::StartPlace;
use super::site::check_word;
use super::unplaced::unplaced;

/// Most peaks of a layer.
const MAX_PEAKS: usize = 256;
/// A disc of so many cells has more cells than a robot may sense.
const FAR: f64 = 64.0;
/// A column that would be less wide than this share of a cell comes from rounding: 15.24 m are 50 cells of 0.3048 m.
const ROUNDING: f64 = 1e-9;

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LayerTable {
    name: Spanned<String>,
    cell: Spanned<Length>,
    value: Option<Spanned<f64>>,
    min: Option<Spanned<f64>>,
    max: Option<Spanned<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    range: Option<Spanned<Length>>,
    decay: Option<Spanned<f64>>,
    diffuse: Option<Spanned<f64>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    peaks: Vec<Spanned<PeakTable>>,
}

#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct PeakTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    count: Option<usize>,
    at: StartPlace,
    radius: Spanned<Length>,
    height: Spanned<f64>,
}

/// What the checks of layers depend on.
#[derive(Clone, Copy)]
pub(super) struct LayerSetting<'a> {
    pub(super) field_m: [f64; 2],
    pub(super) tick_s: f64,
    pub(super) source: &'a Source,
}

/// Where the tables of the layers are in the file, by name.
pub(super) type LayerSpans = BTreeMap<String, Span<usize>>;

/// The layers of a scenario, and where they are in the file.
pub(super) fn check(
    raw: &[Spanned<LayerTable>],
    setting: LayerSetting<'_>,
) -> Result<(BTreeMap<String, LayerSpec>, LayerSpans), FileError> {
    let mut layers: BTreeMap<String, LayerSpec> = BTreeMap::new();
    let mut spans = LayerSpans::new();

    for entry in raw {
        let table = entry.get_ref();
        let name = table.name.get_ref();
        check_word(name, "the name of a layer")
            .map_err(|reason| setting.refuse(table.name.span(), &reason))?;
        if layers.len() == MAX_LAYERS {
            let reason = format!("more than {MAX_LAYERS} layers");
            return Err(setting.refuse(entry.span(), &reason));
        }
        if layers.contains_key(name) {
            let reason = format!("a second layer called {name}");
            return Err(setting.refuse(table.name.span(), &reason));
        }

        let spec = table.check(setting)?;
        let cells = spec.len() + layers.values().map(LayerSpec::len).sum::<usize>();
        if cells > MAX_LAYER_CELLS {
            let reason = format!(
                "{} columns and {} rows: with the other layers {cells} cells, more than the {MAX_LAYER_CELLS} allowed",
                spec.columns, spec.rows
            );
            return Err(setting.refuse(table.cell.span(), &reason));
        }
        let sensed = most_sensed(&spec) + layers.values().map(most_sensed).sum::<usize>();
        if sensed > MAX_SENSED_CELLS {
            let span = table.range.as_ref().map_or(entry.span(), Spanned::span);
            let reason = format!(
                "with the other layers a robot would sense {sensed} cells, more than the {MAX_SENSED_CELLS} allowed: make the \
                 range shorter or the cells larger"
            );
            return Err(setting.refuse(span, &reason));
        }
        layers.insert(name.clone(), spec);
        spans.insert(name.clone(), entry.span());
    }
    Ok((layers, spans))
}

impl LayerTable {
    fn check(&self, setting: LayerSetting<'_>) -> Result<LayerSpec, FileError> {
        let LayerSetting {
            field_m,
            tick_s,
            source,
        } = setting;
        let cell_m = positive(source, Some(&self.cell), *self.cell.get_ref(), "a cell")?.0;
        let [columns, rows] = field_m.map(|side_m| cells_along(side_m, cell_m));
        let (Some(columns), Some(rows)) = (columns, rows) else {
            let reason = format!("more than the {MAX_LAYER_CELLS} cells allowed");
            return Err(setting.refuse(self.cell.span(), &reason));
        };

        let min = setting.number(self.min.as_ref(), -MAX_LAYER_VALUE)?;
        let max = setting.number(self.max.as_ref(), MAX_LAYER_VALUE)?;
        if min > max {
            let span = self.min.as_ref().or(self.max.as_ref()).map(Spanned::span);
            let reason = format!("min, {min}, is more than max, {max}");
            return Err(FileError::at(source, span, &reason));
        }
        let value = setting.number(self.value.as_ref(), 0.0_f64.clamp(min, max))?;
        if !(min..=max).contains(&value) {
            let span = self.value.as_ref().map(Spanned::span);
            let reason = format!("the value, {value}, is outside the bounds");
            return Err(FileError::at(source, span, &reason));
        }

        let decay_per_s = setting.rate(self.decay.as_ref(), 1.0 / tick_s, "decay", "1/s")?;
        let fastest = cell_m * cell_m / (4.0 * tick_s);
        let diffuse_m2ps = setting.rate(self.diffuse.as_ref(), fastest, "diffuse", "m²/s")?;
        let range_m = match &self.range {
            Some(range) => Some(positive(source, Some(range), *range.get_ref(), "the range")?.0),
            None => None,
        };
        Ok(LayerSpec {
            cell_m,
            columns,
            rows,
            value,
            peaks: self.check_peaks(setting)?,
            min,
            max,
            range_m,
            decay_per_s,
            diffuse_m2ps,
        })
    }

    fn check_peaks(&self, setting: LayerSetting<'_>) -> Result<Vec<Peak>, FileError> {
        let mut peaks = Vec::new();
        for entry in &self.peaks {
            let table = entry.get_ref();
            let count = table.count.unwrap_or(1);
            if count > MAX_PEAKS - peaks.len() {
                let reason = format!("more than {MAX_PEAKS} peaks");
                return Err(setting.refuse(entry.span(), &reason));
            }

            let radius = &table.radius;
            let radius_m = positive(setting.source, Some(radius), *radius.get_ref(), "a radius")?.0;
            let height = setting.number(Some(&table.height), 0.0)?;
            for number in 1..=count {
                let place = match table.count {
                    Some(_) => table.at.member(number, count),
                    None => table.at.clone(),
                };
                let (at, drawn) = place.resolve();
                peaks.push(Peak {
                    at: to_wire(at),
                    drawn,
                    radius_m,
                    height,
                });
            }
        }
        Ok(peaks)
    }

    /// A layer, written out.
    pub(super) fn of(name: &str, spec: &LayerSpec) -> Self {
        let peaks = spec.peaks.iter().map(|peak| {
            unplaced(PeakTable {
                count: None,
                at: StartPlace::of(to_world(peak.at), peak.drawn),
                radius: unplaced(Length(peak.radius_m)),
                height: unplaced(peak.height),
            })
        });
        Self {
            name: unplaced(name.to_owned()),
            cell: unplaced(Length(spec.cell_m)),
            value: Some(unplaced(spec.value)),
            min: Some(unplaced(spec.min)),
            max: Some(unplaced(spec.max)),
            range: spec.range_m.map(Length).map(unplaced),
            decay: Some(unplaced(spec.decay_per_s)),
            diffuse: Some(unplaced(spec.diffuse_m2ps)),
            peaks: peaks.collect(),
        }
    }

    /// Makes places that follow from the seed any of their regions again.
    pub(super) fn forget_places(&mut self) {
        for peak in &mut self.peaks {
            peak.as_mut().at.forget();
        }
    }
}

impl LayerSetting<'_> {
    fn refuse(&self, span: Span<usize>, reason: &str) -> FileError {
        FileError::at(self.source, Some(span), reason)
    }

    /// A number that a cell can hold, or its default.
    fn number(&self, given: Option<&Spanned<f64>>, default: f64) -> Result<f64, FileError> {
        let Some(given) = given else {
            return Ok(default);
        };
        let number = *given.get_ref();
        if number.abs() <= MAX_LAYER_VALUE {
            return Ok(number);
        }
        let reason = format!("a number of a layer is at most {MAX_LAYER_VALUE:e} from zero");
        Err(self.refuse(given.span(), &reason))
    }

    /// A rate that is not negative, and not so high that a tick would overshoot.
    fn rate(
        &self,
        given: Option<&Spanned<f64>>,
        highest: f64,
        key: &str,
        unit: &str,
    ) -> Result<f64, FileError> {
        let Some(given) = given else {
            return Ok(0.0);
        };
        let rate = *given.get_ref();
        if (0.0..=highest).contains(&rate) {
            return Ok(rate);
        }
        let reason = format!(
            "{key} is from 0 to {highest:.4} {unit} with this tick: a higher rate would overshoot"
        );
        Err(self.refuse(given.span(), &reason))
    }
}

/// How many cells are side by side over a length; `None` if a layer cannot have as many.
fn cells_along(side_m: f64, cell_m: f64) -> Option<u32> {
    let cells = (side_m / cell_m - ROUNDING).ceil().max(1.0);
    (cells <= MAX_LAYER_CELLS as f64).then_some(cells as u32)
}

/// An upper bound of the cells that a robot senses of a layer: all whose centers are within range of a place, wherever that is in a cell.
fn most_sensed(spec: &LayerSpec) -> usize {
    let Some(range_m) = spec.range_m else {
        return 0;
    };

    // Half a diagonal more, because the place is within half a diagonal of the center of a cell.
    let reach_m = range_m + spec.cell_m * std::f64::consts::FRAC_1_SQRT_2;
    let cells = (reach_m / spec.cell_m).ceil();
    if cells > FAR {
        return spec.len();
    }
    let middle = cells as u32;
    let center = cell_center(middle, middle, spec.cell_m);
    let mut count = 0;
    for row in 0..=2 * middle {
        for column in 0..=2 * middle {
            let other: Point = cell_center(column, row, spec.cell_m);
            count += usize::from(center.distance_m(other) <= reach_m);
        }
    }
    count.min(spec.len())
}
