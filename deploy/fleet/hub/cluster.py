"""Questions to the running components of a fleet of one machine."""

import csv
import json
import socket
import urllib.error
import urllib.request

from hub.one_machine import ADDRESS, Fleet


def get(port: int, path: str, method: str = "GET") -> tuple[int, str]:
    """Status and text of an answer; status 0 if there is none."""
    request = urllib.request.Request(
        f"http://{ADDRESS}:{port}{path}", method=method
    )
    try:
        with urllib.request.urlopen(request, timeout=3) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, ""
    except OSError:
        return 0, ""


def accepts(port: int) -> bool:
    try:
        socket.create_connection((ADDRESS, port), timeout=2).close()
    except OSError:
        return False
    return True


def members(fleet: Fleet) -> dict[str, dict]:
    """What Patroni says about each database; empty if none answers."""
    for node in fleet.values["databases"]:
        status, text = get(node["rest_port"], "/cluster")
        if status == 200:
            return {m["name"]: m for m in json.loads(text)["members"]}
    return {}


def primary(fleet: Fleet) -> str:
    """The name of the database that is the primary and accepts writes."""
    for node in fleet.values["databases"]:
        if get(node["rest_port"], "/primary", "OPTIONS")[0] == 200:
            return node["name"]
    return ""


def checks(fleet: Fleet) -> dict[tuple[str, str], str]:
    """The state of each server as HAProxy's checks see it: UP, DOWN, ..."""
    path = str(fleet.folder / "run" / "haproxy.sock")
    answer = b""
    try:
        with socket.socket(socket.AF_UNIX) as admin:
            admin.settimeout(3)
            admin.connect(path)
            admin.sendall(b"show stat\n")
            while part := admin.recv(65536):
                answer += part
    except OSError:
        return {}
    rows = csv.DictReader(answer.decode().lstrip("# ").splitlines())
    return {(row["pxname"], row["svname"]): row["status"] for row in rows}
