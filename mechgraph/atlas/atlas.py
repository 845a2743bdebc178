"""``mg.atlas``: all kinematic chains of a kind; saved, and read again."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from os import PathLike
from pathlib import Path
from typing import Annotated

from mechgraph.arguments import Count, Index, at_least, door
from mechgraph.atlas.chain import Chain, data_faults, family_faults
from mechgraph.atlas.generate import Wanted, chains
from mechgraph.errors import DeclarationError, FileError, counted
from mechgraph.model.pair_table import TABLE
from mechgraph.quantities import wrong
from mechgraph.reading import text_of
from mechgraph.writing import write_whole

MOST_JOINTS = 60
"""Pairs beyond which no chain is looked for: of more, no one could read the list."""
FIELDS = ("links", "joints", "types", "family")
"""What a saved chain holds."""


@door
def atlas(
    links: Annotated[int, at_least(2)],
    mobility: Index = 1,
    *,
    joints: Count | None = None,
    family: int = 3,
    types: str | Sequence[str] = ("R",),
    multiple: bool = False,
    fractionated: bool = False,
) -> Iterator[Chain]:
    """All kinematic chains of a kind up to isomorphism, none with a rigid part (but for the whole where mobility is 0), one by one.

    Parameters
    ----------
    links : number of links, the frame among them.
    mobility : Dobrovolski's count, with one link as frame: M = sum of freedoms - (6 - family) (joints - links + 1).
    joints : number of pairs (a multiple joint of k links counts k - 1); left out, every number that fits.
    family : freedoms that no link has, 0 to 5: 3 for planar (and spherical) chains, 0 for spatial ones.
    types : symbols of the pair types that are allowed. A planar loop needs two turns (with fewer it is of family 4).
    multiple : whether several links may share a turning joint.
    fractionated : the chains that one link (or joint) parts when it is taken out, instead of those that none does.

    Raises
    ------
    DeclarationError
        with all faults at once.
    """
    faults = family_faults(family)
    symbols = (types,) if isinstance(types, str) else tuple(types)
    faults += [wrong(t, "types", f"symbols of the pair table: {', '.join(TABLE)}") for t in symbols if t not in TABLE]
    if not faults:
        most = 6 - family
        have = {1: "none", 2: "1"}.get(most, f"1 to {most - 1}")
        faults += [
            f"types {t!r}: has {counted(TABLE[t].f, 'freedom')}; a pair of a chain of family {family} has {have}"
            for t in symbols
            if not 0 < TABLE[t].f < most
        ]
    if faults or not symbols:
        raise DeclarationError("atlas", faults or ["types: is empty; allow at least one pair type, e.g. 'R'"])
    rows = tuple(TABLE[t] for t in dict.fromkeys(symbols))
    counts = (joints,) if joints is not None else range(links, MOST_JOINTS)
    kinds = (Wanted(links, count, mobility, family, rows, multiple) for count in counts)
    fitting = (w for w in kinds if _fits(w))
    return (chain for wanted in fitting for chain in chains(wanted, fractionated))


def _fits(wanted: Wanted) -> bool:
    """Whether pairs of these types can have that many freedoms."""
    freedoms = [t.f for t in wanted.types]
    return wanted.loops > 0 and min(freedoms) * wanted.joints <= wanted.freedoms <= max(freedoms) * wanted.joints


@door
def save_chains(chains: Iterable[Chain], path: str | PathLike[str]) -> int:
    """Write chains to a file, one a line (JSON); how many."""
    lines = []
    for c in chains:
        if not isinstance(c, Chain):
            raise DeclarationError("save_chains", [wrong(c, f"chains[{len(lines)}]", "a Chain")])
        lines.append(json.dumps({name: getattr(c, name) for name in FIELDS}))
    write_whole(path, (f"{line}\n" for line in lines))
    return len(lines)


@door
def load_chains(path: str | PathLike[str]) -> Iterator[Chain]:
    """The chains of a saved file, one by one."""
    for number, line in enumerate(text_of(Path(path), "file of chains").splitlines(), start=1):
        try:
            data = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise FileError(path, f"line {number}: expected a chain as save_chains writes it ({error})") from None
        faults = data_faults(data)
        if faults:
            raise FileError(path, f"line {number}: expected a chain as save_chains writes it: {'; '.join(faults)}")
        yield Chain(data["links"], tuple(map(tuple, data["joints"])), tuple(data["types"]), data["family"])
