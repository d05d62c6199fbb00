//! Draws what the robots do: bands of emotions and behaviors, and what becomes of their processes.

use protocol::{RobotName, Tick};
use timeline::{StateKind, StateSpan};

use crate::diagram::changes;
use crate::diagram::items::Items;
use crate::diagram::lanes::{BEHAVIOR_PX, EMOTION_PX, STRIP_PX};
use crate::diagram::picture::{LabelPosition, Picture};
use crate::diagram::words::fault_name;
use crate::labels::{shortened, width_px};
use crate::palette::state_look;
use crate::shapes::{LABEL_PX, SMALL_PX};

/// Most letters of the name of an emotion or a behavior.
const NAME_LETTERS: usize = 40;
/// Most letters of the label of an act on a site.
const SITE_LETTERS: usize = 32;

/// Draws the bands.
pub(crate) fn draw_bands(picture: &mut Picture, items: &Items) {
    for band in &items.bands {
        draw_band(picture, band);
    }
}

fn draw_band(picture: &mut Picture, band: &StateSpan) {
    let Some((lane, left, width)) = picture.on_lane(&band.robot, band.period) else {
        return;
    };
    let emotion_top = lane.top + STRIP_PX;
    let (class, top, height, font, font_px) = match band.kind {
        StateKind::Emotion => ("emotion", emotion_top, EMOTION_PX, "", LABEL_PX),
        StateKind::Behavior => {
            let top = emotion_top + EMOTION_PX;
            ("behavior", top, BEHAVIOR_PX, "small ", SMALL_PX)
        }
    };

    let title = picture.titles.band(band);
    picture.open(class, band.period.begin, &title);
    let look = state_look(band.kind, &band.name, &picture.names);
    let svg = &mut picture.svg;
    svg.state(&look, "band", (left, top), (width, height));
    let name = shortened(&band.name, NAME_LETTERS);
    if width_px(&name, font_px) + 6.0 <= width {
        let class = format!("{font}on-{}", look.class());
        let baseline = top + height / 2.0 + font_px * 0.36;
        svg.text(&class, left + 4.0, baseline, "start", &name);
    }
    picture.close();
}

/// Draws faults, absences, returns, ticks that were missed or held up, acts on sites, and changes of the scenario.
pub(crate) fn draw_processes(picture: &mut Picture, items: &Items) {
    draw_missed(picture, items);
    draw_faults(picture, items);
    draw_absences(picture, items);
    draw_joined(picture, items);
    draw_held_up(picture, items);
    draw_sites(picture, items);
    draw_changes(picture, items);
}

/// Ticks that a robot missed are hatched.
fn draw_missed(picture: &mut Picture, items: &Items) {
    const STEP_PX: f64 = 6.0;
    for missed in &items.missed {
        let Some((lane, left, width)) = picture.on_lane(&missed.robot, missed.period) else {
            continue;
        };

        let title = picture.titles.missed(missed);
        picture.open_ticks("missed", missed.period, &title);
        let top = lane.top + STRIP_PX;
        let mut x = left;
        while x < left + width {
            let right = (x + STEP_PX).min(left + width);
            picture.line("hatch", &[(x, lane.bottom), (right, top)]);
            x += STEP_PX;
        }
        picture.close();
    }
}

fn draw_faults(picture: &mut Picture, items: &Items) {
    for fault in &items.faults {
        let Some((lane, left, width)) = picture.on_lane(&fault.robot, fault.period) else {
            continue;
        };

        let title = picture.titles.fault(fault);
        let begin = fault.period.begin;
        let name = fault_name(fault.kind);
        picture.open("fault", begin, &title);
        let svg = &mut picture.svg;
        svg.rect(name, (left, lane.top), width, STRIP_PX - 1.5);
        picture.close();
        mark(picture, &fault.robot, left, begin, name);
    }
}

fn draw_absences(picture: &mut Picture, items: &Items) {
    for absence in &items.absences {
        let Some((lane, left, width)) = picture.on_lane(&absence.robot, absence.period) else {
            continue;
        };

        let title = picture.titles.absence(absence);
        let begin = absence.period.begin;
        let begins_here = begin >= picture.window.from;
        picture.open("absence", begin, &title);
        let top = lane.top + STRIP_PX + 0.5;
        let height = EMOTION_PX + BEHAVIOR_PX - 1.0;
        picture.svg.rect("absent", (left, top), width, height);
        if begins_here {
            let middle = lane.middle() + STRIP_PX / 2.0;
            picture.svg.cross("gone", (left, middle));
        }
        picture.close();
        if begins_here {
            mark(picture, &absence.robot, left, begin, "lost");
        }
    }
}

