"""The pair table: pair types as rows of data, looked up by symbol and printed. To add a pair type, add a row."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from mechgraph.document import Document, Shown, Table
from mechgraph.model.pair_type import PairType, fill_row
from mechgraph.model.row_parts import UNIT_TWISTS, UNIT_WRENCHES, Bookkeeping, Component, Freedom, Touching

_AXIS = (Freedom("Tz", UNIT_TWISTS["Tz"]), Freedom("Rz", UNIT_TWISTS["Rz"]))
_FZ = Component("Fz", UNIT_WRENCHES["Fz"])
_MZ = Component("Mz", UNIT_WRENCHES["Mz"])
_IN_GROOVE = Touching(("Fx", "Fy"), a=(0.0, -1.0), b=(1.0, 1.0))
_SCREW_FZ = Component("Fz", UNIT_WRENCHES["Fz"], 0, (0.0, 0.0, -1.0, 0.0, 0.0, 0.0))


class PairTable(Mapping[str, PairType], Shown):
    """The pair table: symbol -> PairType; prints as a table."""

    _every_method_is_a_door = False  # a Mapping has KeyErrors

    def __init__(self, rows: Sequence[PairType]) -> None:
        self._rows = {row.symbol: row for row in rows}

    def __getitem__(self, symbol: str) -> PairType:
        if not isinstance(symbol, str):
            raise KeyError(symbol)
        return self._rows[symbol]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def document(self) -> Document:
        """The table as a document."""
        rows = []
        for row in self.values():
            reactions = " ".join(f"{c.name}@{c.frame}" for c in row.reactions or ()) or " ".join(row.component_names)
            unknowns, equations = row.unknowns_and_equations
            rows.append(
                (
                    row.symbol,
                    row.name,
                    str(row.f),
                    " ".join(f.label for f in row.freedoms) or "none",
                    reactions or "none",
                    f"{unknowns} / {equations}",
                )
            )
        header = ("symbol", "name", "f", "freedoms in order", "reactions @ frame", "Lee's ledger")
        return Document("Pair types", (Table(header, tuple(rows)),))


def _row(
    symbol: str, name: str, freedoms: Sequence[object], reactions: Sequence[object], *, dual: bool = True, **rest: Any
) -> PairType:
    """A row of the table, not tried at random positions: a test does that for all of them, once and not at every start.

    ``dual``: whether unit couples about the turns and unit forces along the slides are dual to the freedoms.
    """
    row = object.__new__(PairType)
    fill_row(row, symbol, name, freedoms, reactions, **rest)
    object.__setattr__(row, "computed_efforts", not dual)
    return row


TABLE = PairTable(
    [
        _row(
            "R",
            "revolute",
            freedoms=["Rz"],
            reactions=["Fx", "Fy", "Fz", "Mx", "My"],
            bookkeeping=Bookkeeping(_AXIS, (_FZ,)),
        ),
        _row(
            "P",
            "prismatic",
            freedoms=["Tz"],
            reactions=["Fx", "Fy", "Mx", "My", "Mz"],
            bookkeeping=Bookkeeping(_AXIS, (_MZ,)),
        ),
        _row(
            "H",
            "helical",
            freedoms=["Rz + pitch Tz"],
            reactions=["Fx", "Fy", "Mx", "My", _SCREW_FZ],
            bookkeeping=Bookkeeping(_AXIS, (_SCREW_FZ,)),
        ),
        _row(
            "C",
            "cylindrical",
            freedoms=["Rz", "Tz"],
            reactions=["Fx", "Fy", "Mx", "My"],
            bookkeeping=Bookkeeping(_AXIS, ()),
        ),
        _row(
            "U",
            "universal (slotted sphere)",
            freedoms=["Rz", "Rx"],
            reactions=["Fx", "Fy", "Fz", "My@1"],
            square_second=True,
        ),
        _row("S", "spherical", freedoms=["rotation"], reactions=["Fx", "Fy", "Fz"], directed=False),
        _row("E", "planar", freedoms=["Tx", "Ty", "Rz"], reactions=["Fz", "Mx", "My"]),
        _row(
            "Sc",
            "sphere in slotted cylinder",
            freedoms=["Tz", "Ry", "Rx"],
            reactions=["Fx@1", "Fy@1", "Mz@2"],
            square_second=True,
            touching=_IN_GROOVE,
        ),
        _row(
            "Sg",
            "sphere in groove",
            freedoms=["Tz", "rotation"],
            reactions=["Fx@1", "Fy@1"],
            touching=_IN_GROOVE,
        ),
        _row(
            "Cp",
            "cylinder on plane",
            freedoms=["Tx", "Ty", "Rz", "Rx"],
            reactions=["Fz@2", "My@3"],
            square_second=True,
            touching=Touching(("Fz",), a=(0.0, 0.0), b=(0.0, 1.0), tilting="My"),
        ),
        _row(
            "Sp",
            "sphere on plane",
            freedoms=["Tx", "Ty", "rotation"],
            reactions=["Fz@2"],
            touching=Touching(("Fz",), a=(0.0, 0.0), b=(1.0, 1.0)),
        ),
        _row("Tc", "torque coupling", freedoms=["Tx", "Ty", "Tz", "Rx", "Ry"], reactions=["Mz@4"]),
        _row("Fr", "free, all six", freedoms=["Tx", "Ty", "Tz", "Rx", "Ry", "Rz"], reactions=[], dual=False),
        _row("W", "weld", freedoms=[], reactions=["Fx", "Fy", "Fz", "Mx", "My", "Mz"], directed=False),
    ]
)


def pair_types() -> PairTable:
    """The pair table of mechgraph: a mapping symbol -> PairType that prints as a table."""
    return TABLE
