"""Tolerances asked for by name: they change the verdict, they show themselves, and two sets are never mixed."""

import dataclasses
import inspect
import pickle
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import mechgraph as mg
from mechgraph.maths import tolerances as inside
from mechgraph.memo import ASKED, dataclass

COARSE = mg.Tolerances(rank={"loop": 1e-4, "position": 1e-4})
SHORT = mg.Tolerances(path={"longest": 0.02, "first": 0.01, "shortest_quick": 1e-4})


def tilted(angle: float = 1e-6) -> mg.Mechanism:
    """A planar four-bar, the axis of one pair out of parallel by an angle."""
    points = {"A": (0, 0, 0), "B": (0, 1, 0), "C": (3, 2, 0), "D": (4, 0, 0)}
    axes = dict.fromkeys(points, (0.0, 0.0, 1.0)) | {"C": (np.sin(angle), 0.0, np.cos(angle))}
    ends = {"A": ("base", "crank"), "B": ("crank", "rod"), "C": ("rod", "rocker"), "D": ("rocker", "base")}
    pairs = [mg.Pair(name, "R", *ends[name], point=points[name], axis=axes[name]) for name in points]
    return mg.Mechanism("tilted", pairs=pairs, drives=["A"])


def verdict(m: mg.Mechanism, **asked) -> tuple[int, int]:
    r = mg.check(m, **asked)
    return r.mobility, r.redundancy


def test_nearly_parallel_axes_are_parallel_to_a_coarser_tolerance() -> None:
    m = tilted()
    assert verdict(m) == (0, 2)
    assert verdict(m, tolerances=COARSE) == (1, 3) == verdict(m.with_tolerances(COARSE)) == verdict(tilted(0.0))
    assert verdict(m) == (0, 2) == verdict(m.with_tolerances(COARSE), tolerances=mg.Tolerances())


def test_a_solution_takes_the_steps_that_it_is_asked_with() -> None:
    m, motion = mg.load("four-bar"), {"A": mg.Motion([0.0, 1.0], velocity=1.0)}
    usual, short, again = (mg.solve(m, motion, engine="dense", tolerances=t) for t in (None, SHORT, None))
    assert short.work.nodes > 3 * usual.work.nodes == 3 * again.work.nodes
    np.testing.assert_allclose(short["A"].effort, usual["A"].effort, rtol=1e-9)
    assert mg.kinematics(m, motion, engine="dense", tolerances=SHORT).work.nodes == short.work.nodes


@pytest.fixture
def read(monkeypatch):
    """The tolerances under which numbers are read."""
    seen: set[object] = set()
    own = inside._Asked.__getattr__

    def watched(self, name):
        seen.add(ASKED.get())
        return own(self, name)

    monkeypatch.setattr(inside._Asked, "__getattr__", watched)
    return seen


def everything(thing: object) -> None:
    """Read all public attributes, and the text."""
    str(thing)
    for name in dir(type(thing)):
        if not name.startswith("_") and not callable(getattr(type(thing), name)):
            try:
                getattr(thing, name)
            except mg.MechgraphError:
                continue


CALLS = {
    "check": lambda m, t: mg.check(m, tolerances=t),
    "solve": lambda m, t: mg.solve(m, {"A": mg.Motion([0.0, 0.3], velocity=1.0)}, tolerances=t, engine="dense"),
    "kinematics": lambda m, t: mg.kinematics(m, {"A": mg.Motion([0.0, 0.3], velocity=1.0)}, tolerances=t),
    "respond": lambda m, t: mg.respond(m.replace(drives=[]), [0.0, 0.01], tolerances=t),
    "assemblies": lambda m, t: mg.assemblies(m, {"A": 0.2}, tolerances=t),
    "study": lambda m, t: mg.study(
        m, {"B.point.x": [0.0, 1e-3]}, "A.effort", 2, tolerances=t, engine="dense", executor=ThreadPoolExecutor(1)
    ),
}


@pytest.mark.parametrize("call", CALLS)
def test_what_is_read_later_goes_by_the_same(read, call: str) -> None:
    m = mg.load("four-bar")
    usual = CALLS[call](m, None)
    assert read <= {None}
    read.clear()
    result = CALLS[call](m, SHORT)
    everything(result)
    if call in ("solve", "kinematics"):
        everything(result["B"])
        everything(result.link("coupler"))
    assert read == {SHORT}
    assert ASKED.get() is None
    read.clear()
    everything(usual)
    assert read <= {None}


def test_copies_and_pickles_carry_them_and_the_mechanism_does_not() -> None:
    m = tilted()
    coarse = m.with_tolerances(COARSE)
    assert pickle.loads(pickle.dumps(coarse)).replace(loads=[]).replace(name="other").tolerances == COARSE
    assert m.replace(loads=[]).tolerances == m.tolerances == mg.Tolerances()
    assert coarse == m


