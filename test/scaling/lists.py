"""The lists and pages of a hub, timed over HTTP as its console reads them."""

import dataclasses
import random
import time
import urllib.parse
from collections.abc import Callable

from hub import processes

from scaling import real_rigs
from scaling.cpu import cpu_s
from scaling.daemon import Daemon
from scaling.database import Server

_LIMIT_MS = 50
_PAGE = 500  # of the command line
_WALK_S = 4  # to collect the tokens of later pages
_COMPONENT = "cam0.focal.x"


@dataclasses.dataclass
class Request:
    name: str
    path: Callable[[], str]
    # Empty: an answer without a list, or one that may have nothing.
    items: str = ""
    paged: bool = False


class Fleet:
    """Rigs to ask for: those whose segments have all of their bytes."""

    def __init__(self, connection) -> None:
        cursor = connection.cursor()
        cursor.execute(
            "SELECT id, is_heavy, has_data FROM copied.chosen "
            "WHERE is_complete OR has_data"
        )
        rows = cursor.fetchall()
        self._heavy = [rig for rig, is_heavy, _ in rows if is_heavy]
        self._others = [rig for rig, is_heavy, _ in rows if not is_heavy]
        self._with_data = [rig for rig, _, has_data in rows if has_data]
        cursor.execute(
            "SELECT id, session, session_index FROM copied.chosen r "
            "JOIN payloads p USING (rig) JOIN segments s USING (rig, sequence)"
        )
        self._stored = cursor.fetchall()
        cursor.execute("SELECT count(*) FROM rigs")
        (self.rigs,) = cursor.fetchone()

    def heavy(self) -> str:
        return "rigs/" + random.choice(self._heavy)

    def other(self) -> str:
        return "rigs/" + random.choice(self._others)

    def with_data(self) -> str:
        return "rigs/" + random.choice(self._with_data)

    def stored(self) -> str:
        """A segment whose data is stored."""
        rig, session, index = random.choice(self._stored)
        return f"rigs/{rig}/segments/{session}~{index}"

    def number(self, digits: int) -> str:
        """Digits in the name of at least one rig."""
        name = f"{random.randrange(1, self.rigs + 1):06}"
        return name[-digits:]


def _with(path: str, **parameters) -> str:
    return f"{path}?{urllib.parse.urlencode(parameters)}"


_LISTS_OF_ALL = {
    "by temperature": {"order_by": "temperature_c desc"},
    "by angular rate": {"order_by": "angular_rate desc"},
    "by acceleration, of a range": {
        "order_by": "acceleration asc",
        "filter": "acceleration >= 1",
    },
    "that are unusable": {"filter": "state = UNUSABLE"},
    "that wait for their score": {"filter": "state = STORED"},
    "that do not fit": {"filter": "excluded = DOES_NOT_FIT"},
    "that are too old": {"filter": "excluded = TOO_OLD"},
}


def _segments_of_all(size: int, model: str) -> list[Request]:
    """Those that an index of their own serves, also with a label."""

    def page(**parameters) -> Callable[[], str]:
        return lambda: _with("segments", page_size=size, **parameters)

    found = []
    for name, parameters in _LISTS_OF_ALL.items():
        # The others may be of no segment.
        items = "segments" if "order_by" in parameters else ""
        found += [
            Request(f"segments of all {name}", page(**parameters), items, True),
            Request(
                f"... of a model, {name}",
                page(**parameters, rig_filter=model),
                "",
                True,
            ),
        ]
    return found


