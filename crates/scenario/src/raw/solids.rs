//! Bodies and walls as written in the file: sizes of robots and obstacles, obstacles in bulk, and polylines.

use std::ops::Range as Span;
use std::path::{Path, PathBuf};

use config::units::Length;
use config::{FileError, Source};
use import::floor_plan::{self, Placement};
use serde::{Deserialize, Serialize};
use toml::Spanned;
use world::{BODY_MIN_M, SIDE_MAX_M, Shape, WALLS_MAX, Wall};

use super::super::checked::{Obstacle, to_wire, to_world};
use super::place::{Lengths, Spacing, StartPlace, lengths, point};
use super::unplaced::unplaced;

/// `[[obstacle]]`: a fixed one, or as many as `count` says.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObstacleTable {
    #[serde(skip_serializing_if = "Option::is_none")]
    count: Option<usize>,
    at: Spanned<StartPlace>,
    #[serde(skip_serializing_if = "Option::is_none")]
    size: Option<Spanned<Size>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    radius: Option<Spanned<Length>>,
}

/// Sides along x and along y.
pub(super) type Size = Spacing;

/// `[[wall]]`: straight walls from point to point.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WallTable {
    points: Spanned<Vec<Lengths>>,
}

/// `[floor_plan]`: obstacles and walls from a drawing.
#[derive(Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FloorPlanTable {
    file: PathBuf,
    /// Length of a unit of the drawing.
    scale: Option<Length>,
    /// Where the lower left corner of the drawing is.
    at: Option<Lengths>,
}

/// What stands still, with the places in the file that errors point to.
#[derive(Default)]
pub(super) struct Fixed {
    pub(super) obstacles: Vec<(Obstacle, Span<usize>)>,
    pub(super) walls: Vec<(Wall, Span<usize>)>,
}

impl Fixed {
    /// Reads the tables.
    pub(super) fn read(
        obstacles: &[ObstacleTable],
        walls: &[WallTable],
        source: &Source,
    ) -> Result<Self, FileError> {
        let mut fixed = Self::default();
        for table in obstacles {
            fixed.add_obstacles(table, source)?;
        }

        for table in walls {
            let span = table.points.span();
            let points = table.points.get_ref();
            if points.len() < 2 {
                let reason = "a wall has at least two points";
                return Err(FileError::at(source, Some(span), reason));
            }
            for ends in points.windows(2) {
                let wall = Wall {
                    from: point(ends[0]),
                    to: point(ends[1]),
                };
                fixed.walls.push((wall, span.clone()));
            }
        }
        Ok(fixed)
    }

    /// Adds what a drawing has on it. The file is relative to `folder`; without one no drawing may be named.
    pub(super) fn add_plan(
        &mut self,
        table: &Spanned<FloorPlanTable>,
        folder: Option<&Path>,
        source: &Source,
    ) -> Result<(), FileError> {
        let span = table.span();
        let table = table.get_ref();
        let Some(folder) = folder else {
            let reason = "a scenario from outside names no drawing: write its walls out as [[wall]] and [[obstacle]]";
            return Err(FileError::at(source, Some(span), reason));
        };

        let path = folder.join(&table.file);
        source.check_named(span.clone(), &path)?;
        let drawing = Source::read(&path).map_err(|error| error.named_by(&source.name))?;
        let placement = Placement {
            scale_m: table.scale.map(|scale| scale.0),
            at: table.at.map(point).unwrap_or_default(),
        };
        let plan =
            floor_plan::read(&drawing, placement).map_err(|error| error.named_by(&source.name))?;

        for (at, shape) in plan.obstacles {
            let obstacle = Obstacle {
                at: to_wire(at),
                shape: Some(shape),
                drawn: None,
            };
            self.obstacles.push((obstacle, span.clone()));
        }
        let walls = plan.walls.into_iter();
        self.walls.extend(walls.map(|wall| (wall, span.clone())));
        Ok(())
    }