def test_a_call_within_a_call_goes_by_its_own() -> None:
    inner: list[tuple[int, int]] = []
    m = mg.load("four-bar").with_tolerances(COARSE)
    mg.solve(m, progress=lambda done, of: inner.append(verdict(tilted(), tolerances=mg.Tolerances())))
    mg.solve(m, progress=lambda done, of: inner.append(verdict(FINE)))
    assert inner[0] == (0, 2) == inner[-1]


FINE = tilted()


def test_threads_do_not_mix_them() -> None:
    m = tilted()

    def ask(i: int) -> tuple[int, int]:
        return verdict(m.replace(name=f"m{i}"), **({"tolerances": COARSE} if i % 2 else {}))

    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(ask, range(12))) == [(0, 2), (1, 3)] * 6


def test_other_tolerances_are_not_for_the_kernel(compiled) -> None:
    with pytest.raises(mg.DeclarationError, match="other tolerances"):
        mg.solve(mg.load("four-bar"), engine="compiled", tolerances=SHORT)


def test_an_error_under_other_tolerances_names_them() -> None:
    """So that the geometry is not blamed for them; once, and nothing under the default ones."""
    coarse = mg.Tolerances(rank={"loop": 0.9})
    with pytest.raises(mg.DeclarationError, match="too far apart") as caught:
        mg.solve(mg.load("rcsr"), tolerances=coarse)
    assert str(caught.value).endswith("other than the default ones: rank.loop = 0.9 (default 1e-09)")
    assert str(caught.value).count("other than") == 1
    assert mg.Tolerances().changed == ""
    with pytest.raises(mg.DeclarationError) as caught:
        mg.solve(mg.load("rcsr"), {"X": 0.0})
    assert "other than" not in str(caught.value)


def test_every_number_shows_its_reason() -> None:
    text = repr(mg.Tolerances(rank={"loop": 1e-6}))
    assert "closed = 1e-14" in (mg.Tolerances.__doc__ or "")
    assert "path.closed = 1e-14: Closure residual" in text


def test_wrong_numbers_are_all_named() -> None:
    with pytest.raises(mg.DeclarationError) as caught:
        mg.Tolerances(rank={"loops": 1e-6, "loop": -1.0}, path={"iterations": 2.5, "closed": "small"}, stress=3)
    assert len(caught.value.faults) == 5
    with pytest.raises(mg.DeclarationError, match="expected Tolerances"):
        mg.check(mg.load("four-bar"), tolerances=1e-6)


# --- dataclasses of which the methods are written late ---------------------------------------------------------------------


def classes(decorate: Any) -> tuple[type, type]:
    """A dataclass and one above it."""

    @decorate(frozen=True, repr=False)
    class Placed:
        """A place."""

        x: float
        y: float = dataclasses.field(default=2.0, kw_only=True)
        names: list[str] = dataclasses.field(default_factory=list, compare=False)

        def __post_init__(self) -> None:
            object.__setattr__(self, "x", float(self.x))

    @decorate(frozen=True)
    class Turned(Placed):
        angle: float = 0.5

    return Placed, Turned


def behavior(decorate: Any) -> list[Any]:
    """All that a dataclass is seen to do."""
    placed, turned = classes(decorate)
    out = [inspect.signature(turned), [f.name for f in dataclasses.fields(placed)], placed.__doc__, placed.__qualname__]
    one = turned(1, angle=3.0, y=4.0)
    out += [repr(one), one == dataclasses.replace(one), one == turned(1), placed(1) == turned(1), hash(one)]
    out += [turned.__match_args__, turned.__init__.__qualname__, dataclasses.asdict(one), turned.y]
    for wrong in (lambda: setattr(one, "x", 2.0), lambda: delattr(one, "z"), turned, lambda: turned(1, 2, 3, 4)):
        with pytest.raises((TypeError, AttributeError)) as error:
            wrong()
        out.append(str(error.value))
    return list(map(str, out))


def test_a_dataclass_written_late_is_that_of_the_standard_library() -> None:
    assert behavior(dataclass) == behavior(dataclasses.dataclass)


def test_threads_that_make_the_first_objects_at_once_make_whole_ones() -> None:
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(8) as pool:
            for _ in range(5):
                _, turned = classes(dataclass)
                assert list(pool.map(lambda x, kind=turned: kind(x).x, range(16))) == list(range(16))
    finally:
        sys.setswitchinterval(before)


@dataclass(frozen=True)
class Early:
    x: float


@dataclass(frozen=True)
class Later:
    x: float


def test_the_first_object_may_come_out_of_a_pickle() -> None:
    out = pickle.loads(pickle.dumps(Early(1.0)).replace(b"Early", b"Later"))
    with pytest.raises(dataclasses.FrozenInstanceError):
        out.x = 2.0
    assert repr(out) == "Later(x=1.0)"
    assert out == Later(1.0)
