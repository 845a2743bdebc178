"""The facts of a determinacy report: of the graph alone and of a closed position, each computed when first asked for.

Also which drivers move a mechanism, and which freedoms would complete them: pure functions of what can move.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechgraph.determinacy import findings
from mechgraph.determinacy.decomposition import Decomposition, decomposition
from mechgraph.determinacy.families import Families, MotionKind, families, kind_of, kind_of_mechanism
from mechgraph.determinacy.findings import (
    LIMIT,
    Advice,
    Finding,
    LoopData,
    PassiveFinding,
    completing,
    driving_advice,
    variants,
)
from mechgraph.determinacy.finite_motion import FiniteMotion, finite_motion
from mechgraph.determinacy.mobility import Freedoms, Generic, freedoms_at, generic
from mechgraph.determinacy.pair_changes import LARGEST_FOR_SETS, Effect, advice
from mechgraph.determinacy.uniqueness import MisfitSum, SelfStress, Uniqueness, misfit_sums, uniqueness
from mechgraph.equations.build import BOOKKEEPINGS, BookkeepingName, formulate
from mechgraph.equations.terms import Ledger, LedgerRow
from mechgraph.errors import Budget, DeclarationError
from mechgraph.force.loads import hold_names
from mechgraph.graph.linkgraph import GraphParts, LinkGraph, link_graph, parts_of
from mechgraph.kinematics.assembly import at_position
from mechgraph.kinematics.solver import EngineName
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import independent_rows
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import RANKS
from mechgraph.memo import dataclass
from mechgraph.model.friction import rests_on, rubbing_loads
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import wrong


def suggested(
    freedoms: Freedoms, driven: Index, moving: Index, able: NDArray[np.bool_], wanted: int, engine: EngineName
) -> list[int]:
    """Columns among those ``able (F,)`` that complete the drivers ``moving`` to at most ``wanted``, independent.

    A driver may stop a motion that was passive, and so leave another one undriven; then more are sought.
    """
    columns = moving
    after = freedoms if len(moving) == len(driven) else freedoms_at(freedoms.position, moving, engine)
    while after.undriven and len(columns) < wanted:
        both = [*columns.tolist(), *completing(after, able)]
        independent = np.array(independent_rows(freedoms.null, both, wanted), dtype=np.intp)
        if len(independent) == len(columns):
            break
        columns = independent
        after = freedoms_at(freedoms.position, columns, engine)
    return [int(c) for c in np.sort(columns[len(moving) :])]


@dataclass(frozen=True, repr=False)
class GraphFacts:
    """Names, loops and counts of a mechanism, whatever its geometry."""

    mechanism: Mechanism
    graph: LinkGraph

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the links."""
        return self.mechanism.link_names()

    @cached_property
    def pairs(self) -> tuple[str, ...]:
        """Names of the pairs."""
        return tuple(p.name for p in self.mechanism.pairs)

    @cached_property
    def loops(self) -> tuple[tuple[tuple[str, int], ...], ...]:
        """Independent loops, each a chain of (pair name, sign)."""
        return tuple(tuple((self.pairs[k], sign) for k, sign in loop) for loop in self.graph.loops)

    @property
    def freedom_count(self) -> int:
        """Sum of the freedoms of the pairs."""
        return sum(p.type.f for p in self.mechanism.pairs)

    @property
    def equation_count(self) -> int:
        """Number of closure equations: six a loop (in the plane three), one a coupling."""
        return self.graph.loop_rows + len(self.mechanism.couplings)

    @property
    def mobility_by_count(self) -> int:
        """Kutzbach mobility: sum of freedoms - closure equations."""
        return self.freedom_count - self.equation_count

    def ledger(self, bookkeeping: BookkeepingName = "lee") -> Ledger:
        """Count unknowns against equations of the force equations.

        Parameters
        ----------
        bookkeeping : {"lee", "minimal"}
            Choice of unknowns.

        Returns
        -------
        Ledger
            ``unknowns``, ``equations``, ``balance`` = equations - unknowns, ``by_kind``.

        Examples
        --------
        >>> import mechgraph as mg
        >>> ledger = mg.check(mg.load("7r")).ledger("lee")
        >>> ledger.unknowns, ledger.equations
        (50, 50)
        """
        countable = isinstance(bookkeeping, str) and bookkeeping in BOOKKEEPINGS and not self.mechanism.couplings
        if countable:
            return counted_ledger(self.mechanism, bookkeeping)
        return formulate(self.mechanism, bookkeeping).ledger()

    @cached_property
    def parts(self) -> GraphParts:
        """Dulmage-Mendelsohn parts: which links and pairs are over-, which underdetermined by count."""
        return parts_of(self.mechanism, self.graph)


