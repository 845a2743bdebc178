"""Inputs that are wrong or odd, at random: files, calls, mechanisms. What comes back must be an answer or an error of ours.

``tests/test_fuzz.py`` runs a few of each; ``pytest tests/test_fuzz.py --attack 1000`` a thousand seeds more. A failing seed is a
reproduction.
"""

from __future__ import annotations

import contextlib
import copy
import datetime
import decimal
import functools
import random
import re
import signal
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import scipy
from public import every_door

import mechgraph as mg

LIBRARY = Path(__file__).resolve().parents[1] / "library"
PATIENCE = 10
"""Seconds of processor time that one input may take."""
NAN, INF = float("nan"), float("inf")


class TookTooLongError(Exception):
    """An input took more than ``PATIENCE`` seconds."""


@contextmanager
def limited(what: str) -> Iterator[None]:
    """Raise TookTooLongError where the block takes too long (where the system has timers); without warnings."""

    def late(*_: object) -> None:
        raise TookTooLongError(f"{what}: more than {PATIENCE} s")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def answered(call: Callable[[], object], what: str) -> object:
    """The answer of a call, None where it is an error of ours; any other error says for which input it came."""
    try:
        with limited(what):
            return call()
    except mg.MechgraphError as error:
        if not 0 < len(str(error)) < 10**5:
            raise RuntimeError(f"{what}: a message of {len(str(error))} characters") from error
        return None
    except Exception as error:
        error.add_note(what)
        raise


def used(m: mg.Mechanism, rng: random.Random) -> None:
    """What a user does with a mechanism."""
    motions = {d.freedom: rng.choice([0.0, [0.0, 0.1, 0.2], [rng.uniform(-4, 4), 3.0]]) for d in m.drives}
    how = {"on_reach": rng.choice(["raise", "flag"]), "engine": rng.choice(["auto", "dense", "sparse"])}
    odd = len(m.pairs) % 2  # not drawn: what is drawn later stays as it was
    options = {
        "method": rng.choice(["loop_wrench", ("newton_euler", "printed")[odd]]),
        "redundant": rng.choice(["nan", "minimum_norm"]),
    }
    report = answered(lambda: mg.check(m, engine=how["engine"]), "check")
    if report is not None:
        answered(lambda: str(report), "report")
        answered(report.to_json, "report as JSON")
    s = answered(lambda: mg.solve(m, motions or None, **how, **options), f"solve {motions} {how} {options}")
    if s is not None:
        answered(lambda: (s.columns(), str(s), s.state(0 if s.batch else ())), "columns")
    sought = ("kinetostatics", "response")[odd]
    f = answered(lambda: mg.formulate(m, rng.choice(["lee", "minimal"]), unknowns=sought), "formulate")
    if f is not None:
        answered(f.text, "equations")
        if s is not None and len(f.unknowns) <= 400:
            answered(lambda: f.coefficients(s.state(0 if s.batch else ())), "numbers of the equations")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "m.toml"
        answered(lambda: (mg.save(m, file), mg.load(file)), "to a file and back")


# --- files -------------------------------------------------------------------------------------------------------------------

VALUES = [
    "nan",
    "-inf",
    "1e400",
    "1e308",
    "-1e-320",
    "0",
    "-1",
    "true",
    '"0.3"',
    '""',
    "[]",
    "[[]]",
    "{}",
    "[1, 'a']",
    "{x = 1}",
    "9" * 30,
    "9" * 500,
    "9" * 5000,
    "0x" + "f" * 300,
    "2001-01-01",
    "12:00:00",
    "'R'",
    '"A"',
    "1e-9",
    "1e9",
    "[0, 0, 0]",
    "[1e9, 1e18, 1e-9]",
    "[" * 50 + "]" * 50,
    "[" * 3000 + "]" * 3000,
    "'''\n\n'''",
    '"\\u0000"',
    "a.b.c",
    "1__0",
]
LINES = [
    "[units]",
    "[[link]]",
    "[[pair]]",
    "[[load]]",
    "[chain]",
    "[start]",
    "[[coupling]]",
    "[[pair_type]]",
    "chain = 1",
    "kind = 'spring'",
    "name = 'A'",
    "frame = 'rocker'",
    "a.b.c = 1",
    "\x00",
    "\ufeff",
    "= 3",
    "[expected]\nx = 1",
]
NUMBER = re.compile(r"-?\d+\.?\d*(e[-+]?\d+)?")


@functools.cache
def _texts() -> tuple[str, ...]:
    return tuple((LIBRARY / f"{name}.toml").read_text(encoding="utf-8") for name in mg.library())


