"""Learned robots: the tests of PettingZoo and Gymnasium, whole runs of a seed by all ways to play them, records, and a policy that
learns something."""

from __future__ import annotations

import hashlib
import json
import math
import pickle
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lab import Lab, environment
from numpy.typing import NDArray

import cars
from cars import Action, Cars, Point, Robot

gymnasium = pytest.importorskip("gymnasium", reason="pip install gymnasium")
pytest.importorskip("pettingzoo", reason="pip install pettingzoo")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from pettingzoo.test import api_test, max_cycles_test, parallel_api_test, parallel_seed_test, render_test  # noqa: E402

from cars import rl  # noqa: E402

HALL = "hors_doeuvres"
PAIR: dict[str, Any] = {
    "agents": ["Butler", "Leguin"],
    "duration": "30 s",
    "peers": ["Butler", "Leguin"],
    "says": [("Leguin", "refill"), ("Butler", "wait")],
    "hears": ["refill", "wait"],
    "set": {"measure": [{"name": "walked", "walked": {"robots": "*", "by": "sum"}}]},
    "reward": "walked",
}


def pair(**more: Any) -> rl.CarsParallelEnv:
    """The hall with both robots learned."""
    return rl.parallel_env(HALL, **{**PAIR, **more})


def actions(env: rl.CarsParallelEnv, seed: int) -> Any:
    """Random actions, always the same."""
    for number, agent in enumerate(env.possible_agents):
        env.action_space(agent).seed(seed + number)
    while True:
        yield {agent: env.action_space(agent).sample() for agent in env.agents}


def episode(env: rl.CarsParallelEnv, seed: int) -> list[Any]:
    """All that a run gives, as bytes and numbers."""
    observations, _ = env.reset(seed=seed)
    given: list[Any] = [{agent: row.tobytes() for agent, row in observations.items()}]
    for chosen in actions(env, seed):
        observations, *rest = env.step(chosen)
        given.append(({agent: row.tobytes() for agent, row in observations.items()}, *rest[:3]))
        if not env.agents:
            return given
    raise AssertionError("no run goes on forever")


def test_pettingzoo_and_gymnasium_accept_them() -> None:
    parallel_api_test(pair(), num_cycles=200)
    parallel_seed_test(pair)
    api_test(rl.env(HALL, **PAIR), num_cycles=100)
    module = types.SimpleNamespace(
        parallel_env=lambda max_cycles=60: pair(max_cycles=max_cycles),
        env=lambda max_cycles=60: rl.env(HALL, **PAIR, max_cycles=max_cycles),
    )
    max_cycles_test(module)
    alone = {**PAIR, "agents": ["Butler"], "says": []}
    agent = alone.pop("agents")[0]
    check_env(rl.gym_env(HALL, agent, **alone), skip_render_check=True)


def test_pictures_show_the_field(tmp_path: Path) -> None:
    render_test(lambda render_mode=None: rl.env(HALL, **PAIR, record=tmp_path, render_mode=render_mode))
    env = pair(render_mode="rgb_array")
    env.reset(seed=1)
    picture = env.render()
    assert picture.shape == (480, 480, 3) and picture.dtype == np.uint8
    # Butler stands in the middle, and an agent has a color of its own.
    assert tuple(picture[240, 240]) == (224, 96, 32)
    text = pair(render_mode="ansi")
    text.reset(seed=1)
    assert "agent Butler at 7.62 m, 7.62 m" in text.render()


def test_a_seed_is_the_same_run_from_its_first_step_to_its_last() -> None:
    first = episode(pair(), 7)
    assert len(first) == 61 and first[-1][3] == {"Butler": True, "Leguin": True}
    env = pair()
    episode(env, 8)
    assert episode(env, 7) == first, "what was played before does not matter"
    assert episode(pair(), 8) != first
    other = pair()
    other.reset(seed=3)
    assert episode(env, 7) == first, "nor does another environment in the process"

    script = f"import sys; sys.path[:0] = {sys.path!r}; import test_learning as t, hashlib; print(hashlib.sha256(repr(t.episode(t.pair(), 7)).encode()).hexdigest())"
    printed = [
        subprocess.run([sys.executable, "-c", script], env=environment(), capture_output=True, text=True, check=True, cwd=Path(__file__).parent).stdout.strip()
        for _ in range(2)
    ]
    assert printed == [hashlib.sha256(repr(first).encode()).hexdigest()] * 2, "nor does the process"


