"""Unknown dimensions: which declared numbers are sought, and where they stand among the numbers that the kernel reads.

Of an element only what matters is sought. Let a pair do the motions ``g``, and let its place move with a twist ``eta``; the pair then does
``exp(eta) g exp(-eta)``, the same motions where ``eta - Ad_g eta`` is a motion of the pair at every ``g``. So a line is 4 numbers for a
turn about it, a direction 2 for a slide, a point 3 for a ball. Where a pair is placed on each link by itself, the place on one link
matters as far as ``eta`` is no motion of the pair. Of the components of a point, an axis and a second direction those are
sought that tell these apart best; the others stay as they are declared.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache, cached_property
from math import lcm
from typing import Any

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, did_you_mean, near_names
from mechgraph.fields import XYZ
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import Array, cross, move_twist
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism, chain_numbers
from mechgraph.model.pair import Link, Pair
from mechgraph.model.parameters import declared
from mechgraph.modes.family import span
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import wrong
from mechgraph.variants.numbers import (
    MARKER,
    PLACED,
    SIDES,
    AnyField,
    ChainField,
    Field,
    ItemField,
    chain_marker,
    clashes,
    field_values,
    find_field,
    varied,
)


@dataclass(frozen=True)
class UnknownPlace:
    """A component of ``point``, ``axis`` or ``second`` of the marker of a pair on a side, or the ``pitch`` of a pair; of no pair (-1) a
    number of the ``couplings``, one of the ``factors`` of what is asked, or one of ``others``, from which the mechanism is built.

    What stands there is ``scale`` times the number.
    """

    array: str
    side: int
    component: int
    pair: int
    scale: float = 1.0

    @property
    def turns(self) -> bool:
        """Whether directions change with it."""
        return self.array in MARKER[1:]

    @property
    def index(self) -> tuple[int, ...]:
        """Where it stands in its array."""
        if self.array in MARKER:
            return self.side, self.component, self.pair
        return (self.component if self.pair < 0 else self.pair,)


NOT_MET = "stands in no equation of closure; no position depends on it"
"""Why a number is none to be sought."""


def _of_body(m: Mechanism, name: str) -> bool:
    """Whether a name is that of mass, center or the like of a link, declared or not; not of one of its points."""
    whose = [(link, name.removeprefix(f"{link.name}.")) for link in m.links if name.startswith(f"{link.name}.")]
    return any(hasattr(link, what := rest.partition(".")[0]) and what not in link.points for link, rest in whose)


class Unknowns:
    """The numbers sought, in the order given: ``names (u,)``, and ``places`` where each stands; ``m`` is the mechanism as declared.

    ``whole`` is the mechanism with free pairs behind its own, whose markers at named points are places of these. Faults of ``given``
    are put to ``faults``. Behind the fields stand ``factors``, of freedoms that are asked up to one: ``D.scale`` of ``D``.
    """

    def __init__(
        self, m: Mechanism, whole: Mechanism, given: Sequence[str], faults: list[str], factors: Sequence[str] = ()
    ) -> None:
        self.m, self.whole, self.factors = m, whole, tuple(factors)
        self.fields: dict[str, AnyField] = {}
        faults += [wrong(name, "unknown", "a name") for name in given if not isinstance(name, str)]
        for name in (name for name in given if isinstance(name, str)):
            for one in self._expanded(name):
                found = find_field(m, one)
                if _of_body(m, one):
                    faults.append(f"unknown {one!r}: {NOT_MET}")
                elif isinstance(found, str):
                    near = did_you_mean(near_names(one, self._elements, 0.4))
                    faults.append(
                        f"unknown {one!r}: no element or number of that name; {near}" if near else f"unknown {found}"
                    )
                elif one in self.fields:
                    faults.append(f"unknown {one!r} is named twice")
                else:
                    self.fields[one] = found
        faults += clashes(m, self.fields)
        self.others = [name for name, field in self.fields.items() if not self._places_of(name, field)]
        faults += [f"unknown {name!r}: {why}" for name in self.others if (why := self._why_not(name))]

    def _why_not(self, name: str) -> str:
        """Why a number is none to be sought: no position depends on it, or it cannot change by a little; empty where it is one."""
        at, why = list(self.fields).index(name), ""
        # a change that is seen in the last digits of what follows from the number
        for change in (1e-3, -1e-3):
            values = self.declared.copy()
            values[at] += change * (1.0 + abs(values[at]))
            try:
                other = self.mechanism(values)
            except DeclarationError as error:
                why = f"cannot change by a little: {error.faults[0]}"
                continue
            a, b = (declared(one) for one in (self.m, other))
            same = all(np.array_equal(getattr(a, part), getattr(b, part)) for part in (*PLACED, "couplings"))
            same &= [p.type for p in self.m.pairs] == [p.type for p in other.pairs]
            return NOT_MET if same else ""
        return why

    def _expanded(self, name: str) -> list[str]:
        """The numbers of an element: of a pair, of its point or direction, of a named point; a number is itself."""
        axes = XYZ[:2] if self.m.planar else XYZ
        for link in self.m.links:
            if name.startswith(f"{link.name}.") and name.removeprefix(f"{link.name}.") in link.points:
                return [f"{name}.{at}" for at in axes]
        owner, _, what = name.partition(".")
        if owner not in self.m.pair_index or self.m.pairs[k := self.m.pair_index[owner]].contact is not None:
            return [name]
        out = list[str]()
        for side in ("",) if self.m.pairs[k].on_a is None else SIDES:
            own = [f"{side}.{field}".lstrip(".") for field in MARKER]
            if what in ("", side, *own):
                asked = [what] if what in own else own
                out += mattering(self.m, k, [f"{owner}.{field}.{at}" for field in asked for at in axes])
        return out or [name]

    @cached_property
    def _elements(self) -> list[str]:
        """Names of all named points, and of points and directions of pairs, then of their numbers."""
        named = [f"{link.name}.{point}" for link in self.m.links for point in link.points]
        sides = [(pair.name, side) for pair in self.m.pairs for side in (SIDES if pair.on_a is not None else ("",))]
        named += [".".join(filter(None, (name, side, field))) for name, side in sides for field in MARKER[:2]]
        numbers = {name: own for name in named if (own := self._expanded(name)) != [name]}
        return [*numbers, *(number for own in numbers.values() for number in own)]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all numbers."""
        return (*self.fields, *(f"{name}.scale" for name in self.factors))

    @cached_property
    def declared(self) -> Array:
        """Their declared values ``(u,)``."""
        return np.array([*field_values(self.m, self.fields).values(), *(1.0 for _ in self.factors)], dtype=float)

    @cached_property
    def places(self) -> list[list[UnknownPlace]]:
        """For every number its places; of ``others``, in whose arrays nothing else is, the place among these."""
        own = []
        for name, field in self.fields.items():
            unit = 1.0 / (abs(field_values(self.m, {name: field})[name]) or 1.0)
            own.append(
                self._places_of(name, field) or [UnknownPlace("others", 0, self.others.index(name), -1, scale=unit)]
            )
        return own + [[UnknownPlace("factors", 0, i, -1)] for i in range(len(self.factors))]

    def _places_of(self, name: str, field: AnyField) -> list[UnknownPlace]:
        """Places of a number in arrays in which the closure is linear but for motions; none where it follows otherwise."""
        if isinstance(field, Field) and field.array in MARKER:
            (side, component, pair), *_ = field.places
            return [UnknownPlace(field.array, s, component, pair) for s in ((0, 1) if side == slice(None) else (side,))]
        if isinstance(field, Field) and field.array == "pitch":
            k = int(field.places[0][-1])
            return [UnknownPlace("pitch", 0, 0, k, field.scale)] if per_turn(self.m.pairs[k]).any() else []
        if isinstance(field, Field) and field.array == "couplings":
            return [UnknownPlace("couplings", 0, int(field.places[0][0]), -1)]
        if isinstance(field, ChainField):
            return self._place_in_chain(field)
        if isinstance(field, ItemField) and field.what == "links":
            at = field.place[0]
            owner = name.rpartition(".")[0]
            return [
                UnknownPlace("point", 1, int(at), k)
                for k, pair in enumerate(self.whole.pairs[len(self.m.pairs) :], len(self.m.pairs))
                if pair.name.rstrip("'") == owner
            ]
        return []

    def _place_in_chain(self, field: ChainField) -> list[UnknownPlace]:
        """See ``model.mechanism.markers_of_chain``: length and offset of all links but the last are x and z of a point on link a."""
        side, pair = chain_marker(self.m, field)
        numbers, along = self.m.once(chain_numbers), {1: 0, 2: 2}.get(field.kind)
        if along is None or numbers is None:
            return []
        if not side or along == 0:
            return [UnknownPlace("point", side, along, pair, 1.0 - 2.0 * side)]
        twist, varies = (
            numbers[0, field.index],
            any(
                isinstance(other, ChainField) and not other.kind and other.index == field.index
                for other in self.fields.values()
            ),
        )
        return [] if np.sin(twist) or varies else [UnknownPlace("point", side, along, pair, -np.cos(twist))]

    def mechanism(self, values: Array) -> Mechanism:
        """The mechanism with the numbers ``values (u,)``."""
        values = values[: len(self.fields)]
        points = {
            name: value for (name, field), value in zip(self.fields.items(), values, strict=True) if _on_link(field)
        }
        rest = {name: field for name, field in self.fields.items() if name not in points}
        kept = np.array([[v] for name, v in zip(self.fields, values, strict=True) if name in rest]).reshape(-1, 1)
        m = varied(self.m, rest, kept).one(0) if rest else self.m
        if not points:
            return m
        links = list(m.links)
        for name, value in points.items():
            field = self.fields[name]
            assert isinstance(field, ItemField)
            links[field.index] = field.changed(links[field.index], float(value))
        return m.replace(links=links)