def _fleet_wide(of: Fleet, size: int) -> list[Request]:
    def page(path: str, **parameters) -> Callable[[], str]:
        return lambda: _with(path, page_size=size, **parameters)

    model = 'labels.model = "t3"'
    both = model + ' AND labels.batch = "2026-03"'
    nothing = 'labels.model = "none"'
    return [
        Request("rigs", page("rigs"), "rigs", True),
        Request("rigs of a model", page("rigs", filter=model), "rigs", True),
        Request("activity", page("activity"), "rigs", True),
        Request(
            "activity by name",
            page("activity", order_by="name asc"),
            "rigs",
            True,
        ),
        Request(
            "activity, three digits of the name",
            lambda: _with("activity", page_size=size, filter=of.number(3)),
            "rigs",
        ),
        Request(
            "activity, whole name",
            lambda: _with(
                "activity", page_size=size, filter="dev" + of.number(6)
            ),
            "rigs",
        ),
        Request(
            "activity of a model",
            page("activity", filter=model, order_by="name asc"),
            "rigs",
            True,
        ),
        Request(
            "activity of a model and batch",
            page("activity", filter=both),
            "rigs",
            True,
        ),
        Request(
            "activity of a label that no rig has",
            page("activity", filter=nothing),
        ),
        Request("segments of all", page("segments"), "segments", True),
        Request(
            "segments of all by gain",
            page("segments", order_by="gain.camera desc"),
            "segments",
            True,
        ),
        *_segments_of_all(size, model),
        Request(
            "segments of all of a model",
            page("segments", rig_filter=model),
            "segments",
            True,
        ),
        Request(
            "segments of all of a label that no rig has",
            page("segments", rig_filter=nothing),
        ),
        Request(
            "runs of a model",
            page("recalibrations", rig_filter=model),
            "",
            True,
        ),
        Request(
            "events of a label that no rig has",
            page("events", rig_filter=nothing),
        ),
        Request(
            "attention",
            page("activity", with_alarms="true", order_by="alarms desc"),
            "rigs",
            True,
        ),
        Request(
            "attention of a model",
            page(
                "activity",
                with_alarms="true",
                order_by="alarms desc",
                filter=model,
            ),
            "rigs",
        ),
        Request(
            "calibrations",
            page("calibrations", view="BASIC"),
            "calibrations",
            True,
        ),
        Request(
            "calibrations with all details",
            page("calibrations"),
            "calibrations",
            True,
        ),
        Request("runs", page("recalibrations"), "recalibrations", True),
        Request(
            "calibrations, rejected",
            page("calibrations", view="BASIC", filter="state = REJECTED"),
        ),
        Request(
            "calibrations, not trustworthy",
            page(
                "calibrations",
                view="BASIC",
                filter="verdict = NOT_TRUSTWORTHY",
            ),
            "calibrations",
            True,
        ),
        Request(
            "calibrations, not trustworthy, of a model",
            page(
                "calibrations",
                view="BASIC",
                filter="verdict = NOT_TRUSTWORTHY",
                rig_filter=model,
            ),
        ),
        Request(
            "calibrations by temperature",
            page("calibrations", view="BASIC", order_by="temperature_c desc"),
            "calibrations",
            True,
        ),
        Request(
            "calibrations by temperature, of a range",
            page(
                "calibrations",
                view="BASIC",
                filter="temperature_c >= 20 AND temperature_c <= 21",
                order_by="temperature_c asc",
            ),
            "calibrations",
            True,
        ),
        Request(
            "runs, failed",
            page("recalibrations", filter="state = FAILED"),
            "recalibrations",
            True,
        ),
        Request(
            "runs, failed, of a model",
            page("recalibrations", filter="state = FAILED", rig_filter=model),
        ),
        Request(
            "runs, started by age",
            page("recalibrations", filter="trigger = CALIBRATION_AGED"),
        ),
        Request(
            "runs by duration",
            page("recalibrations", order_by="duration desc"),
            "recalibrations",
            True,
        ),
        Request(
            "runs by duration, of a model",
            page(
                "recalibrations",
                order_by="duration desc",
                rig_filter=model,
            ),
            "recalibrations",
            True,
        ),
        Request("events, oldest first", page("events"), "events", True),
        Request(
            "events, newest first",
            page("events", order_by="number desc"),
            "events",
            True,
        ),
        Request("estimates", page("estimates"), "estimates", True),
        Request(
            "estimates of a component, active",
            page("estimates", component=_COMPONENT, only_active="true"),
            "estimates",
            True,
        ),
        Request(
            "... of a model",
            page(
                "estimates",
                component=_COMPONENT,
                only_active="true",
                filter=model,
            ),
            "estimates",
            True,
        ),
        Request(
            "... of a label that no rig has",
            page(
                "estimates",
                component=_COMPONENT,
                only_active="true",
                filter=nothing,
            ),
        ),
    ]


