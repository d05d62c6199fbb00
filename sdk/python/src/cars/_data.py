"""What robots are told, as types. Lengths are meters, times seconds, speeds meters per second, angles radians counter-clockwise
from +x."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple, Optional, Union

Variable = Union[bool, float, str]
"""A value that a robot publishes about itself. 7 and 7.0 are the same number."""
StateVariables = Mapping[str, Variable]
"""All that a robot chooses to publish about its inner workings: the hashtable of the paper."""


class Point(NamedTuple):
    """A place on the field: meters from its lower left corner."""

    x: float
    y: float

    def distance_m(self, other: Point) -> float:
        """Straight distance, meters."""
        dx, dy = other.x - self.x, other.y - self.y
        # Not hypot: multiplication and square root are the same on every machine.
        return math.sqrt(dx * dx + dy * dy)


class Velocity(NamedTuple):
    """A velocity in the robot's own frame, as ``cmd_vel`` has it in ROS."""

    linear_mps: float
    """Speed along its heading, m/s; negative backward."""
    angular_radps: float
    """Turn rate, rad/s, counter-clockwise."""


class Pose(NamedTuple):
    """Where a robot that drives like wheels stands, where it looks, and how it moves."""

    location: Point
    heading_rad: float
    """Its heading, radians counter-clockwise from +x."""
    velocity: Velocity
    """The velocity that it has reached."""


class _SenderAndText(NamedTuple):
    sender: str
    text: str


class Command(_SenderAndText):
    """A command that arrived: a pair of ``sender`` and ``text``, the name of what is to be done.

    ``payload`` is the JSON value beside the text, ``None`` if there is none; it is no part of the pair.
    """

    payload: Any

    def __new__(cls, sender: str, text: str, payload: Any = None) -> Command:
        command = super().__new__(cls, sender, text)
        command.payload = payload
        return command


class SensedRobot(NamedTuple):
    """Another robot within sensing range."""

    name: str
    location: Point


class SensedBody(NamedTuple):
    """One sensed body: ``obstacle``, ``guest`` or ``robot``, and its center."""

    kind: str
    location: Point


class KnownSite(NamedTuple):
    """A site that every robot knows of: where it is, and not its state."""

    name: str
    kind: str
    location: Point


class SensedSite(NamedTuple):
    """A site within its range: a thing at a place, of a kind, with a state."""

    name: str
    kind: str
    location: Point
    state: StateVariables


@dataclass
class SiteAction:
    """What a robot does to a site: all of it happens, or nothing."""

    site: str
    set: StateVariables = field(default_factory=dict)
    """New values of variables of its state."""
    add: Mapping[str, float] = field(default_factory=dict)
    """What is added to numbers of its state."""
    only_if: StateVariables = field(default_factory=dict)
    """Values that its state must have when the action is carried out; otherwise the action is refused."""


class SiteResult(NamedTuple):
    """What became of an action on a site."""

    site: str
    refused: Optional[str]
    """Why it was refused; None if it was carried out."""


class LayerCell(NamedTuple):
    """A cell of a layer: its column and row in the grid, from 0, its center, and its number."""

    column: int
    row: int
    center: Point
    value: float


class SensedLayer(NamedTuple):
    """The part of a layer that a robot senses: all cells whose centers are within the range of the layer."""

    name: str
    cell_m: float
    """Side of a cell, meters."""
    rows: tuple[tuple[int, int, tuple[float, ...]], ...]
    """The cells, row by row from below: the row, the column of the first cell, and the numbers from left to right."""

    def value_at(self, place: Point) -> Optional[float]:
        """The number of the cell in which a place is; None if the robot does not sense this cell."""
        at_column, at_row = math.floor(place.x / self.cell_m), math.floor(place.y / self.cell_m)
        for row, column, values in self.rows:
            if row == at_row and 0 <= at_column - column < len(values):
                return values[at_column - column]
        return None

    def cells(self) -> Iterator[LayerCell]:
        """The cells, row by row from below, each row from left to right."""
        for row, first, values in self.rows:
            for column, value in enumerate(values, first):
                yield LayerCell(column, row, Point((column + 0.5) * self.cell_m, (row + 0.5) * self.cell_m), value)


