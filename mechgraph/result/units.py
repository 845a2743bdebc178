"""Names of derived units; they are found in ``mechgraph.units``."""

from mechgraph.units import unit_of

__all__ = ["unit_of"]
