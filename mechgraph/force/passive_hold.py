"""What holds passive freedoms against the loads that act: nothing (idle), or a couple or force that no part supplies (load-bearing)."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array, cross, rotate_back
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.passive_rest import TURNING, Idle, passive_twists, rest_points
from mechgraph.closure.rates import Rates, Velocities
from mechgraph.errors import DeclarationError
from mechgraph.force.applied_loads import Site
from mechgraph.model.load_base import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.structure.passive import PassiveMotion
from mechgraph.topology.components import labels_of_bipartite, members


def is_idle(size: Array, terms: Array) -> bool:
    """Whether no effort is needed at any of the positions; those that were not solved are NaN."""
    return bool(np.nanmax(np.abs(size), initial=0.0) <= MOTIONS.idle * np.nanmax(terms, initial=0.0))


def turns(motion: PassiveMotion) -> bool:
    """Whether a passive motion turns its links, so that a couple holds them; else a force."""
    return bool(np.abs(motion.twist[:3]).max() > TURNING)


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
    links = sorted({link for p in passive for link in p.links})
    bodies = tuple(Idle(link) for link in links)
    points = rest_points(here, bodies, Z)
    G = passive_twists(here, bodies, points, Z)
    V = np.stack([here.link_twists(Z[:, p])[:, links] for p in range(Z.shape[1])], axis=2)
    of_loads = loads[:, links]
    power = (of_loads[:, :, None] * V).sum(axis=(0, 1)) + (efforts[:, None] * Z).sum(axis=0)
    dual = np.einsum("ipt,tpq->iqt", G, np.linalg.inv(np.einsum("ipt,iqt->tpq", G, G)))
    held = -np.einsum("iqt,qt->it", dual, power)
    wrenches = np.zeros_like(loads)
    for i, (body, P) in enumerate(zip(bodies, points, strict=True)):
        moment, force = held[6 * i : 6 * i + 3], held[6 * i + 3 : 6 * i + 6]
        wrenches[3:, body.link] += force
        wrenches[:3, body.link] += moment + cross(P, force)
    mixes = _named(passive, Z, V, links)
    sizes, terms = np.empty(power.shape), np.empty(power.shape)
    for i, (motion, mix) in enumerate(zip(passive, np.moveaxis(mixes, 2, 0), strict=True)):
        twist, rates = np.einsum("cnpt,tp->cnt", V, mix), np.einsum("fpt,tp->ft", Z, mix)
        body = twist[:, links.index(motion.links[0])]
        axis = body[:3] if turns(motion) else body[3:]
        length = np.maximum(np.sqrt((axis * axis).sum(axis=0)), 1e-300)
        sense = _sense(rotate_back(here.poses[:, :3, motion.links[0]], axis))
        sizes[i] = -np.einsum("pt,tp->t", power, mix) * sense / length
        terms[i] = largest + (np.abs(of_loads * twist).sum(axis=(0, 1)) + np.abs(efforts * rates).sum(axis=0)) / length
    return wrenches, sizes, terms


def _sense(axis: Array) -> Array:
    """Signs ``(T,)`` that make the first component of note of body-fixed axes ``(3, T)`` positive: the same wherever the body stands."""
    size = np.abs(axis)
    first = np.argmax(size > 0.1 * size.max(axis=0), axis=0)
    return np.where(np.take_along_axis(axis, first[None], axis=0)[0] < 0, -1.0, 1.0)


def _named(passive: tuple[PassiveMotion, ...], Z: Array, V: Array, links: list[int]) -> Array:
    """Mixes ``(T, p, p)`` of motions ``Z`` with twists ``V (6, n, p, T)`` of some links: column i moves those of passive motion i as one.

    First motions that share no link are told apart, by the dual of what each set of links does; then those that do. Where the same links
    have several motions, those that are nearest in their freedoms to the motions at the start.
    """
    p, T = V.shape[2:]
    if p == 1:
        return np.ones((T, 1, 1))
    twists = V.transpose(3, 1, 0, 2)

    def of_links(some: Iterable[int]) -> Array:
        at = [links.index(link) for link in sorted(some)]
        return twists[:, at].reshape(T, 6 * len(at), p)

    touched = scipy.sparse.lil_array((p, max(links) + 1))
    for i, motion in enumerate(passive):
        touched[[i], list(motion.links)] = 1.0
    groups = members(labels_of_bipartite(touched.tocsr()))
    moved = [{link for i in group for link in passive[i].links} for group in groups]
    spaces = [
        np.linalg.svd(of_links(some), full_matrices=False)[2][:, : len(group)]
        for group, some in zip(groups, moved, strict=True)
    ]
    alone = np.split(
        np.linalg.inv(np.concatenate(spaces, axis=1)), np.cumsum([len(group) for group in groups])[:-1], axis=2
    )
    out = np.empty((T, p, p))
    for group, some, mine in zip(groups, moved, alone, strict=True):
        for i in group:
            lead, *rest = passive[i].links
            apart = [of_links([link]) - of_links([lead]) for link in rest]
            rows = np.concatenate([of_links(some.difference(passive[i].links)), *apart], axis=1) @ mine
            count = sum(passive[j].links == passive[i].links for j in group)
            space = mine @ np.linalg.eigh(np.swapaxes(rows, 1, 2) @ rows)[1][:, :, :count]
            there = np.moveaxis(Z, 2, 0) @ space
            out[:, :, i] = (
                (space @ (np.linalg.pinv(there) @ passive[i].rates)[..., None])[..., 0] if count > 1 else space[..., 0]
            )
    return out


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