@dataclass
class LayerAction:
    """What a robot does to a layer: to the cell in which a place is, and to all cells whose centers are within a radius of it."""

    layer: str
    at: Point
    radius_m: float = 0.0
    set: Optional[float] = None
    """What the numbers of the cells are set to."""
    add: Optional[float] = None
    """What is added to the number of each cell, after it was set."""


class LayerResult(NamedTuple):
    """What became of an action on a layer."""

    layer: str
    change: float
    """What it added to the sum of the layer."""
    refused: Optional[str]
    """Why it was refused; None if it was carried out."""


@dataclass(frozen=True)
class Rays:
    """A fan of rays: the first in the direction of motion that the robot reported last, the others counter-clockwise."""

    count: int
    range_m: float


@dataclass(frozen=True)
class DriveLimits:
    """The limits of a robot that drives like wheels. It may ask for any velocity: the simulator applies them."""

    max_speed_mps: float
    """Highest speed, forward and backward: the lower one of its own limit and that of the field."""
    max_turn_radps: Optional[float] = None
    """Fastest turn, to both sides; None if it has no limit, as the others."""
    max_acceleration_mps2: Optional[float] = None
    max_turn_acceleration_radps2: Optional[float] = None


class PublicState(NamedTuple):
    """A robot as it reported itself for ``tick``: the answer to all six queries of the common robot interface."""

    epoch: int
    tick: int
    location: Point
    speed_mps: float
    direction_rad: float
    state_variables: StateVariables
    emotion_state: str
    behavior_state: str


@dataclass(frozen=True)
class Welcome:
    """What a robot needs to know to take part in an epoch."""

    run: str
    name: str
    generation: int
    """Its incarnation, from 1; a robot that comes back has a higher one."""
    epoch: int
    tick: int
    """Last tick that was granted."""
    seed: int
    tick_s: float
    """Length of a tick, simulated seconds."""
    field_m: tuple[float, float]
    """Width and height of the field, meters."""
    body_m: float
    """Side of every body, meters."""
    sensing_range_m: float
    """Distance within which it senses other bodies, meters."""
    location: Point
    """Where it stands, meters."""
    roster: tuple[str, ...]
    """Names of all robots of the scenario, itself included."""
    parameters: Mapping[str, Any]
    """Its parameters, as the scenario says, lengths and times in SI units."""
    rays: Optional[Rays] = None
    """The fan of rays of ``cars.ranges``, if the scenario has one."""
    drive: Optional[DriveLimits] = None
    """Its limits, if it drives like wheels: it has a ``cars.pose``, and returns ``Action.drive``."""
    known_sites: tuple[KnownSite, ...] = ()
    """The sites that every robot knows of, by name. Their states are sensed within range: ``cars.sites``."""
    last_state: Optional[Mapping[str, Any]] = None
    """What its previous incarnation reported last in this epoch."""


def read_welcome(text: str) -> Welcome:
    """A welcome from the message of the protocol."""
    given = json.loads(text)
    names = [one.name for one in fields(Welcome)]
    known = {name: given[name] for name in names if name in given}
    known["field_m"] = tuple(given["field_m"])
    known["location"] = Point(**given["location"])
    if "rays" in given:
        known["rays"] = Rays(**given["rays"])
    if "drive" in given:
        # A later version may have further limits.
        limits = {one.name: given["drive"].get(one.name) for one in fields(DriveLimits)}
        known["drive"] = DriveLimits(**limits)
    known["roster"] = tuple(given["roster"])
    known["known_sites"] = tuple(
        KnownSite(site["name"], site["kind"], Point(**site["location"])) for site in given.get("known_sites", [])
    )
    return Welcome(**known)
