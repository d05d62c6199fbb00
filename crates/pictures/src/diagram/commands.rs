//! Draws commands: slanted lines from the tick they were sent to the tick they arrived, or were lost.

use std::collections::BTreeMap;

use protocol::event::Cause;
use protocol::{RobotName, Tick};
use timeline::{CommandEnd, CommandSpan, QueriesLost};

use crate::diagram::items::Items;
use crate::diagram::picture::{LabelPosition, OUTSIDE_PX, Picture};
use crate::diagram::words;
use crate::labels::{Area, shortened};
use crate::shapes::Pixel;

/// Distance of the first wait from the target's lane, pixels.
const WAIT_PX: f64 = 12.0;
/// Distance between two waits at the same time, pixels.
const NEXT_WAIT_PX: f64 = 5.0;
/// Most waits beside each other; more are drawn over the last one.
const MAX_WAITS: usize = 6;
/// How far the two ends of a doubled command are from where it arrives, pixels.
const FORK_PX: f64 = 4.0;
/// Distance within which a label of a broadcast is not repeated, pixels.
const REPEATED_PX: f64 = 240.0;
/// Most letters of a command in a label.
const LABEL_LETTERS: usize = 24;

type Spoken<'a> = (&'a RobotName, Tick, &'a str);

/// Where the waits at each lane end, by index of the lane and whether the commands come from above.
type Waits = BTreeMap<(usize, bool), Vec<f64>>;

/// The way of a command over the picture.
#[derive(Default)]
struct Route {
    /// To where it waits, arrives, forks or is lost.
    line: Vec<Pixel>,
    /// Where it waits; empty if it does not.
    wait: Vec<Pixel>,
    /// After the wait or the fork.
    branches: Vec<[Pixel; 2]>,
    /// Tips of arrows, each with the point before it.
    heads: Vec<[Pixel; 2]>,
    /// Breaks, each with its reason.
    breaks: Vec<(Pixel, Cause)>,
}

/// A label that is placed after all lines are known.
pub(crate) struct PendingLabel<'a> {
    command: &'a CommandSpan,
    /// Whether it is one of several with the same text in the same tick.
    is_broadcast: bool,
    /// The line beside which the text is put.
    beside: [Pixel; 2],
    breaks: Vec<(Pixel, Cause)>,
}

/// Draws the commands, in the order in which they were sent. Returns the labels that are to be placed.
pub(crate) fn draw_commands<'a>(picture: &mut Picture, items: &'a Items) -> Vec<PendingLabel<'a>> {
    let mut commands: Vec<&CommandSpan> = items.commands.iter().collect();
    commands.sort_by_key(|command| (command.sent, &command.from, command.seq));

    let mut targets: BTreeMap<Spoken<'_>, usize> = BTreeMap::new();
    for command in &commands {
        *targets.entry(spoken(command)).or_default() += 1;
    }
    let mut waits = Waits::new();
    let mut wanted = Vec::new();
    for command in commands {
        let is_broadcast = targets
            .get(&spoken(command))
            .is_some_and(|count| *count > 1);
        wanted.extend(draw_command(picture, command, is_broadcast, &mut waits));
    }
    wanted
}

/// What a robot sends in a tick: sender, tick and text.
fn spoken(command: &CommandSpan) -> Spoken<'_> {
    (&command.from, command.sent, &command.text)
}

