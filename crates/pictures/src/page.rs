//! The page: one HTML file that needs nothing else.

use std::ops::Range;

use crate::markup::Markup;

use crate::diagram::Diagram;
use crate::style::sheet;
use crate::table::Table;
use crate::vega::Chart;

/// What the page may load: nothing. Its style is in it.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:";

/// A text, parts of which stand out.
#[derive(Debug, Clone, Default)]
pub struct Text {
    /// The parts, each with its element; plain text has none.
    parts: Vec<(Option<&'static str>, String)>,
}

impl Text {
    /// Adds plain text.
    #[must_use]
    pub fn text(self, text: impl Into<String>) -> Self {
        self.with(None, text.into())
    }

    /// Adds text with emphasis.
    #[must_use]
    pub fn strong(self, text: impl Into<String>) -> Self {
        self.with(Some("strong"), text.into())
    }

    /// Adds a command, a path, a name from a file.
    #[must_use]
    pub fn code(self, text: impl Into<String>) -> Self {
        self.with(Some("code"), text.into())
    }

    /// The text without what stands out.
    #[must_use]
    pub(crate) fn plain(&self) -> String {
        self.parts.iter().map(|(_, text)| text.as_str()).collect()
    }

    fn with(mut self, element: Option<&'static str>, text: String) -> Self {
        self.parts.push((element, text));
        self
    }

    fn write(&self, markup: &mut Markup) {
        for (element, text) in &self.parts {
            match element {
                Some(element) => markup.tag(element).content(text),
                None => markup.plain(&kept_together(text)),
            }
        }
    }
}

impl<T: Into<String>> From<T> for Text {
    fn from(text: T) -> Self {
        Self::default().text(text)
    }
}

/// A chart among those of a figure.
#[derive(Debug, Clone)]
pub struct ChartPanel {
    /// Heading above the chart; none if it is empty.
    pub heading: String,
    /// The chart, SVG.
    pub svg: String,
    /// What the chart shows.
    pub(crate) chart: Chart,
    /// Whether it is as wide as the page.
    pub(crate) is_wide: bool,
    /// The chart as it is printed, if that is another one.
    printed: Option<String>,
}

impl ChartPanel {
    /// A chart.
    #[must_use]
    pub fn new(heading: impl Into<String>, chart: Chart) -> Self {
        let (svg, is_wide) = match &chart {
            Chart::Bands(chart) => (chart.draw(), true),
            Chart::Course(chart) => (chart.draw(), true),
            Chart::Floor(chart) => (chart.draw(), false),
            Chart::Intervals(chart) => (chart.draw(), false),
            Chart::Matrix(chart) => (chart.draw(), chart.is_wide()),
            Chart::Outcome(chart) => (chart.draw(), true),
            Chart::Steps(chart) => (chart.draw(), false),
            Chart::Trend(chart) => (chart.draw(), false),
            // That of a diagram with too much is not drawn.
            Chart::Diagram(diagram) => (diagram.to_svg().unwrap_or_default(), true),
        };
        Self {
            heading: heading.into(),
            svg,
            chart,
            is_wide,
            printed: None,
        }
    }

    /// The lines of a diagram, from top to bottom, of which the last one has a legend of all of them in print.
    #[must_use]
    pub fn diagram(lines: Vec<Diagram>) -> Vec<Self> {
        let legend = Diagram::svg_with_legend(&lines);
        let lines = lines.into_iter();
        let panels = lines.map(|line| Self::new("", Chart::Diagram(Box::new(line))));
        let mut panels: Vec<Self> = panels.collect();
        if let Some(last) = panels.last_mut() {
            last.printed = legend;
        }
        panels
    }

    /// The chart as it is printed, SVG.
    pub(crate) fn printed(&self) -> &str {
        self.printed.as_ref().unwrap_or(&self.svg)
    }

