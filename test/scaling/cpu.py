"""CPU time of processes: a cost that other programs hardly change."""

import contextlib
import os
import pathlib

from hub import processes

_TICKS = os.sysconf("SC_CLK_TCK")


def cpu_s(pid: int) -> float:
    """CPU time of a process, and of its children, also of those that ended."""
    if pid == 0:
        raise processes.Failed("a process has ended that was measured")
    total = 0
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        with contextlib.suppress(OSError, ValueError, IndexError):
            values = (entry / "stat").read_text().rpartition(")")[2].split()
            if int(entry.name) == pid:
                total += sum(int(value) for value in values[11:15])
            elif int(values[1]) == pid:
                total += sum(int(value) for value in values[11:13])
    return total / _TICKS