def mutated(rng: random.Random) -> bytes:
    """The text of a library mechanism after some mutations."""
    text = rng.choice(_texts())
    for _ in range(rng.choice([1, 1, 1, 2, 3, 6])):
        lines = text.split("\n")
        i = rng.randrange(len(lines))
        kind = rng.randrange(9)
        if kind == 0:
            lines[i] = f"{lines[i].partition('=')[0]}= {rng.choice(VALUES)}"
        elif kind == 1:
            del lines[i]
        elif kind == 2:
            lines.insert(rng.randrange(len(lines)), lines[i])
        elif kind == 3:
            lines.insert(i, rng.choice(LINES))
        elif kind == 4:
            lines[i] = NUMBER.sub(lambda found: rng.choice([found[0], rng.choice(VALUES[:8]), "1e5", "1e-7"]), lines[i])
        elif kind == 5:
            j = rng.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
        elif kind == 6:
            lines[i] = lines[i].replace(
                *rng.choice([('"', ""), ("=", ":"), ("[", "{"), ("]", ""), ('"R"', '"H"'), ('"R"', '"S"')])
            )
        elif kind == 7:
            at = rng.randrange(len(lines[i]) + 1)
            lines[i] = lines[i][:at] + chr(rng.choice([0, 9, 34, 91, 93, 127, 0xE9, 0xD7FF, 0x1F600])) + lines[i][at:]
        else:
            word = rng.choice(re.findall(r"\w+", text) or ["x"])
            lines[i] = re.sub(r"\w+", word, lines[i], count=1)
        text = "\n".join(lines)
    data = text.encode()
    if rng.random() < 0.05:
        at = rng.randrange(len(data))
        data = data[:at] + bytes([rng.randrange(256)]) + data[at + rng.randrange(3) :]
    return data


def attack_file(seed: int, folder: Path) -> None:
    """A mutated file is read and used."""
    rng = random.Random(seed)
    path = folder / "m.toml"
    path.write_bytes(mutated(rng))
    m = answered(lambda: mg.load(path), f"file of seed {seed}")
    if m is not None:
        used(m, rng)


# --- calls -------------------------------------------------------------------------------------------------------------------


class Rude:
    """Raises where it can."""

    def __repr__(self) -> str:
        raise RuntimeError

    def __len__(self) -> int:
        raise RuntimeError


def _deep() -> list:
    deep: list = []
    for _ in range(5000):
        deep = [deep]
    return deep


WRONG = [
    None,
    True,
    0,
    1,
    -1,
    3,
    10**30,
    10**400,
    10**5000,
    1.5,
    NAN,
    INF,
    1e308,
    1e-320,
    1j,
    "",
    "A",
    "x",
    "A.Rz",
    "frame",
    "crank",
    "nope",
    b"A",
    [],
    [1],
    [1, 2, 3],
    [[1, 2], [3]],
    ["A"],
    [None],
    (),
    (0, 0, 0),
    (0, 0, 1),
    (NAN, 0, 0),
    ("1", "2", "3"),
    {},
    {"A": 1},
    {"A": None},
    {1: 2},
    {"A.Rz": "x"},
    set(),
    {1},
    np.zeros(0),
    np.zeros((3, 3)),
    np.ones((2, 3, 4)),
    np.array("A"),
    np.array([None]),
    np.ma.array([1, 2], mask=[0, 1]),
    np.float32(3),
    np.datetime64(1, "s"),
    datetime.date(2000, 1, 1),
    decimal.Decimal(1),
    object(),
    Rude(),
    _deep(),
    repr,
    len,
    lambda *a: None,
    lambda *a: 1 / 0,
    lambda *a: "x",
    int,
    range(3),
    iter([1]),
    mg.Link("x"),
    mg.Gravity((0, 0, 1)),
    mg.Drive("A"),
    mg.Marker(),
    mg.Motion(1.0),
    mg.Coupling({"A": 1.0}),
    mg.Effort("A", 1.0),
    mg.Pair("Q", "R", "frame", "crank"),
    mg.Freedom("Rz", (0, 0, 1, 0, 0, 0)),
    mg,
    "\x00",
    "\ud800",
    scipy.stats.norm,
    scipy.stats.norm(1, 2),
    np.eye(4),
    Path("x"),
]


def attack_call(seed: int, folder: Path) -> None:
    """A call with some of its arguments replaced by something else."""
    rng = random.Random(seed)
    name, call, args, more = rng.choice(every_door(folder))
    given, named = list(args), dict(more)
    for _ in range(rng.choice([1, 1, 2])):
        i = rng.randrange(len(given) + len(named))
        wrong = rng.choice(WRONG)
        wrong = copy.copy(wrong) if isinstance(wrong, Iterator) else wrong  # what is read once is left for later inputs
        if rng.random() < 0.25:
            wrong = rng.choice([[wrong], (wrong, wrong, wrong), {"A": wrong}, [wrong, 1.0], np.array([0, 1, 2, 3.0])])
        if callable(wrong) and [*[""] * len(given), *named][i] in ("progress", "by"):
            continue  # what a user's function raises is the user's
        if i < len(given):
            given[i] = wrong
        else:
            named[list(named)[i - len(given)]] = wrong
    with contextlib.chdir(folder):  # a wrong path may be a good name of a file
        answered(lambda: call(*given, **named), f"{name}, seed {seed}")


