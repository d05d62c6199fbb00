"""Messages: what is read, what is refused and how, what is written."""

from __future__ import annotations

import json
import math

import pytest
from stage import welcome

from cars_robot import Panel, panel
from cars_robot.messages import (
    Clock,
    Correction,
    Delivery,
    Malformed,
    Point,
    Refused,
    SensedBody,
    Welcome,
    decode,
    encode,
    is_name,
    read_clock,
    read_join_answer,
    read_news,
    read_state,
    shortened,
    state_json,
)
from cars_robot.panel import panel_json
from cars_robot.seat import published_angle

STATE = {
    "epoch": 1,
    "tick": 7,
    "location": {"x": 0.1, "y": 1e-9},
    "speed_mps": 0.30000000000000004,
    "direction_rad": -3.141593,
    "state_variables": {"a": True, "b": 7, "c": "caf\u00e9 \U0001f600"},
    "emotion_state": "HAPPY",
    "behavior_state": "WAIT",
}


def test_a_state_survives_the_way_there_and_back() -> None:
    state = decode("k", "A", encode(STATE), read_state)
    assert decode("k", "A", encode(state_json(state)), read_state) == state
    assert state.location == Point(0.1, 1e-9) and state.state_variables["b"] == 7.0
    assert isinstance(state.state_variables["b"], float) and state.state_variables["a"] is True


@pytest.mark.parametrize(
    ("change", "field", "reason"),
    [
        ({"tick": -1}, "tick", "not a whole number from 0"),
        ({"tick": 1 << 53}, "tick", "not a whole number from 0"),
        ({"tick": True}, "tick", "not a whole number from 0 to 9007199254740991 but a flag"),
        ({"epoch": 1 << 32}, "epoch", "not a whole number from 0"),
        ({"location": {"x": 1}}, "location.y", "not a finite number but missing"),
        ({"location": [1, 2]}, "location", "not an object but a list"),
        ({"speed_mps": None}, "speed_mps", "not a finite number but null"),
        ({"speed_mps": 10**400}, "speed_mps", "not a finite number but a number"),
        ({"state_variables": {"v": []}}, "state_variables.v", "not a finite number but a list"),
        ({"state_variables": {str(i): i for i in range(1025)}}, "state_variables", "1025 entries"),
        ({"emotion_state": "\u00e9" * 2049}, "emotion_state", "4098 bytes of text"),
        ({"emotion_state": "\ud800"}, "emotion_state", "not Unicode"),
    ],
)
def test_what_is_wrong_is_named(change: dict[str, object], field: str, reason: str) -> None:
    with pytest.raises(Malformed) as raised:
        decode("cars/r/robot/A/state", "A", json.dumps(STATE | change).encode(), read_state)
    assert str(raised.value).startswith(f"malformed message on cars/r/robot/A/state from A: field {field}: {reason}")
    assert len(str(raised.value)) < 700


def test_what_is_missing_is_named() -> None:
    for name in STATE:
        lacking = {other: value for other, value in STATE.items() if other != name}
        with pytest.raises(Malformed, match=f"field {name}: .*missing"):
            decode("k", "A", encode(lacking), read_state)


def test_a_clock_has_flags_of_news() -> None:
    quiet = decode("k", "s", b'{"epoch":1,"tick":3,"from_the_future":[]}', read_clock)
    assert quiet == Clock(1, 3)
    assert decode("k", "s", b'{"epoch":1,"tick":3,"end":null,"news":4294967295}', read_clock).news == (1 << 32) - 1
    with pytest.raises(Malformed, match="field news: not a whole number"):
        decode("k", "s", b'{"epoch":1,"tick":3,"news":4294967296}', read_clock)


def test_news_tell_exceptions_only() -> None:
    quiet = decode("k", "s", b'{"epoch":1,"tick":3,"from_the_future":[]}', read_news)
    assert (quiet.joined, quiet.correction, quiet.commands, quiet.bodies) == (None, None, (), ())
    told = {
        "epoch": 1,
        "tick": 3,
        "joined": 2,
        "correction": {"location": {"x": 1, "y": 2}},
        "commands": [{"from": "B", "performative": "achieve", "command": "go"}] * 2,
        "unreachable": ["B"],
        "bodies": [{"kind": "guest", "location": {"x": 1, "y": 2}}],
    }
    news = decode("k", "s", encode(told), read_news)
    assert news.correction == Correction(Point(1.0, 2.0), False) and news.joined == 2
    assert news.commands == (Delivery("B", "go"),) * 2 and news.unreachable == ("B",)
    assert news.bodies == (SensedBody("guest", Point(1.0, 2.0)),)


def test_a_welcome_is_read_with_defaults() -> None:
    answer = decode("k", "s", encode(welcome(seed=(1 << 64) - 1)), read_join_answer)
    assert isinstance(answer, Welcome)
    assert (answer.seed, answer.news_flag, answer.last_state) == ((1 << 64) - 1, 1, None)
    refused = decode("k", "s", b'{"answer":"refused","reason":"ended","explanation":"e"}', read_join_answer)
    assert isinstance(refused, Refused) and (refused.reason, str(refused)) == ("ended", "e")


def test_text_is_cut_between_characters() -> None:
    assert shortened("abc", 3) == "abc" and shortened("abcd", 3) == "abc"
    assert shortened("\u00e9" * 5, 5) == "\u00e9" * 2
    assert shortened("\U0001f600" * 2, 7) == "\U0001f600"
    assert shortened("a\ud800b", 10) == "a?b"


def test_names_that_would_break_a_key_or_a_path_are_refused() -> None:
    for bad in ["", "a/b", "*", "a b", "..", "\u00e9", "x" * 65, "a\n", 7, None]:
        assert not is_name(bad), bad
    for good in ["Butler", "r-2_d.2", "x" * 64]:
        assert is_name(good)


def test_published_angles_are_rounded() -> None:
    for angle, published in [(0.12345649, 0.123456), (0.1234565, 0.123457), (-math.pi, -3.141593), (-1e-9, 0.0)]:
        assert published_angle(angle) == published
    assert json.dumps(published_angle(-0.0)) == "0.0"
    assert not math.isfinite(published_angle(math.nan)) and not math.isfinite(published_angle(1e308))


def test_a_panel_stays_within_the_limits_of_a_message() -> None:
    shown = panel_json(
        Panel(
            [
                panel.Sparkline("s", [1.0, math.inf] * 5000),
                panel.Table([["x" * 5000]]),
                *[panel.Face("sad", 1.0)] * 99,
            ]
        )
    )["widgets"]
    assert len(shown) == 64 and len(shown[0]["values"]) == 1024 and shown[0]["values"][1] == 0.0
    assert len(shown[1]["rows"][0][0]) == 4096 and shown[2] == {"widget": "face", "face": "sad", "intensity": 1.0}
