//! Where a robot was: the floor from above, darker where it was longer.

use std::collections::BTreeMap;

use protocol::messages::{BodyShape, StaticWorld};

use crate::axis::{draw_below, draw_left};
use crate::chart::{PANEL_PX, begin, end};
use crate::markup::{Markup, number};
use crate::palette::{HEAT_SHADES, level};
use crate::scale::Scale;

/// Most height of the floor, pixels.
const MAX_PX: f64 = 420.0;

/// The time that a robot spent in each part of the floor.
#[derive(Debug, Clone)]
pub struct Floor {
    /// Name of the svg.
    pub title: String,
    /// Width and height of the field, meters.
    pub field_m: [f64; 2],
    /// Side of obstacles without a shape of their own, meters.
    pub body_m: f64,
    /// Centers of obstacles, meters.
    pub obstacles: Vec<[f64; 2]>,
    /// Walls, and shapes of obstacles.
    pub static_world: StaticWorld,
    /// Side of a part, meters.
    pub part_m: f64,
    /// Time in each part, by column and row from the origin, seconds.
    pub times_s: BTreeMap<(u32, u32), f64>,
}

impl Floor {
    /// The chart as SVG.
    #[must_use]
    pub fn draw(&self) -> String {
        let [width_m, height_m] = self.field_m;
        let left = 44.0;
        let right = PANEL_PX - 2.0;
        let px_per_m = ((right - left) / width_m).min(MAX_PX / height_m);
        let right = left + width_m * px_per_m;
        let top = 6.0;
        let bottom = top + height_m * px_per_m;
        let x = Scale::new(0.0, width_m, left, right);
        let y = Scale::new(0.0, height_m, bottom, top);

        let description = self.description();
        let height = bottom + 64.0;
        let mut svg = begin("floor", PANEL_PX, height, &self.title, &description);
        draw_below(&mut svg, &x, top, bottom, "x, m");
        draw_left(&mut svg, &y, left, right);
        let middle = f64::midpoint(top, bottom);
        svg.upward("muted", 12.0, middle, "middle", "y, m");
        self.draw_times(&mut svg, &x, &y);
        self.draw_obstacles(&mut svg, &x, &y);
        self.draw_walls(&mut svg, &x, &y);
        svg.rect("frame", (left, top), right - left, bottom - top);
        self.draw_key(&mut svg, left, bottom + 42.0);
        end(svg)
    }

    /// The longest time in one part, seconds.
    fn most_s(&self) -> f64 {
        self.times_s.values().copied().fold(0.0, f64::max)
    }

    fn description(&self) -> String {
        format!(
            "A field of {:.1} m by {:.1} m in parts of {:.2} m: the robot was in {} of them, at most {:.1} s in one",
            self.field_m[0],
            self.field_m[1],
            self.part_m,
            self.times_s.len(),
            self.most_s()
        )
    }

    /// Darkness grows with the square root of the time, so that ways are seen beside places to wait.
    fn draw_times(&self, svg: &mut Markup, x: &Scale, y: &Scale) {
        let most_s = self.most_s().max(f64::MIN_POSITIVE);
        let mut paths: BTreeMap<usize, String> = BTreeMap::new();

        for ((column, row), time_s) in &self.times_s {
            let ends = |scale: &Scale, part: u32| {
                [part, part + 1].map(|part| number(scale.at(f64::from(part) * self.part_m)))
            };
            let [left, right] = ends(x, *column);
            let [bottom, top] = ends(y, *row);
            let path = paths.entry(level((time_s / most_s).sqrt())).or_default();
            *path += &format!("M{left} {top}H{right}V{bottom}H{left}z");
        }

        for (level, path) in paths {
            svg.path(&format!("h{level}"), &path);
        }
    }

    /// The shape of an obstacle, by its index; none is a square of the run's size.
    pub(crate) fn shape(&self, obstacle: usize) -> Option<BodyShape> {
        let shape = self.static_world.obstacle_shapes.get(obstacle);
        shape.copied().flatten()
    }

    /// Width and height of an obstacle, by its index, meters.
    pub(crate) fn size_m(&self, obstacle: usize) -> [f64; 2] {
        let shape = self.shape(obstacle);
        shape.map_or([self.body_m; 2], BodyShape::size_m)
    }

    fn draw_obstacles(&self, svg: &mut Markup, x: &Scale, y: &Scale) {
        for (index, [center_x, center_y]) in self.obstacles.iter().enumerate() {
            let [width_m, height_m] = self.size_m(index);
            let left = x.at(center_x - width_m / 2.0);
            let top = y.at(center_y + height_m / 2.0);
            let width = x.at(center_x + width_m / 2.0) - left;
            let height = y.at(center_y - height_m / 2.0) - top;

            let title = format!("obstacle at {center_x:.2} m, {center_y:.2} m");
            svg.group("obstacle", &title);
            if matches!(self.shape(index), Some(BodyShape::Disc(_))) {
                let disc = disc((left, y.at(*center_y)), width);
                svg.path("obstacle", &disc);
            } else {
                svg.rect("obstacle", (left, top), width, height);
            }
            svg.close("g");
        }
    }

    fn draw_walls(&self, svg: &mut Markup, x: &Scale, y: &Scale) {
        let mut path = String::new();
        for wall in &self.static_world.walls {
            for (index, [x_m, y_m]) in wall.iter().enumerate() {
                let command = if index == 0 { 'M' } else { 'L' };
                path += &format!("{command}{} {}", number(x.at(*x_m)), number(y.at(*y_m)));
            }
        }
        if !path.is_empty() {
            svg.path("wall", &path);
        }
    }

    fn draw_key(&self, svg: &mut Markup, left: f64, top: f64) {
        const STEP_PX: f64 = 14.0;
        svg.text("muted", left, top + 11.0, "start", "0 s");
        let first = left + 24.0;
        for step in 1..HEAT_SHADES.len() {
            let x = first + (step - 1) as f64 * STEP_PX;
            svg.rect(&format!("h{step}"), (x, top + 2.0), STEP_PX, 10.0);
        }
        let end = first + (HEAT_SHADES.len() - 1) as f64 * STEP_PX + 6.0;
        let text = format!("{:.1} s in a part of {:.2} m", self.most_s(), self.part_m);
        svg.text("muted", end, top + 11.0, "start", &text);
    }
}

/// The path of a disc from its leftmost point, as two half circles.
fn disc((left, middle): (f64, f64), diameter: f64) -> String {
    let radius = number(diameter / 2.0);
    format!(
        "M{} {}a{radius} {radius} 0 1 0 {} 0a{radius} {radius} 0 1 0 {} 0z",
        number(left),
        number(middle),
        number(diameter),
        number(-diameter)
    )
}
