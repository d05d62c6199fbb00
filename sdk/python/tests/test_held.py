"""Commands that wait for a clock."""

from __future__ import annotations

from cars_robot.held import MAX_COMMANDS, Held
from cars_robot.messages import Command, CommandId


def command(seq: int, epoch: int = 1) -> Command:
    return Command(epoch, 1, seq, "")


def test_who_floods_loses_its_own() -> None:
    held = Held()
    held.hold("Quiet", command(1))
    for seq in range(1, 2 * MAX_COMMANDS + 1):
        held.hold("Flood", command(seq))
    assert held.count == MAX_COMMANDS
    assert held.take(CommandId("Quiet", 1), 1) is not None
    assert held.take(CommandId("Flood", 1), 1) is None
    assert held.take(CommandId("Flood", 2 * MAX_COMMANDS), 1) is not None


def test_many_who_send_little_are_bounded_too() -> None:
    held = Held()
    for sender in range(MAX_COMMANDS + 100):
        held.hold(f"s{sender}", command(1))
    assert held.count == MAX_COMMANDS == len(held._by_sender)


def test_a_command_is_taken_once_and_only_in_its_epoch() -> None:
    held = Held()
    held.hold("A", command(1))
    held.hold("A", command(1))
    assert held.take(CommandId("A", 1), 2) is None
    assert held.take(CommandId("A", 1), 1) is not None
    assert held.take(CommandId("A", 1), 1) is None
    held.hold("A", command(2))
    held.hold("A", command(1, epoch=2))
    held.begin(2)
    assert held.take(CommandId("A", 2), 1) is None
    assert held.take(CommandId("A", 1), 2) is not None
    assert held.count == 0
