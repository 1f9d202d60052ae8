"""Settings of a fleet that are the same on one machine and on several."""

import argparse
import copy
import datetime
import secrets

# For several machines; hub/one_machine.py has smaller values.
DEFAULTS = {
    "name": "selfcal",
    "failover": {
        "ttl": 20,
        "loop_wait": 5,
        "retry_timeout": 5,
        "strict": False,
    },
    "postgresql": {
        "bin_dir": "/usr/lib/postgresql/15/bin",
        "max_connections": 300,
        "shared_buffers": "1GB",
        "max_slot_wal_keep_size": "16GB",
        "parameters": {},  # any others
    },
    # A daemon has up to 18 connections.
    "pooler": {"pool_size": 200, "max_client_conn": 1000},
    "proxy": {"maxconn": 20000},
    "watchdog": "automatic",
    "backup": {
        "repository": {"repo1-path": "/srv/selfcal-backup"},
        "retention_full": 2,
    },
    "restore_to": "",
    "tls": "",
    "tls_name": "",
}

# What has no defaults: any options of PostgreSQL and of pgBackRest.
_OPEN = ("postgresql.parameters", "backup.repository")

# Users of PostgreSQL, and that of Patroni's REST interface.
_USERS = ("superuser", "replicator", "rewinder", "selfcal", "patroni")


class Invalid(Exception):
    """A setting that the fleet cannot have."""


def merged(base: dict, changes: dict, path: str = "") -> dict:
    """`base` with the values of `changes`, folder by folder."""
    result = copy.deepcopy(base)
    for key, value in changes.items():
        name = f"{path}{key}"
        if path.rstrip(".") not in _OPEN:
            _check(name, key, value, base)
        if isinstance(value, dict) and isinstance(result.get(key), dict):
            result[key] = merged(result[key], value, f"{name}.")
        else:
            result[key] = value
    return result


def _check(name: str, key: str, value: object, base: dict) -> None:
    if key not in base:
        raise Invalid(f"{name} is not known; known are: {', '.join(base)}")
    kind = type(base[key])
    # A number is also a text: YAML does not tell them apart.
    fits = (int, str) if kind is str else (kind,)
    if type(value) not in fits:
        words = {dict: "a group of settings", bool: "true or false"}
        words |= {int: "a number", str: "a text, in quotes"}
        raise Invalid(f"{name} must be {words[kind]}, not {value!r}")


def check(values: dict) -> None:
    """What one setting demands of the others."""
    failover = values["failover"]
    least = failover["loop_wait"] + 2 * failover["retry_timeout"]
    if failover["ttl"] < least:
        raise Invalid(
            f"failover.ttl must be at least loop_wait + 2 * retry_timeout, "
            f"{least}, not {failover['ttl']}: a primary that can still be "
            "reached would be replaced"
        )
    members = len(values["etcd"])
    if members % 2 == 0:
        raise Invalid(
            f"etcd has {members} members: it needs an odd number, of which "
            "most agree"
        )


def point_in_time(text: str) -> str:
    """A time with its zone, as PostgreSQL and pgBackRest read it."""
    example = "2026-01-31 12:00:00+00"
    try:
        time = datetime.datetime.fromisoformat(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text!r} is not a time like '{example}'"
        ) from None
    if time.tzinfo is None:
        raise argparse.ArgumentTypeError(
            f"{text!r} has no time zone; it has one in '{example}'"
        )
    return time.isoformat(" ")


def new_passwords() -> dict:
    return {user: secrets.token_hex(16) for user in _USERS}
