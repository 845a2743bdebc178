"""One position for the printed equations: screws, loads and coordinates in the user's units about the global origin."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.rates import Rates
from mechgraph.equations.terms import MovingState
from mechgraph.errors import MechgraphError
from mechgraph.force.applied_loads import inertia_wrenches, user_poses, user_twists
from mechgraph.force.dalembert import internal_state
from mechgraph.model.parameters import Parameters
from mechgraph.quantities import shown


def user_wrench(par: Parameters, f: Array) -> Array:
    """Wrench about the internal origin -> user's units about the global origin, ``(6, ...)``."""
    out = np.empty(f.shape)
    origin = par.origin.reshape(3, *(1,) * (f.ndim - 1))
    np.multiply(f[3:], par.L, out=out[3:])
    np.multiply(f[:3], par.L**2, out=out[:3])
    out[:3] += cross(origin, out[3:])
    return out


def user_state(rates: Rates, coordinates: Array, loads: Array, applied: Array, flank: Array) -> MovingState:
    """The State at one position with user coordinates ``(F, 1)``, internal loads, all and the applied ones alone, ``(6, N, 1)``, and the
    signs ``(n, 1)`` of the multipliers of couplings, which tell on which flanks gears touch each other.
    """
    here = rates.here
    s, par = here.system, here.system.par
    inner = internal_state(here, loads, flank)
    scale = np.broadcast_to(s.row_scale, (s.n_rows, 1))[6 * s.graph.n_loops :]
    rows = [p.type for p in s.m.pairs]
    couples = [[c.is_couple for c in row.reactions or ()] for row in rows]
    efforts = [[c.is_couple for c in row.efforts] for row in rows]
    along = [[c.is_couple for c in row.bookkeeping.along] if row.bookkeeping else [] for row in rows]
    unit = np.where(s.is_length, par.L, 1.0)[:, None]
    freedoms = user_twists(here, here.S) / unit
    columns = [slice(first, end) for first, end in pairwise(s.first_column.tolist())]
    without = here.accelerations_with(np.zeros_like(rates.ddq), rates.bias)
    return MovingState(
        coordinates=coordinates,
        velocities=unit * rates.dq,
        poses=np.moveaxis(user_poses(here)[..., :3, :], (0, 1), (2, 3)),
        twists=user_twists(here, rates.V),
        reactions=tuple(_user_screws(par, w, which) for w, which in zip(inner.reactions, couples, strict=True)),
        efforts=tuple(_user_screws(par, w, which) for w, which in zip(inner.efforts, efforts, strict=True)),
        along=tuple(_user_screws(par, w, which) for w, which in zip(inner.along, along, strict=True)),
        conditions=tuple(user_twists(here, w) if w.shape[1] else w for w in inner.conditions),
        loads=user_wrench(par, loads),
        contacts=tuple(user_wrench(par, G) / (par.L**2 * one) for G, one in zip(inner.contacts, scale, strict=True)),
        accelerations=unit * rates.ddq,
        freedoms=tuple(freedoms[:, mine] for mine in columns),
        biases=user_twists(here, rates.bias),
        inertias=_user_inertias(here),
        applied=user_wrench(par, applied),
        gyroscopic=user_wrench(par, _inertia_wrenches(here, rates.V, without)),
    )


def _inertia_wrenches(here: Configuration, V: Array, A: Array) -> Array:
    return inertia_wrenches(here, SimpleNamespace(V=V, A=A))  # type: ignore[arg-type]


def _user_inertias(here: Configuration) -> Array:
    """Inertias of all links about the global origin ``(6, 6, N, T)``, in the user's units."""
    par, still = here.system.par, np.zeros((6, len(here.system.m.links), here.T))
    columns = []
    for unit in np.eye(6):
        inner = np.concatenate([unit[:3], (unit[3:] - cross(par.origin, unit[:3])) / par.L])
        wrenches = -_inertia_wrenches(here, still, np.broadcast_to(inner[:, None, None], still.shape))
        columns.append(user_wrench(par, wrenches))
    return np.stack(columns, axis=1)


def _user_screws(par: Parameters, wrenches: Array, couples: list[bool]) -> Array:
    """Unit wrenches ``(6, n, T)``: arms in the user's length, about the global origin; unit couples stay, forces that go with them are
    per length.
    """
    out = wrenches.copy()
    for j in range(out.shape[1]):
        if j < len(couples) and couples[j]:
            out[3:, j] /= par.L
        else:
            out[:3, j] *= par.L
        out[:3, j] += cross(par.origin[:, None], out[3:, j])
    return out


def flat_place(batch: tuple[int, ...], index: Any) -> int:
    """Place in the flat batch of the one position that an index names.

    Raises
    ------
    MechgraphError
    """
    try:
        flat = np.arange(int(np.prod(batch))).reshape(batch)[index]
    except (IndexError, ValueError, TypeError):
        text = f"state({shown(index)}): no such position in a batch {batch}; give one index an axis"
        raise MechgraphError(text) from None
    if np.ndim(flat):
        raise MechgraphError(
            f"state({shown(index)}): names {np.size(flat)} positions of a batch {batch}; give one index an axis"
        )
    return int(flat)
