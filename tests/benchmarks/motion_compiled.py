"""Motion under given loads with mechgraph's compiled kernel, built before the clock starts; ``motion_mechgraph`` is numpy."""

from functools import partial

import motion_mechgraph
from motion_mechgraph import VERSION, Setting, ladder, variants

import mechgraph as mg

__all__ = ["VERSION", "Setting", "ladder", "solve", "variants"]

try:
    mg.compile(mg.load("four-bar"))
except mg.MissingExtraError as error:
    raise ImportError(str(error)) from None

solve = partial(motion_mechgraph.solve, engine="auto")
