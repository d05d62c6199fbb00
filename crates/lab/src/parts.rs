//! What runs and experiments keep: no output of a command replaces it.

use std::path::Path;

use record::RunFolder;

use crate::experiment::is_of_experiment;

/// Whether a path is that of a part of the record of a run or an experiment: as it is given, with its folder's links resolved, or with
/// all links resolved.
#[must_use]
pub fn is_part_of_record(path: &Path) -> bool {
    let absolute = std::path::absolute(path).ok();
    // The folder of the absolute path is never the empty path.
    let folder = absolute.as_deref().and_then(Path::parent);
    let in_folder = folder
        .and_then(|folder| folder.canonicalize().ok())
        .zip(path.file_name())
        .map(|(folder, name)| folder.join(name));
    let resolved = path.canonicalize().ok();

    let mut places = [absolute, in_folder, resolved].into_iter().flatten();
    places.any(|place| RunFolder::is_of_run(&place) || is_of_experiment(&place))
}
