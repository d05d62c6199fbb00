//! The layers of a run: a number for each cell of a grid over the floor, and what robots do to them.
//!
//! At the beginning of each tick after tick 0 they diffuse, then decay; robots sense what this leaves. All actions of a tick are carried
//! out when all of its reports are in: in the order of the robots' names, those of a robot in the order of its report. Each one sees
//! what the one before has left.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use protocol::messages::{
    LayerAction, LayerFrame, LayerRefusal, LayerResult, MAX_LAYER_VALUE, Point, SensedLayer,
    SensedRow, cell_center,
};
use protocol::{Event, RobotName};
use scenario::{LayerSpec, Scenario};
use xxhash_rust::xxh3::xxh3_128;

/// What decays to less than this is 0: it would never be otherwise, and such numbers are slow to compute with.
const LEAST: f64 = 1e-9;
/// The greatest level of a cell in a frame.
const MAX_LEVEL: f64 = 255.0;

/// The layers of an epoch.
#[derive(Debug, Clone, Default)]
pub struct Layers {
    layers: BTreeMap<String, Layer>,
    /// What became of the actions of the last tick, by robot.
    results: BTreeMap<RobotName, Vec<LayerResult>>,
}

#[derive(Debug, Clone)]
struct Layer {
    spec: LayerSpec,
    /// The numbers, row by row from below.
    cells: Vec<f64>,
    /// Whether a cell may have another number than at the start.
    has_changed: bool,
    /// The digest of the numbers, if they are the same as when it was computed.
    digest: Option<u128>,
    /// The least and the greatest number at the start.
    at_start: [f64; 2],
    /// The share of each difference between neighbors that evens out in a tick.
    diffused: f64,
    /// What is left of a number after a tick.
    kept: f64,
    /// The numbers before they diffuse. Its memory is used again.
    before: Vec<f64>,
}

/// What an action changes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct LayerEffect {
    cells: u32,
    sum: f64,
}

impl Layers {
    /// The layers of a scenario, as they are at the start.
    #[must_use]
    pub fn new(scenario: &Scenario) -> Self {
        let layers = scenario.layers.iter();
        let layers = layers.map(|(name, spec)| (name.clone(), Layer::new(spec, scenario.tick_s)));
        Self {
            layers: layers.collect(),
            results: BTreeMap::new(),
        }
    }

    /// Whether there is no layer.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }

    /// Lets the time of a tick pass: what diffuses and decays does so.
    pub fn pass_tick(&mut self) {
        for layer in self.layers.values_mut() {
            layer.diffuse();
            layer.decay();
        }
    }

    /// Begins the actions of a tick: those of the tick before have no results any more.
    pub fn begin_actions(&mut self) {
        self.results.clear();
    }

    /// Carries out the actions of a robot that stands at `at`. Robots come in the order of their names. Returns what happened.
    pub fn carry_out(
        &mut self,
        robot: &RobotName,
        at: Point,
        actions: &[LayerAction],
    ) -> Vec<Event> {
        let mut events = Vec::new();
        let mut results = Vec::with_capacity(actions.len());
        for action in actions {
            let done = self.act(at, action);
            match done {
                Ok(LayerEffect { cells: 0, .. }) => {}
                Ok(change) => events.push(Event::LayerChanged {
                    robot: robot.clone(),
                    layer: action.layer.clone(),
                    cells: change.cells,
                    change: change.sum,
                }),
                Err(because) => events.push(Event::LayerRefused {
                    robot: robot.clone(),
                    layer: action.layer.clone(),
                    because,
                }),
            }
            results.push(LayerResult {
                layer: action.layer.clone(),
                change: done.map_or(0.0, |change| change.sum),
                refused: done.err(),
            });
        }
        if !results.is_empty() {
            self.results.insert(robot.clone(), results);
        }
        events
    }

    fn act(&mut self, at: Point, action: &LayerAction) -> Result<LayerEffect, LayerRefusal> {
        let layer = self.layers.get_mut(&action.layer);
        let layer = layer.ok_or(LayerRefusal::UnknownLayer)?;
        let range_m = layer.spec.range_m.ok_or(LayerRefusal::OutOfRange)?;
        if action.radius_m > range_m || at.distance_m(action.at) > range_m {
            return Err(LayerRefusal::OutOfRange);
        }
        Ok(layer.change(action))
    }

