//! Draws a diagram: what is behind first, labels last.

use std::collections::BTreeSet;

use protocol::{RobotName, Tick};

use crate::diagram::axis::{draw_axis, draw_grid};
use crate::diagram::bands::{draw_bands, draw_processes};
use crate::diagram::commands::{draw_commands, draw_queries, place_labels};
use crate::diagram::items::{Items, Period};
use crate::diagram::labels::{Area, Labels};
use crate::diagram::lanes::Lanes;
use crate::diagram::legend::draw_legend;
use crate::markup::{Markup, number};
use crate::diagram::options::Options;
use crate::diagram::picture::{HEADING_PX, LABEL_PX, Label, OUTSIDE_PX, Picture, Window};
use crate::diagram::scale::{Scale, Width};
use crate::diagram::shading::{Shaded, shaded};
use crate::diagram::style::style;
use crate::diagram::words::{Titles, shortened, width_px};

/// Space at the right of the lanes, pixels.
const RIGHT_PX: f64 = 22.0;
/// Space below the lanes for the axis, pixels.
const AXIS_PX: f64 = 36.0;
/// Least width of a legend, pixels: its longest entries fit.
const LEGEND_PX: f64 = 300.0;
/// Most letters of the title.
const TITLE_LETTERS: usize = 120;
/// Most letters of a robot's name in front of its lane.
const NAME_LETTERS: usize = 18;

/// The picture of a window, as SVG.
pub(crate) fn draw(
    robots: Vec<RobotName>,
    items: &Items,
    window: Window,
    options: &Options,
) -> String {
    let mut picture = begin(robots, items, window, options);

    draw_lanes(&mut picture);
    draw_cuts(&mut picture, items);
    draw_grid(&mut picture);
    draw_bands(&mut picture, items);
    draw_queries(&mut picture, items);
    let labels = draw_commands(&mut picture, items);
    draw_processes(&mut picture, items);
    place_labels(&mut picture, &labels);
    draw_axis(&mut picture);
    picture.draw_labels();
    let height = if options.has_legend {
        draw_legend(&mut picture, items)
    } else {
        picture.lanes.bottom + AXIS_PX
    };

    finish(picture, height, options)
}

fn begin(robots: Vec<RobotName>, items: &Items, window: Window, options: &Options) -> Picture {
    let mut names = Vec::new();
    if items
        .commands
        .iter()
        .any(|command| command.from.is_operator())
    {
        names.push(RobotName::operator());
    }
    names.extend(robots);
    let mut links = BTreeSet::new();
    links.extend(
        items
            .commands
            .iter()
            .map(|command| (&command.from, &command.to)),
    );
    links.extend(items.cuts.iter().map(|cut| (&cut.from, &cut.to)));
    let lanes = Lanes::new(&names, &links);

    let most_px = (options.max_width_px - lanes.left_px - RIGHT_PX).max(100.0);
    let mut least_px = width_px(&heading(window, options), HEADING_PX);
    if options.has_legend {
        least_px = least_px.max(LEGEND_PX);
    }
    let least_px = least_px.min(most_px);
    let busy = busy_ticks(items);
    let scale = Scale::new(
        window.from,
        window.end(),
        (!options.is_whole).then_some(&busy),
        lanes.left_px,
        Width {
            least_px,
            most_px,
            tick_px: options.tick_px,
        },
    );
    let right_px = scale.right_px().max(scale.left_px() + least_px);
    let mut labels = Labels::between(scale.left_px(), right_px + OUTSIDE_PX);
    for lane in &lanes.all {
        labels.take(Area {
            left: scale.left_px(),
            top: lane.top,
            width: scale.right_px() - scale.left_px(),
            height: lane.bottom - lane.top,
            is_before: false,
        });
    }

    Picture {
        svg: Markup::default(),
        lanes,
        scale,
        right_px,
        labels,
        placed: Vec::new(),
        window,
        titles: Titles {
            tick_s: window.tick_s,
        },
    }
}

/// The ticks in which something begins or ends.
fn busy_ticks(items: &Items) -> BTreeSet<Tick> {
    let mut busy = BTreeSet::new();
    let mut periods: Vec<Period> = Vec::new();
    periods.extend(items.bands.iter().map(|band| band.period));
    periods.extend(items.cuts.iter().map(|cut| cut.period));
    periods.extend(items.faults.iter().map(|fault| fault.period));
    periods.extend(items.missed.iter().map(|missed| missed.period));
    periods.extend(items.absences.iter().map(|absence| absence.period));
    periods.extend(items.queries.iter().map(|lost| lost.period));
    for Period { begin, end } in periods {
        busy.insert(begin);
        busy.extend(end);
    }

    for command in &items.commands {
        busy.insert(command.sent);
        busy.extend(command.until);
        busy.extend(command.ends.iter().map(|end| end.tick));
    }
    busy.extend(items.joined.iter().map(|joined| joined.tick));
    busy.extend(items.held_up.iter().map(|held| held.tick));
    busy.extend(items.changes.iter().map(|change| change.tick));
    busy
}

