"""What is said: the messages of the contract that a robot sends or reads, as types, and their JSON.

Lengths are meters, times seconds, speeds meters per second, angles radians counter-clockwise from +x. Unknown fields are
ignored; what is missing or malformed raises :class:`Malformed`, which names key, sender, field and reason.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

PROTOCOL_VERSION = 2
"""Version of the contract that this package speaks."""

MAX_MESSAGE_BYTES = 1 << 20
"""Largest message that is accepted."""
MAX_TEXT_BYTES = 4096
"""Longest text in a message, UTF-8: a command, a state's name, a log line."""
MAX_ENTRIES = 1024
"""Most entries of any list or map in a message."""
MAX_WIDGETS = 64
"""Most widgets of a panel."""

Variable = bool | float | str
"""A value that a robot publishes about itself. 7 and 7.0 are the same number."""
StateVariables = Mapping[str, Variable]
"""All that a robot chooses to publish about its inner workings: the hashtable of the paper."""

T = TypeVar("T")
Json = dict[str, Any]


class Malformed(ValueError):
    """A message that could not be understood: it changes nothing at the receiver."""

    def __init__(self, key: str, sender: str, field_: str, reason: str) -> None:
        super().__init__(f"malformed message on {key} from {sender}: field {field_}: {shortened(reason)}")


class Point(NamedTuple):
    """A place on the field: meters from its lower left corner."""

    x: float
    y: float

    def distance_m(self, other: Point) -> float:
        """Straight distance, meters."""
        dx, dy = other.x - self.x, other.y - self.y
        # Not hypot: multiplication and square root are the same on every machine.
        return math.sqrt(dx * dx + dy * dy)


@dataclass(frozen=True, slots=True)
class PublicState:
    """A robot as it reported itself for ``tick``: the answer to all six queries of the common robot interface."""

    epoch: int
    tick: int
    location: Point
    """Where it stood, meters."""
    speed_mps: float
    direction_rad: float
    state_variables: StateVariables
    emotion_state: str
    behavior_state: str


@dataclass(frozen=True, slots=True)
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
    stream: str
    """Name of the random stream that is its own."""
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
    news_flag: int = 0
    """Its flag in :attr:`Clock.news`."""
    last_state: PublicState | None = None
    """What its previous incarnation reported last in this epoch."""
    state_before: PublicState | None = None
    """What that one reported for the tick before, where others may still ask for it."""


class Refused(Exception):
    """The simulator does not let a robot in; the text says why and what to do about it."""

    def __init__(self, reason: str, explanation: str) -> None:
        super().__init__(explanation)
        self.reason = reason


@dataclass(frozen=True, slots=True)
class Correction:
    """A robot does not stand where it proposed to."""

    location: Point
    blocked: bool
    """Whether its move was refused; else it was placed there."""


class Delivery(NamedTuple):
    """A command that arrives."""

    sender: str
    command: str


class SensedRobot(NamedTuple):
    """Another robot within sensing range."""

    name: str
    location: Point


class SensedBody(NamedTuple):
    """One sensed body: ``obstacle``, ``guest`` or ``robot``, and its center."""

    kind: str
    location: Point


@dataclass(frozen=True, slots=True)
class Percept:
    """What a robot senses around itself as of ``tick``, in a fixed order."""

    epoch: int = 0
    tick: int = 0
    bodies: tuple[SensedBody, ...] = ()


@dataclass(frozen=True, slots=True)
class News:
    """What is new for one robot in a tick; put before the tick's clock."""

    epoch: int = 0
    tick: int = 0
    joined: int | None = None
    """The incarnation of this generation takes part from this tick on."""
    rejoin: int | None = None
    """The incarnation of this generation takes part no more: its process joins again."""
    correction: Correction | None = None
    commands: tuple[Delivery, ...] = ()
    """Commands that arrive now, in this order. One that is listed twice counts as two."""
    unreachable: tuple[str, ...] = ()
    """Robots that it cannot query in this tick."""
    sensed: tuple[SensedRobot, ...] = ()
    """Other robots within its sensing range."""
    bodies: tuple[SensedBody, ...] = ()
    """All bodies within its sensing range, if it asked for them when it joined."""


