"""Replicas of a fleet that run an earlier program and the present one: which of
them each runs, and what its process has done.
"""

import dataclasses
import os
import re

from hub import processes

from failover.running_fleet import RunningFleet
from failover.tried import wait

_START_S = 60
_COUNTERS = {
    "acknowledged": r'^selfcal_segments_total\{verdict="stored"\} (\S+)$',
    "scored": r"^selfcal_scoring_seconds_count (\S+)$",
}
_RESULT = re.compile(
    r"rig \S+ has calibration \d+|calibration \d+ of rig \S+ is rejected"
)
_STOPPED = re.compile(r" info stopped$", re.MULTILINE)


@dataclasses.dataclass
class Work:
    """Counts of a process since its start, from its metrics and its log."""

    acknowledged: int = 0
    scored: int = 0
    results: int = 0  # of runs

    def __add__(self, other: "Work") -> "Work":
        return Work(
            self.acknowledged + other.acknowledged,
            self.scored + other.scored,
            self.results + other.results,
        )

    def __str__(self) -> str:
        return (
            f"{self.acknowledged} segments acknowledged, {self.scored} scored, "
            f"{self.results} results of runs"
        )


@dataclasses.dataclass
class _Process:
    program: str
    pid: int
    log_begin: int  # of the log of its replica


class MixedReplicas:
    """All replicas run `program` at first."""

    def __init__(self, fleet: RunningFleet, program: str) -> None:
        self._fleet = fleet
        self._running = {
            name: _Process(program, fleet.pid(name), 0)
            for name in fleet.replicas()
        }
        self._ended: list = []  # programs and what their processes had done

    def stop(self, name: str) -> list:
        """Returns a sentence if it did not stop as it should."""
        process = self._running.pop(name)
        self._ended.append((process.program, self._work(name, process)))
        if self._fleet.pid(name) != process.pid:
            return [f"{name} had ended: {self.log_end(name)}"]
        self._fleet.stop_replica(name)
        log = self._fleet.log(name)[process.log_begin :]
        if not _STOPPED.search(log):
            return [f"{name} did not stop by itself: {self.log_end(name)}"]
        return []

    def start(self, name: str, program: str) -> bool:
        """False if the process ends instead of being ready."""
        log_begin = len(self._fleet.log(name))
        self._fleet.use(program)
        self._fleet.start_replica(name)
        pid = self._fleet.pid(name)

        def is_ready() -> bool:
            return "selfcald ready" in self._fleet.log(name)[log_begin:]

        wait(lambda: is_ready() or self._fleet.pid(name) == 0, _START_S)
        if not is_ready():
            return False
        self._running[name] = _Process(program, pid, log_begin)
        return True

    def unexpected(self) -> list:
        """A sentence for each replica that is not the process that was started,
        with its program.
        """
        wrong = []
        for name, process in self._running.items():
            pid = self._fleet.pid(name)
            if pid != process.pid:
                wrong.append(f"{name} has ended: {self.log_end(name)}")
                continue
            program = os.readlink(f"/proc/{pid}/exe")
            if program != os.path.realpath(process.program):
                wrong.append(f"{name} runs {program}, not {process.program}")
        return wrong

    def idle(self, before: dict) -> list:
        """Replicas that have not acknowledged and scored segments since."""
        now = self.work()
        return [
            name
            for name, work in before.items()
            if now[name].acknowledged <= work.acknowledged
            or now[name].scored <= work.scored
        ]

    def work(self) -> dict:
        """Of the process of each replica."""
        return {
            name: self._work(name, process)
            for name, process in self._running.items()
        }

    def work_of(self, program: str) -> Work:
        """Of all processes of a program, also those that have ended."""
        running = [
            (process.program, self._work(name, process))
            for name, process in self._running.items()
        ]
        done = [work for ran, work in self._ended + running if ran == program]
        return sum(done, Work())

    def log_end(self, name: str) -> str:
        return processes.log_end(self._fleet.folder, name, 3)

    def _work(self, name: str, process: _Process) -> Work:
        text = self._fleet.metrics(name)
        counts = {
            counter: int(float(found[1]))
            for counter, line in _COUNTERS.items()
            if (found := re.search(line, text, re.MULTILINE))
        }
        log = self._fleet.log(name)[process.log_begin :]
        return Work(**counts, results=len(_RESULT.findall(log)))
