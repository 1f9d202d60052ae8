"""A program with the stream of the client library, which sends a recording of
its own: test/browser/send_segments.
"""

import subprocess

from failover import checks
from failover.load import Context
from selfcal.v1 import rig_pb2

_SECONDS = 200  # of the recording
_PATIENCE_S = 120


class Sender:
    """Runs from construction until finish(), if there is the program."""

    def __init__(self, context: Context, rig_id: str, port: int) -> None:
        self._context = context
        self._rig_id = rig_id
        self._process = None
        if context.send_segments is None:
            return
        checks.create_rig(context.fleet, _rig(context, rig_id))
        self._process = subprocess.Popen(
            _command(context, f"127.0.0.1:{port}", rig_id),
            cwd=context.fleet.folder.parent,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )

    def finish(self) -> list:
        """Returns what is wrong, once it has ended."""
        if self._process is None:
            return []
        try:
            error = self._process.communicate(timeout=_PATIENCE_S)[1]
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            error = f"it is not done after {_PATIENCE_S} s"
        if self._process.returncode != 0:
            return [f"rig {self._rig_id}: the client library: {error.strip()}"]
        found = self._context.fleet.query(
            "SELECT session, session_index, observations, start_ns"
            " FROM segments JOIN rigs USING (rig) WHERE id = %s ORDER BY 1, 2",
            self._rig_id,
        )
        expected = _expected(self._context)
        if found == expected:
            return []
        return [
            f"rig {self._rig_id}: {len(found)} segments of {len(expected)}, or "
            "other ones"
        ]


def _rig(context: Context, rig_id: str) -> rig_pb2.Rig:
    rig = rig_pb2.Rig()
    rig.CopyFrom(context.source.rig)
    rig.ClearField("create_time")
    rig.name = f"rigs/{rig_id}"
    return rig


def _command(context: Context, target: str, rig_id: str) -> list:
    return [context.send_segments, target, rig_id, "walk", str(_SECONDS)]


def _expected(context: Context) -> list:
    """What the program sends where nothing fails."""
    if context.sent_by_program is None:
        reference = context.reference
        request = rig_pb2.CreateRigRequest(rig=_rig(context, "library"))
        reference.daemon.rig_service.CreateRig(request, timeout=30)
        command = _command(context, reference.target, "library")
        subprocess.run(command, check=True)
        rows = []
        for segment in reference.daemon.segments("library"):
            session, index = segment.name.rpartition("/")[2].rsplit("~", 1)
            rows.append(
                (session, int(index), segment.observations, segment.start_ns)
            )
        context.sent_by_program = sorted(rows)
    return context.sent_by_program
