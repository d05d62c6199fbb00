//! The page: one HTML file that needs nothing else.

use std::ops::Range;

use crate::markup::Markup;

use crate::style::sheet;
use crate::table::Table;

/// What the page may load: nothing. Its style is in it.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:";

/// A part of a sentence.
#[derive(Debug, Clone)]
pub enum Part {
    /// Plain text.
    Text(String),
    /// Text with emphasis.
    Strong(String),
    /// A command, a path, a name from a file.
    Code(String),
    /// A link within the page: text and the id of its target.
    Link(String, String),
}

impl Part {
    /// Plain text.
    #[must_use]
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// Text with emphasis.
    #[must_use]
    pub fn strong(text: impl Into<String>) -> Self {
        Self::Strong(text.into())
    }

    /// A command, a path, a name from a file.
    #[must_use]
    pub fn code(text: impl Into<String>) -> Self {
        Self::Code(text.into())
    }
}

/// A chart among those of a figure.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Heading above the chart; none if it is empty.
    pub heading: String,
    /// The chart, SVG.
    pub svg: String,
    /// Whether it is as wide as the page.
    pub is_wide: bool,
}

/// Charts with one caption, and the same numbers as a table.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// The charts.
    pub panels: Vec<Panel>,
    /// What is shown, with n and the kind of interval.
    pub caption: Vec<Part>,
    /// The numbers.
    pub table: Option<Table>,
}

/// A page that is being written.
#[derive(Debug)]
pub struct Page {
    title: String,
    head: Markup,
    body: Markup,
    /// Headings of the sections with their ids.
    sections: Vec<(String, String)>,
    /// Where the figures are in the body.
    figures: Vec<Range<usize>>,
    tables: usize,
}

impl Page {
    /// A page with a title. `kind` stands above it.
    #[must_use]
    pub fn new(kind: &str, title: &str) -> Self {
        let mut head = Markup::default();
        head.tag("p").with("class", "kind").content(kind);
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
    pub fn lead(&mut self, parts: &[Part]) {
        self.head.tag("p").with("class", "lead").open();
        write_parts(&mut self.head, parts);
        self.head.close("p");
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
    pub fn paragraph(&mut self, parts: &[Part]) {
        self.body.tag("p").open();
        write_parts(&mut self.body, parts);
        self.body.close("p");
    }

    /// Adds a remark about what is not shown or not known.
    pub fn remark(&mut self, parts: &[Part]) {
        self.body.tag("p").with("class", "remark").open();
        write_parts(&mut self.body, parts);
        self.body.close("p");
    }

    /// Adds a list.
    pub fn list(&mut self, items: &[Vec<Part>]) {
        self.body.tag("ul").open();
        for item in items {
            self.body.tag("li").open();
            write_parts(&mut self.body, item);
            self.body.close("li");
        }
        self.body.close("ul");
    }

    /// Adds a figure and returns its number.
    pub fn figure(&mut self, figure: &Figure) -> usize {
        let number = self.figures.len() + 1;
        let begin = self.body.size();
        let body = &mut self.body;
        body.tag("figure")
            .with("id", &format!("figure-{number}"))
            .open();
        body.tag("div").with("class", "panels").open();
        for panel in &figure.panels {
            let class = if panel.is_wide { "panel wide" } else { "panel" };
            body.tag("div").with("class", class).open();
            if !panel.heading.is_empty() {
                body.tag("p").with("class", "name").content(&panel.heading);
            }
            body.tag("div").with("class", "scroll").open();
            body.add(&panel.svg);
            body.close("div");
            body.close("div");
        }
        body.close("div");

        body.tag("figcaption").open();
        body.tag("b").content(&format!("Figure {number}."));
        body.text(" ");
        write_parts(body, &figure.caption);
        body.close("figcaption");
        if let Some(table) = &figure.table {
            body.tag("details").open();
            body.tag("summary")
                .content(&format!("Numbers of figure {number}"));
            table.write(body);
            body.close("details");
        }
        body.close("figure");
        self.figures.push(begin..self.body.size());
        number
    }

    /// Adds a table and returns its number.
    pub fn table(&mut self, caption: &[Part], table: &Table) -> usize {
        self.tables += 1;
        let number = self.tables;

        let body = &mut self.body;
        body.tag("figure")
            .with("class", "table")
            .with("id", &format!("table-{number}"))
            .open();

        body.tag("figcaption").open();
        body.tag("b").content(&format!("Table {number}."));
        body.text(" ");
        write_parts(body, caption);
        body.close("figcaption");
        table.write(body);
        body.close("figure");

        number
    }

    /// Adds commands, one a line, to be copied.
    pub fn commands(&mut self, commands: &[String]) {
        self.body.tag("pre").with("class", "command").open();
        for command in commands {
            self.body.tag("code").content(command);
            self.body.add("\n");
        }
        self.body.close("pre");
    }

    /// Adds a file, whole, behind its name.
    pub fn file(&mut self, name: &str, text: &str) {
        self.body.tag("details").open();
        self.body.tag("summary").content(name);
        self.body.tag("pre").lines(text);
        self.body.close("details");
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
        for place in self.figures {
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
    page.tag("meta")
        .with("http-equiv", "Content-Security-Policy")
        .with("content", POLICY)
        .empty();
    page.tag("meta")
        .with("name", "viewport")
        .with("content", "width=device-width, initial-scale=1")
        .empty();
    page.tag("meta")
        .with("name", "color-scheme")
        .with("content", "light dark")
        .empty();
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
        page.tag("a")
            .with("href", &format!("#{id}"))
            .content(heading);
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

fn write_parts(markup: &mut Markup, parts: &[Part]) {
    for part in parts {
        match part {
            Part::Text(text) => markup.text(&kept_together(text)),
            Part::Strong(text) => markup.tag("strong").content(text),
            Part::Code(text) => markup.tag("code").content(text),
            Part::Link(text, id) => markup
                .tag("a")
                .with("href", &format!("#{id}"))
                .content(text),
        }
    }
}
