"""A mechanism as it is meant to a tolerance: the nearest one of which near-special geometry is exact, and what it moved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from time import monotonic
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import closed_start
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError
from mechgraph.fields import tolerance_fault
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Declared
from mechgraph.numerics.linear import singular_values
from mechgraph.structure.least_change import MOST_ROWS, SearchEnded, least_change, weakness
from mechgraph.structure.near_relations import Relation, Relations
from mechgraph.structure.placed_pairs import EXACT, Placed

GIVEN_UP = "{} {!r}: what makes its geometry exact to tol={:g} was not found in {:g} s; pass limit= to look longer, or leave tol out"
"""What is said of a mechanism that is not made exact in time."""


@dataclass(frozen=True)
class Change:
    """What one pair was moved: a turn (radians) and a shift (in the unit of length of the mechanism)."""

    pair: str
    angle: float
    shift: float


@dataclass(frozen=True, repr=False)
class Changes(Shown):
    """What ``Mechanism.snapped`` changed; prints as a table.

    ``moved`` what it moved, ``met`` the relations that are exact now, ``dropped`` those that cannot hold together with them within ``tol``
    (none of these is applied), ``largest`` change (radians, or length / ``L``), ``closure`` with which the loops met before; ``mobile``:
    further conditions, which have no name, were met for it to move.
    """

    tol: float
    moved: tuple[Change, ...]
    met: tuple[Relation, ...]
    dropped: tuple[Relation, ...]
    largest: float
    closure: float
    mobile: bool
    L: float

    def document(self) -> Document:
        """The table as a document."""
        rows = [(c.pair, f"{np.degrees(c.angle):.3g}", f"{c.shift:.3g}") for c in self.moved]
        blocks: list[Any] = [Table(("pair", "turned [deg]", "shifted"), tuple(rows), align="lrr")] if rows else []
        for title, relations in (
            ("Exact now", [r for r in self.met if r.miss > EXACT]),
            ("Cannot hold together with these within the tolerance, not applied", self.dropped),
        ):
            if relations:
                lines = [
                    (r.text, f"{np.degrees(r.miss):.3g} deg" if r.angular else f"{r.miss:.3g} L") for r in relations
                ]
                blocks += [Paragraph(f"{title}:"), Table(("relation", "missed by"), tuple(lines), align="lr")]
        if self.mobile:
            blocks.append(
                Paragraph("Dimensions were fitted to each other so that the loops close all along the motion.")
            )
        head = f"With a tolerance of {self.tol:.3g} (radians, lengths / L) "
        head += f"the largest change is {self.largest:.3g}." if rows else "nothing is changed."
        return Document("", (Paragraph(head), *blocks))


class SnappedMechanism(Mechanism):
    """A mechanism with the ``changes`` that made it of the one that was ``declared``; copies of it are plain mechanisms."""

    changes: Changes
    declared: Mechanism


def snapped(m: Mechanism, tol: float, until: float = np.inf) -> SnappedMechanism:
    """The mechanism with the smallest change, ``sum angle^2 + (shift / L)^2`` over the pairs, that makes near-special geometry exact.

    Raises
    ------
    DeclarationError
        where ``tol`` is no number above 0 and at most 0.1, or the mechanism has no geometry.
    AssemblyError
        where the loops do not even close to ``tol``.
    SearchEnded
        at the time ``until`` (of ``time.monotonic``).
    """
    fault = tolerance_fault(tol)
    if fault:
        raise DeclarationError(f"mechanism {m.name!r}", [fault])
    here = closed_start(m, tol=tol)
    placed = Placed(here, until)
    change, met, dropped, mobile = least_change(placed, tol)
    pairs = placed.pairs(change)
    L, moved = here.system.par.L, placed.moved(change)
    rows = [
        Change(pair.name, float(angle) if angle > EXACT else 0.0, float(shift * L) if shift > EXACT else 0.0)
        for pair, angle, shift in zip(m.pairs, *moved, strict=True)
        if max(angle, shift) > EXACT
    ]
    changes = Changes(
        tol, tuple(rows), met, dropped, float(np.max(moved, initial=0.0)), float(here.closure[0]), mobile, L
    )
    return _made(m, changes, pairs=pairs, start=placed.start, tol=tol)


def _made(m: Mechanism, changes: Changes, like: Mechanism | None = None, **fields: Any) -> SnappedMechanism:
    """What was made of ``m`` by changes: ``like`` it (left out, like ``m``) with other fields."""
    kept = like or m
    out = SnappedMechanism(**{**{k: getattr(kept, k) for k in kept.formats}, **fields})
    object.__setattr__(out, "changes", changes)
    object.__setattr__(out, "declared", m)
    return out


def started(m: Mechanism, start: Mapping[str, float]) -> Mechanism:
    """The same with another start; what was snapped stays so."""
    if isinstance(m, SnappedMechanism):
        return _made(m.declared, m.changes, like=m, start=start)
    return m.replace(start=start)


def meant(m: Mechanism, tol: float | None, call: str, limit: float = np.inf) -> Mechanism:
    """The mechanism as it is meant with the tolerance of a call, or its own; itself where there is none, or nothing to move.

    Raises
    ------
    SearchEnded
        after ``limit`` seconds.
    """
    tol = m.tol if tol is None else tol
    if tol is None or isinstance(m, SnappedMechanism):
        return m
    fault = tolerance_fault(tol)
    if fault:
        raise DeclarationError(f"{call} {m.name!r}", [fault])
    if not m.has_geometry:
        return m
    try:
        return snapped(m, tol, monotonic() + limit)
    except SearchEnded as error:
        raise SearchEnded(GIVEN_UP.format(call, m.name, tol, limit)) from error


def candidates(m: Mechanism, tol: float) -> Array:
    """Sizes of the changes that near relations and nearly dependent closure rows ask for, and of the misfit of the loops."""
    here = closed_start(m, tol=tol)
    placed = Placed(here)
    declared = Configuration(placed.changed(np.zeros_like(placed.misfit)), placed.x[:, None])
    sizes = [r.miss / 2 for r in Relations(declared, placed.frames).near(tol)] + [float(here.closure[0])]
    s = singular_values(declared.J[:, :, 0]) if here.system.n_rows <= MOST_ROWS else np.zeros(0)
    weak = s[(s > EXACT * s.max(initial=0.0)) & (s < weakness(here.system, tol))] if s.size else s
    return np.array([*sizes, *(weak * tol / weakness(here.system, tol)).tolist()])


def declared_closure(system: System, numbers: Declared, x: Array, which: Index) -> Array:
    """Closure errors ``(T,)`` at states ``x (nx, T)`` of what was snapped, with the ``numbers`` as declared of variants ``which (T,)``."""
    par = system.par
    own = numbers.with_rest(system.m).parameters(system.m, par.offset, par.origin, par.L)
    return Configuration(system.with_parameters(own).cases(which), x).closure
