"""All assemblies of a mechanism at given values of its drivers: what a user calls."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism, check_mechanism
from mechgraph.modes.finding import GUESSED_TURNS, GUESSES, Finder, Progress
from mechgraph.modes.question import Question
from mechgraph.modes.result import AssembliesOver
from mechgraph.quantities import wrong


def assemblies(
    m: Mechanism,
    values: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
    guesses: int = GUESSES,
    turns: float = GUESSED_TURNS,
    cache: bool = True,
    progress: Progress | None = None,
) -> Any:
    """All real assemblies with some freedoms, points of links or link poses given: the closure solved over the complex numbers.

    All assemblies of a random complex mechanism of the same class (topology, and the relations that make closure rows dependent) are
    found once by monodromy and kept; tracks lead from these to the mechanism at hand. Where no class is known (helical pairs, relations
    such as Bennett's), real assemblies are searched from random guesses, and the result says so.

    Parameters
    ----------
    values : as for ``solve``: freedom -> value, ``"bucket.tip"`` -> point, ``"platform"`` -> pose (4, 4). One position gives
        ``Assemblies``, a list of values ``AssembliesOver``.
    seed : of all random numbers; the assemblies and their order do not depend on it.
    guesses, turns : of a search, and the turns about the start within which angles are guessed.
    cache : whether start sets are kept in the user's folder (see ``modes.store``).
    progress : called with a line of text now and then; an exception raised in it ends the call.

    Raises
    ------
    DeclarationError, AssemblyError, IndeterminateError
    """
    check_mechanism(m, "assemblies")
    faults = []
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        faults.append(wrong(seed, "seed", "a whole number, 0 or more"))
    if isinstance(guesses, bool) or not isinstance(guesses, int | np.integer) or guesses < 1:
        faults.append(wrong(guesses, "guesses", "a whole number, 1 or more"))
    if not isinstance(turns, int | float) or not 0 < turns < np.inf:
        faults.append(wrong(turns, "turns", "a number above 0"))
    if progress is not None and not callable(progress):
        faults.append(wrong(progress, "progress", "a function of a line of text"))
    if faults:
        raise DeclarationError(f"assemblies of {m.name!r}", faults)
    question = Question(m, values)
    found = Finder(question, int(seed), cache, progress).positions(int(guesses), float(turns))
    return AssembliesOver(tuple(found)) if question.batch else found[0]