def counted_ledger(m: Mechanism, bookkeeping: str) -> Ledger:
    """The ledger counted from the pair table: must agree with that of the formulation."""
    rows: dict[str, LedgerRow] = {}
    for pair in m.pairs:
        unknowns, equations = pair.type.unknowns_and_equations if bookkeeping == "lee" else (pair.type.held, 0)
        old = rows.get(pair.type.symbol, LedgerRow(0, 0, 0))
        rows[pair.type.symbol] = LedgerRow(old.count + 1, old.unknowns + unknowns, old.equations + equations)
    rows["driver"] = LedgerRow(len(m.drives), len(m.drives), 0)
    rows["link"] = LedgerRow(len(m.links) - 1, 0, m.once(link_graph).width * (len(m.links) - 1))
    return Ledger(bookkeeping, rows)


def nearly_singular(loops: int) -> float:
    """Margin below which a position is called nearly singular; of a regular chain of n loops it goes as 1 / (n + 1)."""
    return 2.0 * RANKS.near / (1 + max(loops, 1))


@dataclass(frozen=True, repr=False)
class Geometry:
    """A closed position: the scaled system, its state, the driven columns and what can move."""

    system: System
    x: Array
    driven: Index
    freedoms: Freedoms

    def __repr__(self) -> str:
        return f"Geometry({len(self.x)} numbers of a closed position)"


