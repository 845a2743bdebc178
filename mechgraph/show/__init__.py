"""Pictures of mechanisms, solutions, formulations and studies; matplotlib (the ``plot`` extra) is imported only when one is drawn."""

from mechgraph.show.animation import animate, save_picture
from mechgraph.show.chains import draw_chains
from mechgraph.show.curves import effort_curve, margin_curve, reaction_curve
from mechgraph.show.diagrams import draw_graph, draw_sparsity, draw_structure
from mechgraph.show.forces import polar_force, reaction_ranges
from mechgraph.show.paths import hodograph, point_path
from mechgraph.show.skeleton import draw_skeleton
from mechgraph.show.studies import study_bands, study_histogram, study_tornado

__all__ = [
    "animate",
    "draw_chains",
    "draw_graph",
    "draw_skeleton",
    "draw_sparsity",
    "draw_structure",
    "effort_curve",
    "hodograph",
    "margin_curve",
    "point_path",
    "polar_force",
    "reaction_curve",
    "reaction_ranges",
    "save_picture",
    "study_bands",
    "study_histogram",
    "study_tornado",
]
