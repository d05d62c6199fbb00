//! Draws a diagram: what is behind first, labels last.

use std::collections::BTreeSet;

use protocol::{RobotName, Tick};
use timeline::{RunDecision, StateOrder, Timeline};

use crate::diagram::commands::{draw_commands, draw_queries, place_labels};
use crate::diagram::cuts::draw_cuts;
use crate::diagram::decisions::draw_decisions;
use crate::diagram::items::Items;
use crate::diagram::lanes::Lanes;
use crate::diagram::legend::draw_legend;
use crate::diagram::picture::{HEADING_PX, Picture, VisibleTicks};
use crate::diagram::robots::{draw_bands, draw_processes};
use crate::diagram::time_axis::{Width, draw_axis, draw_grid, scale};
use crate::labels::{shortened, width_px};
use crate::markup::Markup;
use crate::style::style;

/// Space at the right of the lanes, pixels.
const RIGHT_PX: f64 = 22.0;
/// Space below the lanes for the axis, pixels.
const AXIS_PX: f64 = 36.0;
/// Distance of the first line of a legend from what is above it, pixels.
const LEGEND_BELOW_PX: f64 = 14.0;
/// Least width of a legend, pixels: its longest entries fit.
const LEGEND_PX: f64 = 300.0;
/// Most letters of the title.
const TITLE_LETTERS: usize = 120;
/// Most letters of a robot's name in front of its lane.
const NAME_LETTERS: usize = 18;

/// How a diagram is drawn.
#[derive(Debug, Clone)]
pub struct DiagramOptions {
    /// Text above the picture; none if it is empty.
    pub title: String,
    /// Whether lost queries are drawn.
    pub queries: bool,
    /// Whether time in which nothing happens is always drawn to scale. Otherwise a wide window has gaps instead.
    pub is_whole: bool,
    /// Most pixels of width.
    pub max_width_px: f64,
    /// Whether the text contains its style sheet. Without it, the page that shows the picture has to have [`crate::style`].
    pub has_style: bool,
    /// Whether the picture has a legend of signs and colors. A legend on the page can be that of several pictures.
    pub has_legend: bool,
    /// Emotions and behaviors whose colors are taken: those of other pictures on the same page.
    pub names: StateOrder,
    /// Width of a picture of so many ticks, pixels, so that several pictures have the same scale; without it the window decides.
    pub width: Option<(f64, Tick)>,
    /// What decided the run: curves below the axis of time. None leaves the picture as it is.
    pub decisions: Vec<RunDecision>,
}

impl Default for DiagramOptions {
    fn default() -> Self {
        Self {
            title: String::new(),
            queries: false,
            is_whole: false,
            max_width_px: 4800.0,
            has_style: true,
            has_legend: true,
            names: StateOrder::default(),
            width: None,
            decisions: Vec::new(),
        }
    }
}

/// The picture of a window, as SVG. `legend` is what it has a legend of, and in which window, if that is more than the picture.
pub(crate) fn draw(
    timeline: &Timeline,
    items: &Items,
    window: VisibleTicks,
    options: &DiagramOptions,
    legend: Option<(&Items, VisibleTicks)>,
) -> String {
    let heading = heading(items, window, options);
    let mut picture = begin(timeline, items, window, &heading, options);

    draw_lanes(&mut picture);
    draw_cuts(&mut picture, items);
    draw_grid(&mut picture);
    draw_bands(&mut picture, items);
    draw_queries(&mut picture, items);
    let labels = draw_commands(&mut picture, items);
    draw_processes(&mut picture, items);
    place_labels(&mut picture, &labels);
    draw_axis(&mut picture);
    let axis_end = picture.lanes.bottom + AXIS_PX;
    let below = draw_decisions(&mut picture, &options.decisions, axis_end);
    picture.draw_labels();
    let legend = legend.or(options.has_legend.then_some((items, window)));
    let height = match legend {
        Some((items, window)) => draw_legend(&mut picture, items, window, below + LEGEND_BELOW_PX),
        None if options.decisions.is_empty() => below,
        None => below + LEGEND_BELOW_PX,
    };

    finish(picture, height, &heading, options.has_style)
}

