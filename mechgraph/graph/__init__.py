"""The graph without geometry: incidence, loops, tree, matching; kinematic chains up to isomorphism, and which one a mechanism is."""
