"""The protocol as a robot's process speaks it, rule by rule; the names in brackets are the rules' in docs/protocol.md."""

from __future__ import annotations

import ctypes
import json
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from lab import EXAMPLES, PATIENCE_S, eventually
from stage import Stage, flag, welcome

from cars_robot import stream
from cars_robot.link import LOOK_FOR_SIMULATOR_S

Json = dict[str, Any]
NAMED = {"joined": 1}


def begin(stage: Stage, *arguments: str) -> subprocess.Popen[str]:
    """A robot that has answered tick 0."""
    process = stage.ready(*arguments)
    stage.tick(0, A=NAMED)
    return process


def says(text: str, sender: str = "B") -> Json:
    """A command that arrives, as news."""
    return {"from": sender, "performative": "achieve", "command": text}


def order(stage: Stage, tick: int, text: str, epoch: int = 1) -> Json:
    """A's report of a tick in which B's command arrives."""
    return stage.tick(tick, epoch, A={"commands": [says(text)]})


def send_to_sleep(stage: Stage, robot: subprocess.Popen[str], tick: int, seconds: float, *more: Json) -> None:
    """Grants a tick in which A sleeps, and waits until it does; then it is told more."""
    stage.clock(tick, A={"commands": [says(f"sleep {seconds}"), *more]})
    assert robot.stdout is not None and robot.stdout.readline() == "sleeps\n"


def test_it_listens_before_it_asks_and_shows_its_token_last(stage: Stage) -> None:
    """[join.request, join.ready-last]"""
    stage.ready()
    assert len(stage.joins) == 1
    request = stage.joins[0]
    assert (request["protocol"], request["run"], request["name"]) == (2, "r", "A")
    assert request["instance"] and request["sdk"].startswith("python/")
    assert request["bodies"] is True
    assert request["listens"] and not request["alive"] and request["key"] == "cars/r/join/A"
    # It takes part at once: nothing that comes after the token is lost.
    assert stage.tick(0, A=NAMED)["generation"] == 1


def test_who_does_without_bodies_asks_for_none(stage: Stage) -> None:
    """[join.request]"""
    stage.robot("--name", "A", script=EXAMPLES / "idle.py")
    stage.until_alive("A")
    assert stage.joins[0]["bodies"] is False


def test_a_refusal_ends_it_with_the_reason(stage: Stage) -> None:
    """[join.refused]"""
    stage.welcome = lambda _: {"answer": "refused", "reason": "unknown_name", "explanation": "who is A?"}
    robot = stage.robot()
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert (robot.returncode, said) == (1, "error: A may not join: who is A?\n")


def test_a_name_that_is_taken_is_asked_for_again(stage: Stage) -> None:
    """[join.refused]"""
    taken = {"answer": "refused", "reason": "name_taken", "explanation": "another one is A"}
    stage.welcome = lambda _: taken if len(stage.joins) < 3 else welcome()
    stage.ready()
    assert len(stage.joins) == 3
    stage.welcome = lambda _: taken
    robot = stage.robot("--name", "B", CARS_PATIENCE_S="0.3")
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert (robot.returncode, said) == (1, "error: B may not join: another one is A\n")


def test_a_tick_is_what_figure_5_says(stage: Stage) -> None:
    """[tick.answer, tick.initial, tick.correction]"""
    stage.ready()
    first = stage.tick(0, A=NAMED)
    assert first["proposal"] == {"x": 4.0, "y": 4.0} and first["log"] == ["init", "location", "project"]
    assert first["state_variables"] == {"whole": 7, "part": 0.1, "flag": True, "text": "caf\u00e9"}
    assert first["direction_rad"] == 0.123457  # [number.angles]
    second = stage.tick(1)
    assert second["log"] == ["location", "variables", "emotion", "behavior", "project"]
    assert second["proposal"] == {"x": 5.0, "y": 4.0}
    moved = stage.tick(2, A={"correction": {"location": {"x": 1, "y": 1}, "blocked": True}})
    assert moved["proposal"] == {"x": 2.0, "y": 1.0}
    assert stage.tick(3)["proposal"] == {"x": 3.0, "y": 1.0}


