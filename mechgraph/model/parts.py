"""What a mechanism consists of, and all of it by name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import repeat
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.errors import DeclarationError
from mechgraph.model.coupling import BaseCoupling
from mechgraph.model.drive import Drive
from mechgraph.model.field_format import Formatted
from mechgraph.model.field_kinds import BY_FREEDOM, FACTS, NUMBER, TABLE, TABLES, TEXT
from mechgraph.model.link import Link
from mechgraph.model.load_base import Load
from mechgraph.model.pair import Pair
from mechgraph.model.pair_type import PairType
from mechgraph.model.response_setup import ResponseSetup
from mechgraph.quantities import shown, without_units
from mechgraph.units import LENGTH, PURE

START = {
    "type": "object",
    "additionalProperties": {"anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}}]},
}
"""JSON Schema of start values."""


@dataclass(frozen=True, eq=False, init=False)
class Parts(Formatted):
    """The fields of a mechanism (see ``Mechanism``), and its links, pairs, couplings and freedoms by name.

    Nothing is checked here: what is looked up may still be what a user declared wrongly.
    """

    name: Annotated[str, TEXT("name of the mechanism")]
    description: Annotated[str, TEXT("what it is", default="empty")]
    source: Annotated[str, TEXT("where it comes from", default="empty")]
    frame: Annotated[str, TEXT("the frame link", default="first link")]
    units: Annotated[Mapping[str, str], TABLE("names of the units of the numbers", table="units", default="no names")]
    tol: Annotated[
        float | None,
        NUMBER(
            "accuracy to which directions (radians) and distances (over L, the mean radius) are meant, as `tol=` of a call",
            default="exact",
        ),
    ]
    links: Annotated[
        tuple[Link, ...], TABLES("links; left out, they follow from the pairs, massless", key="link", table="link")
    ]
    pairs: Annotated[tuple[Pair, ...], TABLES("pairs", key="pair", table="pair")]
    couplings: Annotated[
        tuple[BaseCoupling, ...],
        TABLES("linear relations between freedoms", key="coupling", table="coupling", default="none"),
    ]
    drives: Annotated[tuple[Drive, ...], TABLES("driven freedoms", key="drive", table="drive", default="none")]
    loads: Annotated[tuple[Load, ...], TABLES("loads", key="load", table="load", default="none")]
    start: Annotated[
        Mapping[str, float],
        BY_FREEDOM(
            "pair coordinates near which to assemble, freedom → number, or pair → one number a freedom; "
            "degrees with `_deg` added to the name",
            default="all 0",
            rules=START,
        ),
    ]
    response: Annotated[
        ResponseSetup | None,
        TABLE("what `respond` takes where it is given nothing else", table="response", default="none"),
    ]
    expected: Annotated[Mapping[str, Any], FACTS("facts that a test checks; any names", default="empty")]

    def link_names(self) -> tuple[str, ...]:
        """Names of the links, in order."""
        return tuple([link.name for link in self.links])

    def massive_links(self) -> tuple[str, ...]:
        """Names of the links that have mass."""
        return tuple(link.name for link in self.links if link.mass > 0)

    def ends_of(self, freedom: str) -> tuple[str, str]:
        """Links a and b of the pair of a freedom."""
        pair = self.pairs[self.freedom(freedom)[0]]
        return pair.a, pair.b

    @cached_property
    def link_index(self) -> Mapping[str, int]:
        """Place of every link, by name."""
        return MappingProxyType(_places(link.name for link in self.links))

    @cached_property
    def pair_index(self) -> Mapping[str, int]:
        """Place of every pair, by name."""
        return MappingProxyType(_places(pair.name for pair in self.pairs))

    @cached_property
    def pair_ends(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices of the links a and b of every pair, ``(P,)`` each; -1 for what is no link."""
        place = self.link_index.get
        a, b = (
            np.fromiter(map(place, _hashed(ends), repeat(-1)), np.intp, len(ends))
            for ends in ([pair.a for pair in self.pairs], [pair.b for pair in self.pairs])
        )
        return a, b

    def _place_of_named(self, name: str) -> int | None:
        """Place of the first pair that answers to a name, its own or that of one of its freedoms."""
        places = [self.pair_index[name]] if name in self.pair_index else []
        for i, letter in enumerate(name):
            k = self.pair_index.get(name[:i]) if letter == "." else None
            if k is not None and name in self.pairs[k].freedom_names:
                places.append(k)
        return min(places, default=None)

    def link(self, name: str) -> Link:
        """The link of that name."""
        return self.links[self.place_of_link(name)]

    def pair(self, name: str) -> Pair:
        """The pair of that name."""
        return self.pairs[self.place_of_pair(name)]

    def coupling(self, name: str) -> BaseCoupling:
        """The coupling of that name."""
        return self.couplings[self._index(name, _places(c.name for c in self.couplings), "coupling")]

    def place_of_link(self, name: str) -> int:
        """Index of the link of that name."""
        return self._index(name, self.link_index, "link")

    def place_of_pair(self, name: str) -> int:
        """Index of the pair of that name."""
        return self._index(name, self.pair_index, "pair")

    def _index(self, name: str, places: Mapping[str, int], what: str) -> int:
        if not isinstance(name, str) or name not in places:
            raise DeclarationError(
                f"mechanism {self.name!r}", [f"unknown {what} {shown(name)} ({what}s: {', '.join(places) or 'none'})"]
            )
        return places[name]

    def freedom_names(self) -> tuple[str, ...]:
        """Full names of all freedoms, ``"B.Tz"``, in the order of the pairs."""
        return tuple(name for pair in self.pairs for name in pair.freedom_names)

    def freedom_fault(self, name: Any, *, single: bool) -> str | None:
        """Why ``name`` is no freedom (with ``single``: none that takes a drive), or None."""
        found = self._find_freedom(name)
        if isinstance(found, str):
            return found
        k, j = found
        if single and not self.pairs[k].type.drivable[j]:
            return (
                f"freedom {name!r} is part of a rotation; it takes an effort, not a drive, a start angle or a spring (a pair 'Fr' "
                "beside it, between the same links, has a turn Rz that takes all of these)"
            )
        return None

    def freedom(self, name: str) -> tuple[int, int]:
        """Index of the pair and of the freedom within it, for ``"B.Tz"`` or ``"B"`` (one freedom, or one driven)."""
        found = self._find_freedom(name)
        if isinstance(found, str):
            raise DeclarationError(f"mechanism {self.name!r}", [found])
        return found

    def turns(self, freedom: Any) -> bool:
        """Whether the coordinate of a freedom is an angle; False for what is no freedom."""
        found = self._find_freedom(freedom)
        return not isinstance(found, str) and self.pairs[found[0]].type.freedoms[found[1]].turns

    def period(self, freedom: str) -> float:
        """By how much the coordinate of a freedom grows until it is back: a turn, the length of a closed curve, or infinite."""
        pair, number = self.freedom(freedom)
        return [period for step in self.pairs[pair].type.steps for period in step.periods][number]

    def in_own_units(self, freedom: str, value: Any) -> Any:
        """A coordinate given as a quantity of pint as a plain number in the declared units; unchanged where it does not fit."""
        return without_units(value, PURE if self.turns(freedom) else LENGTH, self.units)

    def full_name(self, name: str) -> str:
        """The full spelling ``"B.Tz"`` of a freedom."""
        k, j = self.freedom(name)
        return self.pairs[k].freedom_names[j]

    def _find_freedom(self, name: Any) -> tuple[int, int] | str:
        """Index of the pair and of the freedom within it, or why there is none."""
        if not isinstance(name, str):
            return f"freedom {shown(name)}: expected a name such as 'B' or 'B.Tz'"
        k = self._place_of_named(name)
        if k is None:
            return f"unknown freedom {name!r} (freedoms: {', '.join(self.freedom_names())})"
        pair = self.pairs[k]
        names = pair.freedom_names
        if name in names:
            return k, names.index(name)
        if not isinstance(pair.type, PairType):
            return f"pair {name!r} has an unknown type"
        if len(names) == 1:
            return k, 0
        driven = [d.freedom for d in self.drives if d.freedom in names]
        if len(driven) == 1:
            return k, names.index(driven[0])
        if not names:
            return f"pair {name!r} ({pair.type.symbol}) has no freedom"
        able = [n for n, single in zip(names, pair.type.drivable, strict=True) if single]
        hint = f"; a drive or spring can take {', '.join(able) or 'none of them (a rotation takes efforts only)'}"
        return f"pair {name!r} has {len(names)} freedoms; name one of {', '.join(names)}" + (
            hint if len(able) < len(names) else ""
        )

    @cached_property
    def has_geometry(self) -> bool:
        """Whether every pair says where it sits (otherwise: a topology, which can be counted, not solved)."""
        return all(pair.has_geometry for pair in self.pairs)


def _hashed(names: list[Any]) -> list[Any]:
    """Names, with None for what is no text."""
    return names if set(map(type, names)) <= {str} else [name if isinstance(name, str) else None for name in names]


def _places(names: Iterable[Any]) -> dict[Any, int]:
    """Name -> its first place; what is no name has none."""
    out: dict[Any, int] = {}
    for i, name in enumerate(names):
        if isinstance(name, str):
            out.setdefault(name, i)
    return out