NO_NEWS = News()


@dataclass(frozen=True, slots=True)
class Clock:
    """The simulator grants a tick."""

    epoch: int = 0
    tick: int = 0
    news: int = 0
    """Flags of the robots that have news in this tick."""
    end: str | None = None
    """``finished``, ``stopped`` or ``aborted``: the run is over."""


@dataclass(slots=True)
class Report:
    """A robot has done its tick."""

    state: PublicState
    generation: int
    proposal: Point
    commands: Sequence[tuple[str, str]] = ()
    """Targets and texts of the commands it sent in this tick, in order."""
    log: list[str] = field(default_factory=list)


# Writing.

_encoder = json.JSONEncoder(ensure_ascii=False, check_circular=False, allow_nan=False, separators=(",", ":"))


def encode(message: object) -> bytes:
    """Writes a message."""
    return _encoder.encode(message).encode()


def shortened(text: str, max_bytes: int = 500) -> str:
    """The text, cut where its UTF-8 is longer than that and never within a character."""
    data = text.encode(errors="replace")
    if len(data) <= max_bytes:
        return text if text.isascii() else data.decode()
    return data[:max_bytes].decode(errors="ignore")


def _point_json(point: Point) -> Json:
    return {"x": point.x, "y": point.y}


def state_json(state: PublicState) -> Json:
    """A state as JSON."""
    return {
        "epoch": state.epoch,
        "tick": state.tick,
        "location": _point_json(state.location),
        "speed_mps": state.speed_mps,
        "direction_rad": state.direction_rad,
        "state_variables": state.state_variables,
        "emotion_state": state.emotion_state,
        "behavior_state": state.behavior_state,
    }


def answer_json(state: PublicState, what: str) -> Json | None:
    """The answer to the query called ``what``; ``None`` if there is no such query."""
    match what:
        case "location":
            value: object = _point_json(state.location)
        case "speed":
            value = state.speed_mps
        case "direction":
            value = state.direction_rad
        case "state_variables" | "emotion_state" | "behavior_state":
            value = getattr(state, what)
        case _:
            return None
    return {"performative": "tell", "epoch": state.epoch, "tick": state.tick, "value": value}


def command_json(report: Report, number: int, text: str) -> Json:
    """The command of this number, from 1, among those of a tick as JSON."""
    return {
        "epoch": report.state.epoch,
        "tick": report.state.tick,
        "generation": report.generation,
        "number": number,
        "performative": "achieve",
        "command": text,
    }


def report_json(report: Report) -> Json:
    """A report as JSON."""
    message = state_json(report.state)
    del message["location"]
    message["generation"] = report.generation
    message["proposal"] = _point_json(report.proposal)
    if report.commands:
        message["commands"] = len(report.commands)
    if report.log:
        message["log"] = report.log
    return message


# Reading.


class _Wrong(Exception):
    """A field that is wrong, and why."""

    def __init__(self, path: str, reason: str) -> None:
        super().__init__(path, reason)
        self.path = path
        self.reason = reason


def _no_constant(text: str) -> float:
    raise ValueError(f"{text} is not a number of JSON")


_decoder = json.JSONDecoder(parse_constant=_no_constant)


def decode(key: str, sender: str, data: bytes, read: Callable[[Any], T]) -> T:
    """Reads a message that came on ``key``.

    :raises Malformed: names key, sender, field and reason.
    """
    if len(data) > MAX_MESSAGE_BYTES:
        raise Malformed(key, sender, ".", f"{len(data)} bytes, more than the {MAX_MESSAGE_BYTES} allowed")
    try:
        return read(_decoder.decode(data.decode()))
    except _Wrong as wrong:
        raise Malformed(key, sender, shortened(wrong.path), wrong.reason) from None
    except (ValueError, RecursionError) as error:
        raise Malformed(key, sender, ".", str(error)) from None


_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]{0,63}")


