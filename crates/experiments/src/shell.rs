//! Words of commands that people and tasks type into a shell.

use std::path::Path;

/// A word as it is typed in a shell: quoted if necessary.
#[must_use]
pub fn word(text: &str) -> String {
    let mut characters = text.chars();
    let is_plain = characters.all(|c| c.is_ascii_alphanumeric() || "-_./=:,@%+".contains(c));
    if is_plain && !text.is_empty() {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// A path as it is typed in a shell, as an argument that is no option.
#[must_use]
pub fn path(path: &Path) -> String {
    let text = path.display().to_string();
    if text.starts_with('-') {
        return word(&format!("./{text}"));
    }
    word(&text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_read_them_otherwise() {
        for (text, typed) in [
            ("/a/b-1.toml", "/a/b-1.toml"),
            ("it's $x", r"'it'\''s $x'"),
            ("", "''"),
            ("ä", "'ä'"),
        ] {
            assert_eq!(word(text), typed);
        }
        assert_eq!(path(Path::new("-o.toml")), "./-o.toml");
    }
}
