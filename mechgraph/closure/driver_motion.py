"""Prescribed motions of the drivers: the motion of every drive by name, and their values at all positions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.prescription import Prescription, with_free_pairs
from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Drive, Motion
from mechgraph.model.pair import Pair
from mechgraph.quantities import items_of


def _as_motion(m: Mechanism, value: Any, name: str, faults: list[str]) -> Motion | None:
    """A motion in the units of the mechanism; positions alone are at rest."""
    try:
        motion = (value if isinstance(value, Motion) else Motion(value)).without_quantities(m.units, m.turns(name))
        faults += motion.faults(f"motion of {name!r}: ")
        return motion
    except DeclarationError as error:
        faults += [f"drive {name!r}: {fault}" for fault in error.faults]
        return None


class Motions(dict[str, Motion]):
    """Motions by full name, with the ``free`` pairs of points and links whose coordinates are among them."""

    def __init__(self, motions: Mapping[str, Motion], free: Iterable[Pair] = ()) -> None:
        super().__init__(motions)
        self.free = tuple(free)


def driven(m: Mechanism, motions: Mapping[str, Any] | None, asked: str = "solve") -> tuple[Mechanism, Motions]:
    """The mechanism with its drives, and all motions by full name; ``asked`` is what errors name.

    Motions given by name go to the declared drives; the others use the motion stored with them. Where a name is no declared drive, the
    names given are the drives of this call, in place of the declared ones.
    """
    if motions is not None and not isinstance(motions, Mapping):
        raise DeclarationError(
            f"{asked} {m.name!r}",
            [f"motions = {type(motions).__name__}: expected a mapping driver -> motion, e.g. {{'A': angles}}"],
        )
    faults: list[str] = []
    spatial = Prescription(m, faults, motions.free if isinstance(motions, Motions) else ())
    given = {}
    for name, value in dict(motions or {}).items():
        why = m.freedom_fault(name, single=True)
        if why is None:
            given[name] = value
        elif isinstance(name, str):
            spatial.add(name, value)
        else:
            faults.append(f"motion of {name!r}: {why}")
    known = {m.full_name(d.freedom): d for d in m.drives}
    if spatial.motions or any(m.full_name(name) not in known for name in given):
        known = {m.full_name(name): Drive(name) for name in given}
        m = m.replace(drives=list(known.values()))
    out: dict[str, Motion] = {}
    for name, value in given.items():
        if m.full_name(name) in out:
            faults.append(f"motion of {name!r}: {m.full_name(name)} is given twice")
            continue
        motion = _as_motion(m, value, name, faults)
        if motion is not None:
            out[m.full_name(name)] = motion
    for name, drive in known.items():
        if name not in out and drive.motion is not None:
            out[name] = drive.motion
        elif name not in out and not faults:
            faults.append(f"drive {name!r} has no motion; give one: {{{name!r}: angles or mg.Motion(...)}}")
    if faults:
        raise DeclarationError(f"{asked} {m.name!r}", faults)
    return m, Motions({name: out[name] for name in known} | spatial.motions, spatial.free.values())


def _batch(m: Mechanism, motions: Mapping[str, Motion], asked: str) -> tuple[int, ...]:
    try:
        batch = np.broadcast_shapes(*(motion.shape for motion in motions.values()))
        if 0 in batch:
            raise DeclarationError(f"{asked} {m.name!r}", ["the motions have no positions; give at least one"])
        return batch
    except ValueError:
        shapes = ", ".join(f"{name} {motion.shape}" for name, motion in motions.items())
        raise DeclarationError(
            f"{asked} {m.name!r}", [f"the motions describe different numbers of positions: {shapes}"]
        ) from None


def actuators(m: Mechanism, actuate: Any) -> tuple[str, ...]:
    """Full names of the freedoms in which the unknown efforts stand.

    Raises
    ------
    DeclarationError
    """
    faults: list[str] = []
    names = items_of([actuate] if isinstance(actuate, str) else actuate, "actuate", faults)
    faults += [f"actuate {name!r}: {why}" for name in names if (why := m.freedom_fault(name, single=True))]
    if not faults:
        names = tuple(map(m.full_name, names))
        faults += [f"actuate: {name} is given twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    if faults:
        raise DeclarationError(f"solve {m.name!r}", faults)
    return names


class DriverMotion:
    """The mechanism ``m`` with the drives of a call, the motion of each, and the shape of the batch of positions.

    ``actuated`` are the freedoms in which the unknown efforts stand; None: in those whose motion is prescribed.
    """

    def __init__(
        self, m: Mechanism, motions: Mapping[str, Any] | None, actuate: Any = None, asked: str = "solve"
    ) -> None:
        self.m, self.motions = driven(m, motions, asked)
        self.actuated = None if actuate is None else actuators(m, actuate)
        self.batch = _batch(self.m, self.motions, asked)
        self.t = next((motion.t for motion in self.motions.values() if motion.t is not None), None)

    @property
    def free(self) -> tuple[Pair, ...]:
        """The free pairs of points and links whose motion is prescribed."""
        return self.motions.free

    @property
    def shown(self) -> Mechanism:
        """The mechanism that a solution shows: its drives are the freedoms that take the unknown efforts."""
        return self.m if self.actuated is None else self.m.replace(drives=self.actuated)

    @property
    def names(self) -> tuple[str, ...]:
        """Full names of the driven freedoms."""
        return tuple(self.motions)

    @property
    def first(self) -> dict[str, float]:
        """Values of the freedoms of pairs at the first position."""
        own = {self.m.full_name(drive.freedom) for drive in self.m.drives}
        return {
            name: float(np.asarray(self.motions[name].position).reshape(-1)[0]) for name in self.motions if name in own
        }

    def whole(self, start: Configuration) -> Mechanism:
        """The mechanism with the free pairs behind its own, in a closed position."""
        par, X = start.system.par, start.poses[:, :, :, 0]
        R = np.moveaxis(X[:, :3], -1, 0)
        poses = np.tile(np.eye(4), (len(R), 1, 1))
        poses[:, :3, :3] = R
        poses[:, :3, 3] = par.origin + par.L * X[:, 3].T - (R @ par.offset.T[:, :, None])[..., 0]
        q = start.system.coordinates_of(start.x, start.system.start_coordinates(self.m.start))[:, 0]
        return with_free_pairs(self.m, self.free, self.names, poses, q)

    def values(self, kind: str, batch: tuple[int, ...]) -> Array:
        """Driver ``position``, ``velocity`` or ``acceleration`` ``(d, T)`` in the user's units, spread over a batch."""
        T = int(np.prod(batch))
        rows = [np.broadcast_to(getattr(motion, kind), batch).reshape(T) for motion in self.motions.values()]
        return np.array(rows).reshape(len(rows), T)
