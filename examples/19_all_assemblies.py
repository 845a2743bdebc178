"""How many ways there are to assemble loops: numbers over the complex numbers, from the declaration alone.

Problem: spatial loops of four to seven pairs, placed at random, with the first pair at a given value: in how many positions do they close,
and in how many of these with real numbers?
Source: G. N. Sandor, D. Kohli and others, report AD-A134519, 1983 (R-Sp-R, R-Sg-R-R, R-Sc-C-R: 2, 4, 8); E. J. F. Primrose, Mech.
Mach. Theory 21, 1986 (7R with the input given: 16).
"""

import numpy as np

import mechgraph as mg

LOOPS = {"R Sp R": 2, "R Sg R R": 4, "R Sc C R": 8, "R R R R R R R": 16}


def general(letters: str, seed: int = 3) -> mg.Mechanism:
    """A loop whose pairs stand anywhere, closed as declared."""
    symbols, rng = letters.split(), np.random.default_rng(seed)
    links = ["frame", *(f"link{i}" for i in range(1, len(symbols))), "frame"]
    pairs = [
        mg.Pair(f"O{i + 1}", symbol, links[i], links[i + 1], point=rng.normal(size=3), axis=rng.normal(size=3))
        for i, symbol in enumerate(symbols)
    ]
    return mg.Mechanism(letters, pairs=pairs, drives=["O1"])


print(f"{'loop':14} {'over C':>6} {'real':>5}  completeness")
for letters, expected in LOOPS.items():
    modes = mg.assemblies(general(letters), {"O1": 0.02})
    print(f"{letters:14} {modes.total:6} {len(modes):5}  {modes.completeness}")
    assert modes.total == len(modes) + len(modes.complex) + modes.infinite == expected
    assert all(sure.proved for sure in modes.certificates if sure is not None)