_ORDERS = (
    "receive_time desc",
    "receive_time asc",
    "entropy.camera asc",
    "gain.camera desc",
    "landmarks desc",
    "temperature_c desc",
    "angular_rate desc",
)
_FILTERS = (
    "state = SCORED AND gain.camera >= 0.5",
    "in_table = camera",
    'session = "walk"',
    "temperature_c >= 49",
    "state = UNUSABLE",
    "excluded = DOES_NOT_FIT",
    "has_data = true",
)


def _segments(rig: Callable[[], str], of: str, size: int) -> list[Request]:
    def page(**parameters) -> Callable[[], str]:
        return lambda: _with(rig() + "/segments", page_size=size, **parameters)

    found = [
        Request(
            f"segments of {of}, {order}",
            page(view="BASIC", order_by=order),
            "segments",
            True,
        )
        for order in _ORDERS
    ]
    found += [
        Request(
            f"segments of {of}, {condition}",
            page(view="BASIC", filter=condition),
        )
        for condition in _FILTERS
    ]
    found.append(Request(f"segments of {of}, full", page(), "segments", True))
    return found


def _of_rig(rig: Callable[[], str], of: str, size: int) -> list[Request]:
    def page(path: str, **parameters) -> Callable[[], str]:
        return lambda: _with(f"{rig()}/{path}", page_size=size, **parameters)

    return [
        *_segments(rig, of, size),
        Request(f"sessions of {of}", page("sessions"), "sessions", True),
        Request(f"calibrations of {of}", page("calibrations"), "calibrations"),
        Request(f"runs of {of}", page("recalibrations"), "recalibrations"),
        Request(
            f"events of {of}", page("events", order_by="number desc"), "events"
        ),
        Request(f"estimates of {of}", page("estimates"), "estimates"),
        Request(f"instructions of {of}", page("instructions")),
    ]


def _details(of: Fleet) -> list[Request]:
    def rig(path: str = "", source=of.other) -> Callable[[], str]:
        return lambda: source() + path

    return [
        Request("a rig", rig()),
        Request("its tables", rig("/tables"), "tables"),
        Request("its active version", rig("/calibrations/active")),
        Request(
            "two versions, compared",
            lambda: (
                lambda name: _with(
                    f"{name}/calibrations/2:compare", b=f"{name}/calibrations/3"
                )
            )(of.other()),
        ),
        Request("a run", rig("/recalibrations/3")),
        Request("a trajectory", rig("/sessions/walk/trajectory"), "segments"),
        Request("a segment", of.stored),
        Request("its information", lambda: of.stored() + "/information"),
        Request("its data", lambda: of.stored() + "/data"),
        Request("its residuals", lambda: of.stored() + "/residuals"),
        Request("the caller", lambda: "caller"),
        Request("advice on motion", rig(":adviseMotion?max_advice=1")),
        Request(
            "a cohort of 500 rigs",
            lambda: _with("cohort", filter='labels.model = "t3"'),
        ),
    ]


def requests(of: Fleet) -> list[tuple[str, list[Request]]]:
    """Those of each part of the table, with its title."""
    parts = []
    for size in (50, _PAGE):
        parts += [
            (f"of all rigs, pages of {size}", _fleet_wide(of, size)),
            (
                f"of one rig, pages of {size}",
                _of_rig(of.other, "a rig", size)
                + _segments(of.heavy, "a heavy rig", size)
                + [
                    Request(
                        "sessions of a heavy rig",
                        lambda size=size: _with(
                            of.heavy() + "/sessions", page_size=size
                        ),
                        "sessions",
                    )
                ],
            ),
        ]
    return [*parts, ("without pages", _details(of))]


