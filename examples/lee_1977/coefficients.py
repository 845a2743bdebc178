"""Tables XIV, XXIV and XXXII: the printed coefficient lists against the generated matrices, entry by entry."""

from dataclasses import dataclass

import numpy as np

import mechgraph as mg
from lee_1977.chains import rank
from lee_1977.tables import coefficients
from mechgraph.equations.terms import State

AXES = "xyz"


@dataclass(frozen=True)
class Layout:
    """Order of Lee's unknowns and equations.

    ``columns``: pair and what stands there: ``F``, ``M`` (three each), ``A`` (axial), ``BCD`` (three forces of a spherical
    pair), ``IN``; a minus sign where his reaction is that of link b on link a. ``rows``: links (six each) and pairs (two each).
    ``screws``: his letters of a pair's axis, real and dual part.
    """

    name: str
    columns: tuple[tuple[str, str, int], ...]
    rows: tuple[str, ...]
    screws: dict[str, tuple[str, str]]
    spherical: dict[str, str]


RCSR = (("O1", "F", 1), ("O2", "F", 1), ("O4", "F", -1), ("O1", "M", 1), ("O2", "M", 1), ("O4", "M", -1),
        ("O1", "A", 1), ("O4", "A", -1), ("O3", "BCD", 1), ("O1", "IN", 1))  # fmt: skip
