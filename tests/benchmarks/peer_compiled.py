"""The same job with mechgraph's compiled kernel, built before the clock starts; ``peer_mechgraph`` is numpy."""

from functools import partial

import peer_mechgraph
from peer_mechgraph import FORCE, VERSION, verdict

import mechgraph as mg

__all__ = ["FORCE", "JOB", "VERSION", "solve", "verdict"]

try:
    mg.compile(mg.load("four-bar"))
except mg.MissingExtraError as error:
    raise ImportError(str(error)) from None

JOB = peer_mechgraph
solve = partial(peer_mechgraph.solve, engine="compiled")