# --- mechanisms --------------------------------------------------------------------------------------------------------------


def plausible(rng: random.Random) -> mg.Mechanism | None:
    """Links and pairs at random, closed as declared; special positions, sizes and directions are frequent. None where it is refused."""
    numbers = np.random.default_rng(rng.randrange(2**32))
    size = rng.choice([1.0, 1.0, 1.0, 1e-6, 1e6, 1e-12, 1e30])
    n = rng.choice([2, 2, 3, 4, 4, 5, 6])
    names = [f"l{i}" for i in range(n)]
    types = [t for t in mg.pair_types() if rng.random() < 0.6] or ["R"]
    planar = rng.random() < 0.3

    def vector(special: float) -> list[float]:
        if planar and special:
            return [0.0, 0.0, 1.0]
        if rng.random() < 0.4:
            return [float(rng.choice([-1, 0, 1])) for _ in range(3)]
        return numbers.normal(size=3).tolist()

    pairs = []
    ends = [(rng.randrange(i), i) for i in range(1, n)] + [
        rng.sample(range(n), 2) for _ in range(rng.choice([0, 1, 1, 1, 2, 3]))
    ]
    for k, (a, b) in enumerate(ends):
        axis, second = vector(1.0), vector(0.0)
        kind = rng.choice(types)
        if mg.pair_types()[kind].square_second:
            second = np.cross(axis, second).tolist()
        place = {
            "point": [size * x for x in vector(0.0)],
            "axis": axis,
            "second": second if rng.random() < 0.7 else None,
        }
        if rng.random() < 0.2:
            place = {"on_a": mg.Marker(**place), "on_b": mg.Marker(**place)}
        pitch = {"pitch": size * rng.choice([0.1, -0.01, 0.0, 1e-9])} if kind == "H" else {}
        pairs.append(mg.Pair(f"P{k}", kind, names[a], names[b], **place, **pitch))
    links = [
        mg.Link(x)
        if rng.random() < 0.4
        else mg.Link(x, rng.choice([0.0, 1.0, 1e-9, 1e9]), [size * v for v in vector(0.0)])
        for x in names
    ]
    freedoms = [name for p in pairs for name, able in zip(p.freedom_names, p.type.drivable, strict=True) if able]
    drives = rng.sample(freedoms, min(len(freedoms), rng.choice([0, 1, 1, 1, 2, 3])))
    loads = [mg.Gravity((0, 0, -9.81))] * (rng.random() < 0.7)
    loads += [mg.Wrench(rng.choice(names), force=vector(0.0), point=vector(0.0))] * (rng.random() < 0.3)
    if freedoms and rng.random() < 0.3:
        loads.append(mg.Effort(rng.choice(freedoms), rng.choice([1.0, 0.0, 1e20])))
    couplings = []
    if len(freedoms) > 1 and rng.random() < 0.2:
        couplings = [
            mg.Coupling(
                {q: rng.choice([1.0, -2.0, 1e-3]) for q in rng.sample(freedoms, 2)},
                constant=rng.choice([None, 0.0, 1.0]),
            )
        ]
    start = {q: rng.uniform(-1, 1) for q in freedoms if rng.random() < 0.1}
    made = answered(
        lambda: mg.Mechanism(
            "odd",
            links,
            pairs,
            drives,
            loads,
            couplings=couplings,
            start=start,
            units=rng.choice([None, {"length": "m"}]),
        ),
        "declare",
    )
    return made if isinstance(made, mg.Mechanism) else None


def attack_mechanism(seed: int) -> None:
    """A plausible mechanism is used."""
    rng = random.Random(seed)
    m = plausible(rng)
    if m is None:
        return
    used(m, rng)
    freedoms = [d.freedom for d in m.drives]
    at = {q: rng.choice([0.0, 0.3, -2.0, 8.0]) for q in freedoms}
    answered(lambda: mg.assemble(m, at), f"assemble at {at}")
    answered(lambda: m.moved(np.diag([-1.0, -1.0, 1.0, 1.0])), "moved")
    massive = [link.name for link in m.links if link.center is not None]
    if massive and freedoms and rng.random() < 0.1:
        outputs = [f"{m.full_name(freedoms[0])}", "shaking"]
        answered(
            lambda: mg.study(m, {f"{massive[0]}.mass": [1.0, 2.0]}, outputs, n=2, motions=dict.fromkeys(freedoms, 0.1)),
            "study",
        )
