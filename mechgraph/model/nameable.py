"""The names that a load or a coupling may refer to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from mechgraph.model.link import Link


class Nameable(Protocol):
    """Links and freedoms of a mechanism, by name."""

    @property
    def link_index(self) -> Mapping[str, int]:
        """Place of every link, by name."""

    def freedom_fault(self, name: Any, *, single: bool) -> str | None:
        """Why ``name`` is no freedom (with ``single``: no single freedom), or None."""

    def massive_links(self) -> tuple[str, ...]:
        """Links that have mass."""

    def link(self, name: str) -> Link:
        """The link of that name."""

    def ends_of(self, freedom: str) -> tuple[str, str]:
        """Links a and b of the pair of a freedom."""

    def full_name(self, name: str) -> str:
        """The full spelling ``"B.Tz"`` of a freedom."""