def test_the_same_clock_brings_the_same_bytes_and_the_commands_again(stage: Stage) -> None:
    """[clock.duplicate, command.sent]"""
    begin(stage)
    stage.said.clear()
    news = {"commands": [says("tell C hello there"), says("tell B hi")]}
    keys = ["robot/C/command/A", "robot/B/command/A", "robot/A/report"]
    for key in ["robot/A/state", keys[2]]:
        stage.all_heard(key)
    stage.clock(1, A=news)
    first = [stage.heard_bytes(key) for key in keys]
    assert json.loads(first[2])["commands"] == 2
    told = {"epoch": 1, "tick": 1, "generation": 1, "number": 1, "performative": "achieve", "command": "hello there"}
    assert json.loads(first[0]) == told
    assert json.loads(first[1]) == told | {"number": 2, "command": "hi"}
    put = [key for key in stage.said if key in [*keys, "robot/A/state"]]
    assert put == [*keys[:2], "robot/A/state", keys[2]]
    stage.clock(1, A=news)
    assert [stage.heard_bytes(key) for key in keys] == first
    assert [key for key in stage.said if key in keys] == keys * 2
    # Commands of an earlier tick are not repeated.
    second = stage.tick(2)
    stage.clock(2)
    assert stage.heard("robot/A/report") == second and "commands" not in second
    assert [key for key in stage.said if key in keys] == keys * 2 + keys[2:] * 2


def test_late_clocks_are_echoes(stage: Stage) -> None:
    """[clock.late]"""
    begin(stage)
    stage.tick(1)
    stage.clock(0)
    stage.clock(1, epoch=0)
    assert stage.tick(2)["tick"] == 2 and stage.nothing_more("robot/A/report")


def test_only_the_newest_clock_is_run(stage: Stage) -> None:
    """[clock.late] A robot that is late still reports the tick that it was in."""
    send_to_sleep(stage, begin(stage), 1, 1.0)
    stage.clock(2)
    stage.clock(3)
    assert [stage.heard("robot/A/report")["tick"] for _ in range(2)] == [1, 3]
    assert stage.tick(4)["tick"] == 4 and stage.nothing_more("robot/A/report")


def test_commands_come_with_the_news_in_their_order(stage: Stage) -> None:
    """[command.order, command.twice]"""
    begin(stage)
    told = [("B", "one"), ("C", "two"), ("C", "two"), ("C", "three")]
    report = stage.tick(1, A={"commands": [says(f"note {text}", sender) for sender, text in told]})
    obeyed = [line for line in report["log"] if line.startswith("command")]
    assert obeyed == [f"command {sender} note {text}" for sender, text in told]
    assert not any(line.startswith("command") for line in stage.tick(2)["log"])


def test_news_that_are_flagged_are_waited_for(stage: Stage) -> None:
    """[news.wait] They may be lost, and then come again with the clock; those of another tick do not count."""
    robot = begin(stage)
    assert robot.stderr is not None
    lost = {"epoch": 1, "tick": 1, "news": flag("A")}
    stage.news("A", 0, commands=[says("note of the tick before")])
    stage.news("A", 2, commands=[says("note of the next tick")])
    stage.put("clock", lost)
    # When it complains about the next clock it is done with this one.
    stage.put("clock", b"null")
    assert "malformed message" in robot.stderr.readline()
    assert stage.nothing_more("robot/A/report")
    stage.put("clock", lost)
    stage.news("A", 1, commands=[says("note at last")])
    report = stage.heard("robot/A/report")
    assert [line for line in report["log"] if line.startswith("command")] == ["command B note at last"]
    # The next ones are here already; another robot's flag means nothing.
    stage.put("clock", {"epoch": 1, "tick": 2, "news": flag("A")})
    report = stage.heard("robot/A/report")
    while report["tick"] == 1:  # The clock that came twice may have repeated it.
        report = stage.heard("robot/A/report")
    assert "command B note of the next tick" in report["log"]
    stage.put("clock", {"epoch": 1, "tick": 3, "news": flag("B")})
    assert stage.heard("robot/A/report")["tick"] == 3


