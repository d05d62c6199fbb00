//! Valid seeds. A seed must be the same number in every language.

use protocol::random::MAX_SEED;

/// A number is too large for a seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a seed is at most {MAX_SEED} (2^53 - 1), so that every language can hold it")]
pub struct SeedError;

/// Checks that a number is a seed.
///
/// # Errors
/// [`SeedError`] above 2^53 - 1, the largest integer of a JSON number in every language.
pub fn check(seed: u64) -> Result<u64, SeedError> {
    if seed > MAX_SEED {
        return Err(SeedError);
    }
    Ok(seed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_fits_into_a_json_number() {
        assert_eq!(check(MAX_SEED), Ok(MAX_SEED));
        assert_eq!(check(MAX_SEED + 1), Err(SeedError));
    }
}
