"""Positions and their rates: layout and numbers of the closure equations, their solvers, paths, assembly."""
