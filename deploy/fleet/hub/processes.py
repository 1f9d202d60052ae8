"""Processes of a fleet of one machine: started in the background, found again
by the files run/NAME.pid, ended by a signal.
"""

import os
import pathlib
import signal
import subprocess
import time
from collections.abc import Callable


class Failed(Exception):
    """A component did not start; the text says why."""


def pid_of(folder: pathlib.Path, name: str) -> int:
    """The process of a component that runs; 0 if there is none.

    Its command line contains the folder, so a number that the system has given
    to another process since is not taken for it.
    """
    try:
        words = (folder / "run" / f"{name}.pid").read_text().split()
        pid = int(words[0])
        process = pathlib.Path(f"/proc/{pid}")
        command = (process / "cmdline").read_bytes()
        state = (process / "stat").read_text().rpartition(")")[2].split()[0]
    except (OSError, IndexError, ValueError):
        return 0
    # A process has no command line while it begins, nor after it has ended and
    # until its parent has taken notice.
    if command:
        return pid if os.fsencode(f"{folder}/") in command else 0
    return 0 if state in "ZX" else pid


def _environment() -> dict:
    """That of the caller, without what the components would read from it."""
    return {
        key: value
        for key, value in os.environ.items()
        if not key.startswith(("PG", "ETCD_", "PATRONI_", "PGBACKREST_"))
    }


def launch(
    folder: pathlib.Path,
    name: str,
    command: list[str],
    environment: dict | None = None,
) -> None:
    """Starts a component that does not run yet."""
    log = folder / "log" / f"{name}.log"
    log.parent.mkdir(mode=0o700, exist_ok=True)
    (folder / "run").mkdir(mode=0o700, exist_ok=True)
    with log.open("ab") as out:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=out,
            cwd=folder,
            env={**_environment(), **(environment or {})},
            start_new_session=True,
        )
    (folder / "run" / f"{name}.pid").write_text(f"{process.pid}\n")


def wait_until(
    condition: Callable[[], bool],
    seconds: float,
    why_not: Callable[[], str],
) -> None:
    """Waits for a condition; raises Failed if that takes longer."""
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise Failed(why_not())
        time.sleep(0.1)


def log_end(folder: pathlib.Path, name: str, lines: int = 15) -> str:
    log = folder / "log" / f"{name}.log"
    try:
        text = log.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return f"{log} does not exist"
    return "\n".join([f"{log}:", *text.splitlines()[-lines:]])


def end(
    folder: pathlib.Path,
    name: str,
    how: signal.Signals,
    seconds: float,
) -> bool:
    """Ends a component, by SIGKILL if it takes longer. True if it ran."""
    pid = pid_of(folder, name)
    if pid == 0:
        return False
    os.kill(pid, how)
    deadline = time.monotonic() + seconds
    while pid_of(folder, name) == pid:
        if time.monotonic() > deadline:
            os.kill(pid, signal.SIGKILL)
            deadline = time.monotonic() + 10
        time.sleep(0.05)
    return True