def test_questions_get_the_state_of_the_tick_before(stage: Stage) -> None:
    """[query.tick, query.at-once, query.unknown, tick.state-first]"""
    begin(stage)
    stage.tick(1)
    stage.tick(2)
    answers = {tick: stage.ask("location", f"tick={tick};epoch=1") for tick in (2, 3)}
    assert answers == {
        tick: {"performative": "tell", "epoch": 1, "tick": tick - 1, "value": {"x": 2.0 + tick, "y": 4.0}}
        for tick in (2, 3)
    }
    assert stage.ask("state")["tick"] == 2  # type: ignore[index]
    for what, value in [("speed", 1.0), ("emotion_state", "CALM"), ("behavior_state", "WALK")]:
        assert stage.ask(what) == {"performative": "tell", "epoch": 1, "tick": 2, "value": value}
    assert stage.ask("speed", "tick=1") == "that tick is over"
    assert stage.ask("speed", "tick=9") == "that tick is out of range"
    assert stage.ask("speed", "tick=x") == "parameter tick: not a whole number"
    assert stage.ask("speed", "tick=3;epoch=0") == "that tick is over"
    # One that comes a tick early is to be asked again.
    assert stage.ask("location", "tick=4;epoch=1") == "that tick has not been reported yet: ask again"
    stage.tick(3)
    assert stage.ask("location", "tick=4;epoch=1")["tick"] == 3  # type: ignore[index]


def test_questions_are_answered_while_it_is_busy(stage: Stage) -> None:
    """[query.at-once] While it computes, and while it waits for another robot's answer."""
    robot = begin(stage)
    stage.tick(1)
    stage.clock(2, A={"commands": [says("ask B")]})
    assert stage.heard("robot/A/waiting") == {"epoch": 1, "tick": 2, "on": "B"}
    assert stage.ask("state", "tick=2;epoch=1")["tick"] == 1  # type: ignore[index]
    send_to_sleep(stage, robot, 3, 600)
    assert stage.ask("state", "tick=2;epoch=1")["tick"] == 1  # type: ignore[index]


def test_who_follows_has_the_state_before_the_report(stage: Stage) -> None:
    """[tick.state-first]"""
    begin(stage)
    report = stage.tick(1)
    first, second = stage.heard("robot/A/state"), stage.heard("robot/A/state")
    assert (first["tick"], second["tick"]) == (0, 1)
    assert second["state_variables"] == report["state_variables"] and second["location"] == {"x": 4.0, "y": 4.0}


def test_it_asks_others_once_and_follows_them(stage: Stage) -> None:
    """[query.asking]"""
    begin(stage)
    refusals = ["that tick has not been reported yet: ask again"]
    state = {
        "epoch": 1,
        "tick": 0,
        "location": {"x": 1, "y": 1},
        "speed_mps": 0,
        "direction_rad": 0,
        "state_variables": {"n": 7},
        "emotion_state": "SAD",
        "behavior_state": "SIT",
    }
    asked: list[str] = []

    def answer(query: Any) -> None:
        with query:
            asked.append(str(query.parameters))
            if refusals:
                query.reply_err(refusals.pop())
            else:
                query.reply(query.key_expr, json.dumps(state))

    stage._keep.append(stage.session.declare_queryable("cars/r/robot/B/state", answer))
    # It is refused once, and asks again.
    assert "B is SAD" in order(stage, 1, "ask B")["log"]
    assert asked == ["tick=1;epoch=1"] * 2
    # From now on it is told.
    stage.put("robot/B/state", state | {"tick": 1, "emotion_state": "GLAD"})
    stage.put("robot/B/state", b"{}")
    assert "B is GLAD" in order(stage, 2, "ask B")["log"]
    assert asked == ["tick=1;epoch=1"] * 2


