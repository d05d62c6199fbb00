"""What a robot knows of another one: by asking (which a cut network prevents) and by sensing (which nothing prevents)."""

from __future__ import annotations

from cars import CallError, Cars, Point, PublicState


class Peer:
    """A peer, as far as it is known."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.place: Point | None = None
        """The last place where it was known to be."""
        self.is_missing = False
        """Whether it was looked for where it was last known to be, and not found."""
        self._is_sensed = False  # Whether that place was sensed in this tick.
        self._has_answered = False
        self._behavior = ""  # In its last answer.
        self._unheard_s = 0.0  # How long ago it last answered.
        self._unseen_s = 0.0  # How long ago its place was last known.

    def look(self, cars: Cars, own: Point) -> PublicState | None:
        """Asks and looks around, once a tick; gives its answer, ``None`` if it is unreachable.

        Where it is sensed counts for more than where it says it was, because the answer is a tick old. Without an
        answer, a place within sensing range at which it is not sensed is one at which it is not.
        """
        self._unheard_s += cars.tick_s
        self._unseen_s += cars.tick_s
        state = self._ask(cars)
        sensed = next((location for name, location in cars.sensed_robots if name == self.name), None)
        self._is_sensed = sensed is not None
        place = sensed if sensed is not None else None if state is None else state.location
        if place is not None:
            self._unseen_s = 0.0
        was_searched = self.place is not None and own.distance_m(self.place) <= cars.welcome.sensing_range_m
        self.is_missing = place is None and (self.is_missing or was_searched)
        self.place = place if place is not None else self.place
        return state

    def _ask(self, cars: Cars) -> PublicState | None:
        try:
            state = cars.get_robot_state(self.name)
        except CallError:
            return None
        self._has_answered = True
        self._behavior = state.behavior_state
        self._unheard_s = 0.0
        return state

    def is_within(self, radius_m: float, own: Point, sensing_range_m: float) -> bool:
        """Whether it stands within ``radius_m``, as far as can be told. Sensing decides, being exact and of this tick;
        the answer to a question decides only where sensing does not reach so far."""
        is_certain = self._is_sensed or (sensing_range_m < radius_m and self._unseen_s == 0.0)
        return is_certain and self.place is not None and own.distance_m(self.place) <= radius_m

    def is_unknown(self, stale_s: float) -> bool:
        """Whether what goes on inside it cannot be known: it never answered, or not for longer than ``stale_s``."""
        return not self._has_answered or self._unheard_s > stale_s

    def behavior(self, stale_s: float) -> str | None:
        """Its behavior, unless its last answer is older than ``stale_s``."""
        return None if self.is_unknown(stale_s) else self._behavior

    def location_certainty(self, stale_s: float) -> float:
        """How recent its last known place is: from 1, of this tick, to 0, older than ``stale_s`` or none."""
        if self.place is None:
            return 0.0
        return 1.0 if self._unseen_s == 0.0 else 1.0 - min(self._unseen_s / stale_s, 1.0)
