"""Scenarios as environments of PettingZoo and Gymnasium: learned robots among others.

>>> env = cars.parallel_env("hall.toml", agents=["Rosie", "Max"], reward={"served": 1.0})
>>> observations, infos = env.reset(seed=7)
>>> observations, rewards, terminations, truncations, infos = env.step({agent: env.action_space(agent).sample() for agent in env.agents})

Needs ``pip install 'cars-simulator[rl]'``.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Optional, Union

from . import _arguments, _cars, _settings
from ._errors import BadArgument, Error
from ._robot import Robot, maker

try:
    import gymnasium
    import numpy as np
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode, VectorEnv
    from numpy.typing import NDArray
    from pettingzoo import ParallelEnv
    from pettingzoo.utils import parallel_to_aec
except ImportError as error:
    raise Error(f"environments need Gymnasium and PettingZoo: pip install 'cars-simulator[rl]' ({error})") from error

Array = NDArray[np.float32]
Reward = Union[str, Mapping[str, Any], Callable[[Any, str], float], None]

MAX_COPIES = 65_536
"""Most copies of a vectorized environment."""

_TERMINATED, _TRUNCATED = 1, 2
_DESIGN = ("bodies", "sites", "site_variable", "ranges", "peers", "hears", "emotions", "behaviors", "says", "speed_mps", "serves",
           "max_cycles", "duration", "set", "robots")
_PIXELS = 480
_COLORS = {"obstacle": (90, 90, 90), "guest": (170, 170, 190), "robot": (60, 120, 216), "agent": (224, 96, 32)}


class _Copies:
    """Copies of a scenario, with the rows of their agents."""

    def __reduce__(self) -> Any:
        raise Error("an environment cannot be copied or pickled: make one in each process, with the same arguments")

    def __init__(
        self,
        scenario: Union[str, Path],
        agents: Sequence[str],
        reward: Reward,
        *,
        count: int = 1,
        threads: int = 1,
        bodies: int = 4,
        sites: int = 0,
        site_variable: Optional[str] = None,
        ranges: bool = False,
        peers: Sequence[str] = (),
        hears: Sequence[str] = (),
        emotions: Sequence[str] = (),
        behaviors: Sequence[str] = (),
        says: Sequence[tuple[str, str]] = (),
        speed_mps: float = 1.0,
        serves: Optional[str] = None,
        max_cycles: Optional[int] = None,
        duration: Union[float, str, None] = None,
        set: Optional[Mapping[str, Any]] = None,  # noqa: A002
        robots: Optional[Mapping[str, Callable[[], Robot]]] = None,
    ) -> None:
        self.agents = _names("agents", agents)
        if not self.agents:
            raise BadArgument("agents must be the names of one robot or more, not none")
        self.reward = reward if callable(reward) else None
        lasts = _arguments.time("duration", duration)
        design = {
            "agents": self.agents,
            "bodies": _arguments.whole("bodies", bodies, 0, 4096),
            "sites": _arguments.whole("sites", sites, 0, 4096),
            "site_variable": _arguments.text("site_variable", site_variable),
            "ranges": _arguments.flag("ranges", ranges),
            "peers": _names("peers", peers),
            "hears": _names("hears", hears),
            "emotions": _names("emotions", emotions),
            "behaviors": _names("behaviors", behaviors),
            "says": _pairs(says),
            "speed_mps": _arguments.number("speed_mps", speed_mps, "a speed in m/s"),
            "serves": _arguments.text("serves", serves),
            "max_steps": None if max_cycles is None else _arguments.whole("max_cycles", max_cycles, 1, 2**53),
            "rewards": [] if callable(reward) else _weights(reward, self.agents),
        }
        makers = {of: maker(of, make) for of, make in _arguments.makers("robots", robots).items()}
        self.native = _cars.Environments(
            _arguments.path("scenario", scenario),
            set=_settings.changes(set),
            duration=lasts,
            design=json.dumps(design),
            robots=makers,
            count=_arguments.whole("num_envs", count, 1, MAX_COPIES),
            threads=_arguments.whole("threads", threads, 1, 4096),
        )
        self.says = len(says)
        self.next_seed: Optional[int] = None

    def action_space(self) -> spaces.Space[Any]:
        """Of an agent: where it goes, and what it says if it can say anything."""
        velocity = spaces.Box(-1.0, 1.0, (2,), np.float32)
        if not self.says:
            return velocity
        return spaces.Dict({"velocity": velocity, "say": spaces.Discrete(self.says + 1)})

    def seed(self, given: Optional[int]) -> int:
        """The seed of the next run: the given one, or the one after that of the last run; the first one by chance."""
        if given is not None:
            seed = _arguments.whole("seed", given, 0, _arguments.MAX_SEED)
        elif self.next_seed is None:
            seed = int(np.random.default_rng().integers(_arguments.MAX_SEED))
        else:
            seed = self.next_seed
        self.next_seed = (seed + 1) % (_arguments.MAX_SEED + 1)
        return seed

    def fill(self, row: Array, agent: str, action: Any) -> None:
        """Writes what an agent does as numbers."""
        velocity = action
        if self.says:
            if not isinstance(action, Mapping) or set(action) != {"velocity", "say"}:
                raise BadArgument(f'an action of {agent} is {{"velocity": [x, y], "say": n}}, not {action!r}')
            velocity, say = action["velocity"], action["say"]
            if say not in range(self.says + 1):
                raise BadArgument(f"what {agent} says is a whole number from 0 to {self.says}, not {say!r}")
            row[2] = say
        if np.shape(velocity) != (2,):
            raise BadArgument(f"a velocity of {agent} is two numbers, not {velocity!r}")
        row[:2] = velocity


def _names(name: str, value: Any) -> list[str]:
    """Texts, of which one alone is none: it would be taken letter by letter."""
    if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable):
        raise _arguments.wrong_type(name, 'a list of texts, such as ["Butler"]', value)
    given = list(value)
    if not all(isinstance(one, str) for one in given):
        raise _arguments.wrong_type(name, 'a list of texts, such as ["Butler"]', value)
    return given


def _pairs(says: Any) -> list[list[str]]:
    """Robots, and what is said to them."""
    accepted = 'a list of pairs of robot and command, such as [("Butler", "wait")]'
    if isinstance(says, (str, bytes, Mapping)) or not isinstance(says, Iterable):
        raise _arguments.wrong_type("says", accepted, says)
    pairs = [list(one) if isinstance(one, (tuple, list)) else [] for one in says]
    if not all(len(pair) == 2 and all(isinstance(part, str) for part in pair) for pair in pairs):
        raise _arguments.wrong_type("says", accepted, says)
    return pairs


def _check_design(design: Mapping[str, Any]) -> None:
    """Refuses arguments that there are not, by their names."""
    for name in design:
        if name not in _DESIGN:
            raise TypeError(f"there is no argument {name!r}; those of a design are {', '.join(_DESIGN)}")


def _weights(reward: Reward, agents: Sequence[str]) -> list[tuple[str, str, float]]:
    """Rewards as agent, measure and weight. ``{agent}`` in the name of a measure is the name of each agent."""
    if reward is None:
        return []
    named = {reward: 1.0} if isinstance(reward, str) else reward
    accepted = "a measure, a mapping from measures to weights, one of these by agent, or a function"
    if not isinstance(named, Mapping):
        raise _arguments.wrong_type("reward", accepted, reward)
    by_agent: Mapping[str, Any] = named
    if not all(isinstance(weights, Mapping) for weights in named.values()):
        by_agent = dict.fromkeys(agents, named)
    if not all(isinstance(name, str) for weights in (named, *by_agent.values()) for name in weights):
        raise _arguments.wrong_type("reward", accepted, reward)
    return [
        (agent, measure.replace("{agent}", agent), _arguments.number(f"reward[{measure!r}]", weight, "a weight"))
        for agent, weights in by_agent.items()
        for measure, weight in weights.items()
    ]


class _Window:
    """How people see a run: a picture of it, or the console with its record."""

    def __init__(self, copies: _Copies, mode: Optional[str], modes: Sequence[str]) -> None:
        if mode is not None and mode not in modes:
            raise BadArgument(f"render_mode must be None or one of {', '.join(modes)}, not {mode!r}")
        self.copies, self.mode = copies, mode
        self.console: Optional[subprocess.Popen[bytes]] = None

    def show(self, recorded: Optional[Path], is_over: bool) -> Any:
        """What ``render`` returns."""
        if self.mode == "rgb_array":
            return self._picture()
        if self.mode == "ansi":
            return "\n".join(f"{kind} {name} at {x:.2f} m, {y:.2f} m".replace("  ", " ") for kind, name, x, y in self._scene()[3])
        if self.mode == "human" and is_over and recorded is not None and self.console is None:
            self.console = subprocess.Popen(["cars-console", "--recording", str(recorded), "--open"])
        return None

    def close(self) -> None:
        """Ends the console."""
        if self.console is not None:
            self.console.terminate()
            self.console.wait()
            self.console = None

    def _scene(self) -> tuple[float, float, float, list[tuple[str, str, float, float]]]:
        return self.copies.native.scene(0)

    def _picture(self) -> NDArray[np.uint8]:
        """The field from above, x to the right and y up, with a square for each body."""
        width_m, height_m, body_m, bodies = self._scene()
        scale = _PIXELS / max(width_m, height_m)
        width, height = (max(1, round(side_m * scale)) for side_m in (width_m, height_m))
        picture = np.full((height, width, 3), 245, np.uint8)
        half = max(1, round(body_m * scale / 2))
        for kind, _, x, y in bodies:
            column, line = round(x * scale), height - round(y * scale)
            picture[max(0, line - half) : line + half, max(0, column - half) : column + half] = _COLORS[kind]
        return picture


class _Episodes:
    """One copy, run by run."""

    def __init__(self, copies: _Copies, record: Union[str, Path, None], name: Optional[str]) -> None:
        self.copies = copies
        self.out = None if record is None else _arguments.path("record", record)
        self.name = name
        self.folder: Optional[Path] = None
        self.seed: Optional[int] = None
        self.is_over = True
        self.actions = np.zeros((len(copies.agents), copies.native.action_len), np.float32)

    def begin(self, seed: Optional[int]) -> Array:
        used = self.copies.seed(seed)
        rows, folders = self.copies.native.reset([used], follows=False, out=self.out, name=self.name)
        self.seed, self.folder, self.is_over = used, (folders[0] if folders else None), False
        return self._rows(rows)

    def step(self) -> tuple[Array, list[float], bool, bool]:
        rows, rewards, (end,) = self.copies.native.step(self.actions.tobytes())
        self.is_over = end != 0
        return self._rows(rows), np.frombuffer(rewards, np.float32).tolist(), end == _TERMINATED, end == _TRUNCATED

    def _rows(self, rows: bytes) -> Array:
        return np.frombuffer(rows, np.float32).reshape(len(self.copies.agents), -1)


class CarsParallelEnv(ParallelEnv):  # type: ignore[misc]  # PettingZoo has no types.
    """A scenario as a parallel environment: see :func:`parallel_env`."""

    metadata = {"name": "cars_v0", "render_modes": ["human", "rgb_array", "ansi"], "is_parallelizable": True}

    def __init__(self, copies: _Copies, record: Union[str, Path, None], name: Optional[str], render_mode: Optional[str]) -> None:
        self.render_mode = render_mode
        self.possible_agents = list(copies.agents)
        self.agents: list[str] = []
        self._copies = copies
        self._episodes = _Episodes(copies, record, name)
        self._window = _Window(copies, render_mode, ("human", "rgb_array", "ansi"))
        self._observation_spaces = {agent: spaces.Box(-np.inf, np.inf, (copies.native.row,), np.float32) for agent in copies.agents}
        self._action_spaces = {agent: copies.action_space() for agent in copies.agents}
        self._rows_of_actions = list(zip(self._episodes.actions, copies.agents))
        self.labels: list[str] = copies.native.labels
        """What the numbers of an observation are."""

    @property
    def folder(self) -> Optional[Path]:
        """The record of the run, if runs are recorded; complete when the run is over."""
        return self._episodes.folder

    @property
    def run_seed(self) -> int:
        """The seed of the run."""
        if self._episodes.seed is None:
            raise BadArgument("no run has begun: call reset()")
        return self._episodes.seed

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """What an agent perceives: the numbers of :attr:`labels`."""
        return self._observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """What an agent can do."""
        return self._action_spaces[agent]

    def reset(self, seed: Optional[int] = None, options: Optional[dict[str, Any]] = None) -> tuple[dict[str, Array], dict[str, Any]]:
        """Begins a run with a seed; without one with the seed after that of the last run."""
        self._window.close()
        rows = self._episodes.begin(seed)
        self.agents = list(self.possible_agents)
        return dict(zip(self.agents, rows)), {agent: {} for agent in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[dict[str, Array], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Any]]:
        """Has all agents act, and plays on to the next tick."""
        agents = self.agents
        if not agents:
            return {}, {}, {}, {}, {}
        if not isinstance(actions, Mapping) or actions.keys() != self._action_spaces.keys():
            raise BadArgument(f"actions are expected of {', '.join(agents)}, not {actions!r}")
        for row, agent in self._rows_of_actions:
            self._copies.fill(row, agent, actions[agent])
        rows, given, is_terminated, is_truncated = self._episodes.step()
        reward = self._copies.reward
        if is_terminated or is_truncated:
            self.agents = []
        return (
            dict(zip(agents, rows)),
            dict(zip(agents, given)) if reward is None else {agent: float(reward(self, agent)) for agent in agents},
            dict.fromkeys(agents, is_terminated),
            dict.fromkeys(agents, is_truncated),
            {agent: {} for agent in agents},
        )

    def measures(self) -> dict[str, float]:
        """The numbers that the measures of the scenario have so far."""
        return dict(self._copies.native.measures(0))

    def render(self) -> Any:
        """A picture of the field, places as text, or nothing: ``human`` opens the console when a recorded run is over."""
        return self._window.show(self._episodes.folder, self._episodes.is_over)

    def close(self) -> None:
        """Ends what :meth:`render` has opened."""
        self._window.close()


class CarsEnv(gymnasium.Env[Array, Any]):
    """A scenario with one learned robot: see :func:`gym_env`."""

    metadata = {"render_modes": ["human", "rgb_array", "ansi"]}

    def __init__(self, parallel: CarsParallelEnv) -> None:
        self.parallel = parallel
        self.render_mode = parallel.render_mode
        (self._agent,) = parallel.possible_agents
        self.observation_space = parallel.observation_space(self._agent)
        self.action_space = parallel.action_space(self._agent)

    def reset(self, *, seed: Optional[int] = None, options: Optional[dict[str, Any]] = None) -> tuple[Array, dict[str, Any]]:
        """Begins a run, as :meth:`CarsParallelEnv.reset`."""
        super().reset(seed=seed)
        observations, infos = self.parallel.reset(seed, options)
        return observations[self._agent], infos[self._agent]

    def step(self, action: Any) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Has the agent act, and plays on to the next tick."""
        if not self.parallel.agents:
            raise BadArgument("the run is over: call reset()")
        agent = self._agent
        observations, rewards, is_terminated, is_truncated, infos = self.parallel.step({agent: action})
        return observations[agent], rewards[agent], is_terminated[agent], is_truncated[agent], infos[agent]

    def render(self) -> Any:
        """As :meth:`CarsParallelEnv.render`."""
        return self.parallel.render()

    def close(self) -> None:
        """As :meth:`CarsParallelEnv.close`."""
        self.parallel.close()


