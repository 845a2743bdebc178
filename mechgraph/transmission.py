"""How well the drivers move an output against a load: transmission angle, deviation angle, and their form for any mechanism.

The mechanism at rest and without mass, a unit effort in the freedom of the output: pairs (and gears) k transmit wrenches (F, M) to the
output link, M about the point of the pair (of a contact where its elements touch, of a ball or roller its center), where a unit rate of
the freedom makes the velocity v and the angular velocity w:

    sin mu = cos delta = |sum_k F_k . v_k + M_k . w| / sum_k (|F_k| |v_k| + |M_k| |w|),

what the wrenches do over the most that they could do if they were turned about their points. One force alone gives the angle delta between
it and the velocity of its point, and so the transmission angle mu of a planar four-bar, between coupler and output (H. Alt, Der
Uebertragungswinkel, Werkstattstechnik 26, 1932); of a sphere on a plane delta is the angle between the normal and the velocity of the
output where they touch (M. V. Hernandez, thesis, University of Florida, 1983, section 6.6). Where constraints are redundant the wrenches
are those of least norm.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from mechgraph.document import Document, Paragraph, Shown
from mechgraph.errors import DeclarationError, MechgraphWarning
from mechgraph.files import plain
from mechgraph.kinetostatics import solve
from mechgraph.maths.se3 import Array
from mechgraph.model.couplings import Contact
from mechgraph.model.loads import Effort
from mechgraph.quantities import door, wrong
from mechgraph.result.solution import Solution
from mechgraph.result.values import OK, ranges
from mechgraph.result.views import PositionLabels


@dataclass(frozen=True, eq=False, repr=False)
class Transmission(Shown):
    """How well ``drivers`` move the freedom ``output`` at the positions of a solution. Returned by ``transmission``.

    Attributes
    ----------
    drivers, output : tuple of str, str
        Full names of the freedoms.
    index : (...) array
        1 if all that is transmitted moves the output, 0 if nothing does; NaN if the drivers cannot hold it.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 1.0]})
    >>> mg.transmission(s, "D").index.round(3)
    array([0.938, 0.997])
    """

    solution: Solution
    drivers: tuple[str, ...]
    output: str
    index: Array

    @property
    def transmission_angle(self) -> Array:
        """``mu = arcsin(index)``, 0 to pi/2: best at pi/2."""
        return np.arcsin(self.index)

    @property
    def deviation_angle(self) -> Array:
        """``delta = pi/2 - mu``: best at 0."""
        return np.arccos(self.index)

    def document(self) -> Document:
        """Ranges of both angles, and where they are reached."""
        rows = [
            ("transmission angle [deg]", np.rad2deg(self.transmission_angle)),
            ("deviation angle [deg]", np.rad2deg(self.deviation_angle)),
        ]
        places = PositionLabels(self.solution._values)
        text = f"From {', '.join(self.drivers)} to {self.output}, links at rest and without mass."
        return Document(f"Transmission of {self.solution.mechanism.name}", (Paragraph(text), ranges(rows, places.name)))

    def to_dict(self) -> dict[str, Any]:
        """The ranges as plain data."""
        known = self.transmission_angle[np.isfinite(self.index)]
        least, greatest = (float(f(known)) if known.size else None for f in (np.min, np.max))
        return dict(plain(TransmissionData(self.drivers, self.output, least, greatest)))


@dataclass(frozen=True)
class TransmissionData:
    """The range of the transmission angle, in radians; none where the drivers never hold the output."""

    drivers: Annotated[tuple[str, ...], "freedoms in which the efforts stand"]
    output: Annotated[str, "the freedom that is loaded"]
    least: float | None
    greatest: float | None


@door
def transmission(s: Solution, output: str, driver: str | None = None) -> Transmission:
    """Compute transmission index and angle of an output over a solution.

    The index is the power that the transmitted wrench does on the output, over the most that it could do; for one force ``sin mu``.

    Parameters
    ----------
    s : Solution
        A solution.
    output : str
        A single freedom, ``"D"`` or ``"C.Tz"``, of the pair of the output link and the link that guides it.
    driver : str, optional
        The input freedom. Default: those that take the efforts of the solution.

    Returns
    -------
    Transmission

    Raises
    ------
    DeclarationError
        ``output`` is not a freedom, or is the driver.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 1.0]})
    >>> mg.transmission(s, "D").transmission_angle.round(4)
    array([1.2168, 1.4986])
    """
    m = s.mechanism
    named = {"output": output} if driver is None else {"output": output, "driver": driver}
    faults = [f"{what}: {fault}" for what, name in named.items() if (fault := m.freedom_fault(name, single=True))]
    if faults:
        raise DeclarationError(f"transmission of {m.name!r}", faults)
    output, drivers = m.full_name(output), s.actuated if driver is None else (m.full_name(driver),)
    if output in drivers:
        raise DeclarationError(
            f"transmission of {m.name!r}", [wrong(output, "output", "another freedom than a driver")]
        )
    index = _index(_held(s, output, drivers), output, drivers)
    return Transmission(s, drivers, output, np.where((s.status == OK), index, np.nan))


def _held(s: Solution, output: str, drivers: tuple[str, ...]) -> Solution:
    """The links at rest and without mass at the positions of a solution: the drivers hold a unit effort in the output."""
    m, places = s.mechanism, PositionLabels(s._values)
    known = np.flatnonzero(places.solved)
    if not known.size or not s.prescribed:
        raise DeclarationError(f"transmission of {m.name!r}", ["no position with prescribed motion; solve one first"])
    light = m.replace(
        links=[link.replace(mass=0.0, inertia=None) for link in m.links], loads=[Effort(output, 1.0)], response=None
    )
    # where a position was not solved the motion waits at one that was
    at = known[np.clip(np.searchsorted(known, np.arange(places.solved.size), side="right") - 1, 0, None)]
    motions = {name: of[at].reshape(s.batch) for name, of in zip(places.drivers, places.driver_values, strict=True)}
    actuate = None if set(drivers) == set(s.prescribed) else drivers
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechgraphWarning)  # a contact transmits either way here
        return solve(light, motions, actuate=actuate, redundant="minimum_norm", on_reach="flag")


def _index(s: Solution, output: str, drivers: tuple[str, ...]) -> Array:
    """``sin mu`` at all positions of the unloaded mechanism with a unit effort in the output."""
    m = s.mechanism
    k, j = m.freedom(output)
    guide = m.pairs[k]
    link = guide.b if guide.b != m.frame else guide.a
    V = s._values.screws(k)[..., j]
    w = V[..., :3]
    does, could = np.zeros(s.batch), np.zeros(s.batch)
    for F, M, p in _wrenches(s, link, guide.name):
        v = V[..., 3:] + np.cross(w, p)
        does = does + (F * v).sum(axis=-1) + (M * w).sum(axis=-1)
        could = could + _size(F) * _size(v) + _size(M) * _size(w)
    efforts = [s[m.pairs[i].name].effort[..., n] for i, n in map(m.freedom, drivers)]
    # what wrenches on the output could do for a unit effort, below which nothing is transmitted
    held = np.isfinite(np.sum(efforts, axis=0)) & (could > 1e-12)
    return np.where(held, np.minimum(np.abs(does) / np.where(held, could, 1.0), 1.0), np.nan)


def _wrenches(s: Solution, link: str, guide: str) -> list[tuple[Array, Array, Array]]:
    """Force, moment about a point, and that point, of all that acts on a link beside its guide."""
    m, found = s.mechanism, []
    for pair in m.pairs:
        if link in (pair.a, pair.b) and pair.name != guide:
            total = s[pair.name].total
            p = s.contact(pair.name).center if pair.type.touching else s.link(pair.b).point(pair.markers[1].point)[0]
            found.append((total[..., 3:], total[..., :3] - np.cross(p, total[..., 3:]), p))
    for coupling in m.couplings:
        if isinstance(coupling, Contact) and link in coupling.gears(m):
            result = s.coupling(coupling.name)
            found.append((result.force, np.zeros_like(result.force), result.point))
    return found


def _size(v: Array) -> Array:
    return np.asarray(np.linalg.norm(v, axis=-1))
