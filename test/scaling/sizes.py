"""What records take on the disk: of the real rigs, and in the database."""

_PER_SEGMENT = (
    "segments",
    "segment_information",
    "segment_scores",
    "segment_paths",
    "table_absences",
)
_PER_VERSION = (
    "calibrations",
    "validations",
    "calibration_segments",
    "activations",
    "estimates",
    "runs",
    "run_segments",
)


def _row_bytes(cursor, table: str) -> int:
    """All rows of the real rigs as they are stored, without indexes."""
    cursor.execute(
        f"SELECT coalesce(sum(pg_column_size(t.*)), 0) FROM copied.{table} t"
    )
    return int(cursor.fetchone()[0])


def _count(cursor, table: str) -> int:
    cursor.execute(f"SELECT count(*) FROM copied.{table}")
    return cursor.fetchone()[0]


def show(connection) -> None:
    cursor = connection.cursor()
    for unit, of, tables in (
        ("segment", "segments", _PER_SEGMENT),
        ("version", "calibrations", _PER_VERSION),
    ):
        count = _count(cursor, of)
        print(f"bytes of the rows of a real {unit} ({count} of them)")
        total = 0
        for table in tables:
            size = _row_bytes(cursor, table) / count
            total += size
            print(f"  {table:24} {size:8.0f}")
        print(f"  {'together':24} {total:8.0f}", flush=True)
    for column in ("information", "short"):
        cursor.execute(
            f"SELECT avg(length({column})), avg(pg_column_size({column})) "
            "FROM copied.segment_information"
        )
        raw, stored = cursor.fetchone()
        print(
            f"information of a segment, {column}: {raw:.0f} bytes, stored as "
            f"{stored:.0f}"
        )
    cursor.execute(
        "SELECT avg(length(data)), avg(raw_bytes) FROM copied.payloads"
    )
    stored, raw = cursor.fetchone()
    print(f"data of a segment: {raw:.0f} bytes, stored as {stored:.0f}")
    cursor.execute("SELECT count(*) FROM segments")
    (segments,) = cursor.fetchone()
    print(
        f"{'table':24} {'rows':>12} {'MiB':>9} {'indexes':>9} "
        f"{'of the latter, bytes for a row':>32}"
    )
    cursor.execute(
        "SELECT relname, CAST(reltuples AS BIGINT), "
        "  pg_total_relation_size(oid) - pg_indexes_size(oid), "
        "  pg_indexes_size(oid) FROM pg_class "
        "WHERE relkind = 'r' AND relnamespace = 'public'::regnamespace "
        "AND reltuples > 0 ORDER BY pg_total_relation_size(oid) DESC"
    )
    for table, rows, heap, indexes in cursor.fetchall():
        print(
            f"{table:24} {rows:12} {heap / 2**20:9.1f} {indexes / 2**20:9.1f} "
            f"{indexes / rows:32.0f}"
        )
    cursor.execute("SELECT pg_database_size(current_database())")
    (size,) = cursor.fetchone()
    print(
        f"database: {size / 2**20:.0f} MiB with {segments} segments",
        flush=True,
    )
