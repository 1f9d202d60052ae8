"""A replica of the hub: selfcald on the database of the test."""

import http.client
import json
import pathlib
import re
import signal

from hub import processes

_HEADERS = {"X-Selfcal-Console": "1", "Content-Type": "application/json"}


class Daemon:
    def __init__(
        self, folder: pathlib.Path, program: str, store: str, name: str
    ) -> None:
        self._folder = folder
        self._command = [
            *(program, "--state-dir", str(folder / name), "--store", store),
            *("--console", "127.0.0.1:0", "--console-role", "administer"),
        ]
        self._name = name
        self.target = f"unix:{folder / name}/selfcald.sock"
        self.port = 0

    def start(self, *options: str) -> None:
        (self._folder / self._name).mkdir(mode=0o700, exist_ok=True)
        log = self._folder / "log" / f"{self._name}.log"
        log.unlink(missing_ok=True)
        self.port = 0
        processes.launch(self._folder, self._name, [*self._command, *options])
        processes.wait_until(
            lambda: self._find_port(log.read_text(errors="replace")),
            120,
            lambda: processes.log_end(self._folder, self._name),
        )

    def _find_port(self, log: str) -> bool:
        found = re.search(r"console: http://[\d.]+:(\d+)", log)
        if found and "ready" in log:
            self.port = int(found[1])
        return self.port != 0

    @property
    def pid(self) -> int:
        return processes.pid_of(self._folder, self._name)

    def stop(self) -> None:
        processes.end(self._folder, self._name, signal.SIGTERM, 30)

    def call(self, path: str, method: str = "GET", body=None) -> dict:
        """A call of the API, on a connection of its own."""
        connection = http.client.HTTPConnection(
            "127.0.0.1", self.port, timeout=600
        )
        text = None if body is None else json.dumps(body)
        connection.request(method, f"/api/v1/{path}", text, _HEADERS)
        answer = connection.getresponse()
        content = answer.read()
        connection.close()
        if answer.status != 200:
            raise processes.Failed(
                f"{method} {path}: {answer.status} {content[:300]!r}"
            )
        return json.loads(content)
