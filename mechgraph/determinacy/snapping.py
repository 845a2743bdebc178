"""Near-special geometry made exact with the least change.

The mechanism with the smallest change that makes near-special geometry exact.
Every pair is moved as a whole, by a small turn w_k about its point and a shift t_k, where it stands in the closed start (with
loops that close only to the tolerance: closed in the least-squares sense, the misfit shared by all pairs). Among all changes that meet

    the relations of axes, directions, centres and lengths that are missed by no more than the tolerance (``near_relations``), and
    N_i^T (c_i + C_i (w, t)) = 0   at positions i along the motions that the tolerance leaves,

the smallest is taken, sum over the pairs of w^2 + (t / L)^2, by successive linearization. c_i is what the loops leave open, C_i its
derivative in the changes, N_i the self-stresses there: loops close at a position where no self-stress does work on what they leave open.
The second line needs no name for what makes a mechanism move (Bennett, Bricard, parallel cranks, ...); the first is what people mean
where the second leaves a choice: a planar four-bar is nearest to spherical ones with a far apex.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from time import monotonic
from typing import Any, TypeAlias

import numpy as np
import scipy

from mechgraph.determinacy.near_relations import EXACT, PlacedPairs, Relation, Relations
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, MechgraphError
from mechgraph.fields import tolerance_fault
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import singular_values
from mechgraph.maths.se3 import Array, Index, cross
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Declared

SLACK = 1.001
"""A tolerance is met up to this factor: it may be the printed size of the change itself."""
MANY = 0.7
"""Part of the worst miss from which relations that do not hold together are dropped at a time: the least likely to be meant."""
ROUNDS = 25
"""Most linearizations; each leaves a part of the size of the change."""
NEARER, FARTHER = 0.12, 0.3
"""Steps between the positions along a motion: at first, and once the loops close at those."""
POSITIONS = 5
"""Positions along a motion each way."""
MOST_ROWS = 60
"""Closure rows up to which motions are followed: dense decompositions. Larger mechanisms are left to the relations."""
FAR = 4.0
"""Tolerances beyond which a change on the way is given up: the first linearizations overshoot."""


TOOK_TOO_LONG = "the search took longer than it may"
"""What a search says that is given up for its time."""


class SearchEnded(MechgraphError):
    """A search for near-special geometry was given up."""


def least_change(placed: PlacedPairs, tol: float) -> tuple[Array, tuple[Relation, ...], tuple[Relation, ...], bool]:
    """Change ``(6, P)``, relations met and dropped, and whether motions asked for more."""
    none = np.zeros((6, placed.frames.shape[2]))
    declared = placed.changed(none)
    found = Relations(Configuration(declared, placed.x[:, None]), placed.frames)
    change, met, dropped = _meeting(placed, found, found.near(tol), tol)
    if placed.system.n_rows > MOST_ROWS:
        return change, met, dropped, False
    # parts of the tolerance: relations that are nearer than others stay, where not all let the mechanism move
    sure = [{r.text for r in found.near(tol * part)} for part in (0.25, 0.0625)]
    sets = dict.fromkeys((met, *(tuple(r for r in met if r.text in texts) for texts in sure), ()))
    for mobility in range(_mobility(declared, placed.x, tol), _mobility(placed.changed(change), placed.x, 0.0), -1):
        for relations in sets:
            moving = _moving(placed, found, relations, mobility, tol)
            if moving is not None:
                return moving, relations, (*dropped, *(r for r in met if r not in relations)), True
    return change, met, dropped, False


def _mobility(system: System, x: Array, tol: float) -> int:
    """Mobility at a state, singular values of less than the change that ``tol`` may make of them being zero."""
    s = singular_values(Configuration(system, x[:, None]).J[:, :, 0])
    change = weakness(system, tol) + EXACT * (s[0] if s.size else 1.0)
    return system.n_freedoms - int((s > change).sum())


def weakness(system: System, tol: float) -> float:
    """Singular value of the closure rows that changes of every pair by ``tol`` may make."""
    return 4.0 * tol * float(np.sqrt(len(system.m.pairs)))


def _meeting(
    placed: PlacedPairs, found: Relations, near: tuple[Relation, ...], tol: float
) -> tuple[Array, tuple[Relation, ...], tuple[Relation, ...]]:
    """The smallest change that meets all relations that hold together within the tolerance; these, and those left out."""
    dropped: list[Relation] = []
    while True:
        change, rest = _solved(placed, partial(_relation_rows, found, near))
        size = np.max(placed.moved(change), axis=0, initial=0.0)
        if not near or (rest.max(initial=0.0) <= EXACT and size.max() <= SLACK * tol):
            return change, near, tuple(dropped)
        open_ = np.array([np.abs(row[0]).max() for row in found.rows(near, change)])
        misses = np.array([r.miss for r in near])
        weight = np.where(open_ > EXACT, misses, 0.0) if open_.max() > EXACT else _weights(found, near, size, tol)
        out = weight >= MANY * weight.max()
        dropped += [r for r, gone in zip(near, out, strict=True) if gone]
        near = tuple(r for r, gone in zip(near, out, strict=True) if not gone)


def _weights(found: Relations, near: tuple[Relation, ...], size: Array, tol: float) -> Array:
    """The misses of the relations of pairs that would move by more than the tolerance."""
    far = set(np.flatnonzero(size > SLACK * tol).tolist())
    return np.array([r.miss if far & {int(found.owner[f]) for f in r.features} else 0.0 for r in near])


Rows: TypeAlias = "tuple[Array, scipy.sparse.csr_array]"


def _relation_rows(found: Relations, relations: tuple[Relation, ...], change: Array) -> Rows:
    """Residuals ``(n,)`` and their derivatives ``(n, 6 P)``, sparse; the columns are those of ``change`` pair by pair."""
    parts = found.rows(relations, change)
    r = np.concatenate([np.zeros(0), *(p[0] for p in parts)])
    data, rows, columns, at = [np.zeros(0)], [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)], 0
    for residual, D, c in parts:
        n = len(residual)
        data.append(D.ravel())
        rows.append(np.repeat(np.arange(at, at + n), len(c)))
        columns.append(np.tile(c, n))
        at += n
    entries = np.concatenate(data), (np.concatenate(rows), np.concatenate(columns))
    return r, scipy.sparse.csr_array(entries, shape=(len(r), change.size))


def _solved(
    placed: PlacedPairs, rows_at: Callable[[Array], Rows], begin: Array | None = None, most: float = 1.0
) -> tuple[Array, Array]:
    """The smallest change with residual zero, by least-norm linearizations from ``begin``; and what is left of the residuals.

    Given up where a part of it exceeds ``most``.

    Rows that depend on each other do so at the solution only: singular values of the size of the residual count as zero.
    """
    change = np.zeros((6, placed.frames.shape[2])) if begin is None else begin
    best, least = change, np.full(1, np.inf)
    for _ in range(ROUNDS):
        if monotonic() > placed.until:
            raise SearchEnded(TOOK_TOO_LONG)
        r, A = rows_at(change)
        if not r.size or np.abs(r).max() < np.abs(least).max():
            best, least = change, np.abs(r)
        if not r.size or np.abs(r).max() <= EXACT / 10:
            break
        wanted = A @ change.T.ravel() - r
        cut = min(max(30.0 * float(np.abs(r).max()), 1e-8), 0.05)
        change = _least_norm(A, wanted, cut).reshape(-1, 6).T
        if not np.isfinite(change).all() or np.abs(change).max() > most:
            break
    return best, least


def _least_norm(A: scipy.sparse.csr_array, b: Array, cut: float) -> Array:
    """The smallest ``x`` with least ``|A x - b|``; singular values below ``cut`` times the largest are dropped."""
    # numbers to be changed from which on relations are met by an iterative least-norm solution
    if A.shape[1] > 1200:
        return np.asarray(
            scipy.sparse.linalg.lsmr(A, b, atol=1e-15, btol=1e-15, conlim=1 / cut, maxiter=20 * A.shape[0])[0]
        )
    return np.asarray(scipy.linalg.lstsq(A.toarray(), b, cond=cut, check_finite=False)[0])


# --- motions ------------------------------------------------------------------------------------------------------------------


def _moving(
    placed: PlacedPairs, found: Relations, relations: tuple[Relation, ...], mobility: int, tol: float
) -> Array | None:
    """The smallest change that meets relations and lets the mechanism move with that mobility; None where there is none within ``tol``."""
    rank = placed.system.n_freedoms - mobility
    change = _solved(placed, partial(_relation_rows, found, relations))[0]
    for step in (NEARER, FARTHER):
        states = _followed(placed.changed(change), placed.x, rank, step, 100.0 * tol if step == NEARER else 10.0 * tol)
        if states is None:
            return None
        change, rest = _solved(placed, partial(_rows_along, placed, found, relations, states, rank), change, FAR * tol)
        # hundredth of the residual with which positions near the start, which tell little from each other, lead on to farther
        # ones
        if rest.max() > (1e-10 if step == NEARER else EXACT) * 100 or np.max(placed.moved(change)) > SLACK * tol:
            return None
    return change


def _rows_along(
    placed: PlacedPairs, found: Relations, relations: tuple[Relation, ...], states: Array, rank: int, change: Array
) -> Rows:
    """The rows of relations, and those of loops closed again at states ``(nx, T)``."""
    r, A = _relation_rows(found, relations, change)
    left, C = _closing_rows(placed, change, states, rank)
    return np.concatenate([r, left]), scipy.sparse.csr_array(scipy.sparse.vstack([A, scipy.sparse.csr_array(C)]))


def _followed(system: System, x: Array, rank: int, step: float, open_: float) -> Array | None:
    """States ``(nx, T)`` along the motions that are left where only ``rank`` rows count, as far as the loops close to ``open_``."""
    # seed of these motions
    rng = np.random.default_rng(11)
    mobility, out = system.n_freedoms - rank, []
    # random motions that are followed, each both ways; one where there is but one
    for _ in range(4 if mobility > 1 else 1):
        wish = rng.normal(size=system.n_freedoms)
        for sign in (1.0, -1.0):
            at, way = x[:, None], sign * wish
            for _ in range(POSITIONS):
                here = Configuration(system, at)
                null = np.linalg.svd(here.J[:, :, 0])[2][rank:]
                way = null.T @ (null @ way)
                at = _closed(system, system.advance(at, (step * way / np.abs(way).max())[:, None]), rank)
                if not np.isfinite(at).all() or Configuration(system, at).closure[0] > open_:
                    break
                out.append(at)
    return np.concatenate(out, axis=1) if len(out) > POSITIONS else None


def _closed(system: System, x: Array, rank: int, times: int = 4) -> Array:
    """States ``(nx, T)`` after some least-squares corrections with the ``rank`` largest singular values."""
    for _ in range(times):
        here = Configuration(system, x)
        U, s, Vt = np.linalg.svd(here.J.transpose(2, 0, 1), full_matrices=False)
        part = np.einsum("tmr,mt->tr", U[:, :, :rank], here.residual) / s[:, :rank]
        x = system.advance(x, -np.einsum("tr,trn->nt", part, Vt[:, :rank]))
    return x


def _closing_rows(placed: PlacedPairs, change: Array, states: Array, rank: int) -> tuple[Array, Array]:
    """What self-stresses do on what the loops leave open after a change, closed again from states ``(nx, T)``; with its derivatives."""
    system = placed.changed(change)
    here = Configuration(system, _closed(system, states, rank))
    stress = np.linalg.svd(here.J.transpose(2, 0, 1))[0][:, :, rank:]
    C, n = np.zeros((here.T, system.n_rows, change.size)), len(system.loop_matrix)
    twists = np.einsum("lp,ipct->ilpct", system.loop_matrix, placed.carried(change, here))
    twists[3:] += cross(twists[:3], np.broadcast_to(here.middles[:, :, None, None], twists[:3].shape))
    C[:, : 6 * n] = twists.transpose(4, 1, 0, 2, 3).reshape(here.T, 6 * n, change.size)
    r = np.einsum("tmk,mt->tk", stress, here.residual)
    return r.ravel(), np.einsum("tmk,tmn->tkn", stress, C).reshape(r.size, -1)


GIVEN_UP = "{} {!r}: what makes its geometry exact to tol={:g} was not found in {:g} s; pass limit= to look longer, or leave tol out"
"""What is said of a mechanism that is not made exact in time."""


@dataclass(frozen=True)
class MovedPair:
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
    moved: tuple[MovedPair, ...]
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
    placed = PlacedPairs(here, until)
    change, met, dropped, mobile = least_change(placed, tol)
    pairs = placed.pairs(change)
    L, moved = here.system.par.L, placed.moved(change)
    rows = [
        MovedPair(pair.name, float(angle) if angle > EXACT else 0.0, float(shift * L) if shift > EXACT else 0.0)
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
    placed = PlacedPairs(here)
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
