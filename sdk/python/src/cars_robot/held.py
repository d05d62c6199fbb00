"""Commands that have arrived and wait for a clock to name them."""

from __future__ import annotations

import logging

from .messages import Command, CommandId

MAX_COMMANDS = 16_384
"""Commands that are held for one robot. Beyond that the oldest of whoever has most of them here makes room, so that who
floods a robot loses its own."""

_log = logging.getLogger(__name__)


class Held:
    """The commands for one robot, by sender."""

    def __init__(self) -> None:
        self._by_sender: dict[str, dict[int, Command]] = {}
        self.count = 0

    def hold(self, sender: str, command: Command) -> None:
        """Holds a command; a repetition changes nothing."""
        own = self._by_sender.setdefault(sender, {})
        is_new = command.seq not in own
        own[command.seq] = command
        if is_new:
            self.count += 1
            if self.count > MAX_COMMANDS:
                self._make_room()

    def take(self, command: CommandId, epoch: int) -> Command | None:
        """The command that a clock names, if it is here and of this epoch."""
        found = self._by_sender.get(command.sender, {}).get(command.seq)
        if found is None or found.epoch != epoch:
            return None
        self._drop(command.sender, command.seq)
        return found

    def begin(self, epoch: int) -> None:
        """Forgets what was sent in epochs before this one."""
        kept: dict[str, dict[int, Command]] = {}
        for sender, own in self._by_sender.items():
            current = {seq: command for seq, command in own.items() if command.epoch >= epoch}
            if current:
                kept[sender] = current
        self._by_sender = kept
        self.count = sum(len(own) for own in kept.values())

    def _make_room(self) -> None:
        sender, own = max(self._by_sender.items(), key=lambda entry: len(entry[1]))
        self._drop(sender, next(iter(own)))
        _log.warning("too many commands of %s are waiting; the oldest one is dropped", sender)

    def _drop(self, sender: str, seq: int) -> None:
        own = self._by_sender[sender]
        del own[seq]
        if not own:
            del self._by_sender[sender]
        self.count -= 1
