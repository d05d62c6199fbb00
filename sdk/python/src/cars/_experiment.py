"""Experiments: playing a scenario in several arms under several conditions over many seeds."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Optional, Union

from . import _arguments, _cars, _programs, _settings
from ._frames import Frame, of_rows, read_runs
from ._pictures import Page
from ._robot import Robot, maker
from ._run import MAX_JOBS, Name


class Verdict(NamedTuple):
    """How the runs of an experiment have met an expectation of its file."""

    expectation: str
    verdict: str
    """``pass``, ``fail`` or ``undecided``: that of the worst run; ``not_asked`` if no run was asked, ``unreached`` if no run
    reached what some run should."""
    failed: list[int]
    """Numbers of the units that fail it."""
    undecided: list[int]
    """Numbers of the units that ended before it was certain."""
    not_asked: list[int]
    """Numbers of the units in which what it is expected after did not happen."""
    unreached: list[int]
    """Numbers of the units in which what some run should ``reach`` was not seen."""


class Experiment:
    """The results of an experiment. Its folder has them as files, too."""

    def __init__(self, folder: Path) -> None:
        """Use :func:`cars.experiment`."""
        self.folder = folder
        """Its folder, from which it is resumed, and which every program of CARS reads."""
        self._written = json.loads(Path(folder, "results.json").read_text(encoding="utf-8"))

    def __repr__(self) -> str:
        facts = self._written
        return f"<Experiment {facts['name']}: {facts['units']} units, {len(self.failures)} failed>"

    @property
    def question(self) -> str:
        """The question that it answers."""
        return str(self._written["question"])

    @property
    def results(self) -> Frame:
        """A row for each unit: condition, arm, seed, measures with their states, verdicts."""
        return self.frame()

    def frame(self, kind: Optional[str] = None) -> Frame:
        """The results as a frame of this library: ``"pandas"`` or ``"polars"``.

        :raises Error: if it is not installed.
        """
        return read_runs(Path(self.folder, "runs.csv"), kind)

    @property
    def estimates(self) -> Frame:
        """A row for each measure of each arm under each condition: the mean or the times, with intervals.

        ``mean.interval`` is ``ends`` where there is an interval, ``mean.low`` to ``mean.high``; otherwise it says why there is
        none. ``excluded.not_at_risk`` and the like are how many runs have no number.
        """
        return of_rows(self._written["estimates"])

    @property
    def contrasts(self) -> Frame:
        """A row for each difference to the baseline, with its interval and p value.

        ``kind`` is ``no_pair`` or ``not_finite`` where nothing can be compared: there, ``p_holm`` is missing.
        """
        return of_rows(self._written["contrasts"])

    @property
    def failures(self) -> list[dict[str, Any]]:
        """The units that could not be played to their end, with the reasons."""
        return list(self._written["failures"])

    @property
    def verdicts(self) -> list[Verdict]:
        """How the runs have met each expectation of the experiment file."""
        return [Verdict(*judged) for judged in _cars.verdicts(self.folder)]

    def report(self) -> Page:
        """The report about it: the answer, the design, estimates with intervals, differences, example runs."""
        return Page(_cars.report([self.folder]))

    @property
    def figures(self) -> list[Page]:
        """The figures of its report, each by itself."""
        return [Page(figure) for figure in _cars.figures([self.folder])]


def experiment(
    file: Name,
    *,
    out: Optional[Name] = None,
    scenario: Optional[Name] = None,
    seeds: Union[int, Iterable[int], None] = None,
    duration: Union[float, str, None] = None,
    set: Optional[Mapping[str, Any]] = None,  # noqa: A002
    jobs: Optional[int] = None,
    retry_failed: bool = False,
    robots: Optional[Mapping[str, Callable[[], Robot]]] = None,
    processes: Union[bool, Name] = False,
    fresh_processes: bool = False,
    tick_patience: Optional[float] = None,
) -> Experiment:
    """Plays an experiment, or goes on with it where it was interrupted, as ``cars experiment run`` does.

    :param file: an experiment file, or the name of one that comes with the programs, such as ``"deadlock"``.
    :param out: its folder; without it ``runs/experiments/NAME``.
    :param scenario: scenario or launch file, or the name of one, instead of that of the file.
    :param seeds: instead of those of the file: a number of seeds, or the seeds.
    :param duration: simulated time of each run, instead of that of the file: seconds, or a text such as ``"600 s"``.
    :param set: changes of the scenario in every arm: see :func:`cars.run`.
    :param jobs: number of runs at the same time; without it the number of processors. The results do not depend on it.
    :param retry_failed: play units that failed once more.
    :param robots: classes of robots of Python by the names or patterns of the scenario's robots: see :func:`cars.run`. A unit whose
        robot raises something fails with the traceback: see :attr:`Experiment.failures`. Units are played again when the class has
        another name, or its module or the module of a base class has another text; what the module imports or reads is not
        noticed.
    :param processes: launch every run as processes, as ``--processes`` does: ``True``, or a launch file whose processes run the
        robots of the experiment's scenario. The results are the same.
    :param fresh_processes: start fresh processes for every run, instead of having the same play one run after another.
    :param tick_patience: how long a tick of processes may take, seconds of wall clock, before the unit fails; without it 120.
    :raises Error: with the text of the command line, if a file cannot be used.
    :raises TypeError, BadArgument: which argument has a type or a value that is not accepted.
    """
    makers = _arguments.makers("robots", robots)
    folder, remarks = _cars.experiment(
        _arguments.path("file", file),
        out=None if out is None else _arguments.path("out", out),
        scenario=None if scenario is None else _arguments.path("scenario", scenario),
        seeds=_arguments.seeds("seeds", seeds),
        duration=_arguments.time("duration", duration),
        set=_settings.changes(set),
        jobs=None if jobs is None else _arguments.whole("jobs", jobs, 1, MAX_JOBS),
        retry_failed=_arguments.flag("retry_failed", retry_failed),
        robots={of: maker(of, make) for of, make in makers.items()},
        digests=_programs.digests(makers),
        processes=_arguments.processes(processes, makers, fresh_processes, tick_patience),
    )
    for remark in remarks:
        warnings.warn(remark, stacklevel=2)
    played = Experiment(folder)
    if played.failures:
        first = played.failures[0]
        reason = f"the first, {first['unit']}: {first['reason']}"
        warnings.warn(f"{len(played.failures)} units failed; {reason}", stacklevel=2)
    return played