    fn add_obstacles(&mut self, table: &ObstacleTable, source: &Source) -> Result<(), FileError> {
        let span = table.at.span();
        let count = table.count.unwrap_or(1);
        if count > 1 && self.obstacles.len() + count > WALLS_MAX {
            let reason = format!("more than {WALLS_MAX} obstacles");
            return Err(FileError::at(source, Some(span), &reason));
        }

        let shape = shape(table.size.as_ref(), table.radius.as_ref(), source)?;
        for number in 1..=count {
            let place = match table.count {
                Some(_) => table.at.get_ref().member(number, count),
                None => table.at.get_ref().clone(),
            };
            let (at, drawn) = place.resolve();
            let at = to_wire(at);
            self.obstacles
                .push((Obstacle { at, shape, drawn }, span.clone()));
        }
        Ok(())
    }
}

impl ObstacleTable {
    pub(super) fn of(obstacle: &Obstacle) -> Self {
        let (size, radius) = keys(obstacle.shape);
        let at = to_world(obstacle.at);
        Self {
            count: None,
            at: unplaced(StartPlace::of(at, obstacle.drawn)),
            size,
            radius,
        }
    }

    /// Makes a place that follows from the seed any of its region again.
    pub(super) fn forget(&mut self) {
        self.at.as_mut().forget();
    }
}

impl WallTable {
    /// Tables for walls; those that follow one another are one.
    pub(super) fn of_all(walls: &[Wall]) -> Vec<Self> {
        let mut tables: Vec<Vec<Lengths>> = Vec::new();
        let mut end = None;
        for wall in walls {
            match tables.last_mut() {
                Some(points) if end == Some(wall.from) => points.push(lengths(wall.to)),
                _ => tables.push(vec![lengths(wall.from), lengths(wall.to)]),
            }
            end = Some(wall.to);
        }
        let tables = tables.into_iter().map(|points| Self {
            points: unplaced(points),
        });
        tables.collect()
    }
}

/// The shape that `size` and `radius` give; `None` for a square of the field.
pub(super) fn shape(
    size: Option<&Spanned<Size>>,
    radius: Option<&Spanned<Length>>,
    source: &Source,
) -> Result<Option<Shape>, FileError> {
    let (shape, span) = match (size, radius) {
        (None, None) => return Ok(None),
        (Some(size), None) => {
            let Spacing([width, height]) = *size.get_ref();
            let shape = Shape::Rectangle {
                width_m: width.0,
                height_m: height.0,
            };
            (shape, size.span())
        }
        (None, Some(radius)) => {
            let radius_m = radius.get_ref().0;
            (Shape::Disc { radius_m }, radius.span())
        }
        (Some(_), Some(radius)) => {
            let reason = "a body has a size or a radius, not both";
            return Err(FileError::at(source, Some(radius.span()), reason));
        }
    };

    let (half_x_m, half_y_m) = shape.half_m();
    for side_m in [2.0 * half_x_m, 2.0 * half_y_m] {
        if !(BODY_MIN_M..=SIDE_MAX_M).contains(&side_m) {
            let reason = format!(
                "this body is {side_m} m wide or high: bodies are from {BODY_MIN_M} m to {SIDE_MAX_M} m"
            );
            return Err(FileError::at(source, Some(span), &reason));
        }
    }
    Ok(Some(shape))
}

/// The keys of a shape: `size`, `radius`.
pub(super) fn keys(shape: Option<Shape>) -> (Option<Spanned<Size>>, Option<Spanned<Length>>) {
    match shape {
        None => (None, None),
        Some(Shape::Rectangle { width_m, height_m }) => {
            let size = Spacing([Length(width_m), Length(height_m)]);
            (Some(unplaced(size)), None)
        }
        Some(Shape::Disc { radius_m }) => (None, Some(unplaced(Length(radius_m)))),
    }
}
