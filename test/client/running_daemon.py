"""A real selfcald, as systemd would start it: it says itself when it serves."""

import os
import socket
import subprocess

PATIENCE_S = 60


class RunningDaemon:
    """Serves the state directory `state` from construction until stop()."""

    def __init__(self, program: str, state: str) -> None:
        self.target = f"unix:{state}/selfcald.sock"
        ready = f"{state}.ready"
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as told:
            told.bind(ready)
            told.settimeout(PATIENCE_S)
            self._process = subprocess.Popen(
                [program, "--state-dir", state],
                env={**os.environ, "NOTIFY_SOCKET": ready},
            )
            try:
                while b"READY=1" not in told.recv(4096).split(b"\n"):
                    pass
            except TimeoutError:
                self.stop()
                raise
            finally:
                os.unlink(ready)

    def stop(self) -> None:
        self._process.terminate()
        try:
            self._process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            raise