    /// Its height in print, pixels.
    pub(crate) fn height_px(&self) -> f64 {
        // The root element is the first one with a height.
        let height = self.printed().split_once(" height=\"");
        let height = height.and_then(|(_, rest)| rest.split('"').next()?.parse().ok());
        height.unwrap_or(0.0)
    }
}

/// Charts with one caption, and the same numbers as a table.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// The charts.
    pub panels: Vec<ChartPanel>,
    /// What is shown, with n and the kind of interval.
    pub caption: Text,
    /// The numbers.
    pub table: Option<Table>,
}

impl Figure {
    /// A figure of these charts.
    #[must_use]
    pub fn new(panels: Vec<ChartPanel>, caption: impl Into<Text>, table: Option<Table>) -> Self {
        Self {
            panels,
            caption: caption.into(),
            table,
        }
    }
}

/// A page that is being written.
#[derive(Debug)]
pub struct Page {
    title: String,
    head: Markup,
    body: Markup,
    /// Headings of the sections with their ids.
    sections: Vec<(String, String)>,
    /// The figures, and where they are in the body.
    pub(crate) figures: Vec<(Figure, Range<usize>)>,
    tables: usize,
}

impl Page {
    /// A page with a title. `kind` stands above it.
    #[must_use]
    pub fn new(kind: &str, title: &str) -> Self {
        let mut head = Markup::default();
        head.tag("p").class("kind").content(kind);
        head.tag("h1").content(title);
        Self {
            title: title.to_owned(),
            head,
            body: Markup::default(),
            sections: Vec::new(),
            figures: Vec::new(),
            tables: 0,
        }
    }

    /// Adds a paragraph below the title.
    pub fn lead(&mut self, text: impl Into<Text>) {
        write_text(&mut self.head, "p", "lead", &text.into());
    }

    /// Begins a section; the one before ends.
    pub fn section(&mut self, heading: &str) {
        if !self.sections.is_empty() {
            self.body.close("section");
        }
        let id = format!("section-{}", self.sections.len() + 1);
        self.body.tag("section").with("id", &id).open();
        self.body.tag("h2").content(heading);
        self.sections.push((heading.to_owned(), id));
    }

    /// Adds a heading within a section.
    pub fn heading(&mut self, heading: &str) {
        self.body.tag("h3").content(heading);
    }

    /// Adds a paragraph.
    pub fn paragraph(&mut self, text: impl Into<Text>) {
        write_text(&mut self.body, "p", "", &text.into());
    }

    /// Adds a remark about what is not shown or not known.
    pub fn remark(&mut self, text: impl Into<Text>) {
        write_text(&mut self.body, "p", "remark", &text.into());
    }

    /// Adds a list.
    pub fn list(&mut self, items: &[Text]) {
        self.body.tag("ul").open();
        for item in items {
            write_text(&mut self.body, "li", "", item);
        }
        self.body.close("ul");
    }

    /// Adds a figure and returns its number.
    pub fn figure(&mut self, figure: Figure) -> usize {
        let number = self.figures.len() + 1;
        let begin = self.body.size();
        let body = &mut self.body;
        let id = format!("figure-{number}");
        body.tag("figure").with("id", &id).open();
        body.tag("div").class("panels").open();
        for panel in &figure.panels {
            let class = if panel.is_wide { "panel wide" } else { "panel" };
            body.tag("div").class(class).open();
            if !panel.heading.is_empty() {
                body.tag("p").class("name").content(&panel.heading);
            }
            body.tag("div").class("scroll").open();
            body.add(&panel.svg);
            body.close("div");
            body.close("div");
        }
        body.close("div");

        write_caption(body, &format!("Figure {number}."), &figure.caption);
        if let Some(table) = &figure.table {
            body.tag("details").open();
            let summary = format!("Numbers of figure {number}");
            body.tag("summary").content(&summary);
            table.write(body);
            body.close("details");
        }
        body.close("figure");
        let place = begin..self.body.size();
        self.figures.push((figure, place));
        number
    }

    /// Adds a table.
    pub fn table(&mut self, caption: impl Into<Text>, table: &Table) {
        self.tables += 1;
        let number = self.tables;
        let body = &mut self.body;
        let id = format!("table-{number}");
        body.tag("figure").class("table").with("id", &id).open();
        write_caption(body, &format!("Table {number}."), &caption.into());
        table.write(body);
        body.close("figure");
    }

