"""Faults of a declaration, collected in one pass over its items."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from mechgraph.model.conversion import UNIT_NAMES
from mechgraph.model.drive import Drive
from mechgraph.model.link import Link
from mechgraph.model.load import LOADS
from mechgraph.model.pair import Pair
from mechgraph.model.pair_type import PairType
from mechgraph.model.values import is_numeric

if TYPE_CHECKING:
    from mechgraph.model.mechanism import Mechanism


def _repeated(names: Iterable[Any], what: str) -> list[str]:
    return [f"{what} {n!r} is declared {c} times; names must differ" for n, c in Counter(names).items() if c > 1]


def _kind_faults(m: Mechanism) -> list[str]:
    """Items that are no links, pairs, drives or loads at all."""
    faults = []
    for what, items, kind in (
        ("link", m.links, Link),
        ("pair", m.pairs, Pair),
        ("drive", m.drives, Drive),
        ("load", m.loads, tuple(LOADS.values())),
    ):
        wrong = [item for item in items if not isinstance(item, kind)]
        faults += [f"{what} {item!r}: is no {what}; use mg.{what.capitalize()}(...)" for item in wrong]
    return faults


def declaration_faults(m: Mechanism) -> list[str]:
    """All that is wrong with a mechanism, one line each."""
    faults = _kind_faults(m)
    if not isinstance(m.name, str) or not m.name:
        faults.append(f"name {m.name!r}: expected a text")
    if not m.pairs:
        faults.append("no pairs; a mechanism needs at least one pair")
    if faults:
        return faults
    names = m.link_names()
    known = set(names)
    for link in m.links:
        faults += link.faults()
    faults += _repeated(names, "link") + _repeated([p.name for p in m.pairs], "pair")
    for pair in m.pairs:
        faults += pair.faults()
        for end in (pair.a, pair.b):
            if end is None:
                faults.append(f"pair {pair.name!r}: is on one link only; name both links")
            elif end not in known:
                faults.append(f"pair {pair.name!r}: link {end!r} is not declared (links: {', '.join(map(str, names))})")
    if m.frame not in known:
        faults.append(f"frame {m.frame!r}: is no link (links: {', '.join(map(str, names))})")
    for key, value in m.units.items():
        if key not in UNIT_NAMES or not isinstance(value, str) or not value:
            faults.append(f"units: {key} = {value!r}: expected names for {', '.join(UNIT_NAMES)}")
    by_symbol: dict[str, PairType] = {}
    for pair in m.pairs:
        if isinstance(pair.type, PairType):
            first = by_symbol.setdefault(pair.type.symbol, pair.type)
            if first is not pair.type and first != pair.type:
                faults.append(
                    f"pair {pair.name!r}: its type shares the symbol {pair.type.symbol!r} with another type; rename one"
                )
    ends = {end for pair in m.pairs for end in (pair.a, pair.b)}
    if m.frame in known and ends <= known:
        faults += _connection_faults(m)
    return faults + _reference_faults(m)


def item_faults(m: Mechanism) -> list[str]:
    """Faults of drives and loads alone, for links and pairs that were checked before."""
    faults = _kind_faults(m)
    return faults if faults else _reference_faults(m)


def _connection_faults(m: Mechanism) -> list[str]:
    place, n = m.link_index, len(m.links)
    a, b = ([place[end] for end in ends] for ends in zip(*((p.a, p.b) for p in m.pairs), strict=True))
    graph = scipy.sparse.coo_array((np.ones(len(a)), (a, b)), shape=(n, n))
    _, part = scipy.sparse.csgraph.connected_components(graph, directed=False)
    return [
        f"link {name!r} is not connected to the frame {m.frame!r} by any chain of pairs; add the pair that holds it"
        for name in m.link_names()
        if part[place[name]] != part[place[m.frame]]
    ]


def _reference_faults(m: Mechanism) -> list[str]:
    faults = []
    drives = []
    for drive in m.drives:
        fault = m.freedom_fault(drive.freedom, single=True)
        if fault:
            faults.append(f"drive {drive.freedom!r}: {fault}")
        else:
            drives.append(m.full_name(drive.freedom))
    faults += _repeated(drives, "drive")
    for load in m.loads:
        faults += load.faults(m)
    return faults


def flat_start(m: Mechanism, start: Mapping[str, Any]) -> tuple[dict[str, float], list[str]]:
    """Start values by full freedom name; a pair's name may carry one value for each of its freedoms."""
    flat: dict[str, float] = {}
    faults = []
    for key, value in start.items():
        pair = m.pairs[m.pair_index[key]] if key in m.pair_index else None
        many = len(pair.freedom_names) if pair is not None else 0
        if pair is not None and many > 1 and is_numeric(value, (many,)):
            flat.update(zip(pair.freedom_names, map(float, value), strict=True))
            continue
        fault = m.freedom_fault(key, single=False)
        if fault or not is_numeric(value, ()):
            faults.append(f"start {key!r} = {value!r}: {fault or 'expected a finite number'}")
        else:
            flat[m.full_name(key)] = float(value)
    return flat, faults
