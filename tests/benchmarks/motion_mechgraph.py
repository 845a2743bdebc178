"""Motion under given loads with mechgraph on numpy: what a user writes. Positions of the watched point; all reactions come along."""

import numpy as np
from motion_cases import Case

import mechgraph as mg

VERSION = ""
SMALL = 40
"""Links up to which the kernel would serve; numpy takes sparse matrices for more."""
Setting = float


def variants(case: Case) -> tuple[str, ...]:
    """Steppers that serve."""
    return ("LSODA",) if case.stiff else ("DOP853",)


def ladder(case: Case, variant: str) -> list[Setting]:
    """Relative tolerances, coarse to fine."""
    return [10.0**-k for k in range(3, 13)]


def solve(case: Case, variant: str, rtol: Setting, engine: str = "") -> np.ndarray:
    """Positions ``(T, 3)``; the mechanism is declared anew, so that nothing is known of it."""
    m = case.mechanism
    m = mg.Mechanism(m.name, m.links, m.pairs, frame=m.frame, loads=m.loads)
    engine = engine or ("dense" if len(m.links) < SMALL else "auto")
    r = mg.respond(m, case.times, rates=case.rates, rtol=rtol, atol=1e-2 * rtol, method=variant, engine=engine)
    link, point = case.watched
    return np.asarray(r.link(link).point(point).position)
