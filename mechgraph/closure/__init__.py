"""Positions and their rates: evaluation of the graph, closure, continuation, assembly."""