def is_name(text: object) -> bool:
    """Whether this is a name for a run or a robot: 1 to 64 letters, digits, ``_``, ``-`` or ``.``, no leading ``.``."""
    return isinstance(text, str) and _NAME.fullmatch(text) is not None


_ABSENT = object()


def _object(value: object, path: str = ".") -> Json:
    if isinstance(value, dict):
        return value
    raise _Wrong(path, f"not an object but {_kind(value)}")


def _kind(value: object) -> str:
    if value is _ABSENT:
        return "missing"
    return {dict: "an object", list: "a list", str: "a text", type(None): "null", bool: "a flag"}.get(
        type(value), "a number"
    )


def _integer(of: Json, name: str, below: int = 1 << 64, default: object = _ABSENT) -> int:
    value = of.get(name, default)
    if type(value) is int and 0 <= value < below:
        return value
    raise _Wrong(name, f"not a whole number from 0 to {below - 1} but {_kind(value)}")


def _tick(of: Json) -> int:
    return _integer(of, "tick", 1 << 53)


def _epoch(of: Json) -> int:
    return _integer(of, "epoch", 1 << 32)


def _as_number(value: object, path: str) -> float:
    if type(value) is float and math.isfinite(value):
        return value
    if type(value) is int:
        try:
            return float(value)
        except OverflowError:
            pass
    raise _Wrong(path, f"not a finite number but {_kind(value)}")


def _number(of: Json, name: str) -> float:
    return _as_number(of.get(name, _ABSENT), name)


def _as_text(value: object, path: str) -> str:
    if not isinstance(value, str):
        raise _Wrong(path, f"not a text but {_kind(value)}")
    # Surrogates that JSON can escape and UTF-8 cannot hold must not be passed on.
    if not value.isascii():
        try:
            length = len(value.encode())
        except UnicodeEncodeError:
            raise _Wrong(path, "not Unicode") from None
    else:
        length = len(value)
    if length > MAX_TEXT_BYTES:
        raise _Wrong(path, f"{length} bytes of text, more than the {MAX_TEXT_BYTES} allowed")
    return value


def _text(of: Json, name: str) -> str:
    return _as_text(of.get(name, _ABSENT), name)


def _as_name(value: object, path: str) -> str:
    if isinstance(value, str) and is_name(value):
        return value
    raise _Wrong(path, "not a usable name")


def _name(of: Json, name: str) -> str:
    return _as_name(of.get(name, _ABSENT), name)


def _list(of: Json, name: str, default: object = _ABSENT) -> list[Any]:
    value = of.get(name, default)
    if isinstance(value, list):
        return value
    raise _Wrong(name, f"not a list but {_kind(value)}")


def _flag(of: Json, name: str) -> bool:
    value = of.get(name, False)
    if isinstance(value, bool):
        return value
    raise _Wrong(name, f"not a flag but {_kind(value)}")


def _within(path: str, read: Callable[[Any], T], value: object) -> T:
    try:
        return read(value)
    except _Wrong as wrong:
        raise _Wrong(path if wrong.path == "." else f"{path}.{wrong.path}", wrong.reason) from None


def _optional(of: Json, name: str, read: Callable[[Any], T]) -> T | None:
    value = of.get(name)
    return None if value is None else _within(name, read, value)


def _all(of: Json, name: str, read: Callable[[Any], T]) -> tuple[T, ...]:
    return tuple(_within(f"{name}[{i}]", read, value) for i, value in enumerate(_list(of, name, [])))


def _read_point(value: object) -> Point:
    of = _object(value)
    return Point(_number(of, "x"), _number(of, "y"))


def _point(of: Json, name: str) -> Point:
    return _within(name, _read_point, of.get(name, _ABSENT))


def _read_variables(value: object) -> StateVariables:
    of = _object(value)
    if len(of) > MAX_ENTRIES:
        raise _Wrong(".", f"{len(of)} entries, more than the {MAX_ENTRIES} allowed")
    variables: dict[str, Variable] = {}
    for name, variable in of.items():
        _as_text(name, ".")
        if isinstance(variable, bool):
            variables[name] = variable
        elif isinstance(variable, str):
            variables[name] = _as_text(variable, name)
        else:
            variables[name] = _as_number(variable, name)
    return variables


