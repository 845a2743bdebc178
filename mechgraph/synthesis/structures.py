"""Structure first: every choice of frame, input and output link of chains of turning pairs becomes a mechanism that is asked the same.

What is asked names the parts: pairs stand at the frame (the input and output of a function, freedoms with timing), links that a path or
poses name are not joined to it, as such links would only turn. Choices that are the same up to the numbers of links count once. Where
links could be left out and the rest could still do what is asked (``M = 3 (n - 1) - 2 j`` of the rest is that of all) they have no part in
it: such a choice is that of a smaller chain.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain as joined
from itertools import combinations, permutations
from typing import Any

import numpy as np

from mechgraph.errors import DeclarationError, counted
from mechgraph.graph.atlas import identify
from mechgraph.graph.chains import Chain
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Pair
from mechgraph.quantities import shown
from mechgraph.synthesis.answers import Syntheses, joined_answers
from mechgraph.synthesis.classes import NoClass, TaskClass
from mechgraph.synthesis.system import RowProblem
from mechgraph.synthesis.tasks import FunctionTask, PathTask, PoseTask, asked_of

WHERE = "synthesis of chains"


@dataclass(frozen=True)
class AskedMechanism:
    """A mechanism with a random geometry, and the numbers of it that are sought."""

    mechanism: Mechanism
    unknown: tuple[str, ...]


@dataclass(frozen=True)
class Roles:
    """Parts that are asked something: pairs at the frame ``pins``, links ``bodies`` with their points; the pairs that drive."""

    pins: tuple[str, ...]
    bodies: Mapping[str, tuple[str, ...]]
    drives: tuple[str, ...]

    @staticmethod
    def of(tasks: Any) -> Roles:
        """The parts that tasks name.

        Raises
        ------
        DeclarationError
            where tasks do not say what is a pair and what a link.
        """
        pins, drives, bodies, faults = list[str](), list[str](), dict[str, tuple[str, ...]](), list[str]()
        kinds = (FunctionTask, PathTask, PoseTask)
        for i, task in enumerate(tasks if isinstance(tasks, list | tuple) else [tasks]):
            names = [
                *getattr(task, "at", ()),
                *(getattr(task, name, "") for name in ("input", "output", "link", "point")),
            ]
            if not isinstance(task, kinds) or not all(isinstance(name, str) for name in names):
                faults.append(f"tasks[{i}]: {shown(task)}: of chains expected mg.function, mg.path or mg.poses")
                continue
            drives += [*task.at] if not isinstance(task, FunctionTask) else [task.input]
            pins += [*task.at] if not isinstance(task, FunctionTask) else [task.input, task.output]
            if isinstance(task, PathTask):
                link, _, point = task.point.partition(".")
                bodies[link] = (*bodies.get(link, ()), point)
            elif isinstance(task, PoseTask):
                bodies.setdefault(task.link, ())
        if faults:
            raise DeclarationError(WHERE, faults)
        once = [tuple(dict.fromkeys(name.partition(".")[0] for name in names)) for names in (pins, drives)]
        return Roles(once[0], bodies, once[1] or ("input",))

    @property
    def at_frame(self) -> tuple[str, ...]:
        """All pairs at the frame that have a name."""
        return tuple(dict.fromkeys((*self.drives, *self.pins)))


@dataclass(frozen=True)
class MarkedChain:
    """A chain on its ``frame``, with a link for every name of ``roles``."""

    chain: Chain
    frame: int
    links: Mapping[str, int]
    roles: Roles

    @property
    def has_idle_links(self) -> bool:
        """Whether some links have no part in what is asked."""
        asked = {self.frame, *(self.links[name] for name in (*self.roles.pins, *self.roles.bodies))}
        rest = [link for link in range(self.chain.links) if link not in asked]
        kept = (asked.union(some) for n in range(len(rest)) for some in combinations(rest, n))
        return any(_mobility(self.chain, links) == self.chain.mobility for links in kept)

    def mechanism(self, name: str, points: Mapping[str, Array], rng: np.random.Generator, box: Array) -> Mechanism:
        """The mechanism with pins at random places of a ``box (2, 2)`` and points of links where they are asked first.

        Pairs stand in the order of a walk round the chain from the first driver on, and are called J2, J3, ... but for those with names.
        """
        body = {self.links[name]: name for name in self.roles.bodies}
        pin = {self.links[at]: at for at in self.roles.at_frame}
        walk = list(_walk(self.chain, self.frame, self.links[self.roles.drives[0]]))
        names = {self.frame: "frame"}
        for link in joined.from_iterable((a, b) for _, a, b in walk):
            names.setdefault(link, body.get(link, f"L{len(names)}"))
        links = [
            Link(name, points={p: points[f"{name}.{p}"] for p in self.roles.bodies.get(name, ())})
            for name in names.values()
        ]
        pairs = [
            Pair(pin[b] if a == self.frame and b in pin else f"J{k}", "R", names[a], names[b], point=rng.uniform(*box))
            for k, (_, a, b) in enumerate(walk, 1)
        ]
        return Mechanism(name, links, pairs, drives=self.roles.drives, planar=True)


def _mobility(chain: Chain, links: set[int]) -> int:
    """Freedoms of some links of a planar chain of turning pairs, one of them at rest."""
    return 3 * (len(links) - 1) - 2 * sum(links.issuperset(joint) for joint in chain.joints)


def _walk(chain: Chain, frame: int, first: int) -> Iterator[tuple[int, int, int]]:
    """Joints with the links from and to which they lead, depth first from ``first``, that at the frame first; the frame is never behind."""
    seen = set[int]()

    def along(link: int, only: int | None = None) -> Iterator[tuple[int, int, int]]:
        for k, joint in enumerate(chain.joints):
            other = sum(joint) - link
            if k in seen or link not in joint or only not in (None, other):
                continue
            seen.add(k)
            yield (k, frame, link) if other == frame else (k, link, other)
            if other != frame:
                yield from along(other)

    yield from along(frame, first)
    yield from along(frame)


def choices(chain: Chain, roles: Roles) -> Iterator[MarkedChain]:
    """Every choice of frame and links for roles, up to the numbers of links."""
    seen = set[Any]()
    for frame, *_ in chain.inversions:
        beside = [sum(joint) - frame for joint in chain.joints if frame in joint]
        others = [link for link in range(chain.links) if link not in (frame, *beside)]
        for pins in permutations(beside, len(roles.at_frame)):
            for bodies in permutations(others, len(roles.bodies)):
                links = dict(zip((*roles.at_frame, *roles.bodies), (*pins, *bodies), strict=True))
                code = chain.marked_code({frame: 1} | {link: k for k, link in enumerate(links.values(), 2)})
                if code not in seen:
                    seen.add(code)
                    yield MarkedChain(chain, frame, links, roles)


def structures(chains: Iterable[Chain], tasks: Any, exact: bool, seed: int) -> tuple[list[AskedMechanism], list[str]]:
    """The mechanisms of all choices with the numbers that are sought, and in words how many these are and which were left out.

    Exact tasks determine as many numbers as they have conditions; the others keep random values of ``seed``. Those are sought, of the
    moving pins first, on which what is done depends most in turn: of the conditions ``J dz`` of a random mechanism the columns that are
    independent. Fits seek all pins, but for two at the frame where only functions are asked, which no similarity changes.

    Raises
    ------
    DeclarationError
        Chains with other than turning pairs of two links; faults of tasks.
    """
    roles, every, faults = Roles.of(tasks), list(chains), list[str]()
    for i, one in enumerate(every):
        if one.is_multiple or set(one.types) != {"R"} or one.family != 3:
            faults.append(
                f"chain {i + 1}: {one!r}: expected turning pairs (R) of two links each, in a plane (family=3)"
            )
    faults += [] if every else ["m: no chain is given"]
    if faults:
        raise DeclarationError(WHERE, faults)
    found, idle, refused = list[AskedMechanism](), 0, list[str]()
    rng = np.random.default_rng(seed)
    for i, one in enumerate(every, 1):
        for k, choice in enumerate(choices(one, roles), 1):
            if choice.has_idle_links:
                idle += 1
                continue
            m, candidates = _placed(choice, f"{one.links}-link chain {i}", k, tasks, rng)
            if not exact:
                found.append(AskedMechanism(m, tuple(candidates)))
                continue
            sought = _determined(m, tasks, candidates, rng)
            if isinstance(sought, str):
                refused.append(f"{m.name}: {sought}")
            else:
                found.append(AskedMechanism(m, sought))
    told = [
        f"{counted(len(every), 'chain')}: {counted(len(found), 'mechanism')} by choice of frame, input and output link"
    ]
    told += [f"{counted(idle, 'choice')} left out, in which some links have no part in what is asked"] * (idle > 0)
    if not found:
        raise DeclarationError(WHERE, [*told, *refused] or ["no chain has links enough for what is asked"])
    return found, [*told, *refused]


def _points(roles: Roles) -> list[str]:
    return [f"{body}.{point}" for body, points in roles.bodies.items() for point in points]


def _placed(
    choice: MarkedChain, name: str, k: int, tasks: Any, rng: np.random.Generator
) -> tuple[Mechanism, list[str]]:
    """The mechanism of the ``k``-th choice, about the places that are asked, and all its numbers that may be sought."""
    roles, faults = choice.roles, list[str]()
    unit = np.array([[-1.0, -1.0], [1.0, 1.0]])
    probe = choice.mechanism(name, dict.fromkeys(_points(roles), np.zeros(2)), rng, unit)
    asked = asked_of(probe, tasks, faults)
    if asked is None:
        raise DeclarationError(WHERE, faults)
    at = np.array([[asked.values.get(f"{p}.T{axis}", np.full(1, np.nan))[0] for axis in "xy"] for p in _points(roles)])
    places = [
        np.concatenate([v for key, v in asked.values.items() if key.endswith(f".T{axis}")] or [unit[:, 0]])
        for axis in "xy"
    ]
    ends = np.array([[reach(v[np.isfinite(v)], initial=0.0) for v in places] for reach in (np.min, np.max)])
    middle, size = ends.mean(axis=0), float(np.ptp(ends, axis=0).max()) or 1.0
    box = middle + size * unit
    name = f"{' '.join(identify(probe).usual).strip() or name}, choice {k}"
    m = choice.mechanism(name, dict(zip(_points(roles), np.nan_to_num(at), strict=True)), rng, box)
    at_frame = [pair.name for pair in m.pairs if pair.a == m.frame]
    still = roles.at_frame[:2] if not roles.bodies else ()
    pins = [pair.name for pair in m.pairs if pair.name not in at_frame] + [n for n in at_frame if n not in still]
    sought = [f"{n}.point" for n in pins]
    sought += [p for p, row in zip(_points(roles), at, strict=True) if np.isnan(row).any()]
    return m, [f"{name}.{axis}" for name in sought for axis in "xy"]


def _determined(m: Mechanism, tasks: Any, candidates: Sequence[str], rng: np.random.Generator) -> tuple[str, ...] | str:
    """As many numbers as there are conditions, which these determine; or why there are none."""
    problem = RowProblem(m, tasks, candidates)
    try:
        of = TaskClass(problem, rng)
    except NoClass:
        return "no random mechanism of this kind could be closed at random positions"
    wanted = int(of.conditions.sum())
    J = of.leg(of.start, of.start).at(of.x[:, None], np.ones(1), np.zeros(1, dtype=int)).matrix[0]
    kept = list[int]()
    for k in range(problem.u):
        if len(kept) < wanted and rank_of(singular_values(J[:, [*kept, k]]), MODES.generic) > len(kept):
            kept.append(k)
    if not kept or len(kept) < wanted:
        return f"{counted(wanted, 'condition')}, of which its dimensions can meet {len(kept)}"
    names = [problem.unknowns.names[problem.sought[k]] for k in kept]
    order = [pair.name for pair in m.pairs]
    return tuple(sorted(names, key=lambda name: order.index(name.partition(".")[0])))


def of_chains(
    ask: Callable[..., Any],
    chains: Iterable[Chain],
    tasks: Any,
    unknown: Sequence[str] | None,
    given: Mapping[str, Any],
    seed: int,
    cache: bool,
    progress: Callable[[str], None] | None,
) -> Syntheses:
    """Answers ``ask``ed of all mechanisms that chains make, ranked together; those that refuse the task are told."""
    if tasks is None or given["sweep"]:
        raise DeclarationError(WHERE, ["expected tasks, and no sweep: give chains random numbers of another seed"])
    exact = all(given[name] is None for name in ("fit", "minimize", "maximize"))
    every, told = structures(chains, tasks, exact, seed)
    found, refused = list[Syntheses](), list[str]()
    if progress is not None:
        for text in [*told, *(f"{one.mechanism.name}: {counted(len(one.unknown), 'unknown')}" for one in every)]:
            progress(text)
    for one in every:
        say = None if progress is None else partial(_said_of, one.mechanism.name, progress)
        try:
            found.append(
                ask(one.mechanism, tasks, unknown or one.unknown, **given, seed=seed, cache=cache, progress=say)
            )
        except DeclarationError as error:
            refused += [f"{one.mechanism.name}: {fault}" for fault in error.faults]
    if not found:
        raise DeclarationError(WHERE, [*told, *refused])
    return joined_answers(found, [f"{text}." for text in [*told, *refused]])


def _said_of(name: str, progress: Callable[[str], None], text: str) -> None:
    progress(f"{name}: {text}")