@dataclass(frozen=True, repr=False)
class Facts(GraphFacts):
    """What the graph alone (see ``GraphFacts``) and the graph with its geometry say about a mechanism.

    Facts that need geometry are None (or empty) for a topology, and where the loops cannot be closed (see ``note``).
    What is expensive is computed when first asked for, whatever the size; ``engine`` says which one decided the rank.
    """

    note: str = ""
    geometry: Geometry | None = None
    asked: EngineName = "auto"
    limit: float = LIMIT

    # --- what the topology decides ---------------------------------------------------------------------------------------

    @cached_property
    def generic(self) -> Generic:
        """Rank and excess for random geometry: what the topology alone decides."""
        return generic(self.mechanism, self.graph, self.asked)

    @cached_property
    def loop_facts(self) -> tuple[LoopData, ...]:
        """Every loop taken alone: its chain, freedoms, rank and excess."""
        position = self.geometry.freedoms.position if self.geometry else None
        return findings.loop_facts(self.mechanism, self.loops, position)

    # --- what can move -------------------------------------------------------------------------------------------------

    @property
    def engine(self) -> str:
        """Which engine decided the rank here, ``"dense"`` or ``"sparse"``; empty where there is no geometry."""
        return self.geometry.freedoms.closure.engine if self.geometry else ""

    @property
    def mobility(self) -> int | None:
        """Freedoms minus rank of the closure Jacobian here."""
        return self.geometry.freedoms.mobility if self.geometry else None

    @cached_property
    def motion(self) -> FiniteMotion | None:
        """What was seen when the motions were followed over finite strokes."""
        g = self.geometry
        return finite_motion(g.system, g.x, g.freedoms.closure, self.asked) if g else None

    @property
    def finite_mobility(self) -> int | None:
        """Mobility over finite strokes: the dimension of the set of closed positions."""
        return self.motion.mobility if self.motion else None

    @property
    def stroke(self) -> float | None:
        """Length (radians, or lengths / L) over which a motion was followed with the loops closed."""
        return self.motion.stroke if self.motion else None

    @property
    def inputs(self) -> int | None:
        """Input freedoms: mobility minus passive freedoms."""
        return self.geometry.freedoms.mobility - len(self.geometry.freedoms.passive) if self.geometry else None

    @property
    def redundancy(self) -> int | None:
        """Closure equations minus rank: number of self-stresses with the drivers free."""
        return self.geometry.freedoms.redundancy if self.geometry else None

    @property
    def excess(self) -> dict[str, int]:
        """The redundancy by reason: ``structural`` (whatever the dimensions), ``dimensions`` (all along the motion), ``here``."""
        if not self.motion or self.redundancy is None:
            return {}
        nearby = self.equation_count - self.motion.rank_nearby
        structural = min(self.generic.excess, nearby)
        return {"structural": structural, "dimensions": nearby - structural, "here": self.redundancy - nearby}

    @cached_property
    def _kind(self) -> MotionKind:
        """The kind about the internal origin."""
        return kind_of_mechanism(self.geometry.freedoms, self.motion) if self.geometry else MotionKind()

    @cached_property
    def kind(self) -> MotionKind:
        """Planar, spherical or neither: of all pairs, else of the motion; its normal or center in the global frame."""
        g = self.geometry
        return self._kind.in_global(g.system.par) if g else MotionKind()

    @cached_property
    def loop_kinds(self) -> tuple[MotionKind, ...]:
        """The kind of every loop by its pairs."""
        if not (g := self.geometry):
            return ()
        S, loops = g.freedoms.position.rows.S, g.system.loop_columns
        return tuple(kind_of(S[:, columns]).in_global(g.system.par) for columns, _ in loops)

    # --- structure by the book ------------------------------------------------------------------------------------------

    @cached_property
    def families(self) -> Families | None:
        """Mobility table, families of mechanism and loops, the counts of the textbooks."""
        g = self.geometry
        return families(g.freedoms, g.driven, self.motion) if g and self.motion else None

    @property
    def family(self) -> int | None:
        """The family: freedoms that no pair has along the motion (see ``families``)."""
        return self.families.family if self.families else None

    @cached_property
    def groups(self) -> Decomposition | None:
        """Driver links and structural groups in the order in which they can be solved, for the declared (else suggested) drivers."""
        names = tuple(d.freedom for d in self.mechanism.drives)
        return self.groups_with(names if names and not self.suggested_drives else (*names, *self.suggested_drives))

    def groups_with(self, drives: Sequence[str]) -> Decomposition | None:
        """Return driver links and structural groups for other drivers.

        Parameters
        ----------
        drives : sequence of str
            Names of freedoms; of dependent ones the first count.

        Returns
        -------
        Decomposition or None
            None without a closed position.

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.check(mg.load("windows-2")).groups_with(["A1"]).symbol
        'R - D10 - D10 - 1 + 0'
        """
        if not (g := self.geometry):
            return None
        place = {name: i for i, name in enumerate(self.mechanism.freedom_names())}
        columns = np.array([place[self.mechanism.full_name(name)] for name in drives], dtype=np.intp)
        freedoms = self._freedoms_with(g, columns)
        if len(columns) > freedoms.mobility - len(freedoms.passive):
            columns = columns[freedoms.leading(columns)]
            freedoms = self._freedoms_with(g, columns)
        return decomposition(freedoms, columns, self._kind)

    def _freedoms_with(self, g: Geometry, columns: Index) -> Freedoms:
        at_hand = np.array_equal(columns, g.driven)
        return g.freedoms if at_hand else freedoms_at(g.freedoms.position, columns, self.asked)

    @cached_property
    def groups_by_driver(self) -> dict[str, str]:
        """For every freedom that can drive, the symbol of the groups with it as driver (with mobility above one: instead of the last)."""
        if not self.groups:
            return {}
        others = self.groups.drivers[:-1]
        able = [name for f in self.drivable for name in f.freedoms if name not in others]
        # freedoms that are tried as driver where the groups of all choices are asked for
        found = {name: self.groups_with((*others, name)) for name in able[:60]}
        return {name: d.symbol for name, d in found.items() if d and not d.free}

    @cached_property
    def own_forces_unique(self) -> bool:
        """Whether what a planar mechanism carries in its plane (a spherical one about its center) is unique, driver efforts with it."""
        return bool(self.kind.name and self.reactions and self.reactions.is_unique_on(self.kind.twists))

    # --- how sure that is ----------------------------------------------------------------------------------------------

    @property
    def margin(self) -> float | None:
        """Smallest kept singular value over the largest: small means nearly singular."""
        return self.geometry.freedoms.closure.margin if self.geometry else None

    @property
    def dropped(self) -> float | None:
        """Largest dropped singular value over the largest (0 where none is dropped)."""
        return self.geometry.freedoms.closure.dropped if self.geometry else None

    @property
    def near(self) -> bool:
        """Whether a small change may change the verdict."""
        return self.near_other_rank or self.near_other_uniqueness or self.dead_point

    @property
    def near_other_rank(self) -> bool:
        """Whether a small singular value was kept, or one above rounding dropped."""
        if self.margin is None or self.dropped is None:
            return False
        return self.margin < self.near_below or self.dropped > RANKS.doubt

    @property
    def near_other_uniqueness(self) -> bool:
        """Whether a component of a small part in the self-stresses is called not unique, or one of a part above rounding unique."""
        return bool(self.reactions and self.reactions.is_near)

    @property
    def near_below(self) -> float:
        """Margin below which a position is called nearly singular."""
        return nearly_singular(self.graph.n_loops)

    @property
    def dead_point(self) -> bool:
        """Whether a driver is near a dead point: it hardly moves when the mechanism moves."""
        return bool(self.geometry and self.geometry.freedoms.mobility and self.geometry.freedoms.drive < RANKS.near)

    @property
    def change_point(self) -> bool:
        """Whether branches of a finite motion meet here: more mobility than on either of them, and less rank than nearby."""
        return 0 < (self.finite_mobility or 0) < (self.mobility or 0) and self.excess["here"] > 0

    # --- freedoms and drivers --------------------------------------------------------------------------------------------

    @property
    def contradicting_drives(self) -> bool:
        """Whether the declared drivers cannot move independently of each other."""
        return bool(self.geometry and self.geometry.freedoms.dependent)

    @cached_property
    def undriven(self) -> tuple[Finding, ...]:
        """Freedoms that are neither driven nor passive."""
        return findings.left_free(self.geometry.freedoms) if self.geometry else ()

    @property
    def passive_here_only(self) -> tuple[str, ...]:
        """Names of motions that are passive in this position only: they move other links in all others, and are free."""
        g = self.geometry
        return tuple(hold_names(self.mechanism, g.freedoms.passing)) if g else ()

    @cached_property
    def passive(self) -> tuple[PassiveFinding, ...]:
        """Passive freedoms by name and line, and whether the declared loads move them."""
        g = self.geometry
        return findings.passive_findings(g.system, g.x, g.freedoms.passive) if g else ()

    @property
    def _null_nearby(self) -> Array | None:
        return self.motion.null_nearby if self.motion else None

    @cached_property
    def locked(self) -> tuple[Finding, ...]:
        """Freedoms that cannot move here, with the reason."""
        return findings.locked(self.geometry.freedoms, self._null_nearby) if self.geometry else ()

    @cached_property
    def drivable(self) -> tuple[Finding, ...]:
        """Freedoms that can serve as a driver here: single freedoms that move in other than passive motions."""
        return findings.drivable(self.geometry.freedoms) if self.geometry else ()

    @cached_property
    def not_drivable(self) -> tuple[Finding, ...]:
        """Single freedoms that cannot drive here, with the reason."""
        g = self.geometry
        return findings.not_drivable(g.freedoms, self.drivable, self._null_nearby) if g else ()

    @property
    def weak_drives(self) -> list[int]:
        """Columns of the drivers that move least when the mechanism does, and as little as the weakest combination of them."""
        if not (g := self.geometry) or len(g.driven) < 2:
            return g.driven.tolist() if g else []
        size = np.sqrt((g.freedoms.null[g.driven] ** 2).sum(axis=1))
        return [int(c) for c in g.driven[size < 2 * g.freedoms.drive * size.max()]]

    @cached_property
    def _moving_drives(self) -> Index:
        """Columns of the declared drivers without those that depend on the ones before, stand still, or nearly do (at a dead point)."""
        if not (g := self.geometry):
            return np.zeros(0, dtype=np.intp)
        columns = independent_rows(g.freedoms.null, g.driven.tolist(), len(g.driven))
        left_out = self.weak_drives if self.dead_point and len(columns) == len(g.driven) else []
        return np.array([c for c in columns if [c] != left_out], dtype=np.intp)

    @cached_property
    def replaced_drives(self) -> tuple[str, ...]:
        """Drivers that do not move the mechanism here, where others are suggested instead of them."""
        g, names = self.geometry, self.mechanism.freedom_names()
        at_rest = set(g.driven.tolist()) - set(self._moving_drives.tolist()) if g and self.suggested_drives else ()
        return tuple(names[c] for c in sorted(at_rest))

    @cached_property
    def suggested_drives(self) -> tuple[str, ...]:
        """Freedoms that would complete the drivers (all of them where none is declared): at the frame first, independent.

        At a change point there are no more of them than the finite motion needs, and they move in it.
        """
        g = self.geometry
        if not g:
            return ()
        able, wanted = np.ones(self.freedom_count, dtype=bool), self.freedom_count
        if self.change_point:
            able = findings.moves_nearby(self._null_nearby, self.freedom_count)
            wanted = max((self.finite_mobility or 0) - len(g.freedoms.passive), 0)
        more = suggested(g.freedoms, g.driven, self._moving_drives, able, wanted, self.asked)
        return tuple(self.mechanism.freedom_names()[c] for c in more)

    @cached_property
    def dependent_drives(self) -> tuple[tuple[str, ...], ...]:
        """For mobility above one: sets of freedoms of which only one can be driven, as they move in proportion."""
        g = self.geometry
        return findings.proportional(g.freedoms, self.drivable) if g and (self.inputs or 0) > 1 else ()

    @cached_property
    def ratios(self) -> dict[str, dict[str, float]]:
        """Rates of freedoms that stand in couplings for a unit rate of each driver, the others at rest: ratios of gear trains."""
        if not (g := self.geometry) or not self.mechanism.couplings or not len(g.driven) or self.dead_point:
            return {}
        f, fixed = g.freedoms, np.concatenate([g.driven, g.freedoms.hold])
        if len(fixed) != f.mobility or f.dependent or f.undriven:  # the drivers do not say all other motions
            return {}
        of = np.setdiff1d(g.system.coupled_freedoms, g.driven)
        rates = f.null[of] @ np.linalg.solve(f.null[fixed], np.eye(len(fixed), len(g.driven)))
        units, names = g.system.in_user_units(np.ones(len(f.null))), self.mechanism.freedom_names()
        found = units[of, None] * rates / units[g.driven]
        drives = [names[c] for c in g.driven]
        return {names[c]: dict(zip(drives, row, strict=True)) for c, row in zip(of, found.tolist(), strict=True)}

    # --- reactions -------------------------------------------------------------------------------------------------------

    @cached_property
    def reactions(self) -> Uniqueness | None:
        """Verdict on every reaction component and effort, with the self-stresses."""
        g = self.geometry
        return uniqueness(g.freedoms.position.declared, g.driven, self.asked, g.freedoms.driven_closure) if g else None

    @property
    def unique(self) -> dict[str, dict[str, bool]]:
        """For every pair: component -> whether it is unique; ``effort`` for a driven freedom and for a coupling."""
        return self.reactions.unique if self.reactions else {}

    @cached_property
    def self_stresses(self) -> tuple[SelfStress, ...]:
        """Reaction states without load, with the declared drivers: a canonical sparse basis.

        Those that connect loops are left out where they are more than ``determinacy.uniqueness.CONNECTING``.
        """
        return self.reactions.states if self.reactions else ()

    @property
    def misfits(self) -> tuple[MisfitSum, ...]:
        """Errors of seats that must cancel or lock in forces, one condition a self-stress: notes for a drawing.

        Examples
        --------
        >>> import mechgraph as mg
        >>> hinges = [
        ...     mg.Pair(k, "R", "frame", "door", point=(0, 0, z), axis=(0, 0, 1)) for k, z in (("A", 0), ("B", 1))
        ... ]
        >>> print(mg.check(mg.Mechanism("door", pairs=hinges, drives=["A"])).misfits[-1].text)
        these errors must cancel: A.Fz - B.Fz
        """
        g = self.geometry
        return misfit_sums(self.mechanism, self.self_stresses, float(g.system.par.L)) if g else ()

    @property
    def friction(self) -> tuple[str, ...]:
        """Friction among the loads that rests on reactions that are not unique, in a sentence for those that rest on the same.

        Examples
        --------
        >>> import mechgraph as mg
        >>> hinges = [
        ...     mg.Pair(k, "R", "frame", "door", point=(0, 0, z), axis=(0, 0, 1)) for k, z in (("A", 0), ("B", 1))
        ... ]
        >>> rubs = mg.Friction("B", mu=0.1, radius=0.01, thrust_radius=0.01)
        >>> print(
        ...     mg.check(mg.Mechanism("door", pairs=hinges, drives=["A"], loads=[rubs])).friction[0].partition("; ")[0]
        ... )
        friction of 'B' rests on Fz, not unique: zero where no load adds to it, else not determined
        """
        of: dict[tuple[tuple[str, ...], str], list[str]] = {}
        for load in rubbing_loads(self.mechanism, self.mechanism.loads):
            known = self.unique.get(load.of, {})
            if loose := tuple(name for name in rests_on(self.mechanism, load) if not known.get(name, True)):
                soft = self.mechanism.pair(load.of).stiffness if load.of in self.mechanism.pair_index else None
                given = soft is not None and set(loose) <= set(soft.by_component)
                of.setdefault((loose, "" if given else "give stiffness= and "), []).append(repr(load.of))
        return tuple(
            f"friction of {', '.join(pairs)} rests on {', '.join(loose)}, not unique: zero where no load adds to "
            f"{('it', 'them')[len(loose) > 1]}, else not determined; change a pair type, or {first}solve with redundant='elastic'"
            for (loose, first), pairs in of.items()
        )

    @property
    def determinate(self) -> bool:
        """Whether every freedom is driven or passive, and every reaction and effort unique."""
        if not self.geometry or self.contradicting_drives:
            return False
        return not self.geometry.freedoms.undriven and bool(self.reactions and self.reactions.all_unique)

    # --- advice ----------------------------------------------------------------------------------------------------------

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Changes with their computed effect: they remove redundancy, or free a structure."""
        return self._sought[0]

    @property
    def effects_not_sought(self) -> bool:
        """Whether those were not looked for to the end: it took longer than ``limit``."""
        return self._sought[1]

    @cached_property
    def _sought(self) -> tuple[tuple[Effect, ...], bool]:
        if not (g := self.geometry):
            return (), False
        budget = Budget(self.limit)
        return advice(g.freedoms, g.driven, self.finite_mobility or 0, self.asked, budget), budget.ended

    @property
    def sets_not_sought(self) -> bool:
        """Whether sets of changes that remove all redundancy were not sought, as there are too many self-stresses."""
        return (self.redundancy or 0) > LARGEST_FOR_SETS

    @cached_property
    def advice(self) -> tuple[Advice, ...]:
        """What would make it determinate: drivers to add, changes with their computed effect; each can be applied."""
        g = self.geometry
        if g is None:
            return ()
        m = at_position(self.mechanism, g.system, g.x)
        drives = driving_advice(m, self.suggested_drives, self.replaced_drives, beside=self.change_point)
        return (
            *drives,
            *(Advice(e.text, tuple(item for item, *_ in e.changes), effect=e, mechanism=m) for e in self.effects),
        )

    def self_aligning(self, most: int | None = None) -> Iterator[Advice]:
        """Generate all sets of wider pairs that leave no redundancy and keep the mobility, the easiest to build first.

        Each can be applied. Sets that add passive freedoms are left out; see ``advice`` for these.

        Parameters
        ----------
        most : int, optional
            Largest number of changes in a set. Default: the number of self-stresses.

        Yields
        ------
        Advice

        Examples
        --------
        >>> import mechgraph as mg
        >>> print(next(mg.check(mg.load("four-bar")).self_aligning(2)).text)
        R at A -> C, R at B -> S: redundancy 3 -> 0, mobility 1 -> 1, passive 0 -> 0
        """
        if most is not None and not (type(most) is int and most >= 1):
            raise DeclarationError(
                "DeterminacyReport.self_aligning", [wrong(most, "most", "a whole number from 1, or None for any")]
            )
        g = self.geometry
        if g is None:
            return iter(())
        return variants(at_position(self.mechanism, g.system, g.x), g.freedoms, g.driven, self.asked, most)
