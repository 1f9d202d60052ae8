"""What the trials of a guarantee have come to."""

import statistics
import time
from collections.abc import Callable, Iterator
from typing import Protocol

_ROUND = 10


class Round(Protocol):
    """Devices that send while something fails."""

    attempts: list  # of each run

    def acknowledged(self) -> int: ...

    def finish(self) -> list: ...


class Tried:
    def __init__(self, name: str, wanted: int, say: Callable) -> None:
        self.name = name
        self.wanted = wanted
        self.trials = 0
        self.checked = 0  # of the trials: what was sent has been compared
        self.lost: list = []
        self.seconds: list = []  # until the hub was back
        self.after = "acknowledges again"
        self.segments = 0
        self.attempts: list = []
        self.say = say

    def trial(self, text: str) -> None:
        self.trials += 1
        self.note(f"{self.trials} of {self.wanted}: {text}")

    def note(self, text: str) -> None:
        self.say(f"{self.name}: {text}")

    def fail(self, text: str) -> None:
        self.lost.append(text)
        self.note(f"LOST: {text[:1000]}")

    def finish(self, load: Round) -> None:
        self.note(f"checks {load.acknowledged()} segments")
        for text in load.finish():
            self.fail(text)
        self.segments += load.acknowledged()
        self.attempts += load.attempts
        self.checked = self.trials

    def summary(self) -> str:
        parts = [f"{self.segments} segments", f"{len(self.attempts)} runs"]
        again = sum(attempts > 1 for attempts in self.attempts)
        if again:
            parts.append(f"{again} of them begun again")
        if self.seconds:
            median = statistics.median(self.seconds)
            parts.append(
                f"{self.after} after {median:.1f} s (median), "
                f"{max(self.seconds):.1f} s at most"
            )
        return ", ".join(parts)


def rounds(trials: int, length: int = _ROUND) -> Iterator[range]:
    """Trials with one set of rigs."""
    for first in range(0, trials, length):
        yield range(first, min(trials, first + length))


def wait(condition: Callable, seconds: float) -> bool:
    """False if the condition does not hold within this time."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.1)
    return True
