"""Pictures of solutions; matplotlib (the ``plot`` extra) is imported only when one is drawn."""

from mechgraph.show.curves import effort_curve
from mechgraph.show.skeleton import draw_skeleton

__all__ = ["draw_skeleton", "effort_curve"]