def test_calls_that_give_nothing_say_why(stage: Stage) -> None:
    begin(stage)
    assert any("UnknownRobot: no robot is called 'X'" in line for line in order(stage, 1, "ask X")["log"])
    report = stage.tick(2, A={"commands": [says("ask B")], "unreachable": ["B"]})
    assert "Unreachable: B is unreachable" in report["log"]
    bodies = [{"kind": "guest", "location": {"x": 1, "y": 2}, "unknown": None}]
    assert "sees ['guest']" in stage.tick(3, A={"commands": [says("look")], "bodies": bodies})["log"]
    assert "sees []" in order(stage, 4, "look")["log"]


def test_a_wait_ends_with_the_epoch(stage: Stage) -> None:
    """[epoch.init]"""
    begin(stage)
    stage.clock(1, A={"commands": [says("ask B")]})
    assert stage.heard("robot/A/waiting")["on"] == "B"
    stage.welcome = lambda _: welcome(epoch=2, location={"x": 9, "y": 9})
    report = stage.tick(0, epoch=2, A=NAMED)
    assert report["log"][0] == "init" and report["proposal"] == {"x": 10.0, "y": 9.0}
    assert len(stage.joins) == 2 and stage.joins[0]["instance"] == stage.joins[1]["instance"]


def test_an_epoch_begins_everything_anew(stage: Stage) -> None:
    """[epoch.init, determinism.seed]"""
    begin(stage)
    draws = [order(stage, 1, "draw")["log"][3]]
    stage.welcome = lambda _: welcome(epoch=2)
    stage.tick(0, epoch=2, A=NAMED)
    draws.append(order(stage, 1, "draw", epoch=2)["log"][3])
    assert draws == [f"draws {stream(42, 'robot/A').next_u64()}"] * 2
    assert stage.ask("state", "tick=2;epoch=1") == "that tick is over"


def test_a_later_epoch_is_joined_at_any_tick_and_its_turn_waited_for(stage: Stage) -> None:
    """[epoch.late] The clock of tick 0 was lost, or the link was cut for longer."""
    begin(stage)
    stage.tick(1)
    stage.welcome = lambda _: welcome(epoch=2, generation=3, tick=5)
    stage.clock(5, epoch=2)
    eventually("it to join again", lambda: len(stage.joins) == 2 or None)
    stage.clock(6, epoch=2, A={"sensed": []})
    stage.clock(7, epoch=2, A={"joined": 3})
    report = stage.heard("robot/A/report")
    while report["epoch"] == 1:
        report = stage.heard("robot/A/report")
    assert (report["tick"], report["generation"], report["log"][0]) == (7, 3, "init")
    assert stage.joins[0]["instance"] == stage.joins[1]["instance"]
    # Who is named again goes on.
    assert stage.tick(8, epoch=2, A={"joined": 3})["log"][0] == "location"


def test_what_was_done_in_an_epoch_that_is_over_is_thrown_away(stage: Stage) -> None:
    """[epoch.init]"""
    send_to_sleep(stage, begin(stage), 1, 1.0, says("tell C late"))
    stage.welcome = lambda _: welcome(epoch=2)
    assert stage.tick(0, epoch=2)["log"][0] == "init"
    assert stage.nothing_more("robot/C/command/A") and stage.nothing_more("robot/A/report")


