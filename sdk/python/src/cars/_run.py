"""Runs: playing a scenario in this process, and reading what was recorded."""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, Optional, Union

from . import _arguments, _cars, _settings
from ._errors import BadArgument, Error
from ._frames import Frame, Frames, read, with_value
from ._pictures import Page, Picture
from ._robot import Robot, maker
from ._why import Why, answer

Name = Union[str, os.PathLike[str]]

MAX_JOBS = 4096
"""Most runs at the same time: each has a thread."""


class Run:
    """A run that was recorded."""

    def __init__(self, folder: Path, summary: Optional[Mapping[str, Any]], keeper: object = None) -> None:
        """Use :func:`cars.run` or :func:`cars.load`."""
        self.folder = folder
        """Its folder, as every program of CARS reads it."""
        self.summary: Mapping[str, Any] = summary or {}
        """What ``summary.json`` has: seed, time, verdicts, and for each robot how long it felt and did what. Empty if the
        simulator was killed before it wrote one."""
        self._keeper = keeper
        self._frames: dict[Optional[str], Frames] = {}

    def __repr__(self) -> str:
        facts = self.summary
        if not facts:
            return f"<Run in {self.folder}, without an end>"
        return f"<Run {facts['run']}, seed {facts['seed']}: {facts['ticks']} ticks, {facts['end']}, {self.verdict}>"

    @property
    def verdict(self) -> str:
        """``pass``, ``fail`` or ``undecided``: the worst about what the scenario expects; ``not_asked`` if nothing was asked,
        ``unreached`` if there is only what some run should reach, and this one did not."""
        verdicts = {judged["verdict"] for judged in self.summary.get("expectations", {}).values()}
        return next((verdict for verdict in ("fail", "undecided", "pass", "not_asked", "unreached") if verdict in verdicts), "pass")

    def frames(self, kind: Optional[str] = None) -> Frames:
        """Its tables as frames, which are those of ``cars export``.

        :param kind: ``"pandas"`` or ``"polars"``; without it pandas where it is installed, else polars.
        :raises Error: if that is not installed.
        """
        if kind not in self._frames:
            self._check()
            with tempfile.TemporaryDirectory() as folder:
                for note in _cars.export(self.folder, Path(folder)):
                    warnings.warn(note, stacklevel=2)
                names = ("events", "states", "variables")
                self._frames[kind] = Frames(*(read(Path(folder, f"{name}.csv"), kind) for name in names))
        return self._frames[kind]

    @property
    def events(self) -> Frame:
        """A row for each event: moves that were blocked, emotions, behaviors, commands and their fate, faults, verdicts."""
        return self.frames().events

    @property
    def states(self) -> Frame:
        """A row for each robot in each tick: place, speed, emotion, behavior."""
        return self.frames().states

    @property
    def variables(self) -> Frame:
        """A row for each state variable of each robot in each tick."""
        return self.frames().variables

    @property
    def commands(self) -> Frame:
        """The events of commands: sent, delivered, lost."""
        return with_value(self.events, "command")

    def report(self) -> Page:
        """The report about it: emotions and behaviors over time, transitions, occupancy, the network."""
        self._check()
        return Page(_cars.report([self.folder]))

    @property
    def figures(self) -> list[Page]:
        """The figures of its report, each by itself."""
        self._check()
        return [Page(figure) for figure in _cars.figures([self.folder])]

    def diagram(
        self,
        start: Union[int, str, None] = None,
        end: Union[int, str, None] = None,
        *,
        queries: bool = False,
        whole: bool = False,
    ) -> Picture:
        """Its space-time diagram: who commanded whom, what was lost, what the robots felt.

        :param start: first moment: a tick, or a time such as ``"120 s"``.
        :param end: last moment.
        :param queries: draw lost queries, too.
        :param whole: draw time in which nothing happens to scale, too.
        """
        self._check()
        first, last = _moment("start", start), _moment("end", end)
        is_whole = _arguments.flag("whole", whole)
        svg, notes = _cars.diagram(self.folder, first, last, _arguments.flag("queries", queries), is_whole)
        for note in notes:
            warnings.warn(note, stacklevel=2)
        return Picture(svg)

    def why(self, question: Optional[str] = None) -> Why:
        """What decided it, as ``cars why`` or :func:`cars.why` found it before: a sentence, the expected outcome over the run, and
        where it jumps.

        :param question: what was asked: the name of an expectation or of a measure, a condition, or the path of a number of the
            summary. It may be left out if one question was asked.
        :raises Error: if it was not asked.
        """
        self._check()
        found, notes = answer(self.folder, _arguments.text("question", question))
        for note in notes:
            warnings.warn(note, stacklevel=2)
        return found

    def _check(self) -> None:
        """Checks that no later run has taken its folder."""
        if self.summary:
            _, now = _cars.find(Path(), self.folder)
            if now is None or json.loads(now)["digest"] != self.summary["digest"]:
                raise Error(f"{self.folder} holds another run now; give each run a name or a folder of its own")


