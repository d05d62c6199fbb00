//! Named random streams derived from the seed.
//!
//! Every consumer of chance has a stream of its own (`guests`, `robot/Butler`), so that no robot's draws depend on
//! who else takes part. The derivation is ten lines in any language:
//!
//! 1. `h` = FNV-1a, 64 bit, over the UTF-8 bytes of the stream's name;
//! 2. `s` = `seed XOR h`;
//! 3. xoshiro256++ whose four words are the first four outputs of `SplitMix64` started at `s`.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// The generator behind every draw of a run.
pub type Stream = Xoshiro256PlusPlus;

/// Largest seed, 2^53 - 1: the largest integer that every JSON reader holds exactly.
pub const MAX_SEED: u64 = (1 << 53) - 1;

/// The stream called `name` of a run with `seed`.
#[must_use]
pub fn stream(seed: u64, name: &str) -> Stream {
    Stream::seed_from_u64(seed ^ fnv1a(name.as_bytes()))
}

/// The seed of streams that are drawn anew from a tick on, by what re-seeds the run (`seed`) and what they are for. Streams that
/// last have the tick in `of`, so that two re-seeds with the same seed do not repeat each other.
#[must_use]
pub fn reseeded(seed: u64, of: &str) -> u64 {
    stream(seed, &format!("reseed/{of}")).next_u64() & MAX_SEED
}

/// A number of 64 bits that belongs to a name, for what derives further numbers from it.
#[must_use]
pub fn key(seed: u64, name: &str) -> u64 {
    stream(seed, name).next_u64()
}

/// The next draw as a number from 0 up to but not including 1: its upper 53 bits over 2^53.
pub fn unit(stream: &mut Stream) -> f64 {
    (stream.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// FNV-1a, 64 bit: spreads short names over the seed space; no security is asked of it.
fn fnv1a(bytes: &[u8]) -> u64 {
    const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    bytes.iter().fold(OFFSET, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(PRIME)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `SplitMix64` and xoshiro256++ written out, as an author in another language would.
    fn reference(seed: u64, name: &str) -> [u64; 3] {
        let mut state = seed ^ fnv1a(name.as_bytes());
        let mut split_mix = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        };
        let mut s = [split_mix(), split_mix(), split_mix(), split_mix()];
        std::array::from_fn(|_| {
            let result = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
            let t = s[1] << 17;
            s[2] ^= s[0];
            s[3] ^= s[1];
            s[1] ^= s[2];
            s[0] ^= s[3];
            s[2] ^= t;
            s[3] = s[3].rotate_left(45);
            result
        })
    }

    #[test]
    fn streams_follow_the_published_derivation() {
        for (seed, name) in [
            (0, "guests"),
            (42, "robot/Butler"),
            (MAX_SEED, "robot/Leguin"),
        ] {
            let mut stream = stream(seed, name);
            let drawn: [u64; 3] = std::array::from_fn(|_| stream.next_u64());
            assert_eq!(drawn, reference(seed, name), "seed {seed}, stream {name}");
        }
    }

    #[test]
    fn fnv_matches_its_published_vectors() {
        // Fowler, Noll, Vo: test vectors of the reference distribution.
        assert_eq!(fnv1a(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv1a(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv1a(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