def test_a_successor_waits_for_its_clock_and_takes_over(stage: Stage) -> None:
    """[return.generation]"""
    last = {
        "epoch": 1,
        "tick": 6,
        "location": {"x": 5, "y": 5},
        "speed_mps": 0,
        "direction_rad": 0,
        "state_variables": {"trips": 3},
        "emotion_state": "SAD",
        "behavior_state": "SIT",
    }
    before = last | {"tick": 5, "emotion_state": "GLAD"}
    stage.welcome = lambda _: welcome(generation=2, tick=7, stream="robot/A#2", last_state=last, state_before=before)
    stage.ready()
    # Others may still ask what its predecessor has said.
    assert [stage.ask("emotion_state", f"tick={tick};epoch=1")["value"] for tick in (6, 7)] == ["GLAD", "SAD"]  # type: ignore[index]
    stage.clock(7)
    report = stage.tick(8, A={"joined": 2, "commands": [says("tell C I am back")]})
    assert report["generation"] == 2 and report["commands"] == 1
    sent = stage.heard("robot/C/command/A")
    assert (sent["generation"], sent["number"], sent["command"]) == (2, 1, "I am back")
    assert report["log"][:2] == ["init", "resumes [('trips', 3.0)]"]
    assert stage.nothing_more("robot/A/report")


def test_who_is_asked_to_joins_again_and_starts_over(stage: Stage) -> None:
    """[return.rejoin]"""
    begin(stage)
    order(stage, 1, "draw")
    stage.welcome = lambda _: welcome(generation=2, tick=4, stream="robot/A#2")
    # Also in the middle of a tick, whose result is thrown away.
    stage.clock(2, A={"commands": [says("ask B")]})
    assert stage.heard("robot/A/waiting")["on"] == "B"
    for _ in range(2):
        stage.clock(5, A={"rejoin": 1})
    eventually("it to join again", lambda: len(stage.joins) == 2 or None)
    stage.clock(5, A={"rejoin": 1})
    report = stage.tick(6, A={"joined": 2, "commands": [says("draw")]})
    assert (report["generation"], report["log"][0]) == (2, "init")
    assert f"draws {stream(42, 'robot/A#2').next_u64()}" in report["log"]
    assert len(stage.joins) == 2 and stage.joins[0]["instance"] == stage.joins[1]["instance"]
    assert stage.nothing_more("robot/A/report")


def test_a_clock_of_an_epoch_that_has_not_begun_changes_nothing(stage: Stage) -> None:
    """[epoch.init] A clock from elsewhere, for example."""
    begin(stage)
    order(stage, 1, "draw")
    for tick in range(6):
        stage.news("A", tick, epoch=9, commands=[says("draw")])
        stage.clock(tick, epoch=9)
    eventually("it to join again", lambda: len(stage.joins) > 1 or None)
    first, second = stream(42, "robot/A"), order(stage, 2, "draw")
    first.next_u64()
    assert second["log"][0] == "location" and f"draws {first.next_u64()}" in second["log"]
    # Also in the middle of a tick.
    stage.clock(3, A={"commands": [says("ask B")]})
    assert stage.heard("robot/A/waiting")["on"] == "B"
    asked = len(stage.joins)
    stage.clock(0, epoch=9)
    eventually("it to join again", lambda: len(stage.joins) > asked or None)
    at = {"location": {"x": 1, "y": 1}, "speed_mps": 0, "direction_rad": 0, "state_variables": {}}
    stage.put("robot/B/state", at | {"epoch": 1, "tick": 2, "emotion_state": "SAD", "behavior_state": "SIT"})
    report = stage.heard("robot/A/report")
    assert report["tick"] == 3 and "B is SAD" in report["log"]


def test_one_who_is_replaced_ends(stage: Stage) -> None:
    """[return.replaced]"""
    robot = begin(stage)
    stage.clock(1, A={"joined": 2})
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert (robot.returncode, said) == (1, "error: another process is A now\n")
    stage.until_alive()


