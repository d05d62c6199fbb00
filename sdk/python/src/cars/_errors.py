"""What can go wrong, as exceptions."""


class Error(Exception):
    """Something cannot be used or done. The text is what the command line prints: with file, line and caret where it is about
    a file."""


class FileError(Error):
    """A file that a person has written cannot be used, or a file cannot be read or written."""


class RecordError(Error):
    """The record of a run or an experiment is damaged, incomplete, or not there."""


class RefusedError(Error):
    """What was asked for cannot be done, or not with this scenario or this record; the text says what can be done instead."""


class RobotError(Error):
    """A robot of the project refuses its parameters, or ends the run."""


class BadArgument(Error, ValueError):
    """A value that an argument may not have; the text names the argument and what is accepted."""


class HostError(Error):
    """A robot cannot take part, or cannot go on."""


class BadParameters(Error):
    """Parameters that a robot cannot work with; the text says which and why."""

    def __init__(self, robot: str, reason: str) -> None:
        super().__init__(f"parameters of {robot}: {reason}; mend them in the scenario, under the robot's params")
        self.reason = reason


class CallError(Error):
    """Why a call between robots gave nothing."""


class UnknownRobot(CallError):
    """No robot of the roster has this name."""


class Unreachable(CallError):
    """The network between the two is cut, or the other one is lost."""


class TooEarly(CallError):
    """Before tick 1 nobody has reported anything."""


class Interrupted(CallError):
    """The tick is over: a newer clock is here, or the run ends. A robot may let it through."""
