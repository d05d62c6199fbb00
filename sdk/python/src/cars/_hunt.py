"""Hunts: drawing faults until an expectation of a scenario fails."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Optional, Union

from . import _arguments, _cars, _settings
from ._robot import Robot, maker
from ._run import MAX_JOBS, Name

MAX_PLANS = 100_000_000
"""Most plans of a hunt."""


class Finding(NamedTuple):
    """An expectation that fails, and the faults under which it does."""

    expectation: str
    because: str
    """Why it fails."""
    time_s: float
    """Simulated time at which that is certain, seconds."""
    faults: list[str]
    """The faults, shrunk, in words."""
    is_minimal: bool
    """Whether nothing can be left out of them."""
    plan: int
    """Number of the plan that found it, from 1."""
    plans: int
    """Number of plans with this cause under which the expectation fails."""
    file: Path
    """Its scenario file: :func:`cars.run` plays it, with the same ``robots``."""


class Hunt:
    """The result of a hunt."""

    def __init__(self, report: Mapping[str, Any]) -> None:
        """Use :func:`cars.hunt`."""
        self.report = report
        """What ``cars hunt --json`` prints."""

    def __repr__(self) -> str:
        return f"<Hunt in {self.report['scenario']}: {self.report['plans']} plans, {len(self.findings)} findings>"

    @property
    def findings(self) -> list[Finding]:
        """What was found, one for each cause for which an expectation fails."""
        found = []
        for one in self.report["findings"]:
            fields = {name: one[name] for name in Finding._fields}
            found.append(Finding(**{**fields, "file": Path(one["file"])}))
        return found

    @property
    def never_asked(self) -> list[str]:
        """Expectations that were asked in no run: what they are expected after did not happen."""
        return list(self.report["never_asked"])

    @property
    def goals(self) -> dict[str, int]:
        """What some run should ``reach``, with the number of plans in whose runs it was reached."""
        return dict(self.report["goals"])

    @property
    def never_reached(self) -> list[str]:
        """What some run should ``reach``, and neither a plan nor the run without faults has."""
        without_faults = self.report["reached_without_faults"]
        return [goal for goal, plans in self.goals.items() if plans == 0 and goal not in without_faults]


def _texts(name: str, value: Union[str, Iterable[str], None]) -> list[str]:
    given = [] if value is None else [value] if isinstance(value, str) else value
    if not isinstance(given, Iterable):
        raise _arguments.wrong_type(name, "a text, or several", value)
    texts = list(given)
    for text in texts:
        if not isinstance(text, str):
            raise _arguments.wrong_type(name, "a text, or several", value)
    return texts


def hunt(
    scenario: Name,
    *,
    plans: Optional[int] = None,
    time: Union[float, str] = "60 s",
    seed: int = 1,
    jobs: Optional[int] = None,
    kinds: Union[str, Iterable[str], None] = None,
    longest: Union[float, str] = "60 s",
    expect: Union[str, Iterable[str], None] = None,
    shrink_runs: int = 1000,
    set: Optional[Mapping[str, Any]] = None,  # noqa: A002
    out: Name = "hunt",
    robots: Optional[Mapping[str, Callable[[], Robot]]] = None,
    processes: Union[bool, Name] = False,
    fresh_processes: bool = False,
    tick_patience: Optional[float] = None,
) -> Hunt:
    """Draws fault plans until what the scenario expects fails, and shrinks what it finds to scenario files, as ``cars hunt`` does.

    A robot that raises something is what a hunt looks for: its run does not go to its end.

    :param scenario: a scenario or launch file, or the name of one that comes with the programs.
    :param plans: draw this number of plans. The same seed and number of plans give the same result.
    :param time: without ``plans``, draw plans for this time of wall clock: seconds, or a text such as ``"60 s"``.
    :param seed: seed of the plans; the scenario keeps its own.
    :param jobs: number of runs at the same time; without it the number of processors. The result does not depend on it.
    :param kinds: kinds of faults that are drawn, such as ``["lose", "crash"]``; without it all.
    :param longest: longest time of a fault, in simulated time.
    :param expect: names of expectations to check; without it all are.
    :param shrink_runs: most runs to shrink a finding.
    :param set: changes of the scenario: see :func:`cars.run`.
    :param out: where scenario files of findings are written.
    :param robots: classes of robots of Python by the names or patterns of the scenario's robots: see :func:`cars.run`.
    :param processes: launch every run as processes: see :func:`cars.experiment`.
    :param fresh_processes: start fresh processes for every run.
    :param tick_patience: how long a tick of processes may take, seconds of wall clock, before the run fails; without it 120.
    :raises Error: with the text of the command line, if a file cannot be used, or the scenario fails without any fault.
    :raises TypeError, BadArgument: which argument has a type or a value that is not accepted.
    """
    lasts, longest_fault = _arguments.time("time", time), _arguments.time("longest", longest)
    if lasts is None or longest_fault is None:
        raise TypeError("time and longest are seconds, or texts with a unit such as '60 s'")
    makers = _arguments.makers("robots", robots)
    report, remarks = _cars.hunt(
        _arguments.path("scenario", scenario),
        plans=None if plans is None else _arguments.whole("plans", plans, 1, MAX_PLANS),
        time=lasts,
        seed=_arguments.whole("seed", seed, 0, _arguments.MAX_SEED),
        jobs=None if jobs is None else _arguments.whole("jobs", jobs, 1, MAX_JOBS),
        kinds=_texts("kinds", kinds),
        longest=longest_fault,
        expect=frozenset(_texts("expect", expect)),
        shrink_runs=_arguments.whole("shrink_runs", shrink_runs, 0, 2**53 - 1),
        set=_settings.changes(set),
        out=_arguments.path("out", out),
        robots={of: maker(of, make) for of, make in makers.items()},
        processes=_arguments.processes(processes, makers, fresh_processes, tick_patience),
    )
    for remark in remarks:
        warnings.warn(remark, stacklevel=2)
    return Hunt(json.loads(report))
