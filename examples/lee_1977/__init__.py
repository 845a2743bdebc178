"""What Lee printed, computed again with mechgraph: one module for every worked example of the thesis.

Source: I.-P. J. Lee, Dynamic Analysis of Spatial Mechanisms Using the Method of Dual Successive Screws, thesis, Oklahoma State
University 1977. The functions return differences and identities as numbers; ``05_lee_verdicts.py`` prints them, the reference
tests bound them.
"""
