"""Ports for processes of tests."""

from __future__ import annotations

import fcntl
import itertools
import os
import socket
from pathlib import Path
from typing import BinaryIO

# Not those that the kernel gives to connections: another process would take one before it is used.
FIRST = 11_000
COUNT = 20_000
PORTS = itertools.cycle(range(FIRST, FIRST + COUNT))
# Processes begin at different places.
for _ in range(os.getpid() % COUNT):
    next(PORTS)

# Processes of tests claim theirs by locks, as `system_tests::free_port` does, until they end.
CLAIMED = Path(__file__).resolve().parents[2] / "target" / "tmp" / "ports"
CLAIMS: list[BinaryIO] = []


def free_port() -> int:
    """A port of the loopback interface at which no process listens."""
    CLAIMED.mkdir(parents=True, exist_ok=True)
    while True:
        port = next(PORTS)
        claim = open(CLAIMED / str(port), "wb")
        if try_lock(claim) and is_free(port):
            CLAIMS.append(claim)
            return port
        claim.close()


def try_lock(claim: BinaryIO) -> bool:
    """Locks a file until this process ends, and returns whether that is done: another process may have locked it."""
    try:
        fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def is_free(port: int) -> bool:
    """Whether a listener can be bound to a port."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True
