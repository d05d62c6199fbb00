//! Writes SVG and the markup around it. Everything that may come from robots is escaped.

use std::fmt::Write;

use protocol::plain::{escape_line, escape_text};

/// A text of elements that is being written: XML, which HTML parsers read, too.
#[derive(Debug, Default)]
pub(crate) struct Markup {
    text: String,
}

/// A start tag that is being written.
#[must_use]
pub(crate) struct Tag<'a> {
    markup: &'a mut Markup,
    name: &'static str,
}

impl Markup {
    /// Begins a start tag.
    pub(crate) fn tag(&mut self, name: &'static str) -> Tag<'_> {
        self.text.push('<');
        self.text.push_str(name);
        Tag { markup: self, name }
    }

    /// Writes the end tag of an element that was opened.
    pub(crate) fn close(&mut self, name: &str) {
        self.text.push_str("</");
        self.text.push_str(name);
        self.text.push_str(">\n");
    }

    /// Writes the title of the element that was opened last: its description, which viewers show under the pointer.
    pub(crate) fn title(&mut self, text: &str) {
        self.tag("title").content(text);
    }

    /// Writes a style sheet, which is text of this program.
    pub(crate) fn style(&mut self, sheet: &str) {
        self.text.push_str("<style>");
        self.text.push_str(sheet);
        self.text.push_str("</style>\n");
    }

    /// Writes a text between elements.
    pub(crate) fn plain(&mut self, text: &str) {
        self.text.push_str(&escaped(&escape_line(text)));
    }

    /// Writes elements that have been written as a text of their own.
    pub(crate) fn add(&mut self, elements: &str) {
        self.text.push_str(elements);
    }

    /// Number of bytes so far.
    pub(crate) fn size(&self) -> usize {
        self.text.len()
    }

    /// The text.
    pub(crate) fn finish(self) -> String {
        self.text
    }
}

impl Tag<'_> {
    /// The attribute `class`, unless it is empty.
    pub(crate) fn class(self, class: &str) -> Self {
        if class.is_empty() {
            return self;
        }
        self.with("class", class)
    }

    /// An attribute.
    pub(crate) fn with(self, name: &str, value: &str) -> Self {
        let value = escaped(&escape_line(value));
        self.raw(name, &value)
    }

    /// An attribute that is a length, pixels.
    pub(crate) fn at(self, name: &str, px: f64) -> Self {
        let value = number(px);
        self.raw(name, &value)
    }

    /// An attribute that is a number.
    pub(crate) fn count(self, name: &str, value: u64) -> Self {
        let value = value.to_string();
        self.raw(name, &value)
    }

    fn raw(self, name: &str, value: &str) -> Self {
        // Infallible: it is written to memory.
        let _ = write!(self.markup.text, " {name}=\"{value}\"");
        self
    }

    /// Ends the tag; elements that follow are in this one.
    pub(crate) fn open(self) {
        self.markup.text.push('>');
    }

    /// Ends an element without content.
    pub(crate) fn empty(self) {
        self.markup.text.push_str("/>");
    }

    /// Ends an element with a text in one line.
    pub(crate) fn content(self, text: &str) {
        self.end(&escaped(&escape_line(text)));
    }

    /// Ends an element with a text of several lines.
    pub(crate) fn lines(self, text: &str) {
        self.end(&escaped(&escape_text(text)));
    }

    fn end(self, text: &str) {
        self.markup.text.push('>');
        self.markup.text.push_str(text);
        self.markup.text.push_str("</");
        self.markup.text.push_str(self.name);
        self.markup.text.push('>');
    }
}

/// A number as it is in SVG: in tenths, without an end of zeros.
pub(crate) fn number(value: f64) -> String {
    let tenths = (value * 10.0).round() / 10.0;
    // Not "-0".
    format!("{}", tenths + 0.0)
}

/// A text without control characters, which XML does not allow, as XML has it.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\u{fffe}' | '\u{ffff}' => escaped.extend(c.escape_unicode()),
            _ => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_one_form() {
        for (value, text) in [(1.0, "1"), (1.26, "1.3"), (-0.01, "0"), (0.1 + 0.2, "0.3")] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn any_text_is_allowed() {
        for code in 0..=0x1_ffff {
            let Some(c) = char::from_u32(code) else {
                continue;
            };
            let mut svg = Markup::default();
            svg.tag("text")
                .with("id", &format!("a{c}"))
                .content(&format!("b{c}"));
            let text = svg.finish();
            let parsed = roxmltree::Document::parse(&text);
            assert!(parsed.is_ok(), "{code:x}: {text}");
        }
    }
}