    /// What a robot at a place senses of the layers, by name.
    #[must_use]
    pub fn near(&self, at: Point) -> Vec<SensedLayer> {
        let mut near = Vec::new();
        for (name, layer) in &self.layers {
            let Some(range_m) = layer.spec.range_m else {
                continue;
            };
            let rows = layer.rows_within(at, range_m);
            if !rows.is_empty() {
                near.push(SensedLayer {
                    name: name.clone(),
                    cell_m: layer.spec.cell_m,
                    rows,
                });
            }
        }
        near
    }

    /// What became of a robot's actions of the last tick, in their order.
    #[must_use]
    pub fn results(&self, robot: &RobotName) -> &[LayerResult] {
        self.results.get(robot).map_or(&[], Vec::as_slice)
    }

    /// The numbers of a layer, row by row from below.
    #[must_use]
    pub fn cells(&self, name: &str) -> Option<&[f64]> {
        Some(&self.layers.get(name)?.cells)
    }

    /// The digest of the numbers of each layer, by name.
    pub(crate) fn digests(&mut self) -> impl Iterator<Item = (&str, u128)> {
        let layers = self.layers.iter_mut();
        layers.map(|(name, layer)| (name.as_str(), layer.digest()))
    }

    /// The layers, for observers.
    #[must_use]
    pub fn frames(&self) -> Vec<LayerFrame> {
        let layers = self.layers.iter();
        layers.map(|(name, layer)| layer.frame(name)).collect()
    }

    /// The layers that may be others than at the start: what a recording has of a tick.
    #[must_use]
    pub fn changed(&self) -> Vec<LayerFrame> {
        let changed = self.layers.iter().filter(|(_, layer)| layer.has_changed);
        changed.map(|(name, layer)| layer.frame(name)).collect()
    }
}

impl Layer {
    fn new(spec: &LayerSpec, tick_s: f64) -> Self {
        let cells = spec.start();
        Self {
            at_start: ends(&cells),
            diffused: spec.diffuse_m2ps * tick_s / (spec.cell_m * spec.cell_m),
            kept: (1.0 - spec.decay_per_s * tick_s).max(0.0),
            spec: spec.clone(),
            cells,
            has_changed: false,
            digest: None,
            before: Vec::new(),
        }
    }

    /// Evens out differences between each cell and those to its left, right, below and above: nothing leaves over the edge.
    fn diffuse(&mut self) {
        if self.diffused == 0.0 {
            return;
        }
        self.touch();

        let columns = self.spec.columns as usize;
        self.before.clone_from(&self.cells);
        let before = &self.before;
        for (index, cell) in self.cells.iter_mut().enumerate() {
            let own = before[index];
            let column = index % columns;
            let mut difference = 0.0;
            if column > 0 {
                difference += before[index - 1] - own;
            }
            if column + 1 < columns {
                difference += before[index + 1] - own;
            }
            if index >= columns {
                difference += before[index - columns] - own;
            }
            if let Some(above) = before.get(index + columns) {
                difference += above - own;
            }
            *cell = self.spec.limit(own + self.diffused * difference);
        }
    }

    fn decay(&mut self) {
        if self.kept == 1.0 {
            return;
        }
        self.touch();

        for cell in &mut self.cells {
            let kept = *cell * self.kept;
            let kept = if kept.abs() < LEAST { 0.0 } else { kept };
            *cell = self.spec.limit(kept);
        }
    }

    /// Notes that numbers change.
    fn touch(&mut self) {
        self.has_changed = true;
        self.digest = None;
    }

    /// Carries out an action that is not refused.
    fn change(&mut self, action: &LayerAction) -> LayerEffect {
        let mut change = LayerEffect { cells: 0, sum: 0.0 };
        let own = self.cell_of(action.at);
        for row in self.rows_around(action.at.y, action.radius_m) {
            let own_column = own.and_then(|(column, own_row)| (own_row == row).then_some(column));
            for column in self.columns_around(action.at.x, action.radius_m) {
                let center = cell_center(column, row, self.spec.cell_m);
                let is_own = own_column == Some(column);
                if !is_own && action.at.distance_m(center) > action.radius_m {
                    continue;
                }

                let index = self.index(column, row);
                let before = self.cells[index];
                let number = action.set.unwrap_or(before) + action.add.unwrap_or(0.0);
                let after = self.spec.limit(number);
                if after != before {
                    self.cells[index] = after;
                    change.cells += 1;
                    change.sum += after - before;
                }
            }
        }
        if change.cells > 0 {
            self.touch();
        }
        change
    }

