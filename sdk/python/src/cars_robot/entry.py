"""The ``main`` of a robot's program: the same arguments, the same environment, the same exit status for all."""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import FrameType

from .bus import DEFAULT_ENDPOINT, BusError
from .host import Host, HostError, HostOptions
from .link import Terminated
from .messages import Malformed, is_name
from .parameters import BadParameters
from .robot import Robot
from .version import __version__


def run(robots: Mapping[str, Robot], options: HostOptions | None = None) -> str:
    """Takes part in a run with these robots, by name, until it ends; returns how it ended.

    :param options: how to reach the run; what the environment says if left out.
    :raises HostError: refused, replaced, or no simulator of this run.
    :raises BusError: the simulator cannot be reached.
    :raises BadParameters: a robot refuses its parameters.
    """
    return Host(robots, options or HostOptions.from_environment()).run()


def main(default_name: str, make: Callable[[str], Robot], arguments: Sequence[str] | None = None) -> int:
    """Runs a robot's program, and returns the exit status: 0 if the run ended as it should, 1 if not, 2 for wrong
    arguments.

    SIGTERM and SIGINT take back the robot's token, close the session, and then end the process as if it had not caught
    them.

    :param default_name: the robot's name where the command line gives none.
    :param make: builds the robot for a name.
    """
    given = _parser(default_name).parse_args(arguments)
    names: list[str] = given.name or [default_name]
    if len(set(names)) < len(names):
        print("error: a robot is named twice; name each once", file=sys.stderr)
        return 2
    _start_log()
    options = HostOptions(given.run, given.connect, given.patience_s, given.gone_patience_s, given.zenoh_config)
    try:
        return _play({name: make(name) for name in names}, options)
    except (HostError, BusError, BadParameters, Malformed) as error:
        print(f"error: {error}", file=sys.stderr)
    except Exception:
        traceback.print_exc()
        print(f"error: {' and '.join(names)} failed: see above", file=sys.stderr)
    return 1


def _play(robots: Mapping[str, Robot], options: HostOptions) -> int:
    # Until the session is open there is nothing to take back, and opening cannot be interrupted otherwise.
    with _Signals() as signals:
        try:
            host = Host(robots, options, on_open=signals.catch)
            signals.stop = host.link.stop
            host.run()
        except Terminated:
            pass
    return 0


class _Signals:
    """Ends the process by the signal that came, after everything has been taken back."""

    CAUGHT = (signal.SIGTERM, signal.SIGINT)

    def __init__(self) -> None:
        self.stop: Callable[[], None] = lambda: None
        self._came: int | None = None
        self._before = {}
        self._wakers: tuple[int, int] | None = None
        """What was told of signals before, and what is told of them now."""
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, signal.SIG_DFL) for number in self.CAUGHT}

    def __enter__(self) -> _Signals:
        return self

    def catch(self) -> None:
        """From now on there is something to take back."""
        if not self._before:
            return
        reader, writer = os.pipe()
        os.set_blocking(writer, False)
        self._wakers = (signal.set_wakeup_fd(writer, warn_on_full_buffer=False), writer)
        threading.Thread(target=self._wake, args=(reader,), name="signals", daemon=True).start()
        for number in self._before:
            signal.signal(number, self._on_signal)

    def _wake(self, reader: int) -> None:
        # Python runs a handler on the main thread when that wakes. One that is about to wait, or whose signal went to
        # another thread, does not wake by the signal.
        while os.read(reader, 1):
            self.stop()
        os.close(reader)

    def _on_signal(self, number: int, _frame: FrameType | None) -> None:
        self._came = number
        for caught in self._before:
            signal.signal(caught, signal.SIG_DFL)  # A second one ends it at once.
        # Should this be swallowed by a callback that happens to run, the loop still hears of it.
        self.stop()
        raise Terminated

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_DFL if self._came else handler)
        if self._wakers is not None:
            before, writer = self._wakers
            signal.set_wakeup_fd(before)
            os.close(writer)
        if self._came is not None:
            sys.stdout.flush()
            sys.stderr.flush()
            signal.raise_signal(self._came)


def _parser(default_name: str) -> argparse.ArgumentParser:
    def setting(name: str, default: str) -> str:
        return os.environ.get(name, default)

    parser = argparse.ArgumentParser(description="A robot of the Cooperative Affective Robot Simulator")
    parser.add_argument(
        "--name",
        action="append",
        type=_name,
        help="which robot of the roster this is; several names run several robots in this process; "
        f"without one {default_name}",
    )
    parser.add_argument(
        "--run", type=_name, default=setting("CARS_RUN", "default"), help="the run to take part in [CARS_RUN]"
    )
    parser.add_argument(
        "--connect",
        metavar="ENDPOINT",
        default=setting("CARS_CONNECT", DEFAULT_ENDPOINT),
        help="where its simulator listens [CARS_CONNECT]",
    )
    parser.add_argument(
        "--patience-s",
        metavar="SECONDS",
        type=_patience,
        default=setting("CARS_PATIENCE_S", "20"),
        help="how long to try to reach the simulator and to be let in [CARS_PATIENCE_S]",
    )
    parser.add_argument(
        "--gone-patience-s",
        metavar="SECONDS",
        type=_patience,
        default=setting("CARS_GONE_PATIENCE_S", "600"),
        help="how long to wait for the simulator once it is gone, or the link to it is cut [CARS_GONE_PATIENCE_S]",
    )
    parser.add_argument(
        "--zenoh-config",
        metavar="FILE",
        type=Path,
        default=os.environ.get("CARS_ZENOH_CONFIG") or None,
        help="a configuration file of the middleware instead of the built-in settings [CARS_ZENOH_CONFIG]",
    )
    parser.add_argument("-V", "--version", action="version", version=f"%(prog)s {__version__}")
    return parser


def _name(text: str) -> str:
    if not is_name(text):
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a usable name: 1 to 64 letters, digits, '_', '-' or '.', not beginning with '.'"
        )
    return text


def _patience(text: str) -> float:
    seconds = float(text)
    if not 0 <= seconds < 1e9:
        raise argparse.ArgumentTypeError(f"{text} is no time to wait; give seconds from 0 to 1e9")
    return seconds


def _start_log() -> None:
    levels = {"error": "ERROR", "warn": "WARNING", "info": "INFO", "debug": "DEBUG", "trace": "DEBUG"}
    level = levels.get(os.environ.get("RUST_LOG", "warn").lower(), "WARNING")
    logging.basicConfig(level=level, stream=sys.stderr, format="%(levelname)s %(message)s")


__all__ = ["main", "run"]