def whole_numbers(row: Array) -> tuple[list[int], float]:
    """Whole numbers that are to each other as those of a row, as the teeth of which ratios are made, and their unit."""
    first = next((float(c) for c in row if c), 1.0)
    parts = [Fraction(float(c) / first).limit_denominator(1000) for c in row]
    many = lcm(*(one.denominator for one in parts))
    return [int(one * many) for one in parts], first / many


def echelon(A: Any) -> tuple[Any, Any, int]:
    """Columns of whole numbers ``A (k, m)`` combined so that those behind the rank are zero, ``A U``; the matrix ``U (m, m)``, of which the
    inverse has whole numbers too; and the rank (Hermite).
    """
    A, rank = A.copy(), 0
    U = np.eye(A.shape[1], dtype=int).astype(object)
    for row in range(len(A)):
        while len(some := [j for j in range(rank, A.shape[1]) if A[row, j]]) > 1:
            least = min(some, key=lambda j: abs(A[row, j]))
            for j in some:
                times = A[row, j] // A[row, least] if j != least else 0
                A[:, j], U[:, j] = A[:, j] - times * A[:, least], U[:, j] - times * U[:, least]
        for j in some:
            for M in (A, U):
                M[:, [rank, j]] = M[:, [j, rank]]
            rank += 1
    return A, U, rank


