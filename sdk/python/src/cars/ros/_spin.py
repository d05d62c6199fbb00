"""The end of a tick: nothing is ready in the executor of the node."""

from __future__ import annotations

from typing import Any, Callable

from ._load import RosError

MAX_CALLBACKS = 20_000
"""Most callbacks of a tick: a node that causes a callback in each of its callbacks is never idle."""


def spin_until_idle(ros: Any, executor: Any, after_each: Callable[[], None]) -> bool:
    """Handles what is ready, and what becomes ready by that, until nothing is; returns whether the node goes on.

    This is exact, without a wait: a message is in the history of its reader when ``publish`` returns, a timer of simulated time is
    ready when the callback of ``/clock`` has returned, and both are before the wait set is asked again.

    :raises RosError: if there is no end to it.
    """
    executors = ros.executors
    waiting: set[Any] = set()
    # Passes in a row in which nothing was ready. The first timeout only says that the list of the last pass is at its end.
    idle_passes = 0
    for _ in range(MAX_CALLBACKS):
        try:
            task, _entity, _node = executor.wait_for_ready_callbacks(timeout_sec=0)
        except executors.TimeoutException:
            idle_passes += 1
            # Coroutines that wait are run in each pass, and one may set the future for which the one before it waits.
            if idle_passes > 1 + len(waiting):
                return True
            continue
        except (executors.ShutdownException, executors.ExternalShutdownException):
            return False

        if not goes_on_after(lambda task=task: _execute(task)):  # type: ignore[misc]
            return False
        # A node that calls rclpy.shutdown() has destroyed its topics and ours.
        if not executor.context.ok():
            return False
        after_each()
        if task.done():
            waiting.discard(task)
            idle_passes = 0
        elif task not in waiting:
            waiting.add(task)
            idle_passes = 0
    raise RosError(
        f"the node handled {MAX_CALLBACKS} callbacks in a tick, and was not idle: does one of its callbacks publish to a topic that it "
        "subscribes to?"
    )


def goes_on_after(call: Callable[[], object]) -> bool:
    """Calls what is the node's own; raises what it raises. Returns whether the node goes on: ``raise SystemExit`` is how many nodes end.

    :raises RosError: if it has ended with an exit status other than 0.
    """
    try:
        call()
    except SystemExit as ended:
        if ended.code in (None, 0):
            return False
        raise RosError(f"the node ended with exit status {ended.code}") from ended
    return True


def _execute(task: Any) -> None:
    """Runs a callback; raises what it raised."""
    task()
    if task.done():
        task.result()
