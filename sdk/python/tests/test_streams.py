"""Random streams: the same numbers as in Rust. `tests/tests/system/python.rs` compares more of them with the Rust ones."""

from __future__ import annotations

import pytest

from cars_robot.streams import Stream, fnv1a, stream

MAX_SEED = (1 << 53) - 1

VECTORS = [
    (0, "guests", [9249299309979672856, 17548166477542984170, 2580611156170238945]),
    (42, "robot/Butler", [12492153271683517459, 18153049311550417798, 8942105629970979609]),
    (MAX_SEED, "robot/Leguin", [6964520748617063734, 7886845811617735621, 14204664675639338103]),
]


@pytest.mark.parametrize(("seed", "name", "drawn"), VECTORS)
def test_streams_follow_the_published_derivation(seed: int, name: str, drawn: list[int]) -> None:
    own = stream(seed, name)
    assert [own.next_u64() for _ in drawn] == drawn


def test_fnv_matches_its_published_vectors() -> None:
    # Fowler, Noll, Vo: test vectors of the reference distribution.
    assert fnv1a(b"") == 0xCBF29CE484222325
    assert fnv1a(b"a") == 0xAF63DC4C8601EC8C
    assert fnv1a(b"foobar") == 0x85944171F73967E8


def test_the_generator_is_xoshiro256_plus_plus() -> None:
    # Blackman and Vigna's reference implementation, from the state 1, 2, 3, 4.
    own = Stream(0)
    own._a, own._b, own._c, own._d = 1, 2, 3, 4
    expected = [41943041, 58720359, 3588806011781223, 3591011842654386, 9228616714210784205, 9973669472204895162]
    assert [own.next_u64() for _ in expected] == expected


def test_units_lie_in_their_interval_and_use_53_bits() -> None:
    own, other = Stream(7), Stream(7)
    for _ in range(1000):
        unit = own.unit()
        assert 0.0 <= unit < 1.0 and unit == (other.next_u64() >> 11) / 2**53