@pytest.mark.parametrize("end", ["finished", "stopped", "aborted"])
def test_it_ends_with_the_run(stage: Stage, end: str) -> None:
    """[end.clock]"""
    robot = begin(stage)
    stage.clock(1, end=end)
    assert robot.wait(PATIENCE_S) == 0
    stage.until_alive()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("order_", ["", "sleep 600", "ask B"])
def test_a_signal_ends_it_cleanly(stage: Stage, number: signal.Signals, order_: str) -> None:
    """[end.sigterm] Between two ticks, within one, and while it waits for an answer."""
    robot = begin(stage)
    if order_:
        stage.clock(1, A={"commands": [says(order_)]})
        if order_ == "ask B":
            stage.heard("robot/A/waiting")
    robot.send_signal(number)
    assert robot.wait(PATIENCE_S) == -number
    # The token was taken back before: a process that is killed is noticed as fast, but closes nothing.
    stage.until_alive()


def test_a_signal_that_wakes_no_main_thread_ends_it(stage: Stage) -> None:
    """[end.sigterm] The system may give a signal to any thread, and a thread that is about to wait does not notice it."""
    robot = begin(stage)
    threads = [int(thread.name) for thread in Path(f"/proc/{robot.pid}/task").iterdir()]
    other = max(thread for thread in threads if thread != robot.pid)
    libc = ctypes.CDLL(None, use_errno=True)
    assert libc.tgkill(robot.pid, other, signal.SIGTERM) == 0
    # A robot that did not notice would look around after LOOK_FOR_SIMULATOR_S.
    assert robot.wait(LOOK_FOR_SIMULATOR_S / 2) == -signal.SIGTERM
    stage.until_alive()


def test_a_flood_holds_the_link_and_not_the_end(stage: Stage) -> None:
    """[end.sigterm] More than the queue takes has arrived, and the robot is busy."""
    robot = begin(stage)
    send_to_sleep(stage, robot, 1, 600)
    for tick in range(2, 12_000):
        stage.news("A", tick, commands=[says("note " + "x" * 100)])
    robot.send_signal(signal.SIGTERM)
    assert robot.wait(PATIENCE_S) == -signal.SIGTERM


def test_a_flood_is_survived(stage: Stage) -> None:
    """News of ticks that never come."""
    send_to_sleep(stage, begin(stage), 1, 1.0)
    for tick in range(100, 10_000):
        stage.news("A", tick, commands=[says("note " + "x" * 100)])
    stage.heard("robot/A/report")
    report = stage.tick(20_000, A={"commands": [says("note fine")]})
    assert sum(line.startswith("command B note") for line in report["log"]) == 1


DAMAGED = [
    b"",
    b"\xff\xfe",
    b"null",
    b"[]",
    b"{}",
    b'{"epoch":1,"tick":-1}',
    b'{"epoch":1,"tick":1.0}',
    b'{"epoch":1,"tick":"1"}',
    b'{"epoch":1,"tick":9007199254740992}',
    b'{"epoch":1,"tick":1,"end":"sometime"}',
    b'{"epoch":1,"tick":1,"end":{}}',
    b'{"epoch":1,"tick":1,"news":null}',
    b'{"epoch":1,"tick":1,"news":-1}',
    b'{"epoch":1,"tick":1,"news":4294967296}',
    b'{"epoch":1,"tick":1,"news":{"A":{}}}',
    b'{"epoch":1,"tick":1}trailing',
    b"[" * 100_000,
    b'{"epoch":1,"tick":1,"x":"' + b"x" * (1 << 20) + b'"}',
]