fn begin(
    timeline: &Timeline,
    items: &Items,
    window: VisibleTicks,
    heading: &str,
    options: &DiagramOptions,
) -> Picture {
    let mut commands = items.commands.iter();
    let mut names = Vec::new();
    if commands.any(|command| command.from.is_operator()) {
        names.push(RobotName::operator());
    }
    names.extend(timeline.robots().cloned());
    let commands = items.commands.iter();
    let mut links: BTreeSet<_> = commands
        .map(|command| (&command.from, &command.to))
        .collect();
    links.extend(items.cuts.iter().map(|cut| (&cut.from, &cut.to)));
    let lanes = Lanes::new(&names, &links);

    let most_px = (options.max_width_px - lanes.left_px - RIGHT_PX).max(100.0);
    let legend_px = if options.has_legend { LEGEND_PX } else { 0.0 };
    let least_px = width_px(heading, HEADING_PX).max(legend_px).min(most_px);
    let busy = (!options.is_whole).then(|| {
        let jumps = options
            .decisions
            .iter()
            .flat_map(|decision| &decision.jumps);
        let mut busy = busy_ticks(items);
        busy.extend(jumps.map(|jump| jump.tick));
        busy
    });
    let width = Width {
        least_px,
        most_px,
        tick_px: options.width.map(|(width_px, ticks)| {
            (width_px - lanes.left_px - RIGHT_PX).max(100.0) / ticks as f64
        }),
    };
    let scale = scale(
        (window.from, window.end()),
        busy.as_ref(),
        lanes.left_px,
        width,
    );
    let mut names = options.names.clone();
    names.add_all(timeline.names());
    Picture::new(lanes, scale, least_px, window, names)
}

/// The ticks in which something begins or ends.
fn busy_ticks(items: &Items) -> BTreeSet<Tick> {
    let mut busy = BTreeSet::new();
    for period in items.periods() {
        busy.insert(period.begin);
        busy.extend(period.end);
    }
    for command in &items.commands {
        busy.insert(command.sent);
        busy.extend(command.until);
        busy.extend(command.ends.iter().map(|end| end.tick));
    }
    busy.extend(items.joined.iter().map(|joined| joined.tick));
    busy.extend(items.held_up.iter().map(|held| held.tick));
    busy.extend(items.changes.iter().map(|change| change.tick));
    busy.extend(items.sites.iter().map(|mark| mark.tick));
    busy
}

fn draw_lanes(picture: &mut Picture) {
    let left = picture.scale.begin_px();
    let right = picture.scale.end_px();

    for lane in picture.lanes.all.clone() {
        let tag = picture.svg.tag("g").class("lane");
        tag.with("data-robot", lane.name.as_str()).open();
        let name = shortened(lane.name.as_str(), NAME_LETTERS);
        let middle = lane.middle();
        let svg = &mut picture.svg;
        svg.text("name", left - 12.0, middle + 6.0, "end", &name);
        svg.line("grid", &[(left, middle + 2.0), (right, middle + 2.0)]);
        picture.close();
    }
}

/// The text above the lanes.
fn heading(items: &Items, window: VisibleTicks, options: &DiagramOptions) -> String {
    let mut ticks = format!("ticks {} to {}", window.from, window.to);
    if items.sites_left_out > 0 {
        ticks += &format!(", {} more acts on sites", items.sites_left_out);
    }
    if options.title.is_empty() {
        return ticks;
    }
    format!("{} · {ticks}", shortened(&options.title, TITLE_LETTERS))
}

/// Puts the root around the picture.
fn finish(picture: Picture, height: f64, heading: &str, has_style: bool) -> String {
    let width = picture.right_px + RIGHT_PX;
    let window = picture.window;

    let mut svg = Markup::default();
    svg.root("cars-diagram", width, height)
        .with("aria-label", &format!("Space-time diagram: {heading}"))
        .count("data-from", window.from)
        .count("data-to", window.to)
        .with("data-tick-s", &window.tick_s.to_string())
        .with("data-scale", &picture.scale.knots())
        .open();
    if has_style {
        svg.style(&style());
    }
    svg.rect("paper", (0.0, 0.0), width, height);
    let left = picture.scale.begin_px();
    svg.text("heading muted", left, 18.0, "start", heading);
    svg.add(&picture.svg.finish());
    svg.close("svg");
    svg.finish()
}