fn draw_command<'a>(
    picture: &mut Picture,
    command: &'a CommandSpan,
    is_broadcast: bool,
    waits: &mut Waits,
) -> Option<PendingLabel<'a>> {
    let route = route(picture, command, waits)?;
    let is_lost = command.is_lost();
    let is_over = command.ends.len() == command.copies() || is_lost;
    let fate = match (is_lost, is_over) {
        (true, _) => "lost",
        (false, true) => "delivered",
        (false, false) => "under-way",
    };
    let comes_in = command.sent < picture.window.from;
    let mut class = format!("command {fate}");
    for (applies, word) in [
        (command.until.is_some(), " delayed"),
        (command.is_doubled, " doubled"),
        (is_broadcast, " broadcast"),
        (comes_in, " enters"),
        (!is_over, " leaves"),
    ] {
        class += if applies { word } else { "" };
    }

    let title = picture.titles.command(command);
    let tick = picture.shown(command.sent);
    picture
        .svg
        .tag("g")
        .class(&class)
        .count("data-tick", tick)
        .with("data-from", command.from.as_str())
        .with("data-to", command.to.as_str())
        .count("data-seq", command.seq)
        .open();
    picture.svg.title(&title);
    draw_route(picture, &route, comes_in);
    picture.close();

    let beside = match route.line[..] {
        [first, .., last] => [first, last],
        _ => [*route.wait.first()?, *route.wait.last()?],
    };
    Some(PendingLabel {
        command,
        is_broadcast,
        beside,
        breaks: route.breaks,
    })
}

fn draw_route(picture: &mut Picture, route: &Route, comes_in: bool) {
    let mut lines: Vec<(&str, &[Pixel])> = vec![("line", &route.line), ("wait", &route.wait)];
    lines.extend(route.branches.iter().map(|branch| ("line", &branch[..])));
    for (class, points) in lines {
        if !points.is_empty() {
            picture.line(class, points);
        }
        for ends in points.windows(2) {
            picture.labels.avoid_line(ends[0], ends[1]);
        }
    }

    if !comes_in && let Some((x, y)) = route.line.first() {
        let circle = picture.svg.tag("circle").class("start");
        circle.at("cx", *x).at("cy", *y).at("r", 2.0).empty();
    }
    for [from, to] in &route.heads {
        picture.svg.triangle("head", *from, *to);
    }
    for ((x, y), _) in &route.breaks {
        picture.svg.cross("break", (*x, *y));
        let area = Area::between((x - 5.0, y - 5.0), (x + 5.0, y + 5.0));
        picture.labels.take(area);
    }
}

/// Where a command begins and which lane it goes to.
struct CommandCourse {
    start: Pixel,
    /// The edge of the target's lane, or a place beside that of the sender if the target has none.
    end_y: f64,
    /// 1 if it goes down, -1 if it goes up.
    down: f64,
    /// Index of the lane beside which it waits, and whether it comes from above.
    waits_at: (usize, bool),
    is_to_itself: bool,
}

/// The course of a command; `None` if its sender has no lane.
fn course(picture: &Picture, command: &CommandSpan) -> Option<CommandCourse> {
    let sender = picture.lanes.index(&command.from)?;
    let target = picture.lanes.index(&command.to);
    let goes_down = target.is_none_or(|target| target >= sender);
    let lane = &picture.lanes.all[sender];
    let start_y = if goes_down { lane.bottom } else { lane.top };
    let end_y = match target {
        Some(target) if target == sender => start_y,
        Some(target) if goes_down => picture.lanes.all[target].top,
        Some(target) => picture.lanes.all[target].bottom,
        None => start_y + 44.0,
    };

    let start_x = if command.sent < picture.window.from {
        picture.scale.begin_px() - OUTSIDE_PX
    } else {
        picture.x(command.sent)
    };
    Some(CommandCourse {
        start: (start_x, start_y),
        end_y,
        down: if goes_down { 1.0 } else { -1.0 },
        waits_at: (target.unwrap_or(sender), goes_down),
        is_to_itself: target == Some(sender),
    })
}

