"""The user that a fleet runs as: PostgreSQL refuses root."""

import os
import pathlib
import pwd
import sys

_USER = "postgres"


def leave_root(folder: pathlib.Path) -> None:
    """Makes the folder of a fleet, and as root becomes the user that owns it.

    A folder of root is given to the user postgres, if it is empty.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        entries = {entry.name for entry in folder.iterdir()}
    except OSError as error:
        sys.exit(f"fleet: {error}")
    if entries and "etc" not in entries:
        sys.exit(f"fleet: {folder} contains something else than a fleet")
    if os.geteuid() != 0:
        return
    if folder.stat().st_uid != 0:
        become_owner(folder)
        return
    if entries:
        sys.exit(f"fleet: {folder} belongs to root, which PostgreSQL refuses")
    try:
        user = pwd.getpwnam(_USER)
    except KeyError:
        sys.exit(
            f"fleet: there is no user {_USER}, and PostgreSQL refuses root"
        )
    os.chown(folder, user.pw_uid, user.pw_gid)
    folder.chmod(0o700)
    become(user)


def become_owner(folder: pathlib.Path) -> None:
    """As root, becomes the user that owns the folder."""
    if os.geteuid() == 0 and folder.stat().st_uid != 0:
        become(pwd.getpwuid(folder.stat().st_uid))


def become(user: pwd.struct_passwd) -> None:
    os.initgroups(user.pw_name, user.pw_gid)
    os.setgid(user.pw_gid)
    os.setuid(user.pw_uid)
    os.environ.update(HOME=user.pw_dir, USER=user.pw_name)
    os.chdir("/")
