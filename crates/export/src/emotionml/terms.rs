//! The nearest terms of W3C's vocabularies for EmotionML (Working Group Note, 1 April 2014), and names and texts in characters
//! that XML allows. The choice of the nearest terms is ours \[I\].

use std::fmt::Write;

use affect::akr::ActionTendency;

/// The URI of one of W3C's vocabularies.
pub(super) fn w3c(vocabulary: &str) -> String {
    format!("http://www.w3.org/TR/emotion-voc/xml#{vocabulary}")
}

/// The nearest term for a category of the standard schemata, or for an action tendency: its vocabulary and its name.
pub(super) fn nearest(kind: &str, name: &str) -> Option<(String, String)> {
    let (vocabulary, term) = match (kind, name) {
        ("category", "HAPPY") => ("everyday-categories", "happy"),
        ("category", "CONFIDENT") => ("everyday-categories", "confident"),
        ("category", "CONCERNED") => ("everyday-categories", "worried"),
        ("category", "FRUSTRATED") => ("fsre-categories", "irritation"),
        ("category", "ANGRY") => ("everyday-categories", "angry"),
        ("category", "DISCOURAGED") => ("frijda-categories", "resignation"),
        ("category", "HOPEFUL") => ("occ-categories", "hope"),
        ("action-tendency", name) => (
            "frijda-action-tendencies",
            ActionTendency::named(name)?.emotionml()?,
        ),
        _ => return None,
    };
    Some((w3c(vocabulary), term.to_owned()))
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

/// Escapes a text, and replaces characters that XML 1.0 does not allow.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::new();
    for char in text.chars() {
        match char {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '\t' | '\n' | ' '..='\u{D7FF}' | '\u{E000}'..='\u{FFFD}' | '\u{10000}'.. => {
                escaped.push(char);
            }
            _ => escaped.push(char::REPLACEMENT_CHARACTER),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_emotion_with_a_schema_has_a_nearest_category() {
        for name in affect::Schemata::standard().names() {
            assert!(nearest("category", name).is_some(), "{name}");
        }
        assert_eq!(nearest("category", "BORED"), None);
    }

    #[test]
    fn names_become_tokens_and_stay_different() {
        assert_eq!(token("VERY_CONTENT-2.1"), "VERY_CONTENT-2.1");
        assert_eq!(token("si content!"), "si_x20_content_x21_");

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
            "\0",
        ];
        let tokens: std::collections::BTreeSet<String> =
            names.iter().map(|name| token(name)).collect();
        assert_eq!(tokens.len(), names.len());
        let mut characters = tokens.iter().flat_map(|token| token.chars());
        assert!(characters.all(|char| char.is_ascii_alphanumeric() || ".-_".contains(char)));
    }

    #[test]
    fn numbers_are_written_without_exponent_and_without_sign() {
        let written = [0.0, -0.0, 1e-9, 0.25, 1.0 / 3.0, 1.0].map(scale_value);
        assert_eq!(written, ["0", "0", "0", "0.25", "0.333333", "1"]);
        assert_eq!(escape("a<\0\r\t&"), "a&lt;\u{FFFD}\u{FFFD}\t&amp;");
    }
}