fn draw_joined(picture: &mut Picture, items: &Items) {
    for joined in &items.joined {
        let Some(bottom) = picture.lanes.lane(&joined.robot).map(|lane| lane.bottom) else {
            continue;
        };

        let title = picture.titles.joined(joined);
        let x = picture.x(joined.tick);
        let base = bottom + 8.0;
        picture.open("joined", joined.tick, &title);
        picture.svg.triangle("back", (x, base), (x, bottom));
        picture.close();

        let text = match joined.generation {
            Some(generation) => format!("back ({generation})"),
            None => "joins".to_owned(),
        };
        let places = [
            LabelPosition::After(x + 6.0, base),
            LabelPosition::Before(x - 6.0, base),
        ];
        picture.label("mark", joined.tick, text, &places);
    }
}

/// Ticks for which the clock was held: for all robots, because of one.
fn draw_held_up(picture: &mut Picture, items: &Items) {
    for held in &items.held_up {
        let robot = &held.awaited.name;
        let Some(top) = picture.lanes.lane(robot).map(|lane| lane.top) else {
            continue;
        };

        let title = picture.titles.held_up(held);
        picture.open("held-up", held.tick, &title);
        let x = draw_moment(picture, "moment", held.tick);
        picture.svg.triangle("held", (x, top - 8.0), (x, top));
        picture.close();
        let text = format!("waited for {robot}");
        mark(picture, robot, x + 4.0, held.tick, &text);
    }
}

/// What robots do to sites: a mark on the lower edge of the lane, and below it what it was, where there is room.
fn draw_sites(picture: &mut Picture, items: &Items) {
    for mark in &items.sites {
        let Some(bottom) = picture.lanes.lane(&mark.robot).map(|lane| lane.bottom) else {
            continue;
        };

        let title = picture.titles.sites(mark);
        let x = picture.x(mark.tick);
        let class = if mark.is_refused() {
            "site refused"
        } else {
            "site"
        };
        picture.open(class, mark.tick, &title);
        picture
            .svg
            .triangle("act", (x, bottom - 1.0), (x, bottom + 6.0));
        picture.close();

        let mut text = shortened(&mark.words[0], SITE_LETTERS);
        if mark.words.len() > 1 {
            text += &format!(", +{}", mark.words.len() - 1);
        }
        let places = [
            LabelPosition::After(x + 6.0, bottom + 7.0),
            LabelPosition::Before(x - 6.0, bottom + 7.0),
            LabelPosition::After(x + 6.0, bottom + 20.0),
        ];
        picture.label("mark", mark.tick, text, &places);
    }
}

/// Ticks from which on the scenario is another one.
fn draw_changes(picture: &mut Picture, items: &Items) {
    let first = picture.lanes.all.first().map(|lane| lane.name.clone());
    for changes in items.changes.chunk_by(|one, next| one.tick == next.tick) {
        let tick = changes[0].tick;
        for change in changes {
            let title = picture.titles.change(change);
            picture.open("change", tick, &title);
            draw_moment(picture, "turn", tick);
            picture.close();
        }

        if let Some(robot) = &first {
            let text = changes::in_words(changes, picture.window.tick_s);
            mark(picture, robot, picture.x(tick) + 4.0, tick, &text);
        }
    }
}

/// Draws a vertical line through all lanes; returns where it is.
fn draw_moment(picture: &mut Picture, class: &str, tick: Tick) -> f64 {
    let x = picture.x(tick);
    let ends = [picture.lanes.top(), picture.lanes.bottom];
    picture.line(class, &ends.map(|y| (x, y)));
    x
}

/// Puts a label above a lane.
fn mark(picture: &mut Picture, robot: &RobotName, left: f64, tick: Tick, text: &str) {
    let Some(lane) = picture.lanes.lane(robot) else {
        return;
    };

    let mut places = Vec::new();
    for middle in [lane.top - 8.0, lane.top - 21.0] {
        places.push(LabelPosition::After(left, middle));
        places.push(LabelPosition::After(left + 34.0, middle));
        places.push(LabelPosition::Before(left - 4.0, middle));
    }
    picture.label("mark", tick, text, &places);
}
