"""CPU time of processes: a cost that other programs hardly change."""

import contextlib
import os
import pathlib

from hub import processes

_TICKS = os.sysconf("SC_CLK_TCK")


def _stats():
    """Of each process: its id, and the fields after its name."""
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        with contextlib.suppress(OSError):
            values = (entry / "stat").read_text().rpartition(")")[2].split()
            yield int(entry.name), values


def children(pid: int) -> list[int]:
    return [child for child, values in _stats() if int(values[1]) == pid]


def own_cpu_s(pid: int) -> float:
    """CPU time of a process without its children."""
    values = dict(_stats()).get(pid)
    if values is None:
        raise processes.Failed("a process has ended that was measured")
    return sum(int(value) for value in values[11:13]) / _TICKS


def cpu_s(pid: int) -> float:
    """CPU time of a process, and of its children, also of those that ended."""
    if pid == 0:
        raise processes.Failed("a process has ended that was measured")
    total = 0
    for other, values in _stats():
        if other == pid:
            total += sum(int(value) for value in values[11:15])
        elif int(values[1]) == pid:
            total += sum(int(value) for value in values[11:13])
    return total / _TICKS
