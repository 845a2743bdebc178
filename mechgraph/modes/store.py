"""Start sets kept in a folder of the user, one file for each class of mechanisms; a file is written whole or not at all.

The folder is ``writing.cache_folder``. Where it cannot be read or written, start sets are worked out anew. Those of the library's
mechanisms and of common topologies come with the package (``PACKED``, made by ``tests/benchmarks/make_start_sets.py``).
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from mechgraph.errors import MechgraphError
from mechgraph.files import cache_folder, whole_file
from mechgraph.modes.family import Family
from mechgraph.modes.labelling import Labelling
from mechgraph.modes.monodromy import StartSet
from mechgraph.modes.trace import Trace

PACKED = Path(__file__).with_name("start-sets.npz")
"""Start sets that come with the package, one after the other: names are ``key/array``."""
START_SET_VERSION = 6
"""Of the files and of what start sets mean."""


def key(labelling: Labelling) -> str:
    """What a start set serves for: the topology; where relations are kept, the geometry too."""
    return f"{START_SET_VERSION}-{labelling.key}"


def kept(family: Family) -> StartSet | None:
    """The start set of a class, where one is kept and closed: the user's, or else that of the package."""
    labelling = Labelling(family)
    return _read(cache_folder() / f"start-{key(labelling)}.npz", "", labelling) or packed(labelling)


def packed(labelling: Labelling) -> StartSet | None:
    """The start set of a class that came with the package."""
    return _read(PACKED, f"{key(labelling)}/", labelling)


def _read(file: Path, prefix: str, labelling: Labelling) -> StartSet | None:
    try:
        with file.open("rb") as handle, np.load(handle, allow_pickle=False) as f:
            loops, lost, followed, degree, samples = f[prefix + "counts"].tolist()
            chance, last, beyond = f[prefix + "sizes"].tolist()
            member, x = labelling.taken(*(f[prefix + name] for name in ("markers", "squares", "x")))
        trace = Trace(degree, samples, last, beyond)
        # any combinations of the rows will do that are not special
        mixing = labelling.family.mixing(np.random.default_rng(0))
        found = StartSet(member, x, mixing, loops, chance, lost, followed, True, trace)
        return found if found.fits(labelling.family) else None
    except (OSError, ValueError, KeyError, IndexError, EOFError, RuntimeError, zipfile.BadZipFile, TypeError):
        return None


def arrays(labelling: Labelling, start: StartSet) -> dict[str, Any]:
    """A start set as arrays by name."""
    return {
        **labelling.ordered(start.member, start.x),
        "sizes": np.array([start.chance, start.trace.last, start.trace.beyond]),
        "counts": np.array([start.loops, start.lost, start.followed, start.trace.degree, start.trace.samples]),
    }


def keep(family: Family, start: StartSet) -> None:
    """Keep a start set, as far as the folder allows."""
    labelling = Labelling(family)
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        with whole_file(cache_folder() / f"start-{key(labelling)}.npz") as temporary, temporary.open("xb") as handle:
            np.savez_compressed(handle, **arrays(labelling, start))
    except (OSError, RuntimeError, MechgraphError):
        return
