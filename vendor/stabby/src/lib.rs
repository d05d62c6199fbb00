//! What zenoh uses of stabby where no plugins are loaded: see `README.md`.

/// Texts.
pub mod str {
    use std::fmt;
    use std::ops::Deref;

    /// A text that is borrowed.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct Str<'a>(&'a str);

    impl<'a> From<&'a str> for Str<'a> {
        fn from(text: &'a str) -> Self {
            Self(text)
        }
    }

    impl Deref for Str<'_> {
        type Target = str;

        fn deref(&self) -> &str {
            self.0
        }
    }

    impl fmt::Display for Str<'_> {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str(self.0)
        }
    }
}
