"""Whether somebody comes nearer: the time since a distance was last smaller than ever before."""

from __future__ import annotations


class Closing:
    """The course of a distance on one way. A goal that moves to and fro brings it no nearer: only a new minimum counts."""

    def __init__(self) -> None:
        self.stalled_s = 0.0
        """Time without progress."""
        self._nearest_m: float | None = None

    def observe(self, distance_m: float | None, progress_m: float, dt_s: float) -> bool:
        """Adds a distance after ``dt_s`` seconds; ``None`` if it is unknown, which is no progress. One that is
        ``progress_m`` smaller than all before is progress. Whether there was one before, and this one is."""
        self.stalled_s += dt_s
        has_begun = self._nearest_m is not None
        if distance_m is not None and (self._nearest_m is None or distance_m <= self._nearest_m - progress_m):
            self._nearest_m = distance_m
            self.stalled_s = 0.0
            return has_begun
        return False
