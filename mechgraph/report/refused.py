"""Named errors for mechanisms that their drivers do not determine where they were assembled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mechgraph.errors import DeadPointError, IndeterminateError
from mechgraph.model.mechanism import Mechanism
from mechgraph.report.report import check
from mechgraph.report.sentences import here_only
from mechgraph.structure.branching import branches_text
from mechgraph.structure.mobility import FreeMotion


def structure_error(m: Mechanism, drives: Sequence[str]) -> IndeterminateError:
    """Nothing moves that could be driven."""
    return IndeterminateError(
        f"mechanism {m.name!r}: {', '.join(drives)} cannot drive it: it is a structure (mobility 0) where it was assembled. Change a pair, "
        "see mg.check",
        check(m),
    )


def undriven_error(m: Mechanism, free: Sequence[FreeMotion]) -> IndeterminateError:
    """Freedoms are left that are neither driven nor passive."""
    report = check(m)
    own = m.freedom_names()
    names = ", ".join(dict.fromkeys(name for motion in free for name in motion.names if name in own))
    many = len(free) > 1
    count, more = (f"{len(free)} freedoms are", f"{len(free)} drivers") if many else ("1 freedom is", "one driver")
    return IndeterminateError(
        f"mechanism {m.name!r}: {count} neither driven nor passive (moving: {names}){here_only(report.passive_here_only)}; add {more}, "
        "or change a pair",
        report,
    )


def no_longer_passive_error(m: Mechanism, names: Sequence[str], drives: Mapping[str, float]) -> IndeterminateError:
    """Motions ``names`` were passive where the mechanism was assembled, and move other links at values of the ``drives``."""
    at = ", ".join(f"{name} = {value:.6g}" for name, value in drives.items())
    return IndeterminateError(
        f"mechanism {m.name!r}: {' or '.join(names)} is passive where it was assembled, but moves other links at {at}, so that the "
        "drivers do not determine the motion there; add a driver, or change a pair",
        check(m),
    )


def undecided_error(m: Mechanism, counts: Sequence[int]) -> IndeterminateError:
    """Two ways to decide the rank find so many passive freedoms."""
    found = " or ".join(map(str, counts))
    return IndeterminateError(
        f"mechanism {m.name!r}: where it was assembled it is so nearly singular that rounding decides whether it has {found} passive "
        "freedoms. Start at another position, or check the dimensions",
        check(m),
    )


def dead_point_error(m: Mechanism, still: Sequence[str], values: dict[str, float], solution: object) -> DeadPointError:
    """Drivers stand ``still`` at the start while the mechanism moves."""
    return DeadPointError(
        f"mechanism {m.name!r}: dead point where it was assembled: {', '.join(still)} stands still there while the mechanism moves, so "
        "that it does not determine the motion; drive another freedom, or start at another position",
        values,
        solution,
    )


def change_point_error(m: Mechanism, values: dict[str, float], ways: tuple[dict[str, float], ...]) -> DeadPointError:
    """Branches cross at the start, with their rates by freedom."""
    error = DeadPointError(
        f"mechanism {m.name!r}: change point where it was assembled: {branches_text(ways, next(iter(values)))}. A path that starts there "
        "has no velocity to continue: start beside it, on the branch that is meant, or drive another freedom",
        values,
    )
    error.branches = ways
    return error
