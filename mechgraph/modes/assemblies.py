"""All assemblies of a mechanism at given values of its drivers: what a user calls."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mechgraph.model.mechanism import Mechanism
from mechgraph.modes.finding import GUESSED_TURNS, GUESSES, Finder, Progress
from mechgraph.modes.question import Question
from mechgraph.modes.result import AssembliesOver
from mechgraph.quantities import Count, Index, Positive, door


@door
def assemblies(
    m: Mechanism,
    values: Mapping[str, Any] | None = None,
    *,
    seed: Index = 0,
    guesses: Count = GUESSES,
    turns: Positive = GUESSED_TURNS,
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
    question = Question(m, values)
    found = Finder(question, int(seed), cache, progress).positions(int(guesses), float(turns))
    return AssembliesOver(tuple(found)) if question.batch else found[0]