/// The way of a command; `None` if its sender has no lane or it was over before the window.
fn route(picture: &Picture, command: &CommandSpan, waits: &mut Waits) -> Option<Route> {
    let last_end = command.ends.iter().map(|end| end.tick).max();
    if last_end.is_some_and(|tick| tick < picture.window.from) {
        return None;
    }

    let course = course(picture, command)?;
    let mut route = Route {
        line: vec![course.start],
        ..Route::default()
    };
    match (command.until, last_end) {
        (Some(until), _) => {
            let over = last_end.unwrap_or(until);
            add_wait(&mut route, picture, command, &course, over, waits);
        }
        (None, Some(tick)) => {
            let end = (picture.x(tick), course.end_y);
            let mut turn = course.start;
            if course.is_to_itself {
                // Down and up again.
                turn = ((turn.0 + end.0) / 2.0, turn.1 + 16.0);
                route.line.push(turn);
            }
            add_ends(&mut route, command, turn, end, course.down);
        }
        (None, None) => {
            let out_x = picture.scale.end_px() + OUTSIDE_PX;
            let half_y = (course.start.1 + course.end_y) / 2.0;
            route.line.push((out_x, half_y));
        }
    }
    Some(route)
}

/// Adds the wait of a command that the medium holds back until tick `over`, and what becomes of it then.
fn add_wait(
    route: &mut Route,
    picture: &Picture,
    command: &CommandSpan,
    course: &CommandCourse,
    over: Tick,
    waits: &mut Waits,
) {
    const TURN_PX: f64 = 5.0;
    let window = picture.window;
    let is_over = !command.ends.is_empty();
    let waits_already = command.sent + 1 < window.from;
    let begin_x = if waits_already {
        course.start.0
    } else {
        picture.x(command.sent + 1)
    };
    let end_x = if over > window.to {
        picture.scale.end_px() + OUTSIDE_PX
    } else {
        picture.x(over)
    };

    let slot = take_slot(waits, course.waits_at, begin_x, end_x);
    let wait_y = course.end_y - course.down * (WAIT_PX + NEXT_WAIT_PX * slot as f64);
    if waits_already {
        route.line.clear();
    } else {
        route.line.push((begin_x, wait_y));
    }
    let turn_x = if is_over {
        (end_x - TURN_PX).max(begin_x)
    } else {
        end_x
    };
    route.wait = vec![(begin_x, wait_y), (turn_x, wait_y)];
    let end = (end_x, course.end_y);
    add_ends(route, command, (turn_x, wait_y), end, course.down);
}

/// Takes the first place for a wait that is free from `begin_x` on.
fn take_slot(waits: &mut Waits, key: (usize, bool), begin_x: f64, end_x: f64) -> usize {
    let ends = waits.entry(key).or_default();
    let free = ends.iter().position(|end| *end < begin_x);
    let slot = free.unwrap_or(ends.len()).min(MAX_WAITS - 1);
    if slot == ends.len() {
        ends.push(end_x);
    } else {
        ends[slot] = ends[slot].max(end_x);
    }
    slot
}

/// Adds what becomes of a command that has come to `turn` and is to arrive at `end`.
fn add_ends(route: &mut Route, command: &CommandSpan, turn: Pixel, end: Pixel, down: f64) {
    let is_waiting = !route.wait.is_empty();
    let fork = if command.is_doubled && !is_waiting {
        at_share(turn, end, 0.6)
    } else {
        turn
    };
    if fork != turn {
        route.line.push(fork);
    }

    for (index, CommandEnd { lost, .. }) in command.ends.iter().enumerate() {
        let aside = match (command.is_doubled, index) {
            (false, _) => 0.0,
            (true, 0) => -FORK_PX,
            (true, _) => FORK_PX,
        };
        let place = (end.0 + aside, end.1);
        let last = match lost {
            None => place,
            Some(Cause::Missed | Cause::Overflow) => (place.0, place.1 - down * 9.0),
            Some(_) if is_waiting => (end.0, turn.1),
            Some(_) => (place.0, (turn.1 + end.1) / 2.0),
        };
        let is_straight = !command.is_doubled && !is_waiting && route.line.len() == 1;
        if is_straight {
            route.line.push(last);
        } else {
            route.branches.push([fork, last]);
        }
        match lost {
            None => route.heads.push([fork, place]),
            Some(because) => route.breaks.push((last, *because)),
        }
    }
}

