//! Maps terms of this project to EmotionML: the nearest terms of W3C's vocabularies (Working Group Note, 1 April 2014),
//! and names and texts in characters that XML allows.
//!
//! The choice of the nearest terms is ours \[I\].

use std::fmt::Write;

use affect::akr::ActionTendency;

/// URI of W3C's vocabularies, to which the id of one is appended.
const W3C: &str = "http://www.w3.org/TR/emotion-voc/xml#";

/// A term of one of W3C's vocabularies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Term {
    /// Id of the vocabulary.
    vocabulary: &'static str,
    pub(super) name: &'static str,
}

impl Term {
    /// URI of the vocabulary, for a `*-set` attribute.
    pub(super) fn set(self) -> String {
        format!("{W3C}{}", self.vocabulary)
    }

    /// Name and vocabulary for people, as in `worried of everyday-categories`.
    pub(super) fn in_words(self) -> String {
        format!("{} of {}", self.name, self.vocabulary)
    }
}

const fn term(vocabulary: &'static str, name: &'static str) -> Term {
    Term { vocabulary, name }
}

pub(super) const VALENCE: Term = term("fsre-dimensions", "valence");
pub(super) const UNPREDICTABILITY: Term = term("fsre-dimensions", "unpredictability");
pub(super) const INTENSITY: Term = term("intensity-dimension", "intensity");
pub(super) const AGENCY: Term = term("ema-appraisals", "agency");
pub(super) const CONTROLLABILITY: Term = term("ema-appraisals", "controllability");
pub(super) const URGENCY: Term = term("ema-appraisals", "urgency");
pub(super) const DESIRABILITY: Term = term("ema-appraisals", "desirability");

/// The nearest category of an emotion of the standard schemata.
pub(super) fn nearest_category(emotion: &str) -> Option<Term> {
    Some(match emotion {
        "HAPPY" => term("everyday-categories", "happy"),
        "CONFIDENT" => term("everyday-categories", "confident"),
        "CONCERNED" => term("everyday-categories", "worried"),
        "FRUSTRATED" => term("fsre-categories", "irritation"),
        "ANGRY" => term("everyday-categories", "angry"),
        "DISCOURAGED" => term("frijda-categories", "resignation"),
        "HOPEFUL" => term("occ-categories", "hope"),
        _ => return None,
    })
}

/// The nearest action tendency of W3C.
pub(super) fn nearest_tendency(tendency: ActionTendency) -> Option<Term> {
    tendency
        .emotionml()
        .map(|name| term("frijda-action-tendencies", name))
}

/// Formats a number between 0 and 1 with the seven digits of the schema's single precision.
pub(super) fn scale_value(value: f64) -> String {
    // Adding zero turns -0 into 0.
    ((value.clamp(0.0, 1.0) * 1e6).round() / 1e6 + 0.0).to_string()
}

/// Encodes a name as an `NMTOKEN`, as vocabularies require. ASCII letters, digits, `.`, `-` and `_` are kept; any other
/// character becomes `_x`, its code point and `_`. Different names have different tokens.
pub(super) fn token(name: &str) -> String {
    let mut token = String::new();
    let mut rest = name.chars().peekable();
    while let Some(char) = rest.next() {
        let begins_code = char == '_' && rest.peek() == Some(&'x');
        if (char.is_ascii_alphanumeric() || ".-_".contains(char)) && !begins_code {
            token.push(char);
        } else {
            let _ = write!(token, "_x{:X}_", u32::from(char));
        }
    }

    token
}

/// Replaces characters that XML 1.0 does not allow.
pub(super) fn text(raw: &str) -> String {
    raw.chars()
        .map(|char| match char {
            '\t' | '\n' | ' '..='\u{D7FF}' | '\u{E000}'..='\u{FFFD}' | '\u{10000}'.. => char,
            _ => char::REPLACEMENT_CHARACTER,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use affect::Schemata;

    #[test]
    fn every_emotion_with_a_schema_has_a_nearest_category() {
        for name in Schemata::standard().names() {
            assert!(nearest_category(name).is_some(), "{name}");
        }
        assert_eq!(nearest_category("BORED"), None);
    }

    #[test]
    fn names_become_tokens_and_stay_different() {
        assert_eq!(token("VERY_CONTENT-2.1"), "VERY_CONTENT-2.1");
        assert_eq!(token("si content!"), "si_x20_content_x21_");
        assert_eq!(token("ému"), "_xE9_mu");

        let names = [
            "a b",
            "a_x20_b",
            "a_x20_",
            "a ",
            "_x",
            "x",
            "_xx",
            "a_x5F_x20_b",
            "<&\">",
            "\u{1F600}",
            "\0",
        ];
        let tokens: std::collections::BTreeSet<String> =
            names.iter().map(|name| token(name)).collect();
        assert_eq!(tokens.len(), names.len());

        for token in &tokens {
            let mut characters = token.chars();
            let is_plain = characters.all(|c| c.is_ascii_alphanumeric() || ".-_".contains(c));
            assert!(is_plain, "{token}");
        }
    }

    #[test]
    fn a_document_holds_no_character_that_xml_forbids() {
        assert_eq!(
            text("a\0\u{1b}\r\u{FFFE}\t\u{1F600}"),
            "a\u{FFFD}\u{FFFD}\u{FFFD}\u{FFFD}\t\u{1F600}"
        );
    }

    #[test]
    fn numbers_are_written_without_exponent_and_without_sign() {
        let written = [0.0, -0.0, 1e-9, 0.25, 1.0 / 3.0, 1.0].map(scale_value);
        assert_eq!(written, ["0", "0", "0", "0.25", "0.333333", "1"]);
    }
}
