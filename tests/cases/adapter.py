"""Answers to the questions of the cases by mechgraph: the only part of this folder that knows the program.

``answer(declaration, ask, engine)`` returns plain data: numbers, lists, words; None stands for what is not unique or not there. A question
that is refused is answered with the class of the error.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

import mechgraph as mg

ENGINES = ("dense", "sparse")
Data = dict[str, Any]


def declared(declaration: str | Mapping[str, Any]) -> mg.Mechanism:
    """The mechanism of a declaration: letters or a name of the library, or the tables of a file."""
    if isinstance(declaration, str):
        return _named(declaration)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "case.toml"
        file.write_text(tomli_w.dumps(dict(declaration)), encoding="utf-8")
        return mg.load(file)


@lru_cache(maxsize=64)
def _named(name: str) -> mg.Mechanism:
    return mg.load(name) if name in mg.library() else mg.chain(name)


def answer(declaration: str | Mapping[str, Any], ask: Mapping[str, Any], engine: str = "auto") -> Data:
    """What mechgraph says."""
    given = {key: value for key, value in ask.items() if key != "what"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return ASKED[ask["what"]](declared(declaration), engine, **given)
        except mg.MechgraphError as error:
            return {"refused": type(error).__name__}


def plain(value: Any) -> Any:
    """Arrays as lists of 11 digits, None for NaN."""
    value = np.asarray(value, dtype=float)
    if value.ndim:
        return [plain(part) for part in value]
    return None if np.isnan(value) else float(f"{float(value):.11g}")


def motions(motion: Mapping[str, Any]) -> Data:
    """Motions by freedom: positions, or positions with rates."""
    return {name: mg.Motion(**given) if isinstance(given, dict) else given for name, given in motion.items()}


# --- questions --------------------------------------------------------------------------------------------------------------


def facts(m: mg.Mechanism, engine: str, **more: Any) -> Data:
    """What the graph and the geometry determine."""
    r = mg.check(m, engine=engine, **more)
    out: Data = {
        "count": [len(r.links), len(r.pairs), len(r.loops), r.mobility_by_count],
        "ledger": {name: [r.ledger(name).unknowns, r.ledger(name).equations] for name in ("lee", "minimal")},
        "determinate": r.determinate,
        "geometry": None,
    }
    if r.mobility is not None:
        out["geometry"] = {
            "mobility": [r.mobility, r.finite_mobility, r.redundancy],
            "unique": {pair: [name for name, is_so in of.items() if is_so] for pair, of in r.unique.items()},
            "passive": sorted(sorted(one.links) for one in r.passive),
            "locked": sorted(name for one in r.locked for name in one.freedoms),
            "drivable": sorted(name for one in r.drivable for name in one.freedoms),
            "undriven": len(r.undriven),
        }
    return out


def text(m: mg.Mechanism, engine: str, full: bool = False) -> Data:
    """The determinacy report as its reader sees it."""
    return {"text": mg.check(m, engine=engine).text(full=full).splitlines()}


def solve(m: mg.Mechanism, engine: str, motion: Mapping[str, Any], forces: bool = True, **more: Any) -> Data:
    """Positions, rates, reactions and efforts of all pairs along a motion."""
    call = mg.solve if forces else mg.kinematics
    s = call(m, motions(motion), engine=engine, on_reach="flag", **more)
    moved, acting = ("position", "velocity", "acceleration"), ("reaction", "effort", "applied_effort")
    # those that say a status in words count with it
    told = [one for one in s.warnings if getattr(one, "status", None) not in s.status]
    out: Data = {"status": np.ravel(s.status).tolist(), "warnings": len(told)}
    for quantity in (*moved, *acting) if forces else moved:
        out[quantity] = {p.name: plain(getattr(s[p.name], quantity)) for p in m.pairs}
    if forces:
        out["shaking"] = plain(s.shaking)
        out["multiplier"] = {c.name: plain(s.coupling(c.name).effort) for c in m.couplings}
        out["passive_effort"] = {name: plain(value) for name, value in s.passive_effort.items()}
    return out


def respond(m: mg.Mechanism, engine: str, t: list[float] | None = None, **more: Any) -> Data:
    """Motion in time from a start."""
    r = mg.respond(m, t, engine=engine, **more)
    return {
        "position": {p.name: plain(r[p.name].position) for p in m.pairs},
        "velocity": {p.name: plain(r[p.name].velocity) for p in m.pairs},
        "reaction": {p.name: plain(r[p.name].reaction) for p in m.pairs},
        "kinetic": plain(r.energy.kinetic),
        "events": [[e.name, plain(e.t)] for e in r.events],
    }


def rest(m: mg.Mechanism, engine: str, start: Mapping[str, float] | None = None) -> Data:
    """Equilibrium, whether it is stable, and frequencies about it."""
    e = mg.equilibrium(m, start)
    return {
        "start": {name: plain(value) for name, value in e.start.items()},
        "stable": e.stable,
        "frequencies": plain(np.sort(np.abs(mg.linearize(e).frequencies))),
    }


def assemblies(m: mg.Mechanism, engine: str, at: Mapping[str, float], seed: int = 0) -> Data:
    """All assemblies at a position: their coordinates as cosine and sine (turns) or lengths, in an order that their numbers give."""
    found = mg.assemblies(m, at, seed=seed)
    turns = np.array([m.turns(name) for name in m.freedom_names()])
    q = np.asarray(found.coordinates).reshape(len(found), len(turns))
    rows = np.concatenate([np.cos(q[:, turns]), np.sin(q[:, turns]), q[:, ~turns]], axis=1) + 0.0
    order = np.lexsort(np.round(rows, 6).T[::-1]) if len(rows) else []
    return {"number": len(found), "completeness": found.completeness, "coordinates": plain(rows[order])}


def branches(m: mg.Mechanism, engine: str, driver: str) -> Data:
    """How far a driver moves every assembly."""
    b = mg.branches(m, driver)
    return {
        "number": len(b),
        "circuits": len(b.circuits),
        "full_turn": sorted(b.full_turn),
        "folds": plain(sorted(fold.value for fold in b.folds)),
    }


def structure(m: mg.Mechanism, engine: str) -> Data:
    """Chain, families and groups."""
    s, chain = mg.structure(m), mg.identify(m)
    return {
        "chain": chain.name,
        "inversions": len(chain.inversions),
        "family": s.families.family,
        "loops": [[loop.family, loop.rank] for loop in s.families.loops],
        "dobrovolski": s.families.dobrovolski,
        "groups": [sorted(group.links) for group in s.groups.groups],
    }


def chains(m: mg.Mechanism, engine: str, links: int, mobility: int) -> Data:
    """How many chains of turning pairs there are."""
    return {"number": sum(1 for _ in mg.atlas(links, mobility))}


def transmission(m: mg.Mechanism, engine: str, motion: Mapping[str, Any], output: str) -> Data:
    """Quality of transmission along a motion."""
    found = mg.transmission(mg.solve(m, motions(motion), engine=engine), output)
    return {"index": plain(found.index)}


ASKED: dict[str, Callable[..., Data]] = {
    "facts": facts,
    "text": text,
    "solve": solve,
    "respond": respond,
    "rest": rest,
    "assemblies": assemblies,
    "branches": branches,
    "structure": structure,
    "chains": chains,
    "transmission": transmission,
}
