//! Draws the legend: signs and colors that the window has.

use protocol::event::Cause;
use std::collections::BTreeSet;
use timeline::{CommandSpan, StateKind};

use crate::diagram::items::Items;
use crate::diagram::picture::{CAPTION_PX, Picture, VisibleTicks};
use crate::labels::{in_rows, shortened, width_px};
use crate::markup::Markup;
use crate::palette::state_look;
use crate::shapes::LABEL_PX;

/// Most letters of a name in the legend.
const NAME_LETTERS: usize = 24;
/// Most entries of a kind.
const MAX_ENTRIES: usize = 40;
/// Distance of two rows of entries, pixels.
const ROW_PX: f64 = 16.0;
/// Width of a sign, pixels.
const SIGN_PX: f64 = 17.0;

/// Draws a sign from `x` on; `y` is its middle.
type Draw = fn(&mut Markup, f64, f64);

/// What commands that wait do.
fn held_back(commands: &[CommandSpan]) -> &'static str {
    let held = commands.iter().filter(|command| command.until.is_some());
    let (queued, others): (Vec<_>, Vec<_>) =
        held.partition(|command| command.because == Some(Cause::Queue));
    match (queued.is_empty(), others.is_empty()) {
        (false, true) => "in the queue",
        (false, false) => "held back or in the queue",
        (true, _) => "held back",
    }
}

/// The signs that a window has, with their names.
fn signs(window: VisibleTicks, items: &Items) -> Vec<(&'static str, Draw)> {
    let commands = &items.commands;
    let mut queries = items.queries.iter();
    let mut missed = items.missed.iter();
    let signs: [(bool, &str, Draw); 8] = [
        (!commands.is_empty(), "command", |svg, x, y| {
            svg.line("line", &[(x, y), (x + SIGN_PX - 3.0, y)]);
            svg.triangle("head-sign", (x, y), (x + SIGN_PX, y));
        }),
        (
            commands.iter().any(|command| command.until.is_some()),
            held_back(commands),
            |svg, x, y| svg.line("wait", &[(x, y), (x + SIGN_PX, y)]),
        ),
        (
            commands.iter().any(|command| command.is_doubled),
            "doubled",
            |svg, x, y| {
                let (fork, end) = ((x + 4.0, y), x + SIGN_PX);
                svg.line("line", &[(end, y - 4.5), fork, (x, y)]);
                svg.line("line", &[fork, (end, y + 4.5)]);
            },
        ),
        (
            commands.iter().any(CommandSpan::is_lost),
            "lost",
            |svg, x, y| {
                let end = (x + SIGN_PX - 3.0, y);
                svg.line("line", &[(x, y), end]);
                svg.cross("break-sign", end);
            },
        ),
        (!items.cuts.is_empty(), "links cut", |svg, x, y| {
            svg.rect("cut", (x, y - 5.5), SIGN_PX, 11.0);
        }),
        (
            queries.any(|lost| window.clip(lost.period).is_some()),
            "query lost",
            |svg, x, y| svg.line("query", &[(x, y + 4.0), (x, y), (x + SIGN_PX, y)]),
        ),
        (
            missed.any(|missed| window.clip(missed.period).is_some()),
            "tick missed",
            |svg, x, y| {
                for left in [x, x + 5.0, x + 10.0] {
                    svg.line("hatch", &[(left, y + 4.5), (left + 5.0, y - 4.5)]);
                }
            },
        ),
        (!items.held_up.is_empty(), "clock held", |svg, x, y| {
            let middle = x + SIGN_PX / 2.0;
            svg.triangle("held", (middle, y - 4.0), (middle, y + 4.0));
        }),
    ];
    let occurring = signs.into_iter().filter(|(occurs, ..)| *occurs);
    occurring.map(|(_, name, draw)| (name, draw)).collect()
}

/// Draws the legend, the first line of which has the base line `y`. Returns the lower end of the picture.
pub(crate) fn draw_legend(
    picture: &mut Picture,
    items: &Items,
    window: VisibleTicks,
    y: f64,
) -> f64 {
    let signs = signs(window, items);
    let names: Vec<&str> = signs.iter().map(|(name, _)| *name).collect();
    let y = draw_entries(
        picture,
        "sign",
        &names,
        SIGN_PX + 6.0,
        y,
        |svg, index, x, y| {
            (signs[index].1)(svg, x, y - 3.5);
        },
    );
    let y = draw_colors(picture, (items, window), StateKind::Emotion, "emotion", y);
    draw_colors(picture, (items, window), StateKind::Behavior, "behavior", y) - 4.0
}

/// Draws the colors of the states of a kind; returns where the next entries are.
fn draw_colors(
    picture: &mut Picture,
    (items, window): (&Items, VisibleTicks),
    kind: StateKind,
    caption: &str,
    y: f64,
) -> f64 {
    let mut found = BTreeSet::new();
    for band in &items.bands {
        if band.kind == kind && window.clip(band.period).is_some() {
            let look = state_look(kind, &band.name, &picture.names);
            found.insert((look, shortened(&band.name, NAME_LETTERS)));
        }
    }
    let (looks, names): (Vec<_>, Vec<_>) = found.into_iter().take(MAX_ENTRIES).unzip();
    draw_entries(picture, caption, &names, 16.0, y, |svg, index, x, y| {
        svg.state(&looks[index], "band", (x, y - 9.0), (12.0, 11.0));
    })
}

/// Draws entries in as many rows as they need, the first one with the base line `y`: what `draw` draws, in a width of `sign_px`,
/// before the names. Returns the base line of what is below; without entries there is nothing.
fn draw_entries<N: AsRef<str>>(
    picture: &mut Picture,
    caption: &str,
    names: &[N],
    sign_px: f64,
    y: f64,
    draw: impl Fn(&mut Markup, usize, f64, f64),
) -> f64 {
    if names.is_empty() {
        return y;
    }

    let left = picture.scale.begin_px();
    let svg = &mut picture.svg;
    svg.text("muted", left - CAPTION_PX, y, "end", caption);
    let names = names.iter().map(AsRef::as_ref);
    let widths = names
        .clone()
        .map(|name| sign_px + width_px(name, LABEL_PX) + 16.0);
    let places = in_rows(widths, left, picture.right_px);
    let last = places.last().map_or(0, |(_, row)| *row);
    for (index, (name, (x, row))) in names.zip(places).enumerate() {
        let y = y + row as f64 * ROW_PX;
        // The colors of what is lost are those of its class.
        let class = if name == "lost" {
            "legend lost"
        } else {
            "legend"
        };
        svg.tag("g").class(class).open();
        draw(svg, index, x, y);
        svg.text("", x + sign_px, y, "start", name);
        svg.close("g");
    }
    y + last as f64 * ROW_PX + 17.0
}
