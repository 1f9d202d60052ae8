"""Synthetic rigs by SQL: copies of the real ones (real_rigs.py) under keys,
names and times of their own.

A rig has the runs, versions and tables of a real one, and repeats its segments
as often as needed. One in a thousand is heavy: these have a fifth of all
segments together. One in twenty (and one in ten of the heavy ones) is
*complete*: the information of its segments has all of its bytes; that of the
others lacks its matrix. Rows are written in an order of time, so that those of
a rig are apart.
"""

import time
from collections.abc import Callable

from hub import processes

from scaling import real_rigs

_BATCHES = 50
_DAY_NS = 86_400 * 10**9
# Bits of server/domain/alarms.h.
_SILENT, _RUN_FAILED, _DEVICE_CHANGED = 1, 4, 16
_BY_RIG = (
    "tables",
    "table_entries",
    "runs",
    "run_segments",
    "calibrations",
    "calibration_segments",
    "activations",
    "validations",
    "estimates",
    "events",
)
# Columns that are not those of the real rig; all others are.
_NAME = f"convert_to(r.id, 'UTF8') from 3 for {len(real_rigs.RIG)}"
_OWN_COLUMNS = {
    "rig": "r.rig",
    "create_time_ns": "t.create_time_ns - r.shift_ns",
    "end_time_ns": "t.end_time_ns - r.shift_ns",
    "time_ns": "t.time_ns - r.shift_ns",
    "steady_ns": "t.steady_ns - r.shift_ns",
    "create_steady_ns": "t.create_steady_ns - r.shift_ns",
    "end_steady_ns": "t.end_steady_ns - r.shift_ns",
}
_OWN = {
    "tables": {"scored": "r.segments"},
    "events": {"rig": "r.id"},
    # Their first field is the name of the rig.
    "calibrations": {
        "content": f"overlay(t.content placing {_NAME})",
        "sha256": f"sha256(overlay(t.content placing {_NAME}))",
        "temperature_c": "CASE WHEN t.run IS NOT NULL "
        "THEN 10 + 40 * random() END",
    },
    "validations": {
        "content": f"overlay(t.content placing {_NAME})",
        "sha256": f"sha256(overlay(t.content placing {_NAME}))",
    },
}

# Of the segments after the first walk, in a row r of the batch: one in a
# thousand each.
_UNUSABLE = "(r.walk > 0 AND (r.k * 7919 + r.n) % 1000 = 1)"
_MISFIT = "(r.walk > 0 AND (r.k * 7919 + r.n) % 1000 = 2)"

Say = Callable[[str], None]


def fill(connection, rigs: int, segments: int, say: Say) -> None:
    cursor = connection.cursor()
    # Neither foreign keys nor the triggers that refuse: checked at the end.
    cursor.execute("SET session_replication_role = replica")
    cursor.execute("SET work_mem = '256MB'")
    _choose_rigs(cursor, rigs, segments)
    rebuild = _drop_indexes(cursor)
    say("writes rigs")
    _fill_rigs(cursor)
    _fill_by_rig(cursor, rigs, say)
    _fill_segments(cursor, say)
    _raise_alarms(cursor)
    cursor.execute("SET session_replication_role = origin")
    _rebuild(cursor, rebuild, say)
    say("collects statistics")
    cursor.execute("VACUUM ANALYZE")