    /// Adds commands, one a line, to be copied.
    pub fn commands(&mut self, commands: &[String]) {
        self.body.tag("pre").class("command").open();
        for command in commands {
            self.body.tag("code").content(command);
            self.body.add("\n");
        }
        self.body.close("pre");
    }

    /// Adds a file, whole, behind its name.
    pub fn file(&mut self, name: &str, text: &str) {
        self.begin_details(name);
        self.body.tag("pre").lines(text);
        self.end_details();
    }

    /// Opens a part that readers unfold; [`Self::end_details`] closes it.
    pub fn begin_details(&mut self, summary: &str) {
        self.body.tag("details").open();
        self.body.tag("summary").content(summary);
    }

    /// Closes what [`Self::begin_details`] opened.
    pub fn end_details(&mut self) {
        self.body.close("details");
    }

    /// Number of figures so far.
    #[must_use]
    pub fn figures(&self) -> usize {
        self.figures.len()
    }

    /// Number of bytes so far.
    #[must_use]
    pub fn size(&self) -> usize {
        self.body.size()
    }

    /// The page. It is HTML and well-formed XML.
    #[must_use]
    pub fn finish(mut self) -> String {
        if !self.sections.is_empty() {
            self.body.close("section");
        }

        let mut page = begin(&self.title);
        page.tag("header").open();
        page.add(&self.head.finish());
        write_contents(&mut page, &self.sections);
        page.close("header");
        page.add(&self.body.finish());
        end(page)
    }

    /// The figures of the page, each as a page of its own.
    #[must_use]
    pub fn into_figures(self) -> Vec<String> {
        let body = self.body.finish();
        let mut pages = Vec::new();
        for (_, place) in self.figures {
            let mut page = begin(&self.title);
            page.add(&body[place]);
            pages.push(end(page));
        }
        pages
    }
}

/// Begins the text of a page, up to what it shows.
fn begin(title: &str) -> Markup {
    let mut page = Markup::default();
    page.add("<!DOCTYPE html>\n");
    page.tag("html").with("lang", "en").open();
    page.tag("head").open();
    page.tag("meta").with("charset", "utf-8").empty();
    for (kind, name, content) in [
        ("http-equiv", "Content-Security-Policy", POLICY),
        ("name", "viewport", "width=device-width, initial-scale=1"),
        ("name", "color-scheme", "light dark"),
    ] {
        let tag = page.tag("meta").with(kind, name);
        tag.with("content", content).empty();
    }
    page.tag("title").content(title);
    page.style(&sheet());
    page.close("head");

    page.tag("body").open();
    page.tag("main").open();
    page
}

/// Ends the text of a page.
fn end(mut page: Markup) -> String {
    page.close("main");
    page.close("body");
    page.close("html");
    page.finish()
}

fn write_contents(page: &mut Markup, sections: &[(String, String)]) {
    page.tag("nav").with("aria-label", "Contents").open();
    for (heading, id) in sections {
        let tag = page.tag("a").with("href", &format!("#{id}"));
        tag.content(heading);
    }
    page.close("nav");
}

/// A text whose lines do not break within `n = 32`, `p < 0.05` and `95 %`.
fn kept_together(text: &str) -> String {
    let mut text = text.replace(" %", "\u{a0}%");
    for relation in [" = ", " < "] {
        let kept = relation.replace(' ', "\u{a0}");
        text = text.replace(relation, &kept);
    }
    text
}

/// Writes an element with a text.
fn write_text(markup: &mut Markup, element: &'static str, class: &str, text: &Text) {
    markup.tag(element).class(class).open();
    text.write(markup);
    markup.close(element);
}

fn write_caption(markup: &mut Markup, number: &str, caption: &Text) {
    markup.tag("figcaption").open();
    markup.tag("b").content(number);
    markup.plain(" ");
    caption.write(markup);
    markup.close("figcaption");
}