class CarsVectorEnv(VectorEnv[Array, Array, NDArray[Any]]):
    """Copies of a scenario on several threads: see :func:`vector_env`."""

    def __init__(self, copies: _Copies, count: int) -> None:
        self.num_envs = count
        self.metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP}
        self._copies = copies
        native = copies.native
        agents = len(copies.agents)
        self._per_agent = (count,) if agents == 1 else (count, agents)
        shape = self._per_agent[1:]
        self.single_observation_space = spaces.Box(-np.inf, np.inf, (*shape, native.row), np.float32)
        self.single_action_space = spaces.Box(-1.0, max(1.0, float(copies.says)), (*shape, native.action_len), np.float32)
        self.observation_space = spaces.Box(-np.inf, np.inf, (*self._per_agent, native.row), np.float32)
        self.action_space = spaces.Box(-1.0, max(1.0, float(copies.says)), (*self._per_agent, native.action_len), np.float32)
        self.labels: list[str] = native.labels

    def reset(self, *, seed: Any = None, options: Optional[dict[str, Any]] = None) -> tuple[Array, dict[str, Any]]:
        """Begins a run of each copy. From a seed ``s`` on, the runs of copy ``i`` have the seeds ``s + i``, ``s + i + num_envs``, …"""
        if seed is not None and np.ndim(seed) == 1:
            seeds = [_arguments.whole("seed", one, 0, _arguments.MAX_SEED) for one in seed]
        else:
            first = self._copies.seed(seed)
            # The next reset without a seed begins after the seeds of all copies of this one.
            self._copies.next_seed = (first + self.num_envs) % (_arguments.MAX_SEED + 1)
            seeds = [(first + copy) % (_arguments.MAX_SEED + 1) for copy in range(self.num_envs)]
        rows, _ = self._copies.native.reset(seeds, follows=True, out=None, name=None)
        return self._rows(rows), {}

    def step(self, actions: Any) -> tuple[Array, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Plays a step of each copy. One whose run was over at the step before begins the next one, and its action is ignored."""
        given = np.ascontiguousarray(actions, np.float32)
        if given.shape != self.action_space.shape:
            raise BadArgument(f"actions have the shape {self.action_space.shape}, not {given.shape}")
        # Checked for all copies before any of them steps: which ones had stepped would depend on the threads.
        if not np.isfinite(given).all():
            raise BadArgument(f"an action of copy {int(np.argwhere(~np.isfinite(given))[0][0])} is not a finite number")
        rows, rewards, ends = self._copies.native.step(given.tobytes())
        how = np.frombuffer(ends, np.uint8)
        return self._rows(rows), np.frombuffer(rewards, np.float32).reshape(self._per_agent), how == _TERMINATED, how == _TRUNCATED, {}

    def _rows(self, rows: bytes) -> Array:
        return np.frombuffer(rows, np.float32).reshape(*self._per_agent, -1)


def parallel_env(
    scenario: Union[str, Path],
    agents: Sequence[str],
    *,
    reward: Reward = None,
    record: Union[str, Path, None] = None,
    name: Optional[str] = None,
    render_mode: Optional[str] = None,
    **design: Any,
) -> CarsParallelEnv:
    """A scenario as a PettingZoo ``ParallelEnv`` in which these robots are learned; all others are what the scenario says.

    :param scenario: as for :func:`cars.run`.
    :param agents: the names of the robots that act as they are told. Their classes in the scenario do not matter.
    :param reward: a measure of the scenario, whose change in a step is the reward of all agents; weights by measure; weights by measure,
        by agent; ``{agent}`` in the name of a measure is each agent's name. Or a function of environment and agent.
    :param record: a folder such as ``"runs"``: each run is recorded there, and ``cars verify`` and the console read it.
    :param name: the name of these records; without it the scenario's.
    :param render_mode: ``"rgb_array"``, ``"ansi"``, or ``"human"``, which opens the console with the record of a run that is over.
    :param design: what agents perceive and do: ``bodies`` and ``sites`` (how many of the nearest ones), ``site_variable``, ``ranges``,
        ``peers`` (whose states of the tick before they query), ``emotions`` and ``behaviors`` (names that they know of peers), ``hears``
        (commands that they understand), ``says`` (pairs of robot and command), ``speed_mps``, ``serves`` (a variable of sites of which
        they take one in each tick), ``max_cycles``, ``duration``, ``set``, and ``robots`` as for :func:`cars.run`.
    """
    _check_design(design)
    copies = _Copies(scenario, agents, reward, **design)
    named = _arguments.text("name", name) or Path(scenario).stem
    if render_mode == "human" and record is None:
        record = "runs"
    return CarsParallelEnv(copies, record, named, render_mode)


def env(*args: Any, **kwargs: Any) -> Any:
    """:func:`parallel_env` in PettingZoo's other form, in which agents act in turns."""
    return parallel_to_aec(parallel_env(*args, **kwargs))


def gym_env(scenario: Union[str, Path], agent: str, **arguments: Any) -> CarsEnv:
    """A scenario with one learned robot as a Gymnasium ``Env``; arguments are those of :func:`parallel_env`."""
    return CarsEnv(parallel_env(scenario, [agent], **arguments))


def vector_env(
    scenario: Union[str, Path], agents: Sequence[str], *, num_envs: int, threads: int = 1, reward: Reward = None, **design: Any
) -> CarsVectorEnv:
    """Copies of a scenario as a Gymnasium ``VectorEnv``; arguments are those of :func:`parallel_env`.

    Arrays have the axes copy, agent (if there are several) and number. The results do not depend on the number of threads. A run that is
    over begins anew in the next step.
    """
    if callable(reward):
        raise BadArgument("reward must be of measures here: a function is called for one environment only")
    _check_design(design)
    return CarsVectorEnv(_Copies(scenario, agents, reward, count=num_envs, threads=threads, **design), num_envs)