fn draw_lanes(picture: &mut Picture) {
    let left = picture.scale.left_px();
    let right = picture.scale.right_px();

    for lane in picture.lanes.all.clone() {
        picture
            .svg
            .tag("g")
            .with("class", "lane")
            .with("data-robot", lane.name.as_str())
            .open();

        let name = shortened(lane.name.as_str(), NAME_LETTERS);
        picture.text("name", left - 12.0, lane.middle() + 6.0, "end", &name);
        let middle = lane.middle() + 2.0;
        picture.path("grid", &[(left, middle), (right, middle)]);
        picture.close();
    }
}

/// Shades the space between lanes where links are cut.
fn draw_cuts(picture: &mut Picture, items: &Items) {
    let window = picture.window;
    let areas = shaded(&items.cuts, &picture.lanes, window.from, window.end());
    for area in &areas {
        draw_cut(picture, area);
    }
}

fn draw_cut(picture: &mut Picture, area: &Shaded<'_>) {
    let top = picture.lanes.all[area.above].bottom;
    let bottom = picture.lanes.all[area.above + 1].top;
    let left = picture.scale.x(area.begin);
    let right = picture.scale.x(area.end);

    let title = picture.titles.cuts(&area.cuts);
    picture.open("partition", area.begin, &title);
    picture.rect("cut", left, top, right - left, bottom - top);
    picture.close();

    let text = cut_label(area);
    let width = width_px(&text, LABEL_PX);
    let mut candidates = Vec::new();
    for middle in [top + 8.0, bottom - 8.0] {
        candidates.push(Area::of_label(left + 4.0, middle, width));
    }
    if width + 8.0 <= right - left
        && let Some(place) = picture.labels.place(&candidates)
    {
        picture.placed.push(Label {
            area: place,
            class: "reason",
            tick: area.begin,
            prefix: "",
            text,
        });
    }
}

fn cut_label(area: &Shaded<'_>) -> String {
    let pairs: BTreeSet<_> = area
        .cuts
        .iter()
        .map(|cut| (&cut.from).min(&cut.to))
        .collect();
    let targets: BTreeSet<_> = area
        .cuts
        .iter()
        .map(|cut| (&cut.from).max(&cut.to))
        .collect();

    match area.cuts[..] {
        [cut] => format!("{} → {} cut", cut.from, cut.to),
        _ if pairs.len() == 1 && targets.len() == 1 => {
            let [one, ..] = area.cuts[..] else {
                return String::new();
            };
            format!("{} ↔ {} cut", one.from, one.to)
        }
        _ => format!("{} links cut", area.cuts.len()),
    }
}

/// The text above the lanes.
fn heading(window: Window, options: &Options) -> String {
    let ticks = format!("ticks {} to {}", window.from, window.to);
    if options.title.is_empty() {
        return ticks;
    }
    format!("{} · {ticks}", shortened(&options.title, TITLE_LETTERS))
}

/// Puts the root around the picture.
fn finish(picture: Picture, height: f64, options: &Options) -> String {
    let width = picture.right_px + RIGHT_PX;
    let Window {
        from, to, tick_s, ..
    } = picture.window;
    let left = picture.scale.left_px();
    let heading = heading(picture.window, options);

    let mut svg = Markup::default();
    svg.tag("svg")
        .with("xmlns", "http://www.w3.org/2000/svg")
        .with("class", "cars-diagram")
        .with(
            "viewBox",
            &format!("0 0 {} {}", number(width), number(height)),
        )
        .at("width", width)
        .at("height", height)
        .with("role", "img")
        .with("aria-label", &format!("Space-time diagram: {heading}"))
        .count("data-from", from)
        .count("data-to", to)
        .with("data-tick-s", &tick_s.to_string())
        .with("data-scale", &picture.scale.knots())
        .open();
    if options.has_style {
        svg.style(&style());
    }
    svg.tag("rect")
        .with("class", "paper")
        .at("width", width)
        .at("height", height)
        .empty();
    svg.tag("text")
        .with("class", "heading muted")
        .at("x", left)
        .at("y", 18.0)
        .content(&heading);

    let mut text = svg.finish();
    text += &picture.svg.finish();
    text += "</svg>\n";
    text
}