def read_state(value: object) -> PublicState:
    """Reads a state."""
    of = _object(value)
    return PublicState(
        epoch=_epoch(of),
        tick=_tick(of),
        location=_point(of, "location"),
        speed_mps=_number(of, "speed_mps"),
        direction_rad=_number(of, "direction_rad"),
        state_variables=_within("state_variables", _read_variables, of.get("state_variables", _ABSENT)),
        emotion_state=_text(of, "emotion_state"),
        behavior_state=_text(of, "behavior_state"),
    )


def _read_correction(value: object) -> Correction:
    of = _object(value)
    return Correction(_point(of, "location"), _flag(of, "blocked"))


def _read_delivery(value: object) -> Delivery:
    of = _object(value)
    return Delivery(_name(of, "from"), _text(of, "command"))


def _read_sensed_robot(value: object) -> SensedRobot:
    of = _object(value)
    return SensedRobot(_name(of, "name"), _point(of, "location"))


def _read_body(value: object) -> SensedBody:
    of = _object(value)
    kind = of.get("kind")
    if kind not in ("obstacle", "guest", "robot"):
        raise _Wrong("kind", "none of obstacle, guest, robot")
    return SensedBody(kind, _point(of, "location"))


def read_news(value: object) -> News:
    """Reads a robot's news."""
    of = _object(value)
    return News(
        epoch=_epoch(of),
        tick=_tick(of),
        joined=None if of.get("joined") is None else _integer(of, "joined", 1 << 32),
        rejoin=None if of.get("rejoin") is None else _integer(of, "rejoin", 1 << 32),
        correction=_optional(of, "correction", _read_correction),
        commands=_all(of, "commands", _read_delivery),
        unreachable=_all(of, "unreachable", lambda name: _as_name(name, ".")),
        sensed=_all(of, "sensed", _read_sensed_robot),
        bodies=_all(of, "bodies", _read_body),
    )


_ENDS = ("aborted", "finished", "stopped")


def read_clock(value: object) -> Clock:
    """Reads a clock."""
    of = _object(value)
    end = of.get("end")
    if end is not None and end not in _ENDS:
        raise _Wrong("end", f"none of {', '.join(_ENDS)}")
    return Clock(_epoch(of), _tick(of), _integer(of, "news", 1 << 32, default=0), end)


def _read_welcome(of: Json) -> Welcome:
    field_m = _list(of, "field_m")
    if len(field_m) != 2:
        raise _Wrong("field_m", "not width and height")
    _list(of, "roster")
    return Welcome(
        run=_name(of, "run"),
        name=_name(of, "name"),
        generation=_integer(of, "generation", 1 << 32),
        epoch=_epoch(of),
        tick=_tick(of),
        seed=_integer(of, "seed"),
        stream=_text(of, "stream"),
        tick_s=_number(of, "tick_s"),
        field_m=(_as_number(field_m[0], "field_m"), _as_number(field_m[1], "field_m")),
        body_m=_number(of, "body_m"),
        sensing_range_m=_number(of, "sensing_range_m"),
        location=_point(of, "location"),
        roster=_all(of, "roster", lambda name: _as_name(name, ".")),
        parameters=_object(of.get("parameters", _ABSENT), "parameters"),
        news_flag=_integer(of, "news_flag", 1 << 32, default=0),
        last_state=_optional(of, "last_state", read_state),
        state_before=_optional(of, "state_before", read_state),
    )


def read_join_answer(value: object) -> Welcome | Refused:
    """Reads the simulator's answer to a robot that asked to join."""
    of = _object(value)
    answer = of.get("answer")
    if answer == "welcome":
        return _read_welcome(of)
    if answer == "refused":
        return Refused(_text(of, "reason"), _text(of, "explanation"))
    raise _Wrong("answer", "neither welcome nor refused")
