"""Certificates of solutions: balls that hold one mechanism each that does what is asked, see ``modes.certificate``.

Unknown are the free coordinates of all rows and the unknown dimensions: points go along their axes, directions turn about lines across
them, a pitch moves a marker along the axis by the angle that is asked, numbers of couplings open their rows in proportion. A dimension
that stands in ``c`` markers counts as ``c^(1/2)`` numbers, so that no row depends on more than the length of all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from mechgraph.kinematics.state import Configuration
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import MODES
from mechgraph.modes.certificate import (
    STORED,
    UP,
    Ball,
    Certificate,
    MovedMarker,
    Open,
    curvature,
    exact,
    root_near,
    rows,
)
from mechgraph.synthesis.classes import TaskClass
from mechgraph.synthesis.legs import ClassMember
from mechgraph.synthesis.system import RowNumbers, RowProblem


def certificates(of: TaskClass, goal: ClassMember, x: Array) -> tuple[Certificate | None, ...]:
    """Certificates of real solutions ``x (nx, n)`` of a task with all rods in their places; None of what they do not serve: rates,
    factors, second directions, numbers that are no places, screws and couplings of which an angle that goes with an unknown number is not
    asked, and pairs that are no products of screws and rotations.

    ``apart`` is the distance of points (over L) or unit axes of the markers that are sought, of pitches or of numbers of couplings.
    """
    first = of.at(of.start, of.x[:, None]).by_coordinates[..., 0]
    rank = of.u + sum(
        rank_of(singular_values(first[i][:, free]), MODES.generic) for i, free in enumerate(of.free) if len(free)
    )
    found = [_certificate(of, goal, one, rank) for one in x.T[:, :, None]]
    proved = [(i, sure, at) for i, (sure, at) in enumerate(found) if sure is not None and sure.proved]
    out = [sure for sure, _ in found]
    for i, sure, at in proved:
        gaps = [np.abs(at - b).max(initial=0.0) / UP - sure.error - other.error for j, other, b in proved if j != i]
        out[i] = replace(sure, apart=float(min(gaps)) if gaps else None)
    return tuple(out)


def _certificate(of: TaskClass, goal: ClassMember, x: Array, rank: int) -> tuple[Certificate | None, Array]:
    """The certificate of one solution ``(nx, 1)``, and points and axes of its markers."""
    p, numbers = of.problem, RowNumbers(*(v.real for v in vars(of.numbers_at(goal, x)).values()))
    told = np.concatenate([np.ravel(v) for v in (*numbers.unit()[:2], numbers.pitch, numbers.couplings)])
    moves, states = _moves(p, numbers), of.at(goal, x.astype(complex)).x.real
    if moves is None or p.rates:
        return None, told
    moved, which = moves
    system, F = p.system_with(numbers), p.system.n_freedoms
    # by what markers move with every number at each row
    ways = np.zeros((len(of.free), len(moved), p.u))
    ways[:, np.arange(len(moved)), which] = 1.0
    for own, place in enumerate(own[0] for own in p.places):
        if place.array == "pitch":
            turn = system.first_column[place.pair]
            if any(turn in free for free in of.free):
                return None, told
            ways[:, [k for k, of_number in enumerate(which) if of_number == own], own] *= states[
                :, system.single_rows[turn]
            ]
    size = np.sqrt((ways**2).sum(axis=1).max(initial=1.0))
    parts, K, open_ = list[tuple[Ball, Ball, Ball]](), 0.0, 0.0
    for i, free in enumerate(of.free):
        here = Configuration(system, states[i])
        try:
            f, A = rows(here, moved)
        except Open:
            return None, told
        coupled = _coupled(p, numbers, here, free)
        if coupled is None:
            return None, told
        parts.append((f, A[:, free], A[:, F:] @ exact(ways[i] / size) + Ball(coupled.mid / size, coupled.rad / size)))
        K, open_ = np.hypot(K, curvature(here, moved)), max(open_, float(here.closure[0]))
    f = Ball(*(np.concatenate([getattr(own, part) for own, _, _ in parts]) for part in ("mid", "rad")))
    by_coordinates = (scipy.linalg.block_diag(*(getattr(J, part) for _, J, _ in parts)) for part in ("mid", "rad"))
    by_unknowns = (np.concatenate([getattr(B, part) for _, _, B in parts]) for part in ("mid", "rad"))
    A = Ball(*(np.concatenate(own, axis=1) for own in zip(by_coordinates, by_unknowns, strict=True)))
    return root_near(f, A, rank, float(K), False, open_), told


def _moves(p: RowProblem, numbers: RowNumbers) -> tuple[list[MovedMarker], list[int]] | None:
    """How markers move with unknown dimensions, and with which; None where that is not served."""
    out, which, turning = list[MovedMarker](), list[int](), dict[tuple[int, int], list[tuple[int, int]]]()
    for k, own in enumerate(p.places):
        for place in own:
            if place.array == "point":
                out.append(MovedMarker(place.pair, place.side, np.eye(6)[3 + place.component]))
                which.append(k)
            elif place.array == "pitch" and len(p.system.m.pairs[place.pair].type.freedoms) == 1:
                (freedom,) = p.system.m.pairs[place.pair].type.freedoms
                along = numbers.poses[:, :3, 0, place.pair, 0] @ np.array(freedom.per_pitch[3:])
                out.append(MovedMarker(place.pair, 0, np.concatenate([np.zeros(3), along])))
                which.append(k)
            elif place.array == "axis":
                turning.setdefault((place.pair, place.side), []).append((k, place.component))
            elif place.array != "couplings":
                return None
    point, axis, _ = numbers.unit()
    for (pair, side), found in turning.items():
        a, at = axis[side, :, pair, 0], point[side, :, pair, 0]
        fixed = np.delete(a, [c for _, c in found])
        # of one component the direction goes in a plane, of two all ways; where what is fixed is zero they are not its coordinates
        if np.linalg.norm(fixed) < MODES.span or len(found) > 2:
            return None
        across = np.cross(a, np.eye(3)[found[0][1]])[None] if len(found) == 1 else np.linalg.svd(a[None])[2][1:]
        for (k, _), w in zip(found, across / np.linalg.norm(across, axis=1)[:, None], strict=True):
            out.append(MovedMarker(pair, side, np.concatenate([w, np.cross(at, w)])))
            which.append(k)
    return out, which


def _coupled(p: RowProblem, numbers: RowNumbers, here: Configuration, free: Index) -> Ball | None:
    """By what rows open with unknown numbers of couplings ``(rows, u)``; None where they do so in step with what is free."""
    out = np.zeros((2, len(here.residual), p.u))
    for k, place in enumerate(own[0] for own in p.places):
        if place.array == "couplings":
            more = numbers.couplings.copy()
            more[place.index] += 1.0
            there = Configuration(p.system_with(replace(numbers, couplings=more)), here.x)
            if np.abs(there.J - here.J)[:, free].any():
                return None
            out[0, :, k] = (there.residual - here.residual)[:, 0]
            # sums of products of numbers and angles, each of which is rounded
            out[1, :, k] = (
                STORED * np.abs(here.x).max(initial=1.0) * len(here.x) * (np.abs(here.J).sum(axis=1)[:, 0] + 1.0)
            )
            out[1, out[0, :, k] == 0.0, k] = 0.0
    return Ball(*out)