def test_threads_do_not_matter() -> None:
    def play(threads: int) -> list[NDArray[Any]]:
        env = rl.vector_env(HALL, ["Butler", "Leguin"], num_envs=6, threads=threads, duration="10 s", reward="walked", set=PAIR["set"])
        observations, _ = env.reset(seed=5)
        given: list[NDArray[Any]] = [observations]
        random = np.random.default_rng(0)
        for _ in range(70):
            assert env.action_space.shape is not None
            given.extend(env.step(random.uniform(-1, 1, env.action_space.shape))[:4])
        return given

    alone = play(1)
    assert all(np.array_equal(one, other) for one, other in zip(alone, play(4)))
    # Every copy has been over three times, and the run after it has another seed.
    over = np.sum(alone[4::4], axis=0)
    assert over.tolist() == [3] * 6
    assert not np.array_equal(alone[0], alone[1 + 4 * 20])

    single = rl.parallel_env(HALL, ["Butler", "Leguin"], duration="10 s", reward="walked", set=PAIR["set"])
    first, _ = single.reset(seed=5 + 3)
    assert np.array_equal(np.stack(list(first.values())), alone[0][3]), "copy i has the seed s + i"


class Repeats(Robot):
    """Does what an agent did, as a robot of Python."""

    def __init__(self, done: list[NDArray[np.float32]], says: list[tuple[str, str]]) -> None:
        self.done, self.says = done, says

    def init(self, cars: Cars) -> None:
        pass

    def tick(self, cars: Cars) -> Action:
        if cars.tick >= len(self.done):
            return Action.stay(cars)
        x, y, said = (float(number) for number in self.done[cars.tick])
        longer = max(1.0, math.sqrt(x * x + y * y))
        x, y = x / longer * 1.0, y / longer * 1.0
        goal = Point(cars.location.x + x * cars.tick_s, cars.location.y + y * cars.tick_s)
        action = Action.go(cars, goal, math.sqrt(x * x + y * y))
        if said:
            cars.set_robot_command(*self.says[int(said) - 1])
        return action


def test_a_run_is_that_of_robots_that_do_the_same(lab: Lab) -> None:
    env = pair(record=lab.folder, name="learned")
    done: dict[str, list[NDArray[np.float32]]] = {"Butler": [], "Leguin": []}
    env.reset(seed=11)
    for chosen in actions(env, 11):
        for agent, action in chosen.items():
            done[agent].append(np.append(action["velocity"], np.float32(action["say"])))
        env.step(chosen)
        if not env.agents:
            break
    assert env.folder == lab.folder / "learned"

    robots = {name: lambda name=name: Repeats(done[name], PAIR["says"]) for name in done}
    run = cars.run(HALL, seed=11, duration="30 s", set=PAIR["set"], robots=robots, out=lab.folder, name="own")
    digest = json.loads((env.folder / "summary.json").read_text())["digest"]
    assert run.summary["digest"] == digest
    assert "the same, 60 ticks to the end" in lab.cars("verify", str(env.folder))
    assert '"command_delivered"' in (run.folder / "events.jsonl").read_text()


def test_a_measure_is_the_sum_of_its_rewards() -> None:
    env = pair(reward={"walked": 2.0})
    env.reset(seed=2)
    total = 0.0
    for chosen in actions(env, 2):
        _, rewards, *_ = env.step(chosen)
        total += rewards["Butler"]
        assert rewards["Butler"] == rewards["Leguin"]
        if not env.agents:
            break
    assert total == pytest.approx(2 * env.measures()["walked"], rel=1e-5)

    called = pair(reward=lambda env, agent: 1.0 if agent == "Butler" else env.measures()["walked"])
    called.reset(seed=2)
    _, rewards, *_ = called.step(next(actions(called, 2)))
    assert rewards["Butler"] == 1.0 and rewards["Leguin"] == pytest.approx(called.measures()["walked"])


