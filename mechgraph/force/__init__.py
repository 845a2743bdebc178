"""Wrenches: inertia and loads, loop wrenches, d'Alembert equations, kinetostatics."""
