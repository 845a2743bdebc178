"""Dry friction in pairs: what a user declares; ``mechgraph.force.friction`` solves for it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.fields import NUMBER, POSITIVE, TEXT
from mechgraph.model.loads import BASIC_LOADS, Load, LoadSite
from mechgraph.pairs.factors import UNIT_TWISTS
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import FORCE, LENGTH, unknown, wrong

SINGLE = frozenset(UNIT_TWISTS.values())
"""Twists of freedoms that turn about or slide along an axis of the frame before them."""


@dataclass(frozen=True, eq=False)
class Friction(Load):
    """Declare dry friction in a pair: it acts against the motion, in proportion to the normal forces of the pair.

    A turn about an axis rubs as a journal: couple ``rho |F|`` of the radial force F, ``rho = radius sin(atan mu)`` (the friction
    circle), and ``mu thrust_radius |F_axial|`` where ``thrust_radius`` is given. A slide: ``mu |F|`` at the shoes, ``width`` puts
    them off the axis and bears the moment about it. Turn and slide along one axis share one force. A screw: ``radius |Q| (tan(lead
    +- phi) - +-tan lead)``, ``tan phi = mu / cos flank``. A ball: ``rho |F|`` against the relative angular velocity. A contact:
    ``mu N`` against its sliding. A plane: ``mu |F|`` at the center of pressure against the velocity there, its turn through
    ``radius``. With ``length`` two places ``+-length / 2`` along the axis carry ``F / 2 +- M x z / length``. Solved in ``solve``
    and ``study``, not in ``respond``. Source: J. E. Shigley and J. J. Uicker, Theory of Machines and Mechanisms, 1995, chapter 13
    (friction circle).

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.load("four-bar")
    >>> given = {"A": mg.Motion(0.5, velocity=10.0)}
    >>> smooth, rough = (
    ...     mg.solve(m, given, loads=[*m.loads, *more]) for more in ([], [mg.Friction("A", mu=0.1, radius=0.02)])
    ... )
    >>> more = rough["A"].effort - smooth["A"].effort
    >>> bool(np.isclose(more, 0.02 * np.sin(np.arctan(0.1)) * rough["A"].magnitude)[0]) if (
    ...     np := __import__("numpy")
    ... ) else None
    True
    """

    kind: ClassVar[str] = "friction"
    subject: ClassVar[str] = "friction of {of}"
    of: Annotated[str, TEXT("name of the pair")]
    mu: Annotated[float, NUMBER("coefficient of friction", minimum=0.0)] = field(kw_only=True)
    static: Annotated[float | None, NUMBER("coefficient at rest, `mu` or more", minimum=0.0, default="mu")] = field(
        default=None, kw_only=True
    )
    radius: Annotated[float | None, POSITIVE("of the journal, ball or thread (mean)", LENGTH)] = field(
        default=None, kw_only=True
    )
    thrust_radius: Annotated[float | None, POSITIVE("mean radius of the collar that bears the axial force", LENGTH)] = (
        field(default=None, kw_only=True)
    )
    length: Annotated[
        float | None, POSITIVE("distance of two places along the axis that carry", LENGTH, default="one place")
    ] = field(default=None, kw_only=True)
    width: Annotated[
        float | None, NUMBER("of a guide that b embraces; negative where a embraces b", LENGTH, default="0")
    ] = field(default=None, kw_only=True)
    on: Annotated[str, TEXT("link whose marker is the middle of the places", choices=("a", "b"), default="b")] = field(
        default="b", kw_only=True
    )
    flank: Annotated[
        float, NUMBER("half angle of a thread in the axial section", degrees=True, minimum=0.0, below=0.5 * np.pi)
    ] = field(default=0.0, kw_only=True)
    model: Annotated[
        str,
        TEXT("`circle`: the force that the pair transmits is tangent to the circle; `total`: rho = mu radius", choices=("circle", "total"),
             default="circle"),
    ] = field(default="circle", kw_only=True)  # fmt: skip
    viscous: Annotated[float, NUMBER("effort per rate in every single freedom", minimum=0.0)] = field(
        default=0.0, kw_only=True
    )
    preload: Annotated[float, NUMBER("normal force more at every place", FORCE, minimum=0.0)] = field(
        default=0.0, kw_only=True
    )

    def act(self, site: LoadSite) -> None:
        """What is viscous, ``-viscous x'``; the rest is solved with the reactions, and refused where nothing does so."""
        if not getattr(site, "solves_friction", False):
            raise DeclarationError(
                self.where.removesuffix(": "),
                [
                    "friction follows the reactions, and is solved with them in solve and study alone; pass loads= without it here"
                ],
            )
        for name in site.freedoms_of(self.of) if self.viscous else ():
            site.add_effort(name, -self.viscous * site.freedom(name)[1])

    @property
    def by_position(self) -> bool:
        """Always."""
        return True

    @property
    def follows_reactions(self) -> bool:
        """Yes."""
        return True

    @property
    def coefficient_at_rest(self) -> float:
        """``static``, or mu."""
        return self.mu if self.static is None else self.static

    def faults(self, names: Any) -> list[str]:
        """What is wrong with this load."""
        found = super().faults(names)
        pair = next((p for p in names.pairs if p.name == self.of), None)
        if pair is None:
            return [*found, self.where + unknown("pair", self.of, [p.name for p in names.pairs])]
        if found or not isinstance(pair.type, PairType):
            return found
        if self.static is not None and self.static < self.mu:
            found.append(self.where + wrong(self.static, "static", f"mu = {self.mu:g} or more"))
        return found + [self.where + fault for fault in self._misplaced(pair)]

    def _misplaced(self, pair: Any) -> list[str]:
        """Numbers without meaning for the pair, and those that are missing."""
        row = pair.type
        rows = {
            "journal": rubs_as_journal(row),
            "slide": rubs_as_slide(row),
            "screw": row.takes_pitch,
            "ball": rubs_as_ball(row),
            "plane": rubs_as_plane(row),
        }
        rolls = pair.roller is not None
        if rolls or not (any(rows.values()) or row.touching):
            why = "a roller rolls" if rolls else "nothing of it rubs under a normal force"
            return [
                f"of: pair {pair.name} of type {row.symbol}: {why}; expected one that turns about, slides along or touches at a place"
            ]
        takes = {
            "radius": any(rows[one] for one in ("journal", "screw", "ball", "plane")), "thrust_radius": rows["journal"],
            "width": rows["slide"],
            "length": rows["journal"] or rows["slide"], "flank": rows["screw"],
        }  # fmt: skip
        out = [
            f"{name}: has no meaning for type {row.symbol}; leave it out"
            for name, taken in takes.items()
            if not taken and getattr(self, name)
        ]
        if self.radius is None and takes["radius"] and not rows["plane"]:
            out.append(f"radius: type {row.symbol} turns; give the radius at which it rubs")
        if row.takes_pitch and self.radius is not None:
            lead = np.arctan2(abs(pair.pitch_per_radian), self.radius)
            phi = np.arctan(self.coefficient_at_rest / np.cos(np.arctan(np.tan(self.flank) * np.cos(lead))))
            if lead + phi >= 0.5 * np.pi:
                out.append(
                    f"mu: a thread with lead angle {np.rad2deg(lead):.4g} deg and friction angle {np.rad2deg(phi):.4g} has no finite force"
                )
        return out