/// Places the texts of commands, and why they were lost. A broadcast has its text once, and each reason once, and so do broadcasts with
/// this text that follow within [`REPEATED_PX`].
pub(crate) fn place_labels(picture: &mut Picture, wanted: &[PendingLabel<'_>]) {
    // The ends of the areas in which a label of a broadcast, the text or a reason, is not repeated.
    let mut said: BTreeMap<(&RobotName, &str, Option<Cause>), f64> = BTreeMap::new();
    for label in wanted {
        let CommandSpan { from, text, .. } = label.command;
        let x = label.beside[0].0;
        let is_new = |end: Option<&f64>| !label.is_broadcast || end.is_none_or(|end| x >= *end);

        let key = (from, text.as_str(), None);
        if is_new(said.get(&key)) && place_text(picture, label) {
            said.insert(key, x + REPEATED_PX);
        }
        for (place, because) in &label.breaks {
            let key = (from, text.as_str(), Some(*because));
            let is_placed = is_new(said.get(&key))
                && place_reason(picture, label.command.sent, *place, *because);
            if is_placed {
                said.insert(key, x + REPEATED_PX);
            }
        }
    }
}

/// Places the text of a command; returns whether there is space for it.
fn place_text(picture: &mut Picture, wanted: &PendingLabel<'_>) -> bool {
    let tick = wanted.command.sent;
    let text = shortened(&wanted.command.text, LABEL_LETTERS);
    let performative = wanted.command.performative.name();
    let places = beside(wanted.beside);
    // With the performative if there is enough space.
    picture.label_with_prefix("text", tick, performative, text.clone(), &places)
        || picture.label_with_prefix("text", tick, "", text, &places)
}

/// Places why a command was lost; returns whether there is space for it.
fn place_reason(picture: &mut Picture, tick: Tick, (x, y): Pixel, because: Cause) -> bool {
    let mut places = Vec::new();
    for middle in [y, y + 12.0, y - 12.0] {
        places.push(LabelPosition::After(x + 8.0, middle));
        places.push(LabelPosition::Before(x - 8.0, middle));
    }
    let text = words::cause(because).to_owned();
    picture.label_with_prefix("reason", tick, "", text, &places)
}

/// Places for a label beside a line.
fn beside([from, to]: [Pixel; 2]) -> Vec<LabelPosition> {
    let mut places = Vec::new();
    for distance in [6.0, 14.0] {
        for share in [0.5, 0.35, 0.65, 0.22, 0.78] {
            let (x, y) = at_share(from, to, share);
            places.push(LabelPosition::After(x + distance, y));
            places.push(LabelPosition::Before(x - distance, y));
        }
    }
    places
}

/// The point that is at this share of a line.
fn at_share(from: Pixel, to: Pixel, share: f64) -> Pixel {
    let x = from.0 + share * (to.0 - from.0);
    (x, from.1 + share * (to.1 - from.1))
}

/// Draws the queries that were lost: dashes at the lane of the robot that would have asked, with a stub towards the other.
pub(crate) fn draw_queries(picture: &mut Picture, items: &Items) {
    for lost in &items.queries {
        draw_lost_queries(picture, lost);
    }
}

fn draw_lost_queries(picture: &mut Picture, lost: &QueriesLost) {
    let Some((left, width)) = picture.extent(lost.period) else {
        return;
    };
    let Some(asker) = picture.lanes.index(&lost.from) else {
        return;
    };
    let target = picture.lanes.index(&lost.to);
    let goes_down = target.is_none_or(|target| target > asker);
    let lane = &picture.lanes.all[asker];
    let (edge, stub) = if goes_down {
        (lane.bottom + 3.0, lane.bottom + 9.0)
    } else {
        (lane.top - 3.0, lane.top - 9.0)
    };

    let title = picture.titles.queries(lost);
    picture.open_ticks("queries", lost.period, &title);
    picture.line("query", &[(left, stub), (left, edge), (left + width, edge)]);
    picture.close();
}
