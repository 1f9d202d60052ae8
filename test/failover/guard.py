"""Ends a fleet and removes its folder when standard input ends: also if the
test was killed.

    guard.py STOP DIR keep|remove
"""

import contextlib
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time


def processes_of(folder: str) -> list:
    """Processes that work in the folder, as all of the test do."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        try:
            place = os.readlink(entry / "cwd")
        except OSError:  # it has ended, or is another user's
            continue
        if f"{place}/".startswith(f"{folder}/"):
            found.append(int(entry.name))
    return found


def send(number: signal.Signals, pids: list) -> None:
    for pid in pids:
        with contextlib.suppress(OSError):
            os.kill(pid, number)


def main() -> None:
    stop, folder, what = sys.argv[1:]
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    sys.stdin.buffer.read()
    send(signal.SIGCONT, processes_of(folder))
    for file in pathlib.Path(folder).glob("*/etc/fleet.yaml"):
        command = [stop, str(file.parent.parent)]
        subprocess.run(command, check=False, stdout=subprocess.DEVNULL)
    # A start that was interrupted, and what else the test had begun.
    deadline = time.monotonic() + 20
    while (left := processes_of(folder)) and time.monotonic() < deadline:
        send(signal.SIGKILL, left)
        time.sleep(0.2)
    if what == "remove":
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()