def per_turn(pair: Pair) -> Array:
    """Advance ``(f,)`` of the freedoms of a pair along their axes for a pitch of one; all zero where a pitch moves them otherwise."""
    rows = [(np.array(f.twist[:3]), np.array(f.per_pitch)) for f in pair.type.freedoms]
    out = np.array([w @ per[3:] for w, per in rows])
    alike = all(np.array_equal(per, [0, 0, 0, *(one * w)]) for one, (w, per) in zip(out, rows, strict=True))
    return out if alike else np.zeros(len(out))


def _on_link(field: AnyField) -> bool:
    return isinstance(field, ItemField) and field.what == "links"


def mattering(m: Mechanism, k: int, candidates: Sequence[str]) -> list[str]:
    """Of numbers of the place of a pair as many as the motions that it does depend on, those that tell them apart best."""
    fields = {name: find_field(m, name) for name in candidates}
    known = [name for name, field in fields.items() if isinstance(field, Field)]
    if not known:
        return []
    places = []
    for field in map(fields.__getitem__, known):
        assert isinstance(field, Field)
        (side, component, _), *_ = field.places
        places.append(UnknownPlace(field.array, 0 if side == slice(None) else side, component, k))
    numbers, side = declared(m), [place.side for place in places]
    vectors = [np.moveaxis(getattr(numbers, name)[side, :, k], 0, 1) for name in MARKER]
    twists = marker_twists(vectors, norms_of(*vectors[1:]), unit_rates(places))
    told = m.once(_told, k, side[0]) @ twists[:, :, 0]
    # all places of directions are counted alike, whatever the length of the declared vector
    size = np.abs(told).max(axis=0)
    told = told / np.where(size > MODES.span, size, 1.0) * (size > MODES.span)
    rank = rank_of(singular_values(told), MODES.generic)
    picked = scipy.linalg.qr(told, pivoting=True, mode="r")[1][:rank]
    return [known[i] for i in sorted(picked.tolist())]