def _timed(daemon: Daemon, path: str) -> tuple[float, dict]:
    begin = time.perf_counter()
    answer = daemon.call(path)
    return 1e3 * (time.perf_counter() - begin), answer


def _later(daemon: Daemon, path: str) -> list[str]:
    """Addresses of pages behind the first, as far as a few seconds suffice."""
    found, token = [], ""
    base = path + ("&" if "?" in path else "?")
    walk = base.replace("page_size=50&", "page_size=200&")
    until = time.monotonic() + _WALK_S
    while time.monotonic() < until:
        address = f"{walk}page_token={token}" if token else walk.rstrip("&")
        token = daemon.call(address).get("nextPageToken", "")
        if not token:
            break
        found.append(f"{base}page_token={token}")
    return found


@dataclasses.dataclass
class Measured:
    name: str
    median_ms: float
    percentile_ms: float  # the 99th
    largest_ms: float
    cpu_ms: float  # mean, of the daemon and of the database

    @property
    def is_slow(self) -> bool:
        return self.percentile_ms >= _LIMIT_MS


class Stopwatch:
    def __init__(self, daemon: Daemon, server: Server, count: int) -> None:
        self._daemon = daemon
        self._server = server
        self._count = count

    def _cpu_s(self) -> float:
        return cpu_s(self._daemon.pid) + cpu_s(self._server.pid)

    def measure(
        self, name: str, path: Callable[[], str], items: str
    ) -> Measured:
        times = []
        cpu = self._cpu_s()
        for _ in range(self._count):
            address = path()
            taken, answer = _timed(self._daemon, address)
            if items and not answer[items]:
                raise processes.Failed(f"{address}: nothing is listed")
            times.append(taken)
        cpu = self._cpu_s() - cpu
        times.sort()
        measured = Measured(
            name,
            times[self._count // 2],
            times[int(0.99 * self._count)],
            times[-1],
            1e3 * cpu / self._count,
        )
        print(
            f"{name:58} {measured.median_ms:8.1f} {measured.percentile_ms:8.1f}"
            f" {measured.largest_ms:8.1f} {measured.cpu_ms:8.1f}"
            f"{'  slow' if measured.is_slow else ''}",
            flush=True,
        )
        return measured


def measure(
    daemon: Daemon, server: Server, connection, count: int, word: str
) -> list[Measured]:
    """Prints a line for each request whose title or name has the word."""
    of = Fleet(connection)
    stopwatch = Stopwatch(daemon, server, count)
    found = []
    for title, all_requests in requests(of):
        chosen = [r for r in all_requests if word in f"{title}: {r.name}"]
        if not chosen:
            continue
        print(
            f"{title:58} {'median':>8} {'99 %':>8} {'largest':>8} {'CPU':>8}"
            "  [ms]"
        )
        for request in chosen:
            daemon.call(request.path())  # prepares its statements
            found.append(
                stopwatch.measure(request.name, request.path, request.items)
            )
            if not request.paged:
                continue
            later = _later(daemon, request.path())
            if later:
                found.append(
                    stopwatch.measure(
                        "  later pages", lambda of=later: random.choice(of), ""
                    )
                )
    return found


def give_instructions(daemon: Daemon, connection) -> None:
    """Some that devices have yet to fetch, so that the lists have entries."""
    cursor = connection.cursor()
    cursor.execute(
        "SELECT id FROM copied.chosen WHERE is_complete AND NOT is_heavy"
    )
    for (rig,) in cursor.fetchall():
        for number in range(20):
            labels = {**real_rigs.LABELS[0], "site": f"south-{number}"}
            update = {
                "rig": {"name": f"rigs/{rig}", "labels": labels},
                "updateMask": "labels",
            }
            daemon.call(
                f"rigs/{rig}/instructions", "POST", {"updateRig": update}
            )
