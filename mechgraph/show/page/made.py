"""The files that the page is made of, and the hashes by which it says that nothing else may run in it."""

from __future__ import annotations

import base64
import hashlib
import json
from functools import cache
from importlib.resources import files

WEB = "web"
"""Folder of the scripts, which build.js of it builds."""


@cache
def text_of(name: str) -> str:
    """A file of the page."""
    return files(__package__).joinpath(*name.split("/")).read_text(encoding="utf-8")


def scripts() -> tuple[str, str]:
    """Other people's libraries, and our own modules that stand on them."""
    return text_of(f"{WEB}/vendor.js"), text_of(f"{WEB}/view.js")


def view_style() -> str:
    """The style sheet of the view."""
    return text_of(f"{WEB}/vendor.css") + text_of("view.css")


def libraries() -> str:
    """What the scripts stand on, with versions and licences."""
    packages = json.loads(text_of(f"{WEB}/built.json"))["packages"]
    return " and ".join(f"{p['name']} {p['version']} ({p['license']})" for p in packages)


def content_policy(scripts: list[str], style: str) -> str:
    """What the page may do: run these scripts, use this style, show pictures that stand in it, and nothing else."""
    allowed = " ".join(map(_source, scripts))
    return f"default-src 'none'; script-src {allowed}; style-src {_source(style)}; img-src data:; base-uri 'none'; form-action 'none'"


def _source(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