    /// The cells whose centers are within a distance of a place, row by row.
    fn rows_within(&self, at: Point, range_m: f64) -> Vec<SensedRow> {
        let mut rows = Vec::new();
        for row in self.rows_around(at.y, range_m) {
            let mut first = 0;
            let mut values = Vec::new();
            // A disc has no gaps: its cells of a row are side by side.
            for column in self.columns_around(at.x, range_m) {
                let center = cell_center(column, row, self.spec.cell_m);
                if at.distance_m(center) <= range_m {
                    if values.is_empty() {
                        first = column;
                    }
                    values.push(self.cells[self.index(column, row)]);
                }
            }
            if !values.is_empty() {
                rows.push(SensedRow {
                    row,
                    column: first,
                    values,
                });
            }
        }
        rows
    }

    /// The cell in which a place is; `None` outside the grid.
    fn cell_of(&self, place: Point) -> Option<(u32, u32)> {
        let column = along(place.x, self.spec.cell_m, self.spec.columns)?;
        let row = along(place.y, self.spec.cell_m, self.spec.rows)?;
        Some((column, row))
    }

    /// The rows that reach into a distance of a place.
    fn rows_around(&self, y_m: f64, reach_m: f64) -> RangeInclusive<u32> {
        around(y_m, reach_m, self.spec.cell_m, self.spec.rows)
    }

    fn columns_around(&self, x_m: f64, reach_m: f64) -> RangeInclusive<u32> {
        around(x_m, reach_m, self.spec.cell_m, self.spec.columns)
    }

    fn index(&self, column: u32, row: u32) -> usize {
        row as usize * self.spec.columns as usize + column as usize
    }

    fn digest(&mut self) -> u128 {
        let cells = &self.cells;
        *self.digest.get_or_insert_with(|| {
            let mut bytes = Vec::with_capacity(cells.len() * size_of::<f64>());
            for cell in cells {
                // Minus zero and zero are equal.
                let number = if *cell == 0.0 { 0.0 } else { *cell };
                bytes.extend_from_slice(&number.to_bits().to_le_bytes());
            }
            xxh3_128(&bytes)
        })
    }

    fn frame(&self, name: &str) -> LayerFrame {
        let [min, max] = ends(&self.cells);
        let step = if max > min {
            MAX_LEVEL / (max - min)
        } else {
            0.0
        };
        let mut levels = Vec::with_capacity(self.cells.len());
        for cell in &self.cells {
            // From 0 to 255, so nothing is lost.
            levels.push(((cell - min) * step + 0.5) as u8);
        }
        LayerFrame {
            name: name.to_owned(),
            cell_m: self.spec.cell_m,
            columns: self.spec.columns,
            rows: self.spec.rows,
            min,
            max,
            scale: self.scale([min, max]),
            levels: STANDARD.encode(levels),
        }
    }

    /// The ends of a color scale, with the least and the greatest number now.
    fn scale(&self, now: [f64; 2]) -> [f64; 2] {
        let bound = |bound: f64| (bound.abs() < MAX_LAYER_VALUE).then_some(bound);
        let low = bound(self.spec.min).unwrap_or(now[0].min(self.at_start[0]));
        let high = bound(self.spec.max).unwrap_or(now[1].max(self.at_start[1]));
        [low, high]
    }
}

/// The least and the greatest of some numbers.
fn ends(numbers: &[f64]) -> [f64; 2] {
    let first = numbers.first().copied().unwrap_or_default();
    let mut ends = [first, first];
    for number in numbers {
        ends = [ends[0].min(*number), ends[1].max(*number)];
    }
    ends
}

/// The cell along an axis in which a coordinate is.
fn along(coordinate_m: f64, cell_m: f64, count: u32) -> Option<u32> {
    let index = (coordinate_m / cell_m).floor();
    (index >= 0.0 && index < f64::from(count)).then_some(index as u32)
}

/// The cells along an axis that reach into a distance of a coordinate; an empty range if there are none.
fn around(coordinate_m: f64, reach_m: f64, cell_m: f64, count: u32) -> RangeInclusive<u32> {
    let first = ((coordinate_m - reach_m) / cell_m).floor().max(0.0);
    let last = ((coordinate_m + reach_m) / cell_m)
        .floor()
        .min(f64::from(count) - 1.0);
    if first > last {
        return RangeInclusive::new(1, 0);
    }
    first as u32..=last as u32
}
