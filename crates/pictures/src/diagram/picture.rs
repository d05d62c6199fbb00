//! A picture that is being drawn: where ticks and robots are, and labels that are placed at the end.

use protocol::{RobotName, Tick};
use timeline::{Period, StateOrder};

use crate::diagram::lanes::{Lane, Lanes};
use crate::diagram::words::Titles;
use crate::labels::{Area, Labels, width_px};
use crate::markup::Markup;
use crate::scale::Scale;
use crate::shapes::{LABEL_PX, Pixel};

/// Distance of the captions below the lanes from where the lanes begin, pixels.
pub(crate) const CAPTION_PX: f64 = 22.0;
/// Font of the text above the lanes, pixels.
pub(crate) const HEADING_PX: f64 = 12.0;
/// How far lines reach out of the window when they come from before it or go on after it, pixels.
pub(crate) const OUTSIDE_PX: f64 = 10.0;

/// The ticks that are shown.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VisibleTicks {
    pub(crate) from: Tick,
    /// The last one.
    pub(crate) to: Tick,
    /// Length of a tick, simulated seconds.
    pub(crate) tick_s: f64,
    /// Whether the run ended with the last tick.
    pub(crate) has_end: bool,
}

impl VisibleTicks {
    /// The tick after the last one.
    pub(crate) fn end(&self) -> Tick {
        self.to.saturating_add(1)
    }

    /// The part of a period that is shown; `None` if there is none.
    pub(crate) fn clip(&self, period: Period) -> Option<(Tick, Tick)> {
        let begin = period.begin.max(self.from);
        let end = period.end.unwrap_or(self.end()).min(self.end());
        (begin < end).then_some((begin, end))
    }
}

/// A label that has its place.
#[derive(Debug)]
struct Label {
    area: Area,
    class: &'static str,
    tick: Tick,
    /// Put before the text, less prominently.
    prefix: &'static str,
    text: String,
}

/// A place for a label: its left or its right end, and its middle.
#[derive(Debug, Clone, Copy)]
pub(crate) enum LabelPosition {
    After(f64, f64),
    Before(f64, f64),
}

/// A picture that is being drawn.
#[derive(Debug)]
pub(crate) struct Picture {
    pub(crate) svg: Markup,
    pub(crate) lanes: Lanes,
    pub(crate) scale: Scale,
    /// The right end of what is above and below the lanes, which may be narrower, pixels.
    pub(crate) right_px: f64,
    pub(crate) labels: Labels,
    /// Labels are drawn after everything else.
    placed: Vec<Label>,
    pub(crate) window: VisibleTicks,
    pub(crate) titles: Titles,
    /// The emotions and behaviors of the run up to the end of the window, which have their colors by it.
    pub(crate) names: StateOrder,
}

impl Picture {
    /// A picture in which nothing is drawn yet. What is above and below the lanes has at least `least_px`.
    pub(crate) fn new(
        lanes: Lanes,
        scale: Scale,
        least_px: f64,
        window: VisibleTicks,
        names: StateOrder,
    ) -> Self {
        let (left, right) = (scale.begin_px(), scale.end_px());
        let right_px = right.max(left + least_px);
        let mut labels = Labels::between(left, right_px + OUTSIDE_PX);
        for lane in &lanes.all {
            labels.take(Area::between((left, lane.top), (right, lane.bottom)));
        }

        Self {
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
            names,
        }
    }

    /// Where a tick begins. Ticks outside of the window are at its edges.
    pub(crate) fn x(&self, tick: Tick) -> f64 {
        self.scale.at(tick as f64)
    }

    /// The left edge and the width of a period, pixels; `None` if it is not in the window.
    pub(crate) fn extent(&self, period: Period) -> Option<(f64, f64)> {
        let (begin, end) = self.window.clip(period)?;
        let left = self.x(begin);
        Some((left, (self.x(end) - left).max(0.3)))
    }

    /// The lane of a robot with the left edge and the width of a period on it; `None` if it is not in the picture.
    pub(crate) fn on_lane(&self, robot: &RobotName, period: Period) -> Option<(Lane, f64, f64)> {
        let (left, width) = self.extent(period)?;
        Some((self.lanes.lane(robot)?.clone(), left, width))
    }

    /// The tick that a click on something that began at `begin` shows.
    pub(crate) fn shown(&self, begin: Tick) -> Tick {
        begin.clamp(self.window.from, self.window.to)
    }

    /// Opens a group of elements that belong to one thing.
    pub(crate) fn open(&mut self, class: &str, begin: Tick, title: &str) {
        let tick = self.shown(begin);
        let tag = self.svg.tag("g").class(class);
        tag.count("data-tick", tick).open();
        self.svg.title(title);
    }

    /// Opens a group of elements that belong to consecutive ticks.
    pub(crate) fn open_ticks(&mut self, class: &str, period: Period, title: &str) {
        let tick = self.shown(period.begin);
        let tag = self.svg.tag("g").class(class);
        tag.count("data-tick", tick)
            .count("data-ticks", period.ticks(period.begin + 1))
            .open();
        self.svg.title(title);
    }

    pub(crate) fn close(&mut self) {
        self.svg.close("g");
    }

    /// Straight lines through these points.
    pub(crate) fn line(&mut self, class: &str, points: &[Pixel]) {
        self.svg.line(class, points);
    }

    /// Puts a label at the first of these places that is free. Without one it is left out.
    pub(crate) fn label(
        &mut self,
        class: &'static str,
        tick: Tick,
        text: impl Into<String>,
        places: &[LabelPosition],
    ) {
        self.label_with_prefix(class, tick, "", text.into(), places);
    }

    /// Puts a label with a prefix at the first of these places that is free; returns whether there is one.
    pub(crate) fn label_with_prefix(
        &mut self,
        class: &'static str,
        tick: Tick,
        prefix: &'static str,
        text: String,
        places: &[LabelPosition],
    ) -> bool {
        let mut width = width_px(&text, LABEL_PX);
        if !prefix.is_empty() {
            width += width_px(prefix, LABEL_PX) + width_px(" ", LABEL_PX);
        }
        let mut candidates = Vec::new();
        for place in places {
            candidates.push(match *place {
                LabelPosition::After(left, middle) => Area::after(left, middle, width),
                LabelPosition::Before(right, middle) => Area::before(right, middle, width),
            });
        }

        let area = self.labels.place(&candidates);
        self.placed.extend(area.map(|area| Label {
            area,
            class,
            tick,
            prefix,
            text,
        }));
        area.is_some()
    }

    /// Draws the labels.
    pub(crate) fn draw_labels(&mut self) {
        for label in std::mem::take(&mut self.placed) {
            self.draw_label(&label);
        }
    }

    fn draw_label(&mut self, label: &Label) {
        let tick = self.shown(label.tick);
        let area = label.area;
        let (x, anchor) = if area.is_before {
            (area.left + area.width, "end")
        } else {
            (area.left, "start")
        };

        let tag = self.svg.tag("text");
        let tag = tag.class(&format!("label {}", label.class));
        let tag = tag.at("x", x).at("y", area.top + 10.0);
        let tag = tag.count("data-tick", tick).anchor(anchor);
        if label.prefix.is_empty() {
            tag.content(&label.text);
            return;
        }

        tag.open();
        let prefix = self.svg.tag("tspan").class("performative");
        prefix.content(&format!("{} ", label.prefix));
        self.svg.tag("tspan").content(&label.text);
        self.svg.close("text");
    }
}
