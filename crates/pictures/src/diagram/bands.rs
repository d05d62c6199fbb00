//! Draws what the robots do: bands of emotions and behaviors, and what becomes of their processes.

use protocol::messages::FaultKind;
use protocol::{RobotName, Tick};

use crate::diagram::changes;
use crate::diagram::items::{Band, BandKind, Items};
use crate::diagram::labels::Area;
use crate::diagram::lanes::{BEHAVIOR_PX, EMOTION_PX, STRIP_PX};
use crate::diagram::picture::{LABEL_PX, Label, Picture};
use crate::diagram::style::{behavior_class, emotion_class};
use crate::diagram::words::{self, shortened, width_px};

/// Most letters of the name of an emotion or a behavior.
const NAME_LETTERS: usize = 40;
/// Font of behaviors, pixels.
const SMALL_PX: f64 = 9.0;

/// Draws the bands.
pub(crate) fn draw_bands(picture: &mut Picture, items: &Items) {
    for band in &items.bands {
        draw_band(picture, band);
    }
}

fn draw_band(picture: &mut Picture, band: &Band) {
    let Some((left, width)) = picture.extent(band.period) else {
        return;
    };
    let Some(lane) = picture.lanes.lane(&band.robot) else {
        return;
    };
    let look = match band.kind {
        BandKind::Emotion => Look {
            class: "emotion",
            color: emotion_class(&band.name),
            top: lane.emotion_top(),
            height: EMOTION_PX,
            font: "",
            font_px: LABEL_PX,
        },
        BandKind::Behavior => Look {
            class: "behavior",
            color: behavior_class(&band.name),
            top: lane.behavior_top(),
            height: BEHAVIOR_PX,
            font: "small ",
            font_px: SMALL_PX,
        },
    };

    let title = picture.titles.band(band);
    picture.open(look.class, band.period.begin, &title);
    let color = &look.color;
    picture.rect(&format!("band {color}"), left, look.top, width, look.height);
    let name = shortened(&band.name, NAME_LETTERS);
    if width_px(&name, look.font_px) + 6.0 <= width {
        let class = format!("{}on-{color}", look.font);
        let baseline = look.top + look.height / 2.0 + look.font_px * 0.36;
        picture.text(&class, left + 4.0, baseline, "start", &name);
    }
    picture.close();
}

/// What the bands of a kind look like.
struct Look {
    class: &'static str,
    /// Class of the color.
    color: String,
    top: f64,
    height: f64,
    /// Class of the text, with a space after it.
    font: &'static str,
    font_px: f64,
}

/// Draws faults, absences, returns and ticks that were missed or held up.
pub(crate) fn draw_processes(picture: &mut Picture, items: &Items) {
    draw_missed(picture, items);
    draw_faults(picture, items);
    draw_absences(picture, items);
    draw_joined(picture, items);
    draw_held_up(picture, items);
    draw_changes(picture, items);
}

fn draw_absences(picture: &mut Picture, items: &Items) {
    for absence in &items.absences {
        let Some((left, width)) = picture.extent(absence.period) else {
            continue;
        };
        let Some(lane) = picture.lanes.lane(&absence.robot).cloned() else {
            continue;
        };

        let title = picture.titles.absence(absence);
        picture.open("absence", absence.period.begin, &title);
        picture.rect(
            "absent",
            left,
            lane.emotion_top() + 0.5,
            width,
            EMOTION_PX + BEHAVIOR_PX - 1.0,
        );
        if absence.period.begin >= picture.window.from {
            picture.cross("gone", left, lane.middle() + STRIP_PX / 2.0);
        }
        picture.close();
        if absence.period.begin >= picture.window.from {
            mark(picture, &absence.robot, left, absence.period.begin, "lost");
        }
    }
}

/// Ticks that a robot missed are hatched.
fn draw_missed(picture: &mut Picture, items: &Items) {
    const STEP_PX: f64 = 6.0;
    for missed in &items.missed {
        let Some((left, width)) = picture.extent(missed.period) else {
            continue;
        };
        let Some(lane) = picture.lanes.lane(&missed.robot).cloned() else {
            continue;
        };

        let title = picture.titles.missed(missed);
        let begin = missed.period.begin;
        let ticks = missed.period.end.map_or(1, |end| end - begin);
        let tick = picture.shown(begin);
        picture
            .svg
            .tag("g")
            .with("class", "missed")
            .count("data-tick", tick)
            .count("data-ticks", ticks)
            .open();
        picture.svg.title(&title);

        let top = lane.emotion_top();
        let mut x = left;
        while x < left + width {
            let right = (x + STEP_PX).min(left + width);
            picture.path("hatch", &[(x, lane.bottom), (right, top)]);
            x += STEP_PX;
        }
        picture.close();
    }
}

