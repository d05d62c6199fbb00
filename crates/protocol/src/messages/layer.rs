//! Layers: a number for each cell of a grid over the floor, which robots sense and change.

use serde::{Deserialize, Serialize};

use super::limits::{at_most, finite};
use super::point::Point;
use crate::codec::FieldError;
use crate::name::MAX_NAME_LEN;

/// Most layers of a scenario.
pub const MAX_LAYERS: usize = 8;
/// Most cells of all layers of a scenario together.
pub const MAX_LAYER_CELLS: usize = 131_072;
/// Most cells of all layers together within range of a robot.
pub const MAX_SENSED_CELLS: usize = 2048;
/// Most actions on layers in a report.
pub const MAX_LAYER_ACTIONS: usize = 64;
/// Cells hold no number that is farther from 0.
pub const MAX_LAYER_VALUE: f64 = 1e12;

/// The part of a layer that a robot senses: all cells whose centers are within range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SensedLayer {
    /// Its name.
    pub name: String,
    /// Side of a cell, meters. The first cell of the grid is in the lower left corner of the field.
    pub cell_m: f64,
    /// The cells, row by row from below.
    pub rows: Vec<SensedRow>,
}

/// Cells of a layer that lie side by side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SensedRow {
    /// The row of the grid, from 0.
    pub row: u32,
    /// The column of the first of them, from 0.
    pub column: u32,
    /// Their numbers, from left to right.
    pub values: Vec<f64>,
}

/// A cell that a robot senses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensedCell {
    /// Its column in the grid, from 0.
    pub column: u32,
    /// Its row in the grid, from 0.
    pub row: u32,
    /// Its center, meters.
    pub center: Point,
    /// Its number.
    pub value: f64,
}

impl SensedLayer {
    /// The number of the cell in which a place is; `None` if the robot does not sense this cell.
    #[must_use]
    pub fn value_at(&self, place: Point) -> Option<f64> {
        let column = (place.x / self.cell_m).floor();
        let row = (place.y / self.cell_m).floor();
        let sensed = self
            .rows
            .iter()
            .find(|sensed| f64::from(sensed.row) == row)?;
        let index = column - f64::from(sensed.column);
        // The conversion would make the first cell of what is to the left of it, and of what is no number.
        let is_right = index >= 0.0;
        let value = is_right.then(|| sensed.values.get(index as usize));
        value.flatten().copied()
    }

    /// The cells, row by row from below, each row from left to right.
    pub fn cells(&self) -> impl Iterator<Item = SensedCell> + '_ {
        self.rows.iter().flat_map(|sensed| {
            let columns = sensed.column..;
            columns
                .zip(&sensed.values)
                .map(|(column, value)| SensedCell {
                    column,
                    row: sensed.row,
                    center: cell_center(column, sensed.row, self.cell_m),
                    value: *value,
                })
        })
    }
}

/// The center of a cell of a layer whose cells have this side, meters.
#[must_use]
pub fn cell_center(column: u32, row: u32, cell_m: f64) -> Point {
    Point::new(
        (f64::from(column) + 0.5) * cell_m,
        (f64::from(row) + 0.5) * cell_m,
    )
}

/// What a robot does to a layer: to the cell in which a place is, and to all cells whose centers are within a radius of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LayerAction {
    /// Name of the layer.
    pub layer: String,
    /// The place, meters.
    pub at: Point,
    /// The radius, meters.
    #[serde(default)]
    pub radius_m: f64,
    /// What the numbers of the cells are set to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<f64>,
    /// What is added to the number of each cell, after it was set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub add: Option<f64>,
}

impl LayerAction {
    /// An action that sets the cells around a place to a number.
    #[must_use]
    pub fn set(layer: impl Into<String>, at: Point, radius_m: f64, number: f64) -> Self {
        Self {
            layer: layer.into(),
            at,
            radius_m,
            set: Some(number),
            add: None,
        }
    }

    /// An action that adds a number to each of the cells around a place.
    #[must_use]
    pub fn add(layer: impl Into<String>, at: Point, radius_m: f64, number: f64) -> Self {
        Self {
            layer: layer.into(),
            at,
            radius_m,
            set: None,
            add: Some(number),
        }
    }

    fn check(&self) -> Result<(), FieldError> {
        at_most(MAX_NAME_LEN, &self.layer, "layer_actions.layer")?;
        self.at.check("layer_actions.at")?;
        finite(self.radius_m, "layer_actions.radius_m")?;
        if self.radius_m < 0.0 {
            return Err(FieldError::new("layer_actions.radius_m", "less than zero"));
        }
        if self.set.is_none() && self.add.is_none() {
            let reason = "an action has set or add";
            return Err(FieldError::new("layer_actions", reason));
        }
        finite(self.set.unwrap_or_default(), "layer_actions.set")?;
        finite(self.add.unwrap_or_default(), "layer_actions.add")
    }
}

/// Checks the actions of a report.
pub(super) fn check_layer_actions(actions: &[LayerAction]) -> Result<(), FieldError> {
    if actions.len() > MAX_LAYER_ACTIONS {
        let reason = format!(
            "{} actions, more than the {MAX_LAYER_ACTIONS} allowed",
            actions.len()
        );
        return Err(FieldError::new("layer_actions", reason));
    }
    actions.iter().try_for_each(LayerAction::check)
}

/// What became of an action on a layer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LayerResult {
    /// Name of the layer, as the action had it.
    pub layer: String,
    /// What the action added to the sum of the layer; 0 if it was refused.
    pub change: f64,
    /// Why the action was refused; absent if it was carried out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refused: Option<LayerRefusal>,
}

/// Why an action on a layer was refused. The first reason that holds counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LayerRefusal {
    /// The scenario has no layer of this name.
    UnknownLayer,
    /// The place is farther away than the range of the layer, the radius is larger than it, or the layer has no range.
    OutOfRange,
}

impl LayerRefusal {
    /// The word for it, as in messages and records.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::UnknownLayer => "unknown_layer",
            Self::OutOfRange => "out_of_range",
        }
    }
}

impl std::fmt::Display for LayerRefusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::UnknownLayer => "there is no such layer",
            Self::OutOfRange => "it is out of range",
        })
    }
}

/// A layer as observers see it: whole, with 256 levels between the least and the greatest number of its cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct LayerFrame {
    /// Its name.
    pub name: String,
    /// Side of a cell, meters. The first cell is in the lower left corner of the field; the last ones may reach over its edge.
    pub cell_m: f64,
    /// Number of columns.
    pub columns: u32,
    /// Number of rows.
    pub rows: u32,
    /// The least number of a cell.
    pub min: f64,
    /// The greatest number of a cell.
    pub max: f64,
    /// The numbers at the ends of a color scale: the bounds of the layer, or where it has none the least and the greatest number of a cell
    /// now and at the start.
    pub scale: [f64; 2],
    /// A byte for each cell, row by row from below, in Base64: its number is about `min + (max - min) * byte / 255`.
    pub levels: String,
}
