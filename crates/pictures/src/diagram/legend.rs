//! Draws the legend: signs and colors that the window has.

use std::collections::BTreeSet;

use crate::diagram::items::{BandKind, Command, Items};
use crate::diagram::picture::{CAPTION_PX, LABEL_PX, Picture};
use crate::diagram::style::{behavior_class, emotion_class};
use crate::diagram::words::{shortened, width_px};

/// Most letters of a name in the legend.
const NAME_LETTERS: usize = 24;
/// Distance of two rows of entries, pixels.
const ROW_PX: f64 = 16.0;
/// Width of a sign, pixels.
const SIGN_PX: f64 = 17.0;

/// A sign that needs an explanation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sign {
    Command,
    Delayed,
    Doubled,
    Lost,
    Cut,
    Queries,
    Missed,
    HeldUp,
}

impl Sign {
    /// In the order of the legend.
    const ALL: [Self; 8] = [
        Self::Command,
        Self::Delayed,
        Self::Doubled,
        Self::Lost,
        Self::Cut,
        Self::Queries,
        Self::Missed,
        Self::HeldUp,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Command => "command",
            Self::Delayed => "held back",
            Self::Doubled => "doubled",
            Self::Lost => "lost",
            Self::Cut => "links cut",
            Self::Queries => "query lost",
            Self::Missed => "tick missed",
            Self::HeldUp => "clock held",
        }
    }

    /// Whether the window has it.
    fn occurs(self, picture: &Picture, items: &Items) -> bool {
        let window = picture.window;
        let commands = &items.commands;

        match self {
            Self::Command => !commands.is_empty(),
            Self::Delayed => commands.iter().any(|command| command.until.is_some()),
            Self::Doubled => commands.iter().any(|command| command.is_doubled),
            Self::Lost => commands.iter().any(Command::is_lost),
            Self::Cut => !items.cuts.is_empty(),
            Self::Queries => {
                let mut queries = items.queries.iter();
                queries.any(|lost| window.clip(lost.period).is_some())
            }
            Self::Missed => {
                let mut missed = items.missed.iter();
                missed.any(|missed| window.clip(missed.period).is_some())
            }
            Self::HeldUp => !items.held_up.is_empty(),
        }
    }

    /// Draws it from `x` on; `y` is its middle.
    fn draw(self, picture: &mut Picture, x: f64, y: f64) {
        let end = x + SIGN_PX;

        match self {
            Self::Command => {
                picture.path("line", &[(x, y), (end - 3.0, y)]);
                picture.triangle("head-sign", (x, y), (end, y));
            }
            Self::Delayed => picture.path("wait", &[(x, y), (end, y)]),
            Self::Doubled => {
                picture.path("line", &[(end, y - 4.5), (x + 4.0, y), (x, y)]);
                picture.path("line", &[(x + 4.0, y), (end, y + 4.5)]);
            }
            Self::Lost => {
                picture.path("line", &[(x, y), (end - 3.0, y)]);
                picture.cross("break-sign", end - 3.0, y);
            }
            Self::Cut => picture.rect("cut", x, y - 5.5, SIGN_PX, 11.0),
            Self::Queries => picture.path("query", &[(x, y + 4.0), (x, y), (end, y)]),
            Self::Missed => {
                for step in [0.0, 5.0, 10.0] {
                    let left = x + step;
                    picture.path("hatch", &[(left, y + 4.5), (left + 5.0, y - 4.5)]);
                }
            }
            Self::HeldUp => {
                let middle = x + SIGN_PX / 2.0;
                picture.triangle("held", (middle, y - 4.0), (middle, y + 4.0));
            }
        }
    }
}

/// An entry of the legend of colors.
struct Entry {
    class: String,
    name: String,
}

/// Draws the legend below the axis. Returns the lower end of the picture.
pub(crate) fn draw_legend(picture: &mut Picture, items: &Items) -> f64 {
    let mut y = picture.lanes.bottom + 50.0;
    let mut signs = Sign::ALL.to_vec();
    signs.retain(|sign| sign.occurs(picture, items));
    if !signs.is_empty() {
        y = draw_signs(picture, &signs, y) + 17.0;
    }

    for (kind, caption) in [
        (BandKind::Emotion, "emotion"),
        (BandKind::Behavior, "behavior"),
    ] {
        let entries = entries(picture, items, kind);
        if !entries.is_empty() {
            y = draw_entries(picture, caption, &entries, y) + 17.0;
        }
    }
    y - 4.0
}

/// Draws the signs in as many rows as they need, the first one with the base line `y`; returns that of the last one.
fn draw_signs(picture: &mut Picture, signs: &[Sign], y: f64) -> f64 {
    let left = picture.scale.left_px();
    let right = picture.right_px;
    picture.text("muted", left - CAPTION_PX, y, "end", "sign");

    let mut x = left;
    let mut y = y;
    for sign in signs {
        let width = SIGN_PX + 22.0 + width_px(sign.name(), LABEL_PX);
        if x + width > right && x > left {
            x = left;
            y += ROW_PX;
        }
        let class = if *sign == Sign::Lost {
            "legend lost"
        } else {
            "legend"
        };
        picture.svg.tag("g").with("class", class).open();
        sign.draw(picture, x, y - 3.5);
        picture.text("", x + SIGN_PX + 6.0, y, "start", sign.name());
        picture.close();
        x += width;
    }
    y
}

fn entries(picture: &Picture, items: &Items, kind: BandKind) -> Vec<Entry> {
    let mut found = BTreeSet::new();
    for band in &items.bands {
        if band.kind == kind && picture.window.clip(band.period).is_some() {
            let color = match kind {
                BandKind::Emotion => emotion_class(&band.name),
                BandKind::Behavior => behavior_class(&band.name),
            };
            found.insert((color, shortened(&band.name, NAME_LETTERS)));
        }
    }

    let mut entries = Vec::new();
    for (color, name) in found {
        let class = format!("band {color}");
        entries.push(Entry { class, name });
    }
    entries
}

/// Draws entries in as many rows as they need; returns the base line of the last one.
fn draw_entries(picture: &mut Picture, caption: &str, entries: &[Entry], y: f64) -> f64 {
    const MAX_ENTRIES: usize = 40;
    let left = picture.scale.left_px();
    let right = picture.right_px;
    picture.text("muted", left - CAPTION_PX, y, "end", caption);

    let mut x = left;
    let mut y = y;
    for Entry { class, name } in entries.iter().take(MAX_ENTRIES) {
        let width = 16.0 + width_px(name, LABEL_PX) + 14.0;
        if x + width > right && x > left {
            x = left;
            y += ROW_PX;
        }
        picture.svg.tag("g").with("class", "legend").open();
        picture.rect(class, x, y - 9.0, 12.0, 11.0);
        picture.text("", x + 16.0, y, "start", name);
        picture.close();
        x += width;
    }
    y
}
