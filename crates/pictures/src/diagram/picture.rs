//! A picture that is being drawn: where ticks and robots are, and labels that are placed at the end.

use protocol::Tick;

use crate::diagram::items::Period;
use crate::diagram::labels::{Area, Labels};
use crate::diagram::lanes::Lanes;
use crate::markup::{Markup, number};
use crate::diagram::scale::Scale;
use crate::diagram::words::Titles;

/// Font of labels, pixels.
pub(crate) const LABEL_PX: f64 = 10.5;
/// Distance of the captions below the lanes from where the lanes begin, pixels.
pub(crate) const CAPTION_PX: f64 = 22.0;
/// Font of the text above the lanes, pixels.
pub(crate) const HEADING_PX: f64 = 12.0;
/// How far lines reach out of the window when they come from before it or go on after it, pixels.
pub(crate) const OUTSIDE_PX: f64 = 10.0;

/// The ticks that are shown.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    pub(crate) from: Tick,
    /// The last one.
    pub(crate) to: Tick,
    /// Length of a tick, simulated seconds.
    pub(crate) tick_s: f64,
    /// Whether the run ended with the last tick.
    pub(crate) has_end: bool,
}

impl Window {
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
pub(crate) struct Label {
    pub(crate) area: Area,
    pub(crate) class: &'static str,
    pub(crate) tick: Tick,
    /// Put before the text, less prominently.
    pub(crate) prefix: &'static str,
    pub(crate) text: String,
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
    pub(crate) placed: Vec<Label>,
    pub(crate) window: Window,
    pub(crate) titles: Titles,
}

impl Picture {
    /// The left edge and the width of a period, pixels; `None` if it is not in the window.
    pub(crate) fn extent(&self, period: Period) -> Option<(f64, f64)> {
        let (begin, end) = self.window.clip(period)?;
        let left = self.scale.x(begin);
        Some((left, self.scale.x(end) - left))
    }

    /// The tick that a click on something that began at `begin` shows.
    pub(crate) fn shown(&self, begin: Tick) -> Tick {
        begin.clamp(self.window.from, self.window.to)
    }

    /// Opens a group of elements that belong to one thing.
    pub(crate) fn open(&mut self, class: &str, begin: Tick, title: &str) {
        let tick = self.shown(begin);
        self.svg
            .tag("g")
            .with("class", class)
            .count("data-tick", tick)
            .open();
        self.svg.title(title);
    }

    pub(crate) fn close(&mut self) {
        self.svg.close("g");
    }

    /// Straight lines through these points.
    pub(crate) fn path(&mut self, class: &str, points: &[(f64, f64)]) {
        let mut d = String::new();
        for (index, (x, y)) in points.iter().enumerate() {
            let letter = if index == 0 { 'M' } else { 'L' };
            d.push(letter);
            d += &number(*x);
            d.push(' ');
            d += &number(*y);
        }

        self.svg
            .tag("path")
            .with("class", class)
            .with("d", &d)
            .empty();
    }

    /// A cross.
    pub(crate) fn cross(&mut self, class: &str, x: f64, y: f64) {
        const ARM_PX: f64 = 4.0;

        let d = format!(
            "M{} {}l8 8M{} {}l8 -8",
            number(x - ARM_PX),
            number(y - ARM_PX),
            number(x - ARM_PX),
            number(y + ARM_PX)
        );
        self.svg
            .tag("path")
            .with("class", class)
            .with("d", &d)
            .empty();
    }

    /// A filled triangle whose tip is at `tip`, in the direction from `base`.
    pub(crate) fn triangle(&mut self, class: &str, base: (f64, f64), tip: (f64, f64)) {
        const LENGTH_PX: f64 = 7.0;
        const HALF_WIDTH_PX: f64 = 3.0;
        let dx = tip.0 - base.0;
        let dy = tip.1 - base.1;
        let length = (dx * dx + dy * dy).sqrt().max(0.1);
        // Of length 1, along the line.
        let along = (dx / length, dy / length);

        let foot_x = tip.0 - LENGTH_PX * along.0;
        let foot_y = tip.1 - LENGTH_PX * along.1;
        let aside_x = HALF_WIDTH_PX * along.1;
        let aside_y = HALF_WIDTH_PX * along.0;
        let one = (foot_x - aside_x, foot_y + aside_y);
        let other = (foot_x + aside_x, foot_y - aside_y);
        self.path(class, &[tip, one, other]);
    }

    pub(crate) fn rect(&mut self, class: &str, left: f64, top: f64, width: f64, height: f64) {
        self.svg
            .tag("rect")
            .with("class", class)
            .at("x", left)
            .at("y", top)
            .at("width", width.max(0.3))
            .at("height", height)
            .empty();
    }

    /// A text; `anchor` is its alignment as in SVG.
    pub(crate) fn text(&mut self, class: &str, x: f64, y: f64, anchor: &str, text: &str) {
        let mut tag = self
            .svg
            .tag("text")
            .with("class", class)
            .at("x", x)
            .at("y", y);
        if anchor != "start" {
            tag = tag.with("text-anchor", anchor);
        }
        tag.content(text);
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
        let x = if area.is_before {
            area.left + area.width
        } else {
            area.left
        };

        let mut tag = self
            .svg
            .tag("text")
            .with("class", &format!("label {}", label.class))
            .at("x", x)
            .at("y", area.top + 10.0)
            .count("data-tick", tick);
        if area.is_before {
            tag = tag.with("text-anchor", "end");
        }
        if label.prefix.is_empty() {
            tag.content(&label.text);
            return;
        }

        tag.open();
        self.svg
            .tag("tspan")
            .with("class", "performative")
            .content(&format!("{} ", label.prefix));
        self.svg.tag("tspan").content(&label.text);
        self.svg.close("text");
    }
}
