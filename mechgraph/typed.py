"""What is typed at the command line: freedoms and their values, with units."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from typing import NoReturn

import numpy as np

from mechgraph.closure.prescription import coordinate
from mechgraph.errors import MechgraphError, MechgraphWarning, shortened
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.model.toml import swept
from mechgraph.units import KNOWN


class UsageError(MechgraphError):
    """Options that are wrong, or that exclude each other."""


def refuse(what: str, fault: str) -> NoReturn:
    """Say what is wrong with something that was typed."""
    raise UsageError(f"{shortened(what)}: {shortened(fault)}")


NUMBER = re.compile(r"(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[A-Za-z/^0-9]*)")


def _number(text: str, where: str, examples: str = "30deg, 0.5rad or 0.02") -> tuple[float, str]:
    """A number and the unit written after it."""
    found = NUMBER.fullmatch(text.strip())
    value = float(found["number"]) if found else np.nan
    if found is None or not np.isfinite(value):
        refuse(where, f"{text!r} is no number; write e.g. {examples}")
    return value, found["unit"]


def _values(texts: Sequence[str], turns: bool, where: str) -> list[float]:
    """Numbers in radians or the declared length; the unit of the last holds for those without one of their own."""
    read = [_number(text, where) for text in texts]
    last = read[-1][1]
    scales = {"": 1.0, "rad": 1.0, "deg": np.pi / 180} if turns else {"": 1.0}
    out = []
    for text, (value, unit) in zip(texts, read, strict=True):
        if (unit or last) not in scales:
            what = (
                "is an angle: deg or rad (the default)"
                if turns
                else "is a length: write the number alone, in the unit of length of the mechanism"
            )
            refuse(where, f"unit {unit or last!r} in {text if unit else texts[-1]!r}: the freedom {what}")
        out.append(value * scales[unit or last])
    return out


MANY_TURNS = 2.0
"""Turns from which on an angle typed without a unit is more likely meant in degrees."""


def _doubt(texts: Sequence[str], values: Sequence[float], where: str) -> None:
    """Warn of angles typed without a unit that are many turns."""
    most = max(values, key=abs) / (2 * np.pi)
    if abs(most) > MANY_TURNS and not any(_number(text, where)[1] for text in texts):
        as_degrees = f"{texts[-1].strip()}deg"
        warnings.warn(
            f"{where}: read as radians, {most:.4g} turns; where degrees are meant write {as_degrees}, where radians {texts[-1].strip()}rad",
            MechgraphWarning,
            stacklevel=3,
        )


def named_value(text: str, what: str) -> tuple[str, str]:
    """Both sides of ``A=30deg``."""
    name, sign, rest = text.partition("=")
    if not sign or not name.strip() or not rest.strip():
        refuse(f"{what} {text!r}", "expected FREEDOM=VALUES, e.g. A=30deg")
    return name.strip(), rest.strip()


def duration(text: str, option: str, declared: str = "s") -> float:
    """A time span: ``10`` or ``10s`` (``ms`` too), in the unit of time ``declared``."""
    value, unit = _number(text, f"{option} {text!r}", "10 or 10s")
    known = KNOWN["time"]
    scales = {"": 1.0, declared: 1.0}
    if declared in known:
        scales |= {name: known[name] / known[declared] for name in ("s", "ms")}
    if unit not in scales or value <= 0:
        refuse(f"{option} {text!r}", f"expected a time above 0 in {', '.join(filter(None, scales))}, e.g. 10{declared}")
    return value * scales[unit]


def longest(text: str, option: str, declared: str = "s") -> float:
    """A time span, or ``inf`` for no limit."""
    return np.inf if text.strip() == "inf" else duration(text, option, declared)


def _turns(m: Mechanism, name: str, where: str) -> bool:
    fault = m.freedom_fault(name, single=True)
    if fault:
        refuse(where, fault)
    return m.turns(name)


def _coordinate_turns(m: Mechanism, name: str, where: str) -> bool:
    """Whether a freedom, or a coordinate of a point or link, is an angle."""
    found = coordinate(m, name)
    if isinstance(found, str):
        refuse(where, found)
    return found


def parse_drive(m: Mechanism, text: str, option: str = "--drive") -> tuple[str, Motion]:
    """Freedom and motion of ``A=start:stop:step@rate@acceleration``, the end excluded; a single value in place of the range."""
    where = f"{option} {text!r}"
    name, rest = named_value(text, option)
    turns = _coordinate_turns(m, name, where)
    spec, *rates = rest.split("@")
    parts = spec.split(":")
    if len(parts) not in (1, 3) or len(rates) > 2:
        refuse(where, "expected FREEDOM=START:STOP:STEP or FREEDOM=VALUE, then @RATE and @ACCELERATION where wanted")
    values = _values(parts, turns, where)
    if turns:
        _doubt(parts[:2], values[:2], where)
    velocity, acceleration = (
        *(_values([r.removesuffix("/s^2").removesuffix("/s2").removesuffix("/s")], turns, where)[0] for r in rates),
        0.0,
        0.0,
    )[:2]
    if len(values) == 1:
        return name, Motion(values[0], velocity, acceleration)
    positions = swept(*values)
    if isinstance(positions, str):
        refuse(where, positions)
    return name, Motion(positions, velocity, acceleration)


def drives_of(m: Mechanism, texts: Sequence[str], option: str = "--drive") -> dict[str, Motion]:
    """The motions of all drives."""
    out: dict[str, Motion] = {}
    known: set[str] = set()
    for text in texts:
        name, motion = parse_drive(m, text, option)
        full = name if m.freedom_fault(name, single=True) else m.full_name(name)
        if full in known:
            refuse(f"{option} {text!r}", f"{name} is given twice")
        known.add(full)
        out[name] = motion
    return out


def motions_of(m: Mechanism, texts: Sequence[str]) -> dict[str, Motion]:
    """The motions of all drives where one is needed of each that is declared."""
    out = drives_of(m, texts)
    given = {name if m.freedom_fault(name, single=True) else m.full_name(name) for name in out}
    declared = {m.full_name(drive.freedom): drive.motion for drive in m.drives}
    still = [name for name, motion in declared.items() if motion is None and name not in given]
    if still and (not given or given & set(declared)):
        example = "0:360:5deg" if m.turns(still[0]) else "0:0.1:0.01"
        refuse(f"drive {still[0]!r}", f"has no motion; give one, e.g. --drive {still[0]}={example}")
    return out


def parse_at(m: Mechanism, text: str, option: str = "--at") -> tuple[str, float]:
    """Freedom and value of ``A=30deg``."""
    where = f"{option} {text!r}"
    name, value = named_value(text, option)
    turns = _turns(m, name, where)
    out = _values([value], turns, where)
    if turns and option != "--rate":
        _doubt([value], out, where)
    return name, out[0]
