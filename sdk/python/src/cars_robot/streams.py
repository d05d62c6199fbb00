"""Named random streams derived from the seed: the same numbers as in every other language.

Every consumer of chance has a stream of its own, so that no robot's draws depend on who else takes part:

1. ``h`` = FNV-1a, 64 bit, over the UTF-8 bytes of the stream's name;
2. ``s`` = ``seed XOR h``;
3. xoshiro256++ whose four words are the first four outputs of SplitMix64 started at ``s``.
"""

from __future__ import annotations

__all__ = ["Stream", "stream"]

_MASK = (1 << 64) - 1


class Stream:
    """A generator of random numbers, xoshiro256++.

    >>> stream(42, "robot/Butler").next_u64()
    12492153271683517459
    """

    __slots__ = ("_a", "_b", "_c", "_d")

    def __init__(self, seed: int) -> None:
        """A stream from a seed of 64 bits, spread over the state by SplitMix64."""
        state = seed & _MASK
        words = []
        for _ in range(4):
            state = (state + 0x9E3779B97F4A7C15) & _MASK
            z = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
            z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
            words.append(z ^ (z >> 31))
        self._a, self._b, self._c, self._d = words

    def next_u64(self) -> int:
        """The next draw: an integer from 0 up to but not including 2^64."""
        a, b, c, d = self._a, self._b, self._c, self._d
        total = (a + d) & _MASK
        result = (((total << 23) | (total >> 41)) + a) & _MASK
        c ^= a
        d ^= b
        self._a = a ^ d
        self._b = b ^ c
        self._c = c ^ ((b << 17) & _MASK)
        self._d = ((d << 45) & _MASK) | (d >> 19)
        return result

    def unit(self) -> float:
        """The next draw as a number from 0 up to but not including 1: its upper 53 bits over 2^53."""
        return (self.next_u64() >> 11) * (1.0 / 9007199254740992.0)


def stream(seed: int, name: str) -> Stream:
    """The stream called ``name`` of a run with ``seed``."""
    return Stream(seed ^ fnv1a(name.encode()))


def fnv1a(data: bytes) -> int:
    """FNV-1a, 64 bit: spreads short names over the seed space; no security is asked of it."""
    digest = 0xCBF29CE484222325
    for byte in data:
        digest = ((digest ^ byte) * 0x100000001B3) & _MASK
    return digest
