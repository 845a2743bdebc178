"""What holds passive freedoms against the loads that act: nothing (idle), or a couple or force that no part supplies (load-bearing)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mechgraph.algebra.se3 import Array, cross, rotate_back
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.passive_motion import PassiveMotion, PassiveMotions
from mechgraph.closure.rates import Rates, Velocities
from mechgraph.errors import DeclarationError
from mechgraph.force.applied_loads import Site
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.tolerances import MOTIONS


def is_idle(size: Array, terms: Array) -> bool:
    """Whether no effort is needed at any of the positions; those that were not solved are NaN."""
    return bool(np.nanmax(np.abs(size), initial=0.0) <= MOTIONS.idle * np.nanmax(terms, initial=0.0))


def hold_names(m: Mechanism, passive: Iterable[PassiveMotion]) -> list[str]:
    """For every passive motion the names of its links; numbered where the same links have several."""
    links = m.link_names()
    names = [" and ".join(links[i] for i in motion.links) for motion in passive]
    return [f"{name} ({n + 1})" if (n := names[:i].count(name)) else name for i, name in enumerate(names)]


def hold(
    here: Configuration, passive: tuple[PassiveMotion, ...], Z: Array, loads: Array, efforts: Array, largest: float
) -> tuple[Array, Array, Array]:
    """What keeps passive bodies at rest: wrenches ``(6, N, T)`` on them, the effort ``(p, T)`` of every passive motion, and its terms.

    Along every passive motion the power of loads, given efforts and hold vanishes. ``Z (F, p, T)`` spans the motions at each position. The
    hold of a turn is a couple about its axis, that of a slide a force along it, so that it loads no pair of the body; it comes from
    outside the mechanism. The terms ``(p, T)`` are the sizes of what adds up to an effort, with the ``largest`` single load: by them
    rounding is told from load.
    """
    at = PassiveMotions(here, passive, Z)
    of_loads = loads[:, at.links]
    power = np.einsum("cnt,cnpt->pt", of_loads, at.twists) + np.einsum("ft,fpt->pt", efforts, at.rates)
    held = -at.dual(power)
    wrenches = np.zeros_like(loads)
    wrenches[3:, at.links] = held[3:]
    wrenches[:3, at.links] = held[:3] + cross(at.points, held[3:])
    sizes, terms = np.empty(power.shape), np.empty(power.shape)
    for i, motion in enumerate(passive):
        twist, rates = at.twists[:, :, i], at.rates[:, i]
        body = twist[:, at.links.index(motion.links[0])]
        axis = body[:3] if motion.turns else body[3:]
        length = np.maximum(np.sqrt((axis * axis).sum(axis=0)), 1e-300)
        sense = _sense(rotate_back(here.poses[:, :3, motion.links[0]], axis))
        sizes[i] = -power[i] * sense / length
        terms[i] = largest + (np.abs(of_loads * twist).sum(axis=(0, 1)) + np.abs(efforts * rates).sum(axis=0)) / length
    return wrenches, sizes, terms


def _sense(axis: Array) -> Array:
    """Signs ``(T,)`` that make the first component of note of body-fixed axes ``(3, T)`` positive: the same wherever the body stands."""
    size = np.abs(axis)
    first = np.argmax(size > 0.1 * size.max(axis=0), axis=0)
    return np.where(np.take_along_axis(axis, first[None], axis=0)[0] < 0, -1.0, 1.0)


def hold_at_rest(
    here: Configuration, coordinates: Array, loads: Iterable[Load], passive: tuple[PassiveMotion, ...]
) -> tuple[Array, Array] | None:
    """Efforts ``(p, 1)`` of the passive motions at one position at rest under loads, and their terms.

    ``coordinates (F, 1)`` are the user's. None where a load has no value there, since it varies over the positions of a solution.
    """
    F, p = len(coordinates), len(passive)
    still = Rates(Velocities(here, np.zeros((F, 1))), np.zeros((F, 1)), np.zeros(1))
    site = Site(here, still, coordinates, (), np.zeros(1, dtype=np.intp), None)
    try:
        site.collect(tuple(loads))
    except DeclarationError:
        return None
    Z = np.stack([motion.rates for motion in passive], axis=1)
    return hold(here, passive, Z.reshape(F, p, 1), site.applied(), site.scaled_efforts(), site.largest)[1:]
