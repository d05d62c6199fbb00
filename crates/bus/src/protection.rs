//! Who may read and change the files with private keys.

use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use crate::error::BusError;

/// Permissions of others than the owner to write.
const OTHERS_WRITE: u32 = 0o022;
/// Permissions of others than the owner.
const OTHERS: u32 = 0o077;

/// Checks the permissions of a file with a private key. A key that others can read is reported: they can take the place of its
/// owner. One that they can change is refused.
///
/// # Errors
/// [`BusError::Unprotected`] if others can write to the file.
pub fn check_key_file(file: &Path) -> Result<(), BusError> {
    // What cannot be looked at cannot be read either, which is reported where it is read.
    let Ok(metadata) = file.metadata() else {
        return Ok(());
    };
    let mode = metadata.permissions().mode() & 0o777;
    let name = file.display();

    if mode & OTHERS_WRITE != 0 {
        return Err(BusError::Unprotected(format!(
            "{name} has a private key, and others than its owner can change it (mode {mode:03o}): \
             if it is still yours, `chmod 600 {name}`"
        )));
    }
    if mode & OTHERS != 0 {
        tracing::warn!(
            "{name} has a private key, and others than its owner can read it (mode {mode:03o}): `chmod 600 {name}`"
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs::Permissions;

    use super::*;

    #[test]
    fn a_key_that_others_can_change_is_refused() {
        let file = std::env::temp_dir().join(format!("cars-key-{}", std::process::id()));
        std::fs::write(&file, "a key").unwrap();
        for (mode, is_accepted) in [
            (0o600, true),
            (0o400, true),
            (0o640, true),
            (0o604, true),
            (0o444, true),
            (0o620, false),
            (0o602, false),
            (0o666, false),
        ] {
            std::fs::set_permissions(&file, Permissions::from_mode(mode)).unwrap();
            let checked = check_key_file(&file);
            assert_eq!(checked.is_ok(), is_accepted, "{mode:o}");
            if let Err(error) = checked {
                assert!(error.to_string().contains("chmod 600"), "{error}");
            }
        }
        std::fs::remove_file(&file).unwrap();
        assert!(check_key_file(&file).is_ok());
    }
}
