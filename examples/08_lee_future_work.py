"""From graph to equations: the first point of Lee's future work, on his own mechanisms 7R, RPRHRRR and PPHCHP.

Problem: I.-P. J. Lee, thesis, Oklahoma State University 1977, writes the equations of seven mechanisms by hand (3.106 to 3.226,
sections 3.8 to 3.14). His conclusions name as the first point for further study a program that identifies variables, links and
pairs from a graph and generates those equations. Here the graph is declared, the equations are generated and stand beside his.

Nothing is matched by hand: his equations are read from ``tests/reference/data/lee_equations.csv``, the generated ones are read
off the assembled matrix, and both are compared pair by pair, screw by screw. He prints a force where a prism pair transmits a
couple in 3.183 and 3.187 (epsilon missing); else the three sections agree but for letters.

Asserted: that list, the counts 50, 50 and 42, and that the generated equations, solved as they stand, give the driver efforts of
``mg.solve``, which solves the transposed closure instead.
"""

import numpy as np
from lee_1977 import chains, equations

import mechgraph as mg

SHOWN = {"7r": "7R, section 3.8", "rprhrrr": "RPRHRRR, section 3.9", "pphchp": "PPHCHP, section 3.12"}
LETTERS = {"7r": "RRRRRRR", "rprhrrr": "RPRHRRR", "pphchp": "PPHCHP"}
WRONG_WRENCH = {("pphchp", "3.183"), ("pphchp", "3.187")}
OTHER_LETTER = {
    ("7r", "after 3.106"),
    ("rprhrrr", "after 3.126"),
    ("pphchp", "3.186"),
    ("pphchp", "3.188"),
}


def from_graph_alone(name: str) -> mg.Formulation:
    """The equations from the pair letters alone: no geometry, no masses, no numbers."""
    return mg.formulate(mg.chain(LETTERS[name]), bookkeeping="lee")


def show(name: str) -> None:
    """The generated equations as mechgraph prints them, then both side by side."""
    f = from_graph_alone(name)
    title = SHOWN[name]
    print(f"{title}\n{'=' * len(title)}\n")
    print(f.text())
    print(f"{equations.table(name)}\n")


def driver_error(name: str) -> float:
    """The generated equations solved as they stand, ``Q u = C``: largest relative difference of the driver effort from mg.solve."""
    m = mg.load(name)
    s = mg.solve(m)
    at = np.arange(0, len(s.checks.power), 12)
    _, efforts = chains.solution_of(mg.formulate(m, bookkeeping="lee"), s, at)
    return chains.relative(efforts, s[m.drives[0].freedom].effort[at, 0])


def main() -> None:
    for name in SHOWN:
        show(name)
        f = from_graph_alone(name)
        assert len(f.unknowns) == len(f.equations) == chains.SECTIONS[name][1]
        error = driver_error(name)
        assert error < 1e-9
        print(f"driver effort from the {len(f.equations)} equations: {error:.0e} relative from mg.solve\n")

    found: dict[str, set[tuple[str, str]]] = {}
    print("Where the equations of sections 3.8 to 3.14 differ\n")
    for name in chains.SECTIONS:
        for x in equations.matched(name):
            found.setdefault(x.verdict, set()).add((name, x.number))
            if x.verdict not in (equations.AGREES, equations.OTHER_SIDE):
                print(f"{name:8s} {x.number or '-':12s} {x.printed or '-':31s} {x.generated:32s} {x.verdict}")
    in_three = {verdict: {k for k in keys if k[0] in SHOWN} for verdict, keys in found.items()}
    assert in_three[equations.WRENCH] == WRONG_WRENCH
    assert in_three[equations.LETTER] == OTHER_LETTER
    assert not in_three[equations.LEFT_OUT] | in_three[equations.TWICE]


if __name__ == "__main__":
    main()
