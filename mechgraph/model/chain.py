"""Single-loop chains from pair letters, with or without twist, length and offset of every link."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array, compose, identity, inverse
from mechgraph.errors import DeclarationError
from mechgraph.model.connection import Marker, Pair
from mechgraph.model.link import Link
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import TABLE
from mechgraph.model.values import is_numeric, plain


def chain_symbols(letters: str) -> tuple[list[str], list[str]]:
    """Split ``"RSgC"`` into symbols of the pair table, the longest first; also the faults."""
    known = sorted(TABLE, key=len, reverse=True)
    symbols: list[str] = []
    at = 0
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


def _link_step(offset: float, length: float, twist: float) -> Array:
    """``Tz(offset) Tx(length) Rx(twist)``."""
    c, s = np.cos(twist), np.sin(twist)
    return np.array([[1.0, 0, 0, length], [0, c, -s, 0], [0, s, c, offset]])


def _marker(X: Array) -> Marker:
    return Marker(point=X[:, 3].tolist(), axis=X[:, 2].tolist(), second=X[:, 0].tolist())


def chain(
    letters: str,
    *,
    twist: Sequence[float] | None = None,
    length: Sequence[float] | None = None,
    offset: Sequence[float] | None = None,
    pitch: Sequence[float] | Mapping[str, float] | None = None,
    name: str | None = None,
    drive: str | None = "O1",
    links: Iterable[Link] | None = None,
    **more: Any,
) -> Mechanism:
    """A single closed loop from pair letters: links ``frame, link1, ...``, pairs ``O1, O2, ...`` (Lee 1977).

    Going round from the frame, ``prod_k D_k(q_k) Tz(offset_k) Tx(length_k) Rx(twist_k) = 1``; the numbers ``k`` belong to the
    link after pair ``k`` (the last to the frame). The global frame is marker A of ``O1``, every other link frame is marker B
    of the pair before it. Without numbers the chain is a topology.

    Parameters
    ----------
    letters : e.g. ``"RPRHRRR"``; Sp, Sg, Sc, Cp are recognised, hyphens skipped.
    twist, length, offset : one number a pair; left out (with another given) they are zero.
    pitch : advance per radian of the helical pairs: one number each in order, or a mapping pair -> pitch.
    drive : the driven pair or freedom; None for none.
    links : links with mass, each in the link frame said above; those left out are massless.
    more : further fields of ``Mechanism`` (loads, start, units, ...).

    Raises
    ------
    DeclarationError
        with all faults at once.
    """
    title = name or letters
    symbols, faults = chain_symbols(letters)
    n = len(symbols)
    if not faults and n < 2:
        faults.append(f"pairs {letters!r}: a loop needs at least two pairs")
    numbers = {}
    for what, values in (("twist", twist), ("length", length), ("offset", offset)):
        numbers[what] = (0.0,) * n if values is None else plain(values)
        if values is not None and not is_numeric(values, (n,)):
            faults.append(f"{what} = {values!r}: expected {n} finite numbers, one a pair")
    pitches, pitch_faults = _pitches(symbols, pitch)
    faults += pitch_faults
    given = {link.name: link for link in links or ()}
    names = ["frame", *(f"link{k}" for k in range(1, n))]
    faults += [f"link {k!r}: is not in this chain (links: {', '.join(names)})" for k in given if k not in names]
    if faults:
        raise DeclarationError(f"chain {title!r}", faults)
    placed = any(v is not None for v in (twist, length, offset))
    steps = [
        _link_step(o, a, t) for o, a, t in zip(numbers["offset"], numbers["length"], numbers["twist"], strict=True)
    ]
    pairs = []
    for k, symbol in enumerate(symbols):
        markers: dict[str, Any] = {}
        if placed:
            on_a = identity() if k == 0 else steps[k - 1]
            on_b = identity() if k < n - 1 else inverse(compose(identity(), steps[-1]))
            markers = {"on_a": _marker(on_a), "on_b": _marker(on_b)}
        pairs.append(Pair(f"O{k + 1}", symbol, names[k], names[(k + 1) % n], pitch=pitches.get(k), **markers))
    if drive is not None:
        more.setdefault("drives", [_first_freedom(pairs, drive)])
    return Mechanism(title, [given.get(link, Link(link)) for link in names], pairs, **more)


def _first_freedom(pairs: list[Pair], drive: str) -> str:
    """The drive as given; for a pair with several freedoms its first."""
    pair = next((p for p in pairs if p.name == drive), None)
    return pair.freedom_names[0] if pair is not None and pair.type.f > 1 else drive


def _pitches(symbols: list[str], pitch: Any) -> tuple[dict[int, float], list[str]]:
    takers = [k for k, symbol in enumerate(symbols) if TABLE[symbol].takes_pitch]
    if pitch is None:
        return {}, []
    if isinstance(pitch, Mapping):
        names = {f"O{k + 1}": k for k in takers}
        wrong = [f"pitch: {key!r} is no helical pair of this chain" for key in pitch if key not in names]
        return {names[key]: value for key, value in pitch.items() if key in names}, wrong
    try:
        values = list(np.asarray(pitch, dtype=float).reshape(-1))
    except (TypeError, ValueError):
        return {}, [f"pitch = {pitch!r}: expected numbers, or a mapping pair -> pitch"]
    if len(values) == len(symbols) and len(takers) < len(symbols):
        values = [values[k] for k in takers]
    if len(values) != len(takers):
        return {}, [f"pitch: {len(values)} given for {len(takers)} helical pairs"]
    return dict(zip(takers, map(float, values), strict=True)), []