LAYOUTS = {
    "XIV": Layout(
        "rcsr", RCSR, ("link1", "link2", "link3", "O2", "O4", "O1"),
        {"O1": ("A10", "A11"), "O2": ("A20", "A21"), "O4": ("A40", "A41")}, {"O3": "BCD"},
    ),
    "XXIV": Layout(
        "rcsr-csr",
        (*RCSR, ("O5", "F", 1), ("O5", "M", 1), ("O6", "BCD", 1), ("O7", "F", -1), ("O7", "M", -1), ("O7", "A", -1)),
        ("link1", "link2", "link3", "O2", "O4", "O1", "link5", "link6", "O5", "O7"),
        {"O1": ("A10", "A11"), "O2": ("A20", "A21"), "O4": ("A40", "A41"), "O5": ("A50", "A51"), "O7": ("A70", "A71")},
        {"O3": "BCD", "O6": "EFG"},
    ),
    "XXXII": Layout(
        "rchch",
        (("O1", "F", 1), ("O1", "M", 1), ("O1", "A", 1), ("O2", "F", -1), ("O2", "M", -1), ("O1", "IN", 1),
         ("O3", "F", -1), ("O3", "M", -1), ("O3", "A", -1), ("O4", "F", -1), ("O4", "M", -1),
         ("O5", "F", -1), ("O5", "M", -1), ("O5", "A", -1)),
        ("link1", "O1", "link2", "link3", "link4", "O2", "O4", "O5", "O3"),
        {"O1": ("A1", "A11"), "O2": ("A2", "A22"), "O3": ("A3", "A31"), "O4": ("A4", "A41"), "O5": ("A5", "A51")},
        {},
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Entries:
    """Printed entries, those equal to the generated ones, the others, entries left out; rank of {Q} as printed; its size."""

    printed: int
    equal: int
    wrong: tuple[str, ...]
    missing: tuple[str, ...]
    rank: int
    size: int
    right_sides: int
    wrong_right_sides: tuple[str, ...]


def in_general_axes(name: str) -> mg.Mechanism:
    """The library mechanism in a random frame, in which no axis lies along x, passes through the origin or has a component zero.

    In Lee's own axes A1 = (1, 0, 0) passes through the origin, and a wrong letter that stands for a zero would count as right.
    """
    rng = np.random.default_rng(1977)
    pose = np.eye(4)
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pose[:3, :3], pose[:3, 3] = turned * np.linalg.det(turned), rng.normal(size=3)
    return mg.load(name).moved(pose)


def evaluated(value: str, numbers: dict[str, float]) -> float:
    """A printed coefficient such as ``-A31x + rho3 A3x``."""
    total = 0.0
    for term in value.replace(" + ", "|").replace(" - ", "|-").split("|"):
        product = -1.0 if term.startswith("-") else 1.0
        over, _, under = term.removeprefix("-").partition(" / ")
        for word in over.split():
            product *= 1.0 if word == "1" else numbers[word]
        for word in under.split():
            product /= numbers[word]
        total += product
    return total


def letters(layout: Layout, m: mg.Mechanism, state: State) -> dict[str, float]:
    """The numbers behind the letters of the pair axes, real and dual part, and of the pitches."""
    numbers = dict.fromkeys([f"A33{x}" for x in AXES], 0.0)  # a letter without meaning in Table XXXII
    for k, pair in enumerate(m.pairs):
        if pair.name in layout.screws:
            real, dual = layout.screws[pair.name]
            turn = next(i for i, c in enumerate(pair.type.bookkeeping.conditions) if c.turns)
            axis = -state.conditions[k][:, turn, 0]  # z of the markers is minus A
            numbers |= {real + x: axis[i] for i, x in enumerate(AXES)} | {
                dual + x: axis[3 + i] for i, x in enumerate(AXES)
            }
    return numbers | {f"rho{k + 1}": p.pitch for k, p in enumerate(m.pairs) if p.pitch is not None}


def spherical(units: np.ndarray, names: str, A: np.ndarray) -> tuple[list[np.ndarray], dict[str, float]]:
    """Columns of three forces through a sphere, and the numbers behind their letters: any three directions, the same on both
    sides.
    """
    rng = np.random.default_rng(1977)
    columns, numbers = [], {}
    for letter in names:
        v = rng.normal(size=3)
        amounts = units[3:].T @ v
        screw = units @ amounts
        numbers |= {f"{letter}0{x}": v[i] for i, x in enumerate(AXES)} | {
            f"{letter}1{x}": screw[i] for i, x in enumerate(AXES)
        }
        columns.append(A @ amounts)
    return columns, numbers


def ordered_rows(layout: Layout, f: mg.Formulation) -> tuple[list[int], np.ndarray]:
    """Rows in Lee's order, and their signs: his conditions are about A, minus z, and about his own free dual force."""
    rows: list[int] = []
    signs: list[float] = []
    pairs = {p.name for p in f.mechanism.pairs}
    reversed_pairs = {pair for pair, _, sense in layout.columns if sense < 0}
    for owner in layout.rows:
        mine = [i for i, e in enumerate(f.equations) if e.owner == owner]
        if owner in pairs:
            mine.sort(key=lambda i: "moment" in f.equations[i].name)
        rows += mine
        signs += [(1.0 if owner in reversed_pairs else -1.0) if owner in pairs else 1.0] * len(mine)
    return rows, np.array(signs)


def generated(number: str, position: int = 3) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """The generated matrix and right side in Lee's order and signs, and the numbers behind his letters."""
    layout = LAYOUTS[number]
    m = in_general_axes(layout.name)
    f, state = mg.formulate(m, bookkeeping="lee"), mg.solve(m).state(position)
    sparse, b = f.assemble(state)
    A = sparse.toarray()
    numbers, columns = letters(layout, m, state), []
    still = mg.solve(m, loads=[]).state(position).loads  # inertia alone
    moving = [link.name for link in m.links if link.name != m.frame]
    for n, name in enumerate(moving, 1):
        wrench = still[:, m.link_index[name], 0]
        numbers |= {f"MI{n}{x}": wrench[i] for i, x in enumerate(AXES)}
        numbers |= {f"FI{n}{x}": wrench[3 + i] for i, x in enumerate(AXES)}
    numbers["Mout"] = m.loads[0].value
    for pair, what, sense in layout.columns:
        mine = [i for i, u in enumerate(f.unknowns) if u.owner == pair and (u.group == "driver") == (what == "IN")]
        if what == "BCD":
            k = [p.name for p in m.pairs].index(pair)
            found, named = spherical(state.reactions[k][:, :, 0], layout.spherical[pair], A[:, mine])
            columns += found
            numbers |= named
        elif what in "FM":
            columns += [sense * A[:, i] for i in (mine[:3] if what == "F" else mine[3:6])]
        else:
            columns.append(-sense * A[:, mine[0] if what == "IN" else mine[6]])
    rows, signs = ordered_rows(layout, f)
    Q = np.column_stack(columns)[rows] * signs[:, None]
    for i, row in enumerate(rows):  # a condition says zero: its scale is free, ours is that of a unit screw
        if "force along" in f.equations[row].name:
            Q[i] /= np.linalg.norm(Q[i])
    return Q, b[rows] * signs, numbers


def compared(number: str) -> Entries:
    """Table ``number`` against the generated matrix at one position."""
    Q, C, numbers = generated(number)
    entries = coefficients(number)
    sides = [(i, value) for i, j, value in entries if j == 0]
    wrong_sides = [f"C({i}) = {v}" for i, v in sides if not np.isclose(evaluated(v, numbers), C[i - 1], atol=1e-9)]
    printed = np.zeros_like(Q)
    right = 0
    wrong = []
    listed = set()
    for i, j, value in (entry for entry in entries if entry[1]):
        found = evaluated(value, numbers)
        printed[i - 1, j - 1] = found
        listed.add((i, j))
        if np.isclose(found, Q[i - 1, j - 1], atol=1e-9):
            right += 1
        else:
            wrong.append(f"Q({i},{j}) = {value}")
    gone = [
        f"Q({i + 1},{j + 1})"
        for i, j in zip(*np.nonzero(np.abs(Q) > 1e-9), strict=True)
        if (i + 1, j + 1) not in listed
    ]
    return Entries(
        right + len(wrong), right, tuple(wrong), tuple(gone), rank(printed), len(Q), len(sides), tuple(wrong_sides)
    )
