"""Start sets kept in a folder of the user, one file for each class of mechanisms; a file is written whole or not at all.

The folder is ``writing.cache_folder``. Where it cannot be read or written, start sets are worked out anew. Those of the library's
mechanisms and of common topologies come with the package (``PACKED``, made by ``tests/benchmarks/make_start_sets.py``).
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from mechgraph.errors import MechgraphError
from mechgraph.modes.family import Family, Member
from mechgraph.modes.monodromy import StartSet
from mechgraph.modes.trace import Trace
from mechgraph.writing import cache_folder, whole_file

PACKED = Path(__file__).with_name("start-sets.npz")
"""Start sets that come with the package, one after the other: names are ``key/array``."""
START_SET_VERSION = 5
"""Of the files and of what start sets mean."""


def key(family: Family) -> str:
    """What a start set serves for: the topology; where relations are kept, the geometry too."""
    s = family.system
    types = [[[f.label, *f.twist] for f in pair.type.freedoms] for pair in s.m.pairs]
    parts: dict[str, Any] = {
        "version": START_SET_VERSION,
        "ends": [s.a.tolist(), s.b.tolist(), s.graph.frame],
        "types": types,
        "driven": family.columns.tolist(),
        "ranks": [h.shape[1] for h in family.loop_algebras],
        "passive": family.passive.shape[1],
        "geometry": None if family.whole else (np.round(family.target.real, 9) + 0.0).tolist(),
    }
    if family.held.size:
        parts["held"] = family.held.tolist()
    if family.points:
        parts["points"] = family.points
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def kept(family: Family) -> StartSet | None:
    """The start set of a class, where one is kept and closed: the user's, or else that of the package."""
    return _read(cache_folder() / f"start-{key(family)}.npz", "", family) or packed(family)


def packed(family: Family) -> StartSet | None:
    """The start set of a class that came with the package."""
    return _read(PACKED, f"{key(family)}/", family)


def _read(file: Path, prefix: str, family: Family) -> StartSet | None:
    try:
        with file.open("rb") as handle, np.load(handle, allow_pickle=False) as f:
            mixing = f[prefix + "mixing"]
            loops, lost, followed, degree, samples = f[prefix + "counts"].tolist()
            chance, last, beyond = f[prefix + "sizes"].tolist()
            member = Member(f[prefix + "markers"], f[prefix + "drive"])
            trace = Trace(degree, samples, last, beyond)
            own = mixing if mixing.size else None
            found = StartSet(member, f[prefix + "x"], own, loops, chance, lost, followed, True, trace)
            return found if found.fits(family) else None
    except (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, TypeError):
        return None


def arrays(start: StartSet) -> dict[str, Any]:
    """A start set as arrays by name."""
    return {
        "markers": start.member.markers,
        "drive": start.member.drive,
        "x": start.x,
        "mixing": np.zeros((0, 0)) if start.mixing is None else start.mixing,
        "sizes": np.array([start.chance, start.trace.last, start.trace.beyond]),
        "counts": np.array([start.loops, start.lost, start.followed, start.trace.degree, start.trace.samples]),
    }


def keep(family: Family, start: StartSet) -> None:
    """Keep a start set, as far as the folder allows."""
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        with whole_file(cache_folder() / f"start-{key(family)}.npz") as temporary, temporary.open("xb") as handle:
            np.savez_compressed(handle, **arrays(start))
    except (OSError, RuntimeError, MechgraphError):
        return
