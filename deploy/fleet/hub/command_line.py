"""What the programs for a fleet of one machine have in common."""

import argparse
import pathlib
import sys

from hub import user
from hub.one_machine import Fleet


def parser(description: str) -> argparse.ArgumentParser:
    """Of a program whose first argument is the folder of the fleet."""
    result = argparse.ArgumentParser(
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    result.add_argument("folder", metavar="DIR", type=pathlib.Path)
    return result


def existing(folder: pathlib.Path) -> Fleet:
    """The fleet in a folder; ends the program if there is none."""
    fleet = Fleet(folder.absolute())
    try:
        user.become_owner(fleet.folder)
        fleet.load()
    except FileNotFoundError:
        sys.exit(f"fleet: there is no fleet in {fleet.folder}")
    except PermissionError as error:
        sys.exit(f"fleet: {error}: run it as the user who started the fleet")
    return fleet
