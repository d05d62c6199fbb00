//! The space-time diagram of a run, as one SVG text: robots are lanes, time is to scale in ticks, commands are slanted lines.
//!
//! Pure: events of ticks go in ([`Diagram::tick`]), text comes out ([`Diagram::to_svg`]). The same events give the same bytes.
//! What was in progress when the window began is known from the events before it ([`Timeline`]).

mod changes;
mod commands;
mod cuts;
mod decisions;
mod draw;
mod items;
mod lanes;
mod legend;
mod picture;
mod robots;
mod time_axis;
mod words;

use protocol::messages::Awaited;
use protocol::{Event, Tick};
use timeline::{Span, StateKind, StateOrder, Timeline};

use crate::data::{DataRow, digits};

use self::draw::draw;
use self::items::{HeldTick, Items};
use self::picture::VisibleTicks;

pub use self::draw::DiagramOptions;

/// Most things in a diagram: bands, commands, marks. A picture with this many has about 4 MB.
pub const MAX_ITEMS: usize = 12_000;

/// The window has more things than can be drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the window has {items} bands, commands and marks, and a diagram has at most {MAX_ITEMS}")]
pub struct TooMuch {
    /// Number of things in the window.
    pub items: usize,
}

/// The diagram of a window of ticks.
#[derive(Debug, Clone)]
pub struct Diagram {
    timeline: Timeline,
    /// Up to the last tick so far.
    window: VisibleTicks,
    options: DiagramOptions,
    items: Items,
    /// Number of things beyond [`MAX_ITEMS`], which are not kept.
    beyond: usize,
}

impl Diagram {
    /// A diagram of no tick yet. `timeline` is that after the tick before `from`; a tick lasts `tick_s` simulated seconds.
    #[must_use]
    pub fn new(timeline: Timeline, tick_s: f64, from: Tick, options: DiagramOptions) -> Self {
        Self {
            timeline,
            window: VisibleTicks {
                from,
                to: from,
                tick_s,
                has_end: false,
            },
            options,
            items: Items::default(),
            beyond: 0,
        }
    }

    /// Adds what happened in a tick. `awaited` are the robots for which the clock was held.
    pub fn tick(&mut self, tick: Tick, events: &[Event], awaited: &[Awaited]) {
        self.window.to = self.window.to.max(tick);
        let mut items = Items::default();

        for event in events {
            for span in self.timeline.apply(tick, event) {
                self.add(span, &mut items);
            }
            items.push_site(tick, event);
            self.window.has_end |= matches!(event, Event::End { .. });
        }
        let held_up = awaited.iter().cloned();
        let held_up = held_up.map(|awaited| HeldTick { tick, awaited });
        items.held_up.extend(held_up);

        if self.items.count() <= MAX_ITEMS {
            self.items.append(items);
        } else {
            self.beyond += items.count();
        }
    }

    /// The picture.
    ///
    /// # Errors
    /// [`TooMuch`] if the window has more than [`MAX_ITEMS`] things.
    pub fn to_svg(&self) -> Result<String, TooMuch> {
        let items = self.shown();
        let count = items.count() + self.beyond;
        if count > MAX_ITEMS {
            return Err(TooMuch { items: count });
        }

        Ok(draw(
            &self.timeline,
            &items,
            self.window,
            &self.options,
            None,
        ))
    }

    /// The last of several diagrams with a legend of all of them; `None` if there is none, or one has too much.
    pub(crate) fn svg_with_legend(diagrams: &[Self]) -> Option<String> {
        let (first, last) = (diagrams.first()?, diagrams.last()?);
        let mut all = Items::default();
        for diagram in diagrams {
            all.append(diagram.shown());
        }
        let window = VisibleTicks {
            from: first.window.from,
            ..last.window
        };
        let own = last.shown();
        (own.count() + last.beyond <= MAX_ITEMS).then(|| {
            let legend = Some((&all, window));
            draw(&last.timeline, &own, last.window, &last.options, legend)
        })
    }

    /// What it shows, with what is in progress.
    fn shown(&self) -> Items {
        let mut items = self.items.clone();
        for span in self.timeline.in_progress() {
            self.add(span, &mut items);
        }
        items
    }

    /// First and last moment, simulated seconds.
    pub(crate) fn window_s(&self) -> (f64, f64) {
        let tick_s = self.window.tick_s;
        let ends = [self.window.from, self.window.end()];
        let [from, to] = ends.map(|tick| tick as f64 * tick_s);
        (from, to)
    }

    /// The emotions and behaviors that have their colors by it.
    pub(crate) fn names(&self) -> StateOrder {
        let mut names = self.options.names.clone();
        names.add_all(self.timeline.names());
        names
    }

    /// The states of a kind that the robots have had so far.
    pub(crate) fn states(&self, kind: StateKind) -> Vec<&String> {
        self.timeline.names().of(kind).iter().collect()
    }

    /// Its bands and commands as rows, in seconds.
    pub(crate) fn data(&self) -> Vec<DataRow> {
        let seconds = |tick: Tick| digits(tick as f64 * self.window.tick_s);
        let items = self.shown();
        let mut rows = Vec::new();
        for band in &items.bands {
            if let Some((begin, end)) = self.window.clip(band.period) {
                rows.push(vec![
                    ("kind", band.kind.as_str().to_owned()),
                    ("robot", band.robot.to_string()),
                    ("state", band.name.clone()),
                    ("from_s", seconds(begin)),
                    ("to_s", seconds(end)),
                    ("to_robot", String::new()),
                ]);
            }
        }
        for command in &items.commands {
            for end in &command.ends {
                rows.push(vec![
                    ("kind", "command".to_owned()),
                    ("robot", command.from.to_string()),
                    ("text", command.text.clone()),
                    ("from_s", seconds(command.sent)),
                    ("to_s", seconds(end.tick)),
                    ("to_robot", command.to.to_string()),
                    ("lost", end.lost.is_some().to_string()),
                ]);
            }
        }
        rows
    }

    /// Adds what is shown.
    fn add(&self, span: Span, items: &mut Items) {
        if self.options.queries || !matches!(span, Span::QueriesLost(_)) {
            items.push(span);
        }
    }
}