def _choose_rigs(cursor, rigs: int, segments: int) -> None:
    cursor.execute("SELECT max(sequence) FROM copied.segments")
    (longest,) = cursor.fetchone()
    heavy = max(1, rigs // 1000)
    of_heavy = max(longest, segments // 5 // heavy)
    of_others = (segments - heavy * of_heavy) // max(1, rigs - heavy)
    if of_others < longest:
        raise processes.Failed(
            f"a rig needs {longest} segments on average, and one in a thousand "
            f"as many as 200 others: at least {100 * rigs} for {rigs} rigs"
        )
    digits = len(real_rigs.RIG) - len("dev")
    month_ns = 30 * _DAY_NS
    cursor.execute(
        "CREATE TABLE copied.chosen AS SELECT n, "
        "  hashint8extended(n, 1) & 9223372036854775807 AS rig, "
        f"  'dev' || lpad(CAST(n AS TEXT), {digits}, '0') AS id, "
        f"  n % {real_rigs.COUNT} + 1 AS seed, "
        f"  n % {len(real_rigs.LABELS)} AS labels, "
        f"  CAST(CASE WHEN n <= {heavy} THEN {of_heavy} ELSE {of_others} END "
        "    AS BIGINT) AS segments, "
        f"  n <= {heavy} AS is_heavy, "
        f"  CASE WHEN n <= {heavy} THEN n <= {max(1, heavy // 10)} "
        "    ELSE n % 20 = 0 END AS is_complete, "
        f"  n % 20 = 0 AND n <= 200 AND n > {heavy} AS has_data, "
        f"  (hashint8extended(n, 2) & 1048575) * {month_ns >> 20} AS shift_ns, "
        "  CAST(NULL AS BIGINT) AS last_ns "
        f"FROM generate_series(CAST(1 AS BIGINT), {rigs}) n"
    )
    cursor.execute(
        "UPDATE copied.chosen c SET last_ns = r.last_seen_ns - c.shift_ns "
        "FROM copied.rigs r WHERE r.seed = c.seed"
    )
    cursor.execute("CREATE INDEX ON copied.chosen (n)")
    cursor.execute("CREATE INDEX ON copied.segments (seed, sequence)")
    cursor.execute("ANALYZE copied.chosen")


def _columns(cursor, table: str) -> list[str]:
    cursor.execute(
        "SELECT column_name FROM information_schema.columns "
        "WHERE table_schema = 'public' AND table_name = %s "
        "AND is_generated = 'NEVER'",
        (table,),
    )
    return [name for (name,) in cursor]


def _insert(cursor, table: str, own: dict, source: str) -> None:
    """Rows of `source`: r is the rig, t the row that is copied."""
    columns = _columns(cursor, table)
    values = {**_OWN_COLUMNS, **own}
    cursor.execute(
        f"INSERT INTO {table} ({', '.join(columns)}) "
        f"SELECT {', '.join(values.get(c, f't.{c}') for c in columns)} "
        f"FROM {source}"
    )


def _fill_rigs(cursor) -> None:
    name = f"convert_to('{real_rigs.RIG}', 'UTF8')"
    definition = (
        "overlay(d.definition placing convert_to(r.id, 'UTF8') "
        f"from position({name} in d.definition))"
    )
    _insert(
        cursor,
        "rigs",
        {
            "id": "r.id",
            "definition": definition,
            "sha256": f"sha256({definition})",
            "last_seen_ns": "r.last_ns",
            # Their devices look at them.
            "session_check_ns": str(2**63 - 1),
            "time_check_ns": "NULL",
        },
        "copied.chosen r JOIN copied.rigs t USING (seed) "
        "JOIN copied.definitions d USING (seed, labels) ORDER BY r.n",
    )
    # As the trigger does, which is off.
    cursor.execute(
        "INSERT INTO rig_name_suffixes (rig, suffix) "
        "SELECT rig, substr(id, k) "
        "FROM copied.chosen, generate_series(1, length(id)) k"
    )
    for number, labels in enumerate(real_rigs.LABELS):
        for label, value in labels.items():
            cursor.execute(
                "INSERT INTO rig_labels (rig, name, value) "
                "SELECT rig, %s, %s FROM copied.chosen WHERE labels = %s",
                (label, value, number),
            )
    cursor.execute(
        "INSERT INTO reported_rigs (rig, device, report, time_ns, waiting, "
        "  program_version) "
        "SELECT rig, n, 100, "
        "  CAST(extract(epoch FROM now()) AS BIGINT) * 1000000000 "
        f"    - CASE WHEN n % 33 = 0 THEN {2 * _DAY_NS} ELSE 0 END, 0, '0.1.0' "
        "FROM copied.chosen"
    )


def _fill_by_rig(cursor, rigs: int, say: Say) -> None:
    at_once = max(1, rigs // _BATCHES)
    progress = Progress("runs, versions and events", _BATCHES, say)
    for first in range(1, rigs + 1, at_once):
        chosen = f"r.n BETWEEN {first} AND {first + at_once - 1}"
        for table in _BY_RIG:
            _insert(
                cursor,
                table,
                _OWN.get(table, {}),
                f"copied.chosen r JOIN copied.{table} t USING (seed) "
                f"WHERE {chosen}",
            )
        progress.step()


def _fill_segments(cursor, say: Say) -> None:
    cursor.execute(
        "CREATE TEMP TABLE lengths AS SELECT seed, max(sequence) AS length "
        "FROM copied.segments GROUP BY seed"
    )
    progress = Progress("segments", _BATCHES, say)
    for batch in range(_BATCHES):
        # k is the number of a segment in its rig, copy that of the real one.
        cursor.execute(
            "CREATE TEMP TABLE batch AS SELECT r.*, k, "
            "  (k - 1) % l.length + 1 AS copy, (k - 1) / l.length AS walk, "
            "  r.last_ns - (r.segments - k) * "
            f"    ({30 * _DAY_NS} / r.segments) AS receive_time_ns "
            "FROM copied.chosen r JOIN lengths l USING (seed), "
            f"  generate_series({batch} * r.segments / {_BATCHES} + 1, "
            f"    {batch + 1} * r.segments / {_BATCHES}) k "
            "ORDER BY hashint8extended(k * 1000003 + n, 3)"
        )
        _fill_batch(cursor)
        cursor.execute("DROP TABLE batch")
        progress.step()


def _fill_batch(cursor) -> None:
    of_copy = "USING (seed) WHERE t.sequence = r.copy"
    own = {"sequence": "r.k"}
    _insert(
        cursor,
        "segments",
        {
            **own,
            "state": f"CASE WHEN {_UNUSABLE} THEN 3 ELSE t.state END",
            "problem": f"CASE WHEN {_UNUSABLE} THEN 'quarantined' "
            "ELSE t.problem END",
            "session": "CASE r.walk WHEN 0 THEN t.session "
            "ELSE 'walk-' || r.walk END",
            "session_index": "CASE r.walk WHEN 0 THEN t.session_index "
            "ELSE r.copy - 1 END",
            "receive_time_ns": "r.receive_time_ns",
            "steady_ns": "r.receive_time_ns",
            "temperature_c": "10 + 40 * random()",
            "angular_rate": "t.angular_rate * (0.5 + random())",
            "acceleration": "t.acceleration * (0.5 + random())",
        },
        f"batch r JOIN copied.segments t {of_copy}",
    )
    for is_complete, record in (("", "t.information"), ("NOT", "t.short")):
        _insert(
            cursor,
            "segment_information",
            {**own, "information": record, "sha256": f"sha256({record})"},
            f"batch r JOIN copied.segment_information t {of_copy} "
            f"AND {is_complete} r.is_complete",
        )
    _insert(
        cursor,
        "segment_paths",
        own,
        f"batch r JOIN copied.segment_paths t {of_copy}",
    )
    _insert(
        cursor,
        "segment_scores",
        {
            **own,
            "entropy": "t.entropy + CASE r.walk WHEN 0 THEN 0 "
            "ELSE random() END",
            "gain": "t.gain * CASE r.walk WHEN 0 THEN 1 ELSE random() END",
        },
        f"batch r JOIN copied.segment_scores t {of_copy}",
    )
    _insert(
        cursor,
        "table_absences",
        # As the trigger does, which is off: of the rare causes alone.
        {
            **own,
            "steady_ns": "CASE WHEN t.cause > 3 THEN r.receive_time_ns END",
        },
        f"batch r JOIN copied.table_absences t {of_copy} AND r.walk = 0",
    )
    # Later ones are outranked (2) by the entries of the first walk; some do
    # not fit (8).
    later = (
        f"FROM batch r JOIN copied.segment_scores t {of_copy} AND r.walk > 0"
    )
    cursor.execute(
        "INSERT INTO table_absences (rig, sequence, group_name, cause, "
        "  time_ns, rival, rival_entropy) "
        "SELECT r.rig, r.k, t.group_name, 2, r.receive_time_ns, "
        f"  1, t.entropy - 1 {later} AND NOT ({_MISFIT})"
    )
    cursor.execute(
        "INSERT INTO table_absences (rig, sequence, group_name, cause, "
        "  time_ns, fit, fit_limit, steady_ns) "
        "SELECT r.rig, r.k, t.group_name, 8, r.receive_time_ns, "
        f"  5, 1.5, r.receive_time_ns {later} AND {_MISFIT}"
    )
    _insert(
        cursor,
        "payloads",
        own,
        f"batch r JOIN copied.payloads t {of_copy} "
        "AND r.walk = 0 AND r.has_data",
    )


def _raise_alarms(cursor) -> None:
    """Alarms of some rigs, with the records that they follow from."""
    cursor.execute(
        "INSERT INTO runs (rig, run, state, cause, create_time_ns, "
        "  end_time_ns, base_version, message, create_steady_ns, "
        "  end_steady_ns) "
        "SELECT u.rig, max(u.run) + 1, 4, 3, max(u.create_time_ns) + 1, "
        "  max(u.end_time_ns) + 1, 1, 'the solver failed: not converged', "
        "  max(u.create_steady_ns) + 1, max(u.end_steady_ns) + 1 "
        "FROM runs u JOIN copied.chosen r USING (rig) WHERE r.n % 100 = 7 "
        "GROUP BY u.rig"
    )
    cursor.execute(
        "INSERT INTO changes (rig, change, time_ns, kind, first_sequence, "
        "  base_version, inflation) "
        "SELECT a.rig, 1, max(a.time_ns) + 1, 1, 2, max(a.version), 1 "
        "FROM activations a JOIN copied.chosen r USING (rig) "
        "WHERE r.n % 100 = 13 GROUP BY a.rig"
    )
    cursor.execute(
        "INSERT INTO change_groups (rig, change, group_name) "
        "SELECT c.rig, 1, min(t.group_name) FROM changes c "
        "JOIN tables t USING (rig) GROUP BY c.rig"
    )
    # The trigger that does this is off.
    cursor.execute(
        "UPDATE calibrations c SET verdict = s.kind FROM shown_verdicts s "
        "WHERE s.rig = c.rig AND s.version = c.version "
        "AND c.rig IN (SELECT rig FROM changes)"
    )
    cursor.execute(
        "UPDATE rigs SET alarms = alarms "
        f"  | CASE WHEN n % 33 = 0 THEN {_SILENT} ELSE 0 END "
        f"  | CASE WHEN n % 100 = 7 THEN {_RUN_FAILED} ELSE 0 END "
        f"  | CASE WHEN n % 100 = 13 THEN {_DEVICE_CHANGED} ELSE 0 END "
        "FROM copied.chosen r WHERE r.rig = rigs.rig "
        "AND (n % 33 = 0 OR n % 100 IN (7, 13))"
    )


def _drop_indexes(cursor) -> list[str]:
    """What builds them again: first the indexes, then what refers to them."""
    cursor.execute(
        "SELECT contype, conrelid::regclass::text, conname, "
        "  pg_get_constraintdef(oid) FROM pg_constraint "
        "WHERE connamespace = 'public'::regnamespace "
        "AND contype IN ('p', 'u', 'f') "
        "AND conrelid <> 'schema_migrations'::regclass "
        "ORDER BY contype = 'f' DESC"
    )
    constraints = cursor.fetchall()
    cursor.execute(
        "SELECT indexname, indexdef FROM pg_indexes i "
        "WHERE schemaname = 'public' AND NOT EXISTS "
        "  (SELECT 1 FROM pg_constraint WHERE conname = i.indexname)"
    )
    indexes = cursor.fetchall()
    for _, table, name, _ in constraints:
        cursor.execute(f"ALTER TABLE {table} DROP CONSTRAINT {name}")
    for name, _ in indexes:
        cursor.execute(f"DROP INDEX {name}")
    rebuild = [definition for _, definition in indexes]
    for _, table, name, definition in reversed(constraints):
        rebuild.append(
            f"ALTER TABLE {table} ADD CONSTRAINT {name} {definition}"
        )
    return rebuild


def _rebuild(cursor, statements: list[str], say: Say) -> None:
    progress = Progress("indexes and foreign keys", len(statements), say)
    for statement in statements:
        cursor.execute(statement)
        progress.step()


class Progress:
    """Says each tenth, with the time that is left."""

    def __init__(self, what: str, steps: int, say: Say) -> None:
        self._what = what
        self._steps = steps
        self._say = say
        self._done = 0
        self._begin = time.monotonic()

    def step(self) -> None:
        before = 10 * self._done // self._steps
        self._done += 1
        tenth = 10 * self._done // self._steps
        if tenth == before:
            return
        taken = time.monotonic() - self._begin
        left = taken * (self._steps - self._done) / self._done
        self._say(
            f"  {self._what}: {10 * tenth} %, {taken:.0f} s, "
            f"about {max(0, left):.0f} s left"
        )
