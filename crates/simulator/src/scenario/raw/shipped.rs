//! Files with parameters that come with the program, for scenarios whose texts come without their files.

use std::path::Path;

use config::Source;

/// Names of the files as the shipped scenarios name them, and their texts.
const FILES: [(&str, &str); 2] = [
    (
        "robots/butler.toml",
        include_str!("../../../../../configs/robots/butler.toml"),
    ),
    (
        "robots/leguin.toml",
        include_str!("../../../../../configs/robots/leguin.toml"),
    ),
];

/// The file with this name.
pub(super) fn parameters(name: &Path) -> Option<Source> {
    let (name, text) = FILES.iter().find(|(known, _)| Path::new(known) == name)?;
    Some(Source {
        name: (*name).to_owned(),
        text: (*text).to_owned(),
    })
}

/// The names of all files.
pub(super) fn names() -> Vec<&'static str> {
    FILES.iter().map(|(name, _)| *name).collect()
}