fn draw_faults(picture: &mut Picture, items: &Items) {
    for fault in &items.faults {
        let Some((left, width)) = picture.extent(fault.period) else {
            continue;
        };
        let Some(lane) = picture.lanes.lane(&fault.robot).cloned() else {
            continue;
        };

        let title = picture.titles.fault(fault);
        let class = match fault.kind {
            FaultKind::Crash => "crash",
            FaultKind::Hang => "hang",
            FaultKind::Slow => "slow",
            FaultKind::Restart => "restart",
        };
        picture.open("fault", fault.period.begin, &title);
        picture.rect(class, left, lane.top, width, STRIP_PX - 1.5);
        picture.close();
        let text = words::fault(fault.kind);
        mark(picture, &fault.robot, left, fault.period.begin, text);
    }
}

fn draw_joined(picture: &mut Picture, items: &Items) {
    for joined in &items.joined {
        let Some(lane) = picture.lanes.lane(&joined.robot).cloned() else {
            continue;
        };

        let title = picture.titles.joined(joined);
        let x = picture.scale.x(joined.tick);
        picture.open("joined", joined.tick, &title);
        picture.triangle("back", (x, lane.bottom + 8.0), (x, lane.bottom));
        picture.close();

        let text = match joined.generation {
            Some(generation) => format!("back ({generation})"),
            None => "joins".to_owned(),
        };
        let width = width_px(&text, LABEL_PX);
        let middle = lane.bottom + 8.0;
        let candidates = [
            Area::of_label(x + 6.0, middle, width),
            Area::of_label_before(x - 6.0, middle, width),
        ];
        place(picture, &candidates, joined.tick, text);
    }
}

/// Ticks for which the clock was held: for all robots, because of one.
fn draw_held_up(picture: &mut Picture, items: &Items) {
    for held in &items.held_up {
        let Some(lane) = picture.lanes.lane(&held.awaited.name).cloned() else {
            continue;
        };

        let title = picture.titles.held_up(held);
        let x = picture.scale.x(held.tick);
        let top = picture.lanes.top();
        let bottom = picture.lanes.bottom;
        picture.open("held-up", held.tick, &title);
        picture.path("moment", &[(x, top), (x, bottom)]);
        picture.triangle("held", (x, lane.top - 8.0), (x, lane.top));
        picture.close();
        let text = format!("waited for {}", held.awaited.name);
        mark(picture, &held.awaited.name, x + 4.0, held.tick, &text);
    }
}

/// Ticks from which on the scenario is another one.
fn draw_changes(picture: &mut Picture, items: &Items) {
    let top = picture.lanes.top();
    let bottom = picture.lanes.bottom;
    let first = picture.lanes.all.first().map(|lane| lane.name.clone());
    for changes in items.changes.chunk_by(|one, next| one.tick == next.tick) {
        let tick = changes[0].tick;
        let x = picture.scale.x(tick);
        for change in changes {
            let title = picture.titles.change(change);
            picture.open("change", tick, &title);
            picture.path("turn", &[(x, top), (x, bottom)]);
            picture.close();
        }

        if let Some(robot) = &first {
            let text = changes::in_words(changes, picture.window.tick_s);
            mark(picture, robot, x + 4.0, tick, &text);
        }
    }
}

/// Puts a label above a lane.
fn mark(picture: &mut Picture, robot: &RobotName, left: f64, tick: Tick, text: &str) {
    let Some(lane) = picture.lanes.lane(robot) else {
        return;
    };

    let width = width_px(text, LABEL_PX);
    let mut candidates = Vec::new();
    for row in [0.0, 1.0] {
        let middle = lane.top - 8.0 - row * 13.0;
        candidates.push(Area::of_label(left, middle, width));
        candidates.push(Area::of_label(left + 34.0, middle, width));
        candidates.push(Area::of_label_before(left - 4.0, middle, width));
    }
    place(picture, &candidates, tick, text.to_owned());
}

fn place(picture: &mut Picture, candidates: &[Area], tick: Tick, text: String) {
    if let Some(area) = picture.labels.place(candidates) {
        picture.placed.push(Label {
            area,
            class: "mark",
            tick,
            prefix: "",
            text,
        });
    }
}