def rubs_as_journal(row: PairType) -> bool:
    """Whether it turns about axes under radial forces."""
    return (
        not row.touching
        and not row.takes_pitch
        and _bears(row)
        and any(_is(f, turn=True) for f in row.freedoms)
        and all(row.drivable)
    )


def rubs_as_slide(row: PairType) -> bool:
    """Whether it slides along one axis under forces across it."""
    return not row.touching and _bears(row) and sum(_is(f, turn=False) for f in row.freedoms) == 1


def rubs_as_ball(row: PairType) -> bool:
    """Whether it turns as a ball and bears forces in all directions."""
    return not row.touching and len(row.freedoms) == 3 and not any(row.drivable) and len(row.component_names) == 3


def rubs_as_plane(row: PairType) -> bool:
    """Whether it slides in a plane under a force across it."""
    return (
        not row.touching
        and all(row.drivable)
        and sum(_is(f, turn=False) for f in row.freedoms) == 2
        and row.component_names[:1] == ("Fz",)
    )


def _is(freedom: Any, *, turn: bool) -> bool:
    return freedom.turns is turn and freedom.twist in SINGLE and not any(freedom.per_pitch)


def _bears(row: PairType) -> bool:
    """Whether it bears forces across its axes: at least two components that are forces, in a plane one."""
    return sum(not c.is_couple for c in row.reactions or ()) >= (2 if row.normal is None else 1)


LOADS: dict[str, type[Load]] = {**BASIC_LOADS, Friction.kind: Friction}
"""Load classes by the name of their kind in files."""