def test_one_that_crashes_takes_no_part_until_it_is_back(lab: Lab) -> None:
    faults = {"on_late": "continue", "fault": [{"robot": "Leguin", "at": "5 s", "do": "crash", "until": "10 s"}]}
    env = pair(set={**PAIR["set"], **faults}, record=lab.folder, name="crashed")
    observations, _ = env.reset(seed=4)
    takes_part = [observations["Leguin"][0]]
    for chosen in actions(env, 4):
        observations, *_ = env.step(chosen)
        takes_part.append(observations["Leguin"][0])
        assert env.agents in (["Butler", "Leguin"], [])
        if not env.agents:
            break
    expected = [1.0] * 10 + [0.0] * 10 + [1.0] * 41
    assert takes_part == expected
    assert "the same, 60 ticks to the end" in lab.cars("verify", "crashed", "--out", str(lab.folder))


def test_a_partition_hides_peers_and_messages() -> None:
    cut = {"network.partition": [{"from": "5 s", "until": "10 s", "groups": [["Butler"], ["Leguin"]]}]}
    env = pair(set={**PAIR["set"], **cut})
    known = env.labels.index("Leguin.is_known")
    said = env.labels.index("Leguin.says.wait")
    observations, _ = env.reset(seed=1)
    seen = []
    says = {"Butler": 0, "Leguin": 2}
    while env.agents:
        step = {agent: {"velocity": np.zeros(2, np.float32), "say": say} for agent, say in says.items()}
        observations, *_ = env.step(step)
        seen.append((observations["Butler"][known], observations["Butler"][said]))
    assert seen[5] == (1.0, 1.0) and seen[-1] == (1.0, 1.0)
    assert seen[13] == (0.0, 0.0)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"agents": 3}, "agents must be"),
        ({"peers": 3}, "peers must be"),
        ({"hears": "refill"}, "hears must be"),
        ({"emotions": [3]}, "emotions must be"),
        ({"says": ("Butler", "wait")}, "says must be"),
        ({"says": ["Butler"]}, "says must be"),
        ({"ranges": 1}, "ranges must be"),
        ({"serves": 3}, "serves must be"),
        ({"site_variable": 3}, "site_variable must be"),
        ({"reward": {3: 1}}, "reward must be"),
        ({"reward": {"Butler": {3: 1}}}, "reward must be"),
        ({"count": 3}, "no argument 'count'"),
        ({"foo": 1}, "no argument 'foo'"),
        ({"agents": []}, "agents must be"),
        ({"agents": ["Zoe"]}, "no robot is called Zoe"),
        ({"agents": ["Butler", "Butler"]}, "each once"),
        ({"agents": "Butler"}, "agents must be"),
        ({"reward": "fun"}, "no measure \"fun\""),
        ({"reward": {"Zoe": {"walked": 1}}}, "no robot is called Zoe"),
        ({"reward": {"walked": float("nan")}}, "weight"),
        ({"bodies": -1}, "bodies must be"),
        ({"bodies": 4097}, "bodies must be"),
        ({"ranges": True}, "no rays"),
        ({"peers": ["Zoe"]}, "no robot is called Zoe"),
        ({"says": [("Zoe", "hello")]}, "no robot is called Zoe"),
        ({"speed_mps": 0}, "speed"),
        ({"render_mode": "paper"}, "render_mode"),
        ({"max_cycles": 0}, "max_cycles"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(arguments: dict[str, Any], reason: str) -> None:
    with pytest.raises((cars.Error, TypeError), match=reason):
        pair(**arguments)


def test_steps_that_cannot_be_played_are_refused_and_nothing_is_lost() -> None:
    env = pair(says=[])
    assert env.step({}) == ({}, {}, {}, {}, {})
    with pytest.raises(cars.RefusedError, match=r"call reset\(\)"):
        env.measures()
    for seed, error in ((-1, cars.BadArgument), (2**53, cars.BadArgument), ("7", TypeError)):
        with pytest.raises(error, match="seed"):
            env.reset(seed=seed)  # type: ignore[arg-type]
    env.reset(seed=2**53 - 1)
    env.reset()
    assert env.run_seed == 0
    still = {agent: np.zeros(2, np.float32) for agent in env.agents}
    before = env.measures()
    with pytest.raises(cars.BadArgument, match="Butler, Leguin"):
        env.step({"Butler": still["Butler"]})
    with pytest.raises(cars.RefusedError, match="Leguin is not a finite number"):
        env.step({**still, "Leguin": np.array([0, np.nan], np.float32)})
    assert env.measures() == before
    wrong: Any
    for wrong in (None, [], still | {"Leguin": 0.5}, still | {"Leguin": "a"}, still | {"Leguin": {"velocity": [0, 0]}}):
        with pytest.raises(cars.BadArgument, match="Leguin"):
            env.step(wrong)
    talks = pair()
    with pytest.raises(cars.BadArgument, match="no run has begun"):
        _ = talks.run_seed
    with pytest.raises(cars.Error, match="cannot be copied or pickled"):
        pickle.dumps(talks)
    talks.reset(seed=1)
    for say in (3, -1, 1.5):
        with pytest.raises(cars.BadArgument, match="from 0 to 2"):
            talks.step(dict.fromkeys(talks.agents, {"velocity": [0, 0], "say": say}))
    with pytest.raises(cars.BadArgument, match="an action of Butler"):
        talks.step(dict.fromkeys(talks.agents, {"velocity": [0, 0]}))
    # What is out of bounds is taken for the bound, as a speed that is too high is for a motor.
    fast = {agent: np.full(2, 1e30, np.float32) for agent in env.agents}
    env.step(fast)
    env.step(still)
    assert 0 < env.measures()["walked"] <= 1.0 + 1e-6
    vector = rl.vector_env(HALL, ["Butler"], num_envs=2)
    vector.reset(seed=1)
    with pytest.raises(cars.BadArgument, match=r"\(2, 2\)"):
        vector.step(np.zeros((3, 2)))


@pytest.mark.parametrize("threads", [1, 4])
def test_no_copy_steps_if_one_has_an_action_that_is_no_number(threads: int) -> None:
    refused, other = (rl.vector_env("waiter", ["Rosie"], num_envs=4, threads=threads, bodies=0) for _ in range(2))
    refused.reset(seed=1)
    other.reset(seed=1)
    still = np.zeros((4, 2), np.float32)
    wrong = still.copy()
    wrong[1, 0] = np.nan
    with pytest.raises(cars.BadArgument, match="copy 1 is not a finite number"):
        refused.step(wrong)
    assert np.array_equal(refused.step(still)[0], other.step(still)[0])


def test_no_copy_repeats_a_run_after_a_reset_without_a_seed() -> None:
    env = rl.vector_env("waiter", ["Rosie"], num_envs=2)
    first, _ = env.reset(seed=1)
    again, _ = env.reset()
    single = rl.parallel_env("waiter", ["Rosie"])
    assert np.array_equal(again[0], single.reset(seed=3)[0]["Rosie"])
    assert not np.array_equal(again[0], first[1])


def test_a_record_of_a_run_that_was_left_is_that_of_one_that_was_killed(lab: Lab) -> None:
    env = pair(record=lab.folder, name="left")
    env.reset(seed=1)
    chosen = actions(env, 1)
    for _ in range(10):
        env.step(next(chosen))
    first = env.folder
    env.reset()
    assert first is not None and env.folder == lab.folder / "left-2"
    events = (first / "events.jsonl").read_text().splitlines()
    assert json.loads(events[-1])["tick"] == 9


@pytest.mark.thorough
def test_a_waiter_learns_to_serve() -> None:
    import learn  # noqa: PLC0415

    weights, means = learn.train()
    learned, other = learn.compare(weights)
    more = learned - other
    # Student's t for 31 degrees of freedom, 99 %.
    half = 2.744 * more.std(ddof=1) / len(more) ** 0.5
    print(f"served {learned.mean():.1f}, with random fields {other.mean():.1f}: {more.mean():.1f} +- {half:.1f} more")
    assert more.mean() - half > 5
    assert means[-1] > 2 * means[0]
    assert np.array_equal(weights, learn.train()[0]), "training is a function of its seed"
