"""What a study keeps of every variant: quantities of a Solution by name, or functions of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.errors import DeclarationError, did_you_mean, listed, near_names
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import items_of, shown, unit_of, wrong
from mechgraph.result.solution import Solution
from mechgraph.result.views import LinkResult, PairResult, link_units, pair_units
from mechgraph.variants.number_names import ALIKE

Output = str | Callable[[Solution], Any]

RESERVED = ("status", "variant", "position", "positions not solved")
"""Names that tables of a study use themselves."""
OF_SOLUTION = ("shaking",)
OF_CHECKS = ("closure", "equilibrium", "power", "accuracy")


def _properties(kind: type) -> tuple[str, ...]:
    return tuple(n for n, v in vars(kind).items() if isinstance(v, property) and n not in ("units", "components"))


RANKS = ("position", "velocity", "acceleration")
OF_PAIR, OF_LINK = _properties(PairResult), _properties(LinkResult)


def named_outputs(m: Mechanism, outputs: Any, parameters: Iterable[str]) -> dict[str, Output]:
    """Outputs by name, from a quantity, several, or a mapping name -> quantity or function.

    Raises
    ------
    DeclarationError
        with all names that are no quantity.
    """
    if isinstance(outputs, str):
        outputs = [outputs]
    if not isinstance(outputs, Mapping):
        unlisted: list[str] = []
        names = items_of(outputs, "", unlisted)
        if unlisted or not all(isinstance(name, str) for name in names):
            raise DeclarationError(
                "study: outputs",
                [wrong(outputs, "outputs", "names, or a mapping name -> name or function of a Solution")],
            )
        outputs = {name: name for name in names}
    faults = [
        fault
        for name, what in outputs.items()
        if (fault := None if callable(what) else _fault(m, name, what)) is not None
    ]
    faults += [
        f"{name!r}: this name is taken; give the output another one"
        for name in outputs
        if name in {*RESERVED, *parameters}
    ]
    if faults or not outputs:
        raise DeclarationError("study: outputs", faults or ["no outputs; name at least one, e.g. 'A.effort'"])
    return dict(outputs)


def _fault(m: Mechanism, name: str, what: Any) -> str | None:
    if isinstance(what, str) and _found(m, what):
        return None
    pair = m.pairs[0]
    hint = did_you_mean(near_names(what, _known(m, what), ALIKE)) if isinstance(what, str) else ""
    example = (
        f"expected e.g. '{pair.name}.effort', '{pair.name}.position', "
        f"'{pair.freedom_names[0] if pair.freedom_names else pair.name}', '{pair.name}:{(*pair.type.component_names, 'Fx')[0]}', "
        f"'{m.links[-1].name}.center', 'shaking', or a function of a Solution"
    )
    said = shown(name) if isinstance(what, str) and name == what else f"{shown(name)}: {shown(what)}"
    return f"{said}: {_missing(m, what)}; {hint or example}"


def _missing(m: Mechanism, what: Any) -> str:
    """What there is not: a pair or link of that name, or a quantity of it."""
    owner = what.rpartition(".")[0] or what.rpartition(":")[0] if isinstance(what, str) else ""
    if not owner or owner in (*m.pair_index, *m.link_index):
        return "is no quantity"
    return f"there is no pair or link {shown(owner)} (pairs: {listed(m.pair_index)}; links: {listed(m.link_index)})"


def _known(m: Mechanism, what: str) -> list[str]:
    """Names of the quantities of the pair or link that is named, or of all."""
    owner = what.rpartition(".")[0]
    of = [(pair.name, OF_PAIR) for pair in m.pairs] + [(link.name, OF_LINK) for link in m.links]
    points = [f"{link.name}.{name}" for link in m.links for name in link.points if owner in (link.name, "")]
    return [f"{name}.{part}" for name, parts in of if owner in (name, "") for part in parts] + [
        *points,
        *OF_SOLUTION,
        *OF_CHECKS,
    ]


def _found(m: Mechanism, text: str) -> Callable[[Solution], Any] | None:
    """The quantity of that name: of a pair, a freedom, a component, a link, or the whole."""
    if text in OF_SOLUTION:
        return lambda s: getattr(s, text)
    if text in OF_CHECKS:
        return lambda s: getattr(s.checks, text)
    if text in m.freedom_names():
        k, j = m.freedom(text)
        return lambda s: s[m.pairs[k].name].position[..., j]
    owner, colon, part = text.partition(":")
    if colon and owner in m.pair_index and part in m.pair(owner).type.component_names:
        return lambda s: s[owner].components[part]
    owner, _, part = text.rpartition(".")
    if owner in m.pair_index and part in OF_PAIR:
        return lambda s: getattr(s[owner], part)
    if owner in m.link_index and part in OF_LINK:
        if part.startswith("center") and m.link(owner).center is None:
            return None
        return lambda s: getattr(s.link(owner), part)
    if point := _point(m, text):
        link, name, rank = point
        return lambda s: getattr(s.link(link).at(name), RANKS[rank])
    return None


def _point(m: Mechanism, text: str) -> tuple[str, str, int] | None:
    """Link, name and derivative of ``bucket.tip``, ``bucket.tip.velocity`` or ``bucket.tip.acceleration``."""
    return next(
        (
            (link.name, name, rank)
            for link in m.links
            for name in link.points
            for rank, of in enumerate(RANKS)
            if text == f"{link.name}.{name}{f'.{of}' if rank else ''}"
        ),
        None,
    )


def unit_of_output(m: Mechanism, what: Output) -> str | tuple[str, ...]:
    """The unit of a quantity in the declared units, or one for every entry of its last axis; empty where it is not known."""
    if not isinstance(what, str):
        return ""
    if what in m.freedom_names():
        return unit_of(m.units, (0 if m.turns(what) else 1, 0, 0))
    owner, colon, part = what.partition(":")
    if colon and owner in m.pair_index:
        return str(pair_units(m.units, m.pair(owner).type)["components"][part])
    owner, _, part = what.rpartition(".")
    found: Any = ""
    if owner in m.pair_index and part in OF_PAIR:
        found = pair_units(m.units, m.pair(owner).type).get(part, "")
    elif owner in m.link_index and part in OF_LINK:
        found = link_units(m.units).get(part, "")
    elif point := _point(m, what):
        found = unit_of(m.units, (1, 0, -point[2]))
    elif what == "shaking":
        found = pair_units(m.units, m.pairs[0].type)["reaction"]
    return found[0] if isinstance(found, tuple) and len(set(found)) == 1 else found


def quantity(s: Solution, name: str, what: Output) -> Array:
    """An output of a solution of variants ``(V, N)``, ``(V, ...)``; a last axis of length one (of a pair with one freedom) is dropped.

    Raises
    ------
    DeclarationError
        where a function fails or gives no array with one entry for every variant.
    """
    if isinstance(what, str):
        found = _found(s.mechanism, what)
        assert found is not None
        value = np.asarray(found(s))
        return value[..., 0] if value.ndim > len(s.batch) and value.shape[-1] == 1 else value
    try:
        value = np.asarray(what(s), dtype=float)
    except Exception as error:
        raise DeclarationError(
            f"study: output {name!r}", [f"its function failed: {type(error).__name__}: {error}"]
        ) from error
    if not value.ndim or value.shape[0] != s.batch[0]:
        raise DeclarationError(
            f"study: output {name!r}",
            [
                f"its function gave shape {value.shape} for {s.batch[0]} variants; quantities of a study are (variants, positions, ...): "
                "reduce over axis 1, not over the variants"
            ],
        )
    return value
