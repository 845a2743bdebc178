"""Single-loop chains from pair letters, with or without twist, length and offset of every link."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mechgraph.errors import DeclarationError, unknown
from mechgraph.fields import plain
from mechgraph.maths.se3 import Array, identity, inverse
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Marker, Pair
from mechgraph.pairs.pair_type import TABLE
from mechgraph.quantities import LENGTH, PURE, door, is_numeric, items_of, real_array, shown, without_units, wrong

NUMBERS_OF_CHAIN = ("twist", "length", "offset")
"""What places the link after every pair of a chain, in the order of the rows of its numbers."""


def chain_symbols(letters: str) -> tuple[list[str], list[str]]:
    """Split ``"RSgC"`` into symbols of the pair table, the longest first; also the faults."""
    known = sorted(TABLE, key=len, reverse=True)
    symbols: list[str] = []
    at = 0
    if not isinstance(letters, str):
        return symbols, [wrong(letters, "pairs", "letters of pair types in one text, e.g. 'RSSR'")]
    while at < len(letters):
        symbol = next((s for s in known if letters.startswith(s, at)), None)
        if symbol is None and letters[at] in "-_ ":
            at += 1
            continue
        if symbol is None:
            return symbols, [
                f"pairs {letters!r}: no pair type starts with {letters[at:]!r} (known: {', '.join(TABLE)})"
            ]
        symbols.append(symbol)
        at += len(symbol)
    return symbols, []


def _marker(X: Array) -> Marker:
    return Marker(point=X[:, 3].tolist(), axis=X[:, 2].tolist(), second=X[:, 0].tolist())


@door
def chain(
    letters: str,
    *,
    twist: ArrayLike | None = None,
    length: ArrayLike | None = None,
    offset: ArrayLike | None = None,
    pitch: ArrayLike | Mapping[str, float] | None = None,
    name: str | None = None,
    drive: str | None = "O1",
    links: Iterable[Link] | None = None,
    **more: Any,
) -> Mechanism:
    """Declare a single closed loop by its pair letters: links ``frame, link1, ...``, pairs ``O1, O2, ...`` (Lee 1977).

    Around the loop from the frame ``prod_k D_k(q_k) Tz(offset_k) Tx(length_k) Rx(twist_k) = 1``; the numbers ``k`` belong to the link
    after pair ``k`` (the last to the frame). The global frame is marker A of ``O1``; every other link frame is marker B of the pair
    before it. Without numbers the chain is a topology.

    Parameters
    ----------
    letters : str
        E.g. ``"RPRHRRR"``; Sp, Sg, Sc, Cp are recognized, hyphens skipped.
    twist, length, offset : (pairs,) array_like, optional
        [rad, length, length] per pair. Default: 0 if another of them is given.
    pitch : array_like or mapping, optional
        Advance per radian of the helical pairs, in order, or pair -> pitch.
    name : str, optional
        Default: the letters.
    drive : str or None
        Driven pair or freedom.
    links : iterable of Link, optional
        Links with mass, each in the link frame described above; the others are massless.
    **more
        Further fields of ``Mechanism``: loads, start, units, ...

    Returns
    -------
    Mechanism

    Raises
    ------
    DeclarationError
        With every fault.

    Examples
    --------
    >>> import mechgraph as mg
    >>> print(mg.check(mg.chain("RPRHRRR")).verdict)
    1 driver, 50 unknowns, 50 equations: determinate for general geometry (mobility 1).
    """
    title = letters if name is None else name
    symbols, faults = chain_symbols(letters)
    n = len(symbols)
    if not faults and n < 2:
        faults.append(f"pairs {letters!r}: a loop needs at least two pairs")
    numbers = {}
    units = more["units"] if isinstance(more.get("units"), Mapping) else {}
    for what, given in zip(NUMBERS_OF_CHAIN, (twist, length, offset), strict=True):
        values = (0.0,) * n if given is None else without_units(given, PURE if what == "twist" else LENGTH, units)
        numbers[what] = plain(values)
        if not is_numeric(values, (n,)):
            faults.append(wrong(values, what, f"{n} finite numbers, one a pair"))
    pitches, pitch_faults = _pitches(symbols, without_units(pitch, LENGTH, units))
    faults += pitch_faults
    names = ["frame", *(f"link{k}" for k in range(1, n))]
    massive: dict[str, Link] = {}
    for link in items_of(() if links is None else links, "links", faults):
        if isinstance(link, Link) and isinstance(link.name, str) and link.name in names:
            massive[link.name] = link
        else:
            faults.append(unknown("link", getattr(link, "name", link), names))
    fields = set(inspect.signature(Mechanism).parameters)
    faults += [unknown("field", name, sorted(fields)) for name in sorted(set(more) - fields)]
    if faults:
        raise DeclarationError(f"chain {shown(title)}", faults)
    placed = any(v is not None for v in (twist, length, offset))
    poses = markers_of_chain(np.array(list(numbers.values()))[:, :, None])
    pairs = []
    for k, symbol in enumerate(symbols):
        markers: dict[str, Any] = {}
        if placed:
            markers = {side: _marker(X[:, :, k, 0]) for side, X in zip(("on_a", "on_b"), poses, strict=True)}
        pairs.append(Pair(f"O{k + 1}", symbol, names[k], names[(k + 1) % n], pitch=pitches.get(k), **markers))
    if drive is not None:
        more.setdefault("drives", [_first_freedom(pairs, drive)])
    return Mechanism(title, [massive.get(link, Link(link)) for link in names], pairs, **more)


def _first_freedom(pairs: list[Pair], drive: str) -> str:
    """The drive as given; for a pair with several freedoms its first."""
    pair = next((p for p in pairs if isinstance(drive, str) and p.name == drive), None)
    return pair.freedom_names[0] if pair is not None and pair.type.f > 1 else drive


def _pitches(symbols: list[str], pitch: Any) -> tuple[dict[int, float], list[str]]:
    takers = [k for k, symbol in enumerate(symbols) if TABLE[symbol].takes_pitch]
    if pitch is None:
        return {}, []
    if isinstance(pitch, Mapping):
        names = {f"O{k + 1}": k for k in takers}
        strange = [f"pitch: {shown(key)} is no helical pair of this chain" for key in pitch if key not in names]
        return {names[key]: value for key, value in pitch.items() if key in names}, strange
    array = real_array(pitch)
    if array is None:
        return {}, [wrong(pitch, "pitch", "numbers, or a mapping pair -> pitch")]
    values = array.reshape(-1).tolist()
    if len(values) == len(symbols) and len(takers) < len(symbols):
        values = [values[k] for k in takers]
    if len(values) != len(takers):
        return {}, [f"pitch: {len(values)} given for {len(takers)} helical pairs"]
    return dict(zip(takers, values, strict=True)), []


def markers_of_chain(numbers: Array) -> tuple[Array, Array]:
    """Poses ``(3, 4, n, B)`` of the markers on links a and b of the pairs of a chain, from its numbers ``(3, n, B)``.

    ``numbers`` are twist, length and offset. Marker A of the first pair and marker B of all but the last are the link frames.
    """
    twist, length, offset = numbers
    steps = np.zeros((3, 4, *twist.shape))
    steps[0, 0] = 1.0
    steps[1, 1] = steps[2, 2] = np.cos(twist)
    steps[2, 1], steps[1, 2] = np.sin(twist), -np.sin(twist)
    steps[0, 3], steps[2, 3] = length, offset
    plain_frames = identity(*twist.shape)
    on_a = np.concatenate([plain_frames[:, :, :1], steps[:, :, :-1]], axis=2)
    on_b = np.concatenate([plain_frames[:, :, :-1], inverse(steps[:, :, -1:])], axis=2)
    return on_a, on_b


def chain_numbers(m: Mechanism) -> Array | None:
    """Twist, length and offset ``(3, n)`` of a mechanism that stands as ``chain`` places it; None of any other."""
    if any(p.on_a is None or p.on_b is None for p in m.pairs):
        return None
    poses = [[pair.markers[side].pose() for pair in m.pairs] for side in (0, 1)]
    steps = [*poses[0][1:], inverse(poses[1][-1][:, :, None])[:, :, 0]]
    numbers = np.array([[np.arctan2(X[2, 1], X[1, 1]), X[0, 3], X[2, 3]] for X in steps]).T
    again = markers_of_chain(numbers[:, :, None])
    ends = [(p.a, p.b) for p in m.pairs]
    ring = all(one[1] == following[0] for one, following in zip(ends, [*ends[1:], ends[0]], strict=True))
    same = all(np.allclose(np.stack(part, axis=2), made[..., 0]) for part, made in zip(poses, again, strict=True))
    return numbers if ring and ends[0][0] == m.frame and same else None
