"""The structure of a mechanism as the textbooks tell it: chain, mobility table, families, counts, groups, other drivers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from mechgraph.determinacy.decomposition import Decomposition, joints_at
from mechgraph.determinacy.families import COLUMNS, Families
from mechgraph.determinacy.report import DeterminacyReport, check
from mechgraph.document import Block, Bullets, Document, Heading, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, MechgraphError, listed
from mechgraph.graph.atlas import Identity, MultipleJoint, identify
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import door, wrong


class Structure(Shown):
    """Chain, families and structural groups of a mechanism at a closed position; prints as text. Returned by ``structure``.

    Attributes
    ----------
    report : DeterminacyReport
        The report that it is taken from.
    groups, families : Decomposition, Families
        Those of the report.
    identity : Identity or None
        Its kinematic chain; None for a mechanism with couplings.
    multiple_joints : tuple of MultipleJoint
        Revolute joints of three or more links.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.structure(mg.load("windows-2")).identity.name
    'Watt II'
    """

    def __init__(self, report: DeterminacyReport, groups: Decomposition, families: Families) -> None:
        self.report, self.groups, self.families = report, groups, families
        self.identity: Identity | None = None if report.mechanism.couplings else identify(report.mechanism)
        self.multiple_joints = joints_at(report.geometry.freedoms.position) if report.geometry else ()

    def __repr__(self) -> str:
        return f"Structure({self.report.mechanism.name!r}: {self.groups.symbol}; print it)"

    def document(self) -> Document:
        """Chain, families, groups, and the groups of other drivers."""
        blocks = [*self._chain(), Heading("Families", 2), *self._families()]
        blocks += [Heading("Groups", 2), *self.groups.blocks(), *self._drivers()]
        return Document(f"Structure of {self.report.mechanism.name}", tuple(blocks))

    def _chain(self) -> Iterator[Block]:
        if self.identity:
            first, *others = self.identity.text.splitlines()
            yield Paragraph(f"{first}.")
            yield Bullets(tuple(line.strip() for line in others))
            if self.multiple_joints:
                whole = identify(self.report.mechanism, joints=self.multiple_joints)
                yield Paragraph(
                    f"With multiple joints as one joint each: {whole.name}. Split, with the pairs on another of its links:"
                )
                rows = [
                    (
                        ", ".join(joint.pairs),
                        str(joint.order),
                        on,
                        "yes" if self._declared(joint, on) else "",
                        self._split(joint, on),
                    )
                    for joint in self.multiple_joints
                    for on in joint.links
                ]
                yield Table(("joint", "order", "pairs on", "declared", "chain"), tuple(rows), align="lrlll")

    def _declared(self, joint: MultipleJoint, on: str) -> bool:
        """Whether the pairs of a joint are declared on a link."""
        return all(on in self.groups.ends[name] for name in joint.pairs)

    def _split(self, joint: MultipleJoint, on: str) -> str:
        """The name of the chain with the joint split on a link, other joints as declared."""
        return identify(self.report.mechanism, joints=(joint,)).split(joint, on).name

    def _families(self) -> Iterator[Block]:
        f = self.families
        rows = [(row.link, *("yes" if has else "no" for has in row.columns), str(row.dimension)) for row in f.table]
        yield Table(("link", *COLUMNS, "span"), tuple(rows), align="l" + "c" * 6 + "r")
        loops = [
            (str(i), " ".join(loop.pairs), str(loop.family), str(loop.rank), ", ".join(loop.locked) or "-")
            for i, loop in enumerate(f.loops, start=1)
        ]
        yield Table(("loop", "pairs", "family", "rank", "locked"), tuple(loops), align="rlrrl")
        counts = ", ".join(f"c{j} = {c}" for j, c in enumerate(f.classes, start=1) if c)
        yield Paragraph(
            f"Family {f.family}, n = {f.links} moving links, {counts}: Dobrovolski's count gives M = {f.dobrovolski}; with the apparent "
            f"family {f.apparent:.4g} of the loops M = {f.by_apparent:.4g}; by rank M = {f.mobility}."
        )
        yield Bullets(f.why)

    def _drivers(self) -> Iterator[Block]:
        rows = tuple(self.report.groups_by_driver.items())
        if len(rows) > 1:
            yield Paragraph("With another driver:")
            yield Table(("driver", "groups"), rows)


@door
def structure(m: Mechanism, drives: str | Iterable[str] | None = None, **options: Any) -> Structure:
    """Report kinematic chain, families and structural groups of a mechanism at its closed start.

    Parameters
    ----------
    m : Mechanism
        The mechanism, with geometry.
    drives : str or iterable of str, optional
        Names of freedoms. Default: the declared drivers, completed by those that the report suggests.
    **options
        Those of ``check``.

    Returns
    -------
    Structure

    Raises
    ------
    DeclarationError
        No geometry, or loops that do not close.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.structure(mg.load("four-bar")).groups.symbol
    'R - D10'
    """
    report = check(m, **options)
    families = report.families
    if families is None:
        raise _no_position(report)
    return Structure(report, _groups(report, drives), families)


@door
def groups(m: Mechanism, drives: str | Iterable[str] | None = None, **options: Any) -> Decomposition:
    """Decompose a mechanism into driver links and structural (Assur) groups, in the order in which they can be solved.

    Parameters
    ----------
    m : Mechanism
        The mechanism, with geometry.
    drives : str or iterable of str, optional
        As in ``structure``.
    **options
        Those of ``check``.

    Returns
    -------
    Decomposition

    Raises
    ------
    DeclarationError
        No geometry, or loops that do not close.

    Examples
    --------
    >>> import mechgraph as mg
    >>> g = mg.groups(mg.load("windows-2"))
    >>> g.symbol, g.words
    ('R - D10 - D10 - 3 + 0', 'R-RRR-RRR')
    """
    return _groups(check(m, **options), drives)


def _groups(report: DeterminacyReport, drives: str | Iterable[str] | None) -> Decomposition:
    m, faults = report.mechanism, list[str]()
    names = None if drives is None else (drives,) if isinstance(drives, str) else tuple(drives)
    known = {*m.freedom_names(), *(p.name for p in m.pairs if p.type.f == 1)}
    faults += [
        wrong(name, "drives", f"names of freedoms: {listed(sorted(known))}")
        for name in names or ()
        if name not in known
    ]
    if faults:
        raise DeclarationError(f"groups of {m.name!r}", faults)
    found = report.groups if names is None else report.groups_with(names)
    if found is None:
        raise _no_position(report)
    if len(found.drivers) < len(names or ()):
        able = f"independent freedoms, here {len(found.drivers)}, e.g. {', '.join(found.drivers)}"
        raise DeclarationError(f"groups of {m.name!r}", [wrong(tuple(names or ()), "drives", able)])
    return found


def _no_position(report: DeterminacyReport) -> MechgraphError:
    what = f"structure of {report.mechanism.name!r}"
    return DeclarationError(
        what, [f"{report.note} Families and groups need a closed position; give geometry that closes"]
    )
