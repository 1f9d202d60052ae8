"""A daemon on SQLite in a folder of its own."""

import pathlib
import signal

import grpc
from hub import processes

import selfcal


class LocalDaemon:
    """Runs from construction until kill() or stop(), and again from start()."""

    def __init__(
        self,
        folder: pathlib.Path,
        name: str,
        program: str,
        options: tuple = (),
    ) -> None:
        self._folder = folder
        self._name = name
        self._program = program
        self._options = options
        self.state = folder / name
        self.target = f"unix:{self.state}/selfcald.sock"
        self.state.mkdir(mode=0o700, exist_ok=True)
        self.start()

    def start(self, *more: str) -> None:
        """With more options from now on."""
        self._options += more
        command = [self._program, "--state-dir", str(self.state)]
        command += self._options
        processes.launch(self._folder, self._name, command)
        self.daemon = selfcal.connect(self.target)
        processes.wait_until(self._serves, 60, self._log_end)

    def kill(self) -> None:
        self._end(signal.SIGKILL)

    def stop(self) -> None:
        self._end(signal.SIGTERM)

    def _end(self, how: signal.Signals) -> None:
        self.daemon.close()
        processes.end(self._folder, self._name, how, 20)

    def log(self) -> str:
        file = self._folder / "log" / f"{self._name}.log"
        return file.read_text(encoding="utf-8", errors="replace")

    def _serves(self) -> bool:
        try:
            list(self.daemon.rigs())
        except grpc.RpcError:
            return False
        return True

    def _log_end(self) -> str:
        return processes.log_end(self._folder, self._name)
