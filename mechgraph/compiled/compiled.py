"""A mechanism that stays hot: efforts, reactions and positions of one state after the other, from the compiled kernel."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any, NoReturn

import numpy as np

from mechgraph.compiled.fmu import InputsName, write_tables
from mechgraph.compiled.tabled import STATUSES, Tabled, tabled
from mechgraph.errors import DeclarationError, listed
from mechgraph.kernel import build
from mechgraph.kernel.tables import START
from mechgraph.maths.se3 import Array, turn_tangent
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import door, has_quantity, is_numeric, real_array, with_doors, without_units, wrong

WORDS = np.array([word for _, word, _ in STATUSES])
OPENING = 1e-6
"""Change of a number, relative, with which redundant loops have to close still; far above their rounding."""
PARTINGS = 12
"""Halvings of a change of parameters, until the loops are closed by small corrections."""


@door
def compile(m: Mechanism) -> Compiled:
    """Keep a mechanism ready in the compiled kernel, for one position after another: control loops, optimizers, real time.

    Dry friction in pairs acts against the motion; where nothing moves efforts are those without it.

    Parameters
    ----------
    m : Mechanism
        The mechanism, with declared drives.

    Returns
    -------
    Compiled

    Raises
    ------
    DeclarationError
        Names what the kernel cannot carry: curves, surfaces, loads that are functions, links with several passive freedoms, gears and
        belts whose centers move.
    MissingExtraError
        The kernel was not installed, and there is no C compiler.

    Examples
    --------
    >>> import mechgraph as mg
    >>> c = mg.compile(mg.load("7r"))
    >>> effort = c(c.position("O1") + 0.3, velocity=10.0)
    >>> print(effort.round(4), c.status)
    [0.2823] ok
    """
    return Compiled(tabled(m))


@cache
def _functions() -> ctypes.CDLL:
    """The kernel, its functions declared so that addresses are passed as they are."""
    library = build.built()
    pointer, whole = ctypes.c_void_p, ctypes.c_int
    library.mgk_state_size.argtypes, library.mgk_state_size.restype = [pointer], ctypes.c_size_t
    library.mgk_start.argtypes = [pointer] * 3
    library.mgk_table.argtypes = [*[pointer] * 3, whole, *[pointer] * 6]
    for of_state in (library.mgk_poses, library.mgk_drives):
        of_state.argtypes, of_state.restype = [pointer] * 4, None
    library.mgk_derivative_size.argtypes, library.mgk_derivative_size.restype = [pointer, whole], ctypes.c_size_t
    library.mgk_derivative.argtypes = [*[pointer] * 3, whole, *[pointer] * 6]
    return library


class CompiledParameters(MutableMapping[str, float]):
    """Declared numbers by the names that studies use (``crank.mass``, ``length[2]``), to be set in place; those that were set are listed.

    What is set counts from the next call on; what is deleted is as declared again. What no declaration could have, beside what was set
    before, is refused at once; numbers that are possible only together, as those of an inertia, are set by ``update``.
    """

    def __init__(self, tables: Tabled, wanted: Mapping[str, float] | None = None) -> None:
        self._tables = tables
        self.wanted = dict(wanted or {})

    def __getitem__(self, name: str) -> float:
        declared = self._tables.known(name)
        return self.wanted.get(name, declared)

    def __setitem__(self, name: str, value: float) -> None:
        self.update({name: value})

    def update(self, *given: Any, **named: Any) -> None:
        """Set several at once, as those of a dict; all of them or none."""
        values = dict(*given, **named)
        for name, value in values.items():
            self._tables.known(name)
            if not is_numeric(value, ()):
                raise DeclarationError(
                    f"parameters of {self._tables.m.name!r}", [wrong(value, name, "a finite number")]
                )
        together = self.wanted | {name: float(value) for name, value in values.items()}
        self._tables.possible(together)
        self.wanted = together

    def __delitem__(self, name: str) -> None:
        self._tables.known(name)
        self.wanted.pop(name, None)

    def __iter__(self) -> Iterator[str]:
        return iter(self.wanted)

    def __len__(self) -> int:
        return len(self.wanted)

    def __repr__(self) -> str:
        return f"CompiledParameters({self.wanted})"


class _Room:
    """Where the motion and the results of ``n`` positions stand, and the call that fills them."""

    def __init__(self, of: Compiled, n: int, state: Array) -> None:
        t, self.of, self.n, self.state = of.tables, of, n, state
        self.motion, self.effort = np.zeros((3, n, len(t.drives))), np.zeros((n, len(t.drives)))
        self.numbers: Any = self.motion.reshape(-1).data  # numbers are put in faster than by numpy
        self.reaction, self.position = np.zeros((n, len(t.m.pairs), 6)), np.zeros((n, t.system.n_freedoms))
        self.poses, self.status = np.zeros((n, len(t.m.links), 3, 4)), np.zeros(n, dtype=np.intc)
        self.library = _functions()
        parts = (of.I, of.P, state), (self.motion, self.effort, self.reaction, self.position, self.status)
        known, own = ([part.ctypes.data for part in some] for some in parts)
        self.run = partial(self.library.mgk_table, *known, n, *own, self.poses.ctypes.data if n > 1 else None)

    def links(self) -> Array:
        """Poses of all links ``(n, N, 4, 4)``; of one position found when they are asked for."""
        if self.n == 1:
            self.library.mgk_poses(*(part.ctypes.data for part in (self.of.I, self.of.P, self.state, self.poses)))
        return np.where(self.status[:, None, None, None] == 0, self.of.tables.poses(self.poses), np.nan)

    def refuse(self, status: int) -> None:
        """No results."""
        self.status[:] = status
        for values in (self.effort, self.reaction, self.position):
            values[:] = np.nan

    def values(self) -> tuple[Any, ...]:
        """The motion and the results."""
        return self.motion, self.effort, self.reaction, self.position, self.poses, self.status


class Compiled:
    """A mechanism kept ready in the compiled kernel. Returned by ``compile``.

    ``c(q, velocity=0.0, acceleration=0.0)`` returns the efforts of the drives, ``(d,)`` or ``(n, d)``; each call continues from the
    last position. Calls release Python's lock; give every thread its own ``copy``.

    Attributes
    ----------
    drives : tuple of str
        Driven freedoms, in the order of their numbers in a call.
    parameters : mapping
        Declared numbers by name; set them in place.
    status : str or array
        ``"ok"``, or why the last call was refused.

    Examples
    --------
    >>> import mechgraph as mg
    >>> c = mg.compile(mg.load("7r"))
    >>> c.drives, c.reaction("O3").shape
    (('O1.Rz',), (6,))
    """

    def __init__(self, tables: Tabled, kept: Mapping[str, Any] | None = None) -> None:
        self.tables, self.drives, self.I = tables, tables.drives, tables.I
        size = _functions().mgk_state_size(self.I.ctypes.data) // 8 + 1
        self.P, self.home, self.state = tables.P.copy(), np.zeros(size), np.zeros(size)
        self._values: dict[str, float] = {}
        self._parameters = CompiledParameters(tables)
        self._one, self._single = _Room(self, 1, self.state), True
        self._last = self._one
        if kept is None:
            _functions().mgk_start(*(part.ctypes.data for part in (self.I, self.P, self.home)))
            self.start()
            return
        self._values, self._parameters = dict(kept["set"]), CompiledParameters(tables, kept["wanted"])
        self._single = kept["single"]
        if not self._single:
            self._last = _Room(self, len(kept["results"][-1]), self.state)
        mine = self.P, self.home, self.state, *self._last.values()
        for array, value in zip(mine, (*kept["numbers"], *kept["results"]), strict=True):
            array[:] = value

    def copy(self) -> Compiled:
        """Return an independent copy with its own state, parameters and results.

        Returns
        -------
        Compiled
        """
        return Compiled(self.tables.copy(), self._kept())

    __copy__ = copy

    def __reduce__(self) -> tuple[Any, ...]:
        return Compiled, (self.tables, self._kept())

    def _kept(self) -> dict[str, Any]:
        """What is its own: numbers that were set and are wanted, states, and the last results."""
        return {
            "set": self._values, "wanted": self._parameters.wanted, "single": self._single,
            "numbers": (self.P, self.home, self.state), "results": self._last.values(),
        }  # fmt: skip

    @property
    def parameters(self) -> CompiledParameters:
        """Declared numbers by name, to be set in place: ``c.parameters["crank.mass"] = 2.0``."""
        return self._parameters

    def __repr__(self) -> str:
        return f"Compiled({self.tables.m.name!r}, drives {listed(self.drives)}, {self.status})"

    # --- calls -------------------------------------------------------------------------------------------------------------

    def __call__(self, q: Any, velocity: Any = 0.0, acceleration: Any = 0.0) -> Array:
        """Return the efforts of the drives at a position, reached from the last good one along a straight line in certified steps.

        If a step is refused, all results are NaN, ``status`` says why, and the next call continues from the last good position.

        Parameters
        ----------
        q : float, (d,) or (n, d) array_like
            Driver positions [rad, length]; ``(n, d)`` are solved one after another, and all results get a leading axis.
        velocity, acceleration : array_like
            Of the drives, broadcast against ``q``.

        Returns
        -------
        (d,) or (n, d) array

        Raises
        ------
        DeclarationError
            Shapes do not fit, numbers are not finite, or ``parameters`` declare no mechanism.

        Examples
        --------
        >>> import mechgraph as mg
        >>> c = mg.compile(mg.load("7r"))
        >>> c(c.position("O1") + [[0.1], [0.2]]).shape, c.status.shape
        ((2, 1), (2,))
        """
        room = self._one
        given = isinstance(q, float) and isinstance(velocity, float) and isinstance(acceleration, float)  # numpy's too
        if given and len(self.tables.drives) == 1:
            single, numbers = True, room.numbers
            numbers[0], numbers[1], numbers[2] = q, velocity, acceleration
        else:
            room, single = self._read(q, velocity, acceleration)
        status = self._led() if self._values != self._parameters.wanted else 0
        if status:
            room.refuse(status)
        elif room.run():
            self._refuse("a coordinate, velocity or acceleration is not finite")
        self._last, self._single = room, single
        return room.effort[0].copy() if single else room.effort.copy()

    def start(self) -> None:
        """Return to the declared position, at rest.

        Examples
        --------
        >>> import mechgraph as mg
        >>> c = mg.compile(mg.load("7r"))
        >>> home, effort = c.position("O1"), c(c.position("O1") + 0.3)
        >>> c.start()
        >>> bool(c.position("O1") == home)
        True
        """
        self.state[:] = self.home
        self(self.tables.home)

    def _read(self, q: Any, velocity: Any, acceleration: Any) -> tuple[_Room, bool]:
        """The motion in a room for it; whether it is one position."""
        d = len(self.tables.drives)
        given = [self._plain(*item) for item in enumerate((q, velocity, acceleration))]
        shape = given[0].shape
        single = shape == (d,) or (d == 1 and shape == ())
        if not single and (len(shape) != 2 or shape[1] != d):
            self._refuse(f"q has the shape {shape}; expected ({d},) or (n, {d}), for {listed(self.tables.drives)}")
        room = self._one if single else _Room(self, shape[0], self.state)
        try:
            for kind, value in zip(room.motion, given, strict=True):
                kind[...] = value
        except ValueError:
            rates = " and ".join(str(value.shape) for value in given[1:])
            self._refuse(
                f"velocity and acceleration have the shapes {rates}; expected such as go with that of q, {shape}"
            )
        return room, single

    def _plain(self, order: int, value: Any) -> Array:
        """Coordinates of the drives (order 0), rates or accelerations as an array; quantities in the units of the mechanism."""
        m, drives = self.tables.m, self.tables.drives
        if has_quantity(value) and len({m.turns(name) for name in drives}) == 1:
            value = without_units(value, (0 if m.turns(drives[0]) else 1, 0, -order), m.units)
        found = real_array(value)
        if found is None:
            self._refuse(wrong(value, ("q", "velocity", "acceleration")[order], "numbers"))
        return found

    def _refuse(self, fault: str) -> NoReturn:
        raise DeclarationError(f"compiled {self.tables.m.name!r}", [fault])

    # --- results -----------------------------------------------------------------------------------------------------------

    @property
    def status(self) -> Any:
        """``"ok"``, or why the last call was refused; of ``(n, d)`` positions an array of words."""
        return self._shown(WORDS[self._last.status])

    def reaction(self, pair: str) -> Array:
        """Return the wrench of link a on link b at the last position, (M, F) about the global origin.

        Parameters
        ----------
        pair : str
            Name of the pair.

        Returns
        -------
        (6,) array
        """
        return np.array(self._shown(self._last.reaction[:, self.tables.m.place_of_pair(pair)]))

    def position(self, pair: str) -> Array:
        """Return the coordinates of a pair at the last position.

        Parameters
        ----------
        pair : str
            Name of the pair.

        Returns
        -------
        (f,) array
        """
        return np.array(self._shown(self._last.position[:, self.tables.columns(pair)]))

    def link(self, name: str) -> Array:
        """Return the pose of a link frame at the last position.

        Parameters
        ----------
        name : str
            Name of the link.

        Returns
        -------
        (4, 4) array
        """
        return np.array(self._shown(self._last.links()[:, self.tables.m.place_of_link(name)]))

    def _shown(self, values: Any) -> Any:
        return values[0] if self._single else values

    def gradient(self, output: str, names: Sequence[str]) -> Array:
        """Compute the exact derivatives of an output at the last position by declared numbers, with unchanged drive motion.

        Parameters
        ----------
        output : str
            ``"A.effort"`` of a drive, ``"B.position"`` or ``"B.reaction"``.
        names : sequence of str
            Names in ``parameters``.

        Returns
        -------
        (names,), (f, names) or (6, names) array
            NaN if the last call was refused, and for a number that opens redundant loops (an axis rotated out of parallel).

        Raises
        ------
        DeclarationError
            Unknown names, or passive freedoms: the places of their links depend on the whole path.

        Examples
        --------
        >>> import mechgraph as mg
        >>> c = mg.compile(mg.load("7r"))
        >>> effort = c(c.position("O1") + 0.3, velocity=10.0)
        >>> c.gradient("O1.effort", ["length[2]", "link3.mass"]).round(4)
        array([-1.1103,  0.543 ])
        """
        of, place = self._output(output)
        if self.tables.layout.shapes["holds"][0]:
            self._refuse(
                "gradient: there are passive freedoms, and where their links stand hangs on the whole way there; solve mechanisms with "
                "other numbers from their starts, and take differences"
            )
        names = [names] if isinstance(names, str) else list(names)
        columns = [self._derivatives(name)[of].reshape(-1)[place] for name in names]
        return np.stack(columns, axis=-1) if columns else np.zeros((*np.shape(place), 0))

    def _output(self, output: Any) -> tuple[int, Any]:
        """Which of efforts, reactions and positions an output is, and its places there."""
        t = self.tables
        owner, _, part = output.rpartition(".") if isinstance(output, str) else ("", "", "")
        if part == "effort" and t.m.freedom_fault(owner, single=True) is None and t.m.full_name(owner) in t.drives:
            return 0, t.drives.index(t.m.full_name(owner))
        if part == "reaction" and owner in t.m.pair_index:
            return 1, 6 * t.m.place_of_pair(owner) + np.arange(6)
        if part == "position" and owner in t.m.pair_index:
            columns = np.arange(t.system.n_freedoms)[t.columns(owner)]
            return 2, columns[0] if len(columns) == 1 else columns
        example = f"'{t.drives[0]}.effort', '{t.m.pairs[-1].name}.position' or '{t.m.pairs[-1].name}.reaction'"
        return self._refuse(wrong(output, "output", f"e.g. {example}"))

    def _derivatives(self, name: str) -> list[Array]:
        """Efforts, reactions and positions, by one number."""
        t, room = self.tables, self._last
        values = {name: t.known(name), **self._values}
        out = [np.full(part.shape[1:], np.nan) for part in (room.effort, room.reaction, room.position)]
        if room.status[-1] or not self._closes_beside(name, values[name]):
            return out
        dP, motion = t.derivative(values, name), np.ascontiguousarray(room.motion[:, -1])
        memory = np.empty(_functions().mgk_derivative_size(self.I.ctypes.data, len(dP)) // 16 + 1, dtype=complex)
        known = [part.ctypes.data for part in (self.I, self.P, dP)]
        rest = [part.ctypes.data for part in (memory, self.state, motion, *out)]
        if _functions().mgk_derivative(*known, len(dP), *rest):
            return [np.full_like(part, np.nan) for part in out]
        for g in t.rotations:
            out[2][g] = turn_tangent(room.position[-1, g], out[2][g])
        return out

    def _closes_beside(self, name: str, value: float) -> bool:
        """Whether redundant loops close with a number a little off; where they do not nothing has a derivative by it."""
        if not self.tables.layout.shapes["stress"][0]:
            return True
        other = self.copy()
        other.parameters[name] = value + OPENING * (abs(value) or 1.0)
        try:
            other(self._last.motion[0, -1])
        except DeclarationError:  # a mass or an inertia that no body has: no loop knows of it
            return True
        return bool(other.status == "ok")

    def write(self, path: str | os.PathLike[str], name: str | None = None, inputs: InputsName = "motion") -> None:
        """Write the mechanism as C99 (``press.c``, ``press.h``) or as a unit for co-simulation (``.fmu``, FMI 2.0), with its present
        parameters.

        The C code uses no heap and only the mathematics of the C library: ``press_start``, ``press_state_size``, ``press_solve``.

        Parameters
        ----------
        path : str or path
            The file.
        name : str, optional
            Prefix of the symbols. Default: the name of the file.
        inputs : {"motion", "efforts"}
            With ``"efforts"`` it also integrates the motion under driver efforts (``press_begin``, ``press_step``: adaptive steps).

        Raises
        ------
        DeclarationError
            ``name`` is not an identifier of C, or the loops do not close with the parameters.
        FileError
            The file cannot be written.
        MissingExtraError
            An ``.fmu`` without a C compiler.
        """
        if self._values != self.parameters.wanted and (status := self._led()):
            self._refuse(f"the declared position cannot be led to the parameters: {WORDS[status]}")
        P, x = self.P.copy(), len(self.tables.x)
        P[START : START + x] = self.home[:x]
        write_tables(replace(self.tables, P=P), path, name, inputs)

    # --- parameters --------------------------------------------------------------------------------------------------------

    def _led(self) -> int:
        """Lead the declared position and the last good one to the numbers wanted; a status, and nothing changed, where that fails."""
        wanted, names = dict(self.parameters.wanted), {**self._values, **self.parameters.wanted}
        begin, goal = ({name: of.get(name, self.tables.known(name)) for name in names} for of in (self._values, wanted))
        arrays = (self.P, self.home, self.state)
        before, done, step = [array.copy() for array in arrays], 0.0, 1.0
        while done < 1.0:
            part, kept = min(1.0, done + step), [array.copy() for array in arrays]
            values = {name: (1.0 - part) * begin[name] + part * goal[name] for name in goal}
            self.P[:] = self.tables.numbers(values)[0]
            status = self._closed(self.home, self.tables.home) or self._closed(self.state, self._drives())
            if not status:
                done = part
                continue
            step *= 0.5
            failed = step < 0.5**PARTINGS
            for array, old in zip(arrays, before if failed else kept, strict=True):
                array[:] = old
            if failed:
                return status
        self._values = wanted
        return 0

    def _drives(self) -> Array:
        """Where the drives stand in the last good position."""
        out = np.zeros(len(self.tables.drives))
        _functions().mgk_drives(*(part.ctypes.data for part in (self.I, self.P, self.state, out)))
        return out

    def _closed(self, state: Array, q: Array) -> int:
        """Close a state with the numbers as they are now, the drives standing at ``q``; its status."""
        room = _Room(self, 1, state)
        room.motion[0] = q
        room.run()
        return int(room.status[0])


with_doors(Compiled)