WRONG = [
    b"",
    b"null",
    b"{}",
    b'{"epoch":1,"tick":-1}',
    b'{"epoch":1,"tick":1}trailing',
    b'{"epoch":1,"tick":1,"joined":-1}',
    b'{"epoch":1,"tick":1,"correction":{"location":{"x":NaN,"y":0}}}',
    b'{"epoch":1,"tick":1,"correction":{"location":{"x":1e999,"y":0}}}',
    b'{"epoch":1,"tick":1,"commands":[{"from":"a/b","command":"note"}]}',
    b'{"epoch":1,"tick":1,"commands":[{"from":"B","command":null}]}',
    b'{"epoch":1,"tick":1,"commands":[{"from":"B","command":"' + b"x" * 5000 + b'"}]}',
    b'{"epoch":1,"tick":1,"bodies":[{"kind":"ghost","location":{"x":0,"y":0}}]}',
    b'{"epoch":1,"tick":1,"unreachable":[".."]}',
]


def test_what_is_damaged_changes_nothing(stage: Stage) -> None:
    """[robust.malformed, compat.unknown-fields]"""
    robot = begin(stage)
    for data in DAMAGED:
        stage.put("clock", data)
    for data in WRONG:
        stage.put("robot/A/news", data)
    report = order(stage, 1, "note fine")
    assert "command B note fine" in report["log"]
    assert robot.poll() is None
    stage.clock(2, end="finished")
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert robot.returncode == 0
    assert said.count("malformed message on cars/r/clock from simulator") == len(DAMAGED)
    assert said.count("malformed message on cars/r/robot/A/news from simulator: field") == len(WRONG)


def test_numbers_that_are_none_do_not_travel(stage: Stage) -> None:
    """[number.finite]"""
    begin(stage)
    report = order(stage, 1, "nan")
    assert report["proposal"] == {"x": 4.0, "y": 4.0}
    assert (report["speed_mps"], report["direction_rad"]) == (0.0, 0.0)
    assert sorted(report["state_variables"]) == ["flag", "part", "text", "whole"]
    assert report["log"][-3:] == [
        "error: the projected location is not a number; staying",
        "error: state variable huge is not a finite number; left out",
        "error: state variable inf is not a finite number; left out",
    ]


def test_a_robot_that_fails_ends_with_its_traceback(stage: Stage) -> None:
    robot = begin(stage)
    stage.clock(1, A={"commands": [says("fail")]})
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert robot.returncode == 1 and "ZeroDivisionError: as it was told" in said and said.endswith("see above\n")
    stage.until_alive()


def test_a_panel_is_shown_to_who_looks(stage: Stage) -> None:
    begin(stage)
    shown = stage.heard("robot/A/panel")["widgets"]
    assert shown[0] == {"widget": "bar", "label": "nothing", "value": 0.0, "min": 0.0, "max": 1.0}
    assert shown[1]["widget"] == "text"


def test_several_robots_share_a_session(stage: Stage) -> None:
    stage.robot("--name", "B", "--name", "A")
    stage.until_alive("A", "B")
    assert len({request["instance"] for request in stage.joins}) == 1
    stage.tick(0, A=NAMED, B=NAMED)
    assert stage.heard("robot/B/report")["tick"] == 0
    # What one asks the other needs no network.
    report = stage.tick(1, A={"commands": [says("ask B", "C")]})
    assert "B is CALM" in report["log"]
    assert stage.heard("robot/B/report")["tick"] == 1


def test_a_simulator_that_is_gone_is_waited_for(stage: Stage) -> None:
    robot = begin(stage, "--gone-patience-s", "0.5")
    stage.session.close()  # type: ignore[no-untyped-call]
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert robot.returncode == 1 and said.endswith("error: the simulator has been gone for 0.5 s\n"), said


def test_where_nobody_is_it_says_what_to_do(stage: Stage) -> None:
    robot = stage.robot("--run", "another", CARS_PATIENCE_S="0.3")
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert robot.returncode == 1 and "no simulator of run another answers at tcp/" in said
    robot = stage.robot("--connect", "tcp/127.0.0.1:1", CARS_PATIENCE_S="0.3")
    _, said = robot.communicate(timeout=PATIENCE_S)
    assert robot.returncode == 1 and "cannot reach the simulator at tcp/127.0.0.1:1" in said and ".rs" not in said
