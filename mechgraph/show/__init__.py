"""Pictures of mechanisms, solutions, formulations and studies; matplotlib (the ``plot`` extra) is imported only when one is drawn."""

from mechgraph.show.curves import (
    effort_curve,
    film_orbit,
    friction_losses,
    hodograph,
    least_base_radius,
    margin_curve,
    point_path,
    polar_force,
    reaction_curve,
    reaction_ranges,
)
from mechgraph.show.diagrams import (
    draw_chains,
    draw_graph,
    draw_sparsity,
    draw_structure,
    study_bands,
    study_histogram,
    study_tornado,
)
from mechgraph.show.skeleton import animate, draw_skeleton, save_picture

__all__ = [
    "animate", "draw_chains", "draw_graph", "draw_skeleton", "draw_sparsity", "draw_structure", "effort_curve",
    "film_orbit", "friction_losses", "hodograph", "least_base_radius", "margin_curve", "point_path", "polar_force",
    "reaction_curve", "reaction_ranges",
    "save_picture", "study_bands", "study_histogram", "study_tornado",
]  # fmt: skip
