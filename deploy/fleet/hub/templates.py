"""Writes the configuration files of a fleet from deploy/fleet/templates."""

import os
import pathlib

import jinja2

_FOLDER = pathlib.Path(__file__).resolve().parent.parent / "templates"
_ENVIRONMENT = jinja2.Environment(
    loader=jinja2.FileSystemLoader(_FOLDER),
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
    keep_trailing_newline=True,
)


def render(template: str, values: dict) -> str:
    return _ENVIRONMENT.get_template(f"{template}.j2").render(values)


def write(path: pathlib.Path, text: str, mode: int = 0o600) -> None:
    """Replaces a file as a whole. Most files contain passwords."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(path.name + ".new")
    new.touch(mode)
    new.chmod(mode)
    new.write_text(text, encoding="utf-8")
    os.replace(new, path)
