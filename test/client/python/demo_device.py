"""A daemon that holds the data of a simulated device, for tests of modules that
are programs too."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.append(str(pathlib.Path(__file__).parents[1]))

from running_daemon import RunningDaemon


def run_module(
    name: str, paths: list[str], arguments: list, **options
) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", name, *arguments],
        env={**os.environ, "PYTHONPATH": ":".join(paths)},
        capture_output=True,
        text=True,
        check=False,
        **options,
    )


class DemoDevice(unittest.TestCase):
    """Its rig is `simulated`, at `target`; `folder` is for files."""

    selfcald: str
    demo: str  # selfcal-demo

    @classmethod
    def setUpClass(cls) -> None:
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = folder.name
        subprocess.run(
            [cls.demo, "--daemon", cls.selfcald, "--seconds", "40"]
            + ["--keep", f"{cls.folder}/demo"],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        running = RunningDaemon(cls.selfcald, f"{cls.folder}/demo/state")
        cls.addClassCleanup(running.stop)
        cls.target = running.target
