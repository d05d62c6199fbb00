"""A robot's own chance: one stream for each thing that it leaves to chance, so that a blocked step does not change when
the next joke comes."""

from __future__ import annotations

import math

from cars import Stream


class Chance:
    """A random stream of a robot's own."""

    def __init__(self, key: int) -> None:
        self._stream = Stream(key)

    @classmethod
    def split(cls, parent: Stream) -> Chance:
        """A stream whose seed is the next number of ``parent``, the stream that the robot was given."""
        return cls(parent.next_u64())

    def uniform(self) -> float:
        """Uniform in [0, 1)."""
        return self._stream.unit()

    def exponential(self, mean: float) -> float:
        """Exponential with this mean, by inversion.

        Logarithms differ between platforms in the last bit. So this decides when something is said, never where a body
        goes.
        """
        return -math.log(1.0 - self.uniform()) * mean

    def around(self, mean: float) -> float:
        """Uniform between half of ``mean`` and one and a half: chance by the four basic operations alone."""
        return mean * (0.5 + self.uniform())

    def direction(self) -> tuple[float, float]:
        """A direction, all equally probable, as a unit vector: a place in the unit disc, drawn until it is inside and
        not so near to the middle that its direction would be coarse."""
        while True:
            x, y = 2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0
            square = x * x + y * y
            if 1e-6 <= square <= 1.0:
                length = math.sqrt(square)
                return (x / length, y / length)

    def one_of(self, count: int) -> int:
        """One of ``count`` things; ``count`` is not 0."""
        return min(int(self.uniform() * count), count - 1)
