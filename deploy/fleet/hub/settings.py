"""Settings of a fleet that are the same on one machine and on several."""

import copy
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

# Users of PostgreSQL, and that of Patroni's REST interface.
_USERS = ("superuser", "replicator", "rewinder", "selfcal", "patroni")


def merged(base: dict, changes: dict) -> dict:
    """`base` with the values of `changes`, folder by folder."""
    result = copy.deepcopy(base)
    for key, value in changes.items():
        if isinstance(value, dict) and isinstance(result.get(key), dict):
            result[key] = merged(result[key], value)
        else:
            result[key] = value
    return result


def new_passwords() -> dict:
    return {user: secrets.token_hex(16) for user in _USERS}
