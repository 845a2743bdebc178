"""The graph without geometry: incidence, loops, tree, counts."""
