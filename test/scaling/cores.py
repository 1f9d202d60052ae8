"""Gives the database processor cores of its own, as on a machine of its own."""

import contextlib
import os

from scaling.cpu import children


def can_be_divided() -> bool:
    return len(os.sched_getaffinity(0)) >= 2


@contextlib.contextmanager
def divided(server_pid: int):
    """Half of the cores are the server's; this process, and what it starts, has
    the others.
    """
    ours = os.sched_getaffinity(0)
    of_server = set(sorted(ours)[: len(ours) // 2])
    servers = [server_pid, *children(server_pid)]
    for pid in servers:  # what they start follows them
        os.sched_setaffinity(pid, of_server)
    os.sched_setaffinity(0, ours - of_server)
    try:
        yield
    finally:
        os.sched_setaffinity(0, ours)
        for pid in [server_pid, *children(server_pid)]:
            with contextlib.suppress(ProcessLookupError):
                os.sched_setaffinity(pid, ours)