def _told(k: int, side: int, m: Mechanism) -> Array:
    """Rows ``(n, 6)`` that vanish for twists of a pair's place, on both links or on that of a side, by which its motions stay the same."""
    pair = m.pairs[k]
    alone = Mechanism(pair.name, [m.link(pair.a), m.link(pair.b)], [pair], planar=m.planar)
    zero = np.zeros((3, 2))
    s = System(alone, None, declared(alone).parameters(alone, zero, zero[:, 0], 1.0))
    # positions at which the motions are compared, each of which may tell in one direction alone
    dq = np.random.default_rng(0).uniform(-1.0, 1.0, (8, s.n_freedoms)).T
    here, rows = Configuration(s, s.advance(s.state_of(np.zeros((s.n_freedoms, 8))), dq)), []
    for i in range(8):
        D, basis = here.poses[..., [i]], span(here.S[:, :, i])
        if pair.on_a is None:
            change = np.eye(6) - move_twist(D[:, :, s.b[0]], np.eye(6))
        else:
            change = move_twist(D[:, :, (s.a, s.b)[side][0]], np.eye(6))
        rows.append(change - basis @ (basis.T @ change))
    return np.concatenate(rows)


@cache
def idle_moves(kind: PairType) -> Array:
    """Directions ``(3, k)``, from its marker, in which the place of a pair may be moved on both links and its motion stays the same."""
    pitch = 1.0 if kind.takes_pitch else None
    pair = Pair("pair", kind, "a", "b", point=(0, 0, 0), axis=(0, 0, 1), second=(1, 0, 0), pitch=pitch)
    told = _told(0, 0, Mechanism(pair.name, [Link("a"), Link("b")], [pair]))
    _, sigma, V = np.linalg.svd(told[:, 3:])
    return np.asarray(V[sigma < MODES.span].T)


def marker_twists(numbers: Sequence[Array], norms: Array, rates: Array) -> Array:
    """Twists ``(6, n, B)`` of markers, in the frames of their links, for rates ``(3, 3, n, B)`` of their points, axes, second directions.

    With ``z = a / |a|`` of an axis ``a (3, n, B)`` and ``x`` of ``s - (z . s) z``, unit, of a second direction ``s``:
    ``z' = (a' - z (z . a')) / |a|``, ``w = (x x x' + y x y' + z x z') / 2``, ``v = p' - w x p`` of a point ``p``. ``norms (2, n, B)`` are
    those of both directions, which over the complex numbers have a sign each.
    """
    (point, axis, second), (dp, da, ds) = numbers, rates
    z = axis / norms[0]
    x = (second - (z * second).sum(axis=0) * z) / norms[1]
    dz = (da - z * (z * da).sum(axis=0)) / norms[0]
    draw = ds - ((dz * second).sum(axis=0) + (z * ds).sum(axis=0)) * z - (z * second).sum(axis=0) * dz
    dx = (draw - x * (x * draw).sum(axis=0)) / norms[1]
    y, dy = cross(z, x), cross(dz, x) + cross(z, dx)
    w = 0.5 * (cross(x, dx) + cross(y, dy) + cross(z, dz))
    return np.concatenate(np.broadcast_arrays(w, dp + cross(point, w)))


def norms_of(axis: Array, second: Array, near: Array | None = None) -> Array:
    """Norms ``(2, ...)`` of axes and of what second directions ``(3, ...)`` have across them, of the signs nearest to others."""
    out: list[Array] = []
    for i in range(2):
        raw = axis if not i else second - (axis * second).sum(axis=0) / out[0] ** 2 * axis
        size = np.sqrt((raw * raw).sum(axis=0))
        out.append(size if near is None else np.where(np.abs(size - near[i]) <= np.abs(size + near[i]), size, -size))
    return np.stack(np.broadcast_arrays(*out))


def unit_rates(places: Sequence[UnknownPlace]) -> Array:
    """Rates ``(3, 3, n, 1)`` of points, axes and second directions of which a component grows at rate one."""
    out = np.zeros((3, 3, len(places), 1))
    for i, place in enumerate(places):
        out[MARKER.index(place.array), place.component, i] = 1.0
    return out
