"""TCP ports for servers that are started later and cannot choose one themselves."""

from __future__ import annotations

import random
import socket
from pathlib import Path

FIRST = 10000
LEAST = 10000  # so many to choose from, where connections have nearly all
GIVEN: set[int] = set()  # by this process
CHANCE = random.SystemRandom()  # processes that run side by side have to choose differently


def first_of_connections() -> int:
    """The system gives connections ports from here on, at any moment."""
    return int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()[0])


def free_port() -> int:
    """A port that nothing listens at now and that no connection will get."""
    while True:
        port = CHANCE.randrange(FIRST, max(first_of_connections(), FIRST + LEAST))
        if port in GIVEN:
            continue
        GIVEN.add(port)
        with socket.socket() as found:
            try:
                found.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