def _moment(name: str, value: Any) -> Optional[str]:
    """A tick or a time as a text."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise _arguments.wrong_type(name, "a tick, or a time such as '120 s'", value)
    return str(value.__index__())


def run(
    scenario: Name,
    *,
    seed: Optional[int] = None,
    set: Optional[Mapping[str, Any]] = None,  # noqa: A002
    duration: Union[float, str, None] = None,
    speed: Union[float, str, None] = None,
    name: Optional[str] = None,
    replace: bool = False,
    out: Optional[Name] = None,
    robots: Optional[Mapping[str, Callable[[], Robot]]] = None,
) -> Run:
    """Runs a scenario in this process to its end, as ``cars run`` does, and returns its record.

    :param scenario: a scenario file, a launch file, whose scenario is run, or the name of one that comes with the programs, such as
        ``"hors_doeuvres"``.
    :param seed: instead of the scenario's.
    :param set: changes of the scenario: ``{"guests.count": 50, "robot.Butler.params.refiller": "Vonda"}``. A text is read as after
        ``--set`` on the command line.
    :param duration: simulated time, instead of the scenario's: seconds, or a text such as ``"600 s"``.
    :param speed: simulated seconds per second; without it as fast as possible.
    :param name: name of the run and of its folder; without it the file's name. A run whose name is taken gets the next free one,
        such as ``hall-2``: see :attr:`Run.folder`.
    :param replace: replace the run with this name, if it is over.
    :param out: where its folder is made, such as ``"runs"``. Without it in a temporary folder, which goes with the returned object.
    :param robots: classes of robots of Python, or functions that make one, by the names of the scenario's robots, or by patterns
        such as ``"S*"``; a name goes before a pattern. All others are made by their classes in the scenario. A robot of Python computes under Python's lock; with those of Rust
        alone other threads of Python go on meanwhile.
    :raises Error: with the text of the command line, if a file cannot be used, or a robot cannot run in this process.
    :raises TypeError, BadArgument: which argument has a type or a value that is not accepted.
    """

    file = _arguments.path("scenario", scenario)
    seed = None if seed is None else _arguments.whole("seed", seed, 0, _arguments.MAX_SEED)
    settings = _settings.changes(set)
    lasts = _arguments.time("duration", duration)
    pace = _arguments.speed("speed", speed)
    named = _arguments.text("name", name)
    makers = {of: maker(of, make) for of, make in _arguments.makers("robots", robots).items()}
    into, keeper = _folder(out)
    folder, summary = _cars.run(
        file,
        seed=seed,
        set=settings,
        duration=lasts,
        speed=pace,
        name=named,
        replace=replace,
        out=into,
        robots=makers,
    )
    return Run(folder, json.loads(summary), keeper)


def _folder(out: Optional[Name]) -> tuple[Path, Optional[tempfile.TemporaryDirectory[str]]]:
    """Where a run is recorded, and what keeps that folder."""
    if out is not None:
        return _arguments.path("out", out), None
    keeper = tempfile.TemporaryDirectory(prefix="cars-")
    return Path(keeper.name), keeper


def load(run: Name = "latest", *, out: Name = "runs") -> Run:
    """A run that was recorded before, by any program.

    :param run: its name, or its folder.
    :param out: where run folders are made.
    :raises Error: if there is none.
    """
    folder, summary = _cars.find(_arguments.path("out", out), _arguments.path("run", run))
    return Run(folder, None if summary is None else json.loads(summary))


def fork(
    run: Union[Run, Name],
    at: Union[int, str],
    *,
    seed: Optional[int] = None,
    reseed: Iterable[str] = (),
    set: Optional[Mapping[str, Any]] = None,  # noqa: A002
    duration: Union[float, str, None] = None,
    name: Optional[str] = None,
    replace: bool = False,
    out: Optional[Name] = None,
    robots: Optional[Mapping[str, Callable[[], Robot]]] = None,
) -> Run:
    """Executes a recorded run again up to a tick, and goes on with changes, or with other chance, as ``cars fork`` does.

    :param run: a run, or its folder.
    :param at: the last tick that both have: a tick, or a time such as ``"120 s"``.
    :param seed: the seed of what is drawn from the next tick on: the same past with another future. Number n of the forks that
        :func:`cars.why` plays after a tick has the seed n + 1.
    :param reseed: what is drawn anew: ``"network"``, ``"guests"``, ``"sensing"``, ``"robot.NAME"``; without it all.
    :param set: what changes from the next tick on: see :func:`cars.run`.
    :param duration: another end, from the beginning of the run.
    :param name: name of the fork; without it ``RUN-fork-TICK``, with ``-seed-N`` after it if there is one.
    :param replace: replace the run with this name, if it is over.
    :param out: where its folder is made; without it in a temporary folder, which goes with the returned object.
    :param robots: the classes of robots of Python with which it was run: see :func:`cars.run`.
    :raises Error: if the run cannot be executed again with the same result, or a change cannot be made.
    :raises TypeError, BadArgument: which argument has a type or a value that is not accepted.
    """
    parent = run if isinstance(run, Run) else load(run)
    parent._check()
    moment = _moment("at", at)
    if moment is None:
        raise _arguments.wrong_type("at", "a tick, or a time such as '120 s'", at)
    kinds = [reseed] if isinstance(reseed, str) else list(reseed)
    if kinds and seed is None:
        raise BadArgument("reseed needs a seed")
    makers = _arguments.makers("robots", robots)
    changes = (
        _settings.changes(set),
        _arguments.time("duration", duration),
        None if seed is None else _arguments.whole("seed", seed, 0, _arguments.MAX_SEED),
        kinds,
    )
    into, keeper = _folder(out)
    folder, summary = _cars.fork(
        parent.folder,
        moment,
        changes,
        name=_arguments.text("name", name),
        replace=_arguments.flag("replace", replace),
        out=into,
        robots={of: maker(of, make) for of, make in makers.items()},
    )
    return Run(folder, json.loads(summary), keeper)


def why(
    run: Union[Run, Name],
    question: Optional[str] = None,
    *,
    robots: Optional[Mapping[str, Callable[[], Robot]]] = None,
    budget: Union[int, str, None] = None,
    jobs: Optional[int] = None,
    out: Name = "runs",
) -> Why:
    """Finds out what decided a run, as ``cars why`` does: the expected outcome after each tick, from forks with other chance, and the
    events at which it jumps.

    Robots of Rust are copied where a fork begins. Those of Python are made anew for each fork and executed again from the start of the
    run, which takes as long as so many runs: give a ``budget``. What a robot raises ends its fork, which then has no outcome: the
    sentence says in how many forks, and what the first of them raised.

    :param run: a run, or its name or folder.
    :param question: the name of an expectation or of a measure, a condition such as
        ``'{ robot = "Butler", behavior = "INTERCEPT" }'``, or the path of a number of the summary; without it the expectation that
        failed first, or else the last one.
    :param robots: the classes of robots of Python with which it was run: see :func:`cars.run`.
    :param budget: most forks, such as ``2000``, or the time after which no fork is begun, such as ``"5 min"``; without it as many as
        the answer needs. The same number of forks gives the same answer. What was played before for a question is not played again.
    :param jobs: number of forks at the same time; without it the number of processors. The answer does not depend on it.
    :param out: where run folders are made.
    :raises Error: if the run has nothing of that kind, or is another one when it is executed again.
    :raises TypeError, BadArgument: which argument has a type or a value that is not accepted.
    """
    asked = run if isinstance(run, Run) else load(run, out=out)
    asked._check()
    makers = _arguments.makers("robots", robots)
    if budget is not None and not isinstance(budget, str):
        budget = str(_arguments.whole("budget", budget, 1, 2**53 - 1))
    words = _cars.why(
        asked.folder,
        _arguments.text("question", question),
        budget=budget,
        jobs=None if jobs is None else _arguments.whole("jobs", jobs, 1, MAX_JOBS),
        robots={of: maker(of, make) for of, make in makers.items()},
    )
    return asked.why(words)
