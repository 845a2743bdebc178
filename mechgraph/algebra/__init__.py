"""Rigid-body algebra, batched; knows no mechanism.

Component axes come first and the batch axes last: a pose is ``(3, 4, ...)``, a twist or wrench ``(6, ...)``, so that
every operation runs over contiguous batches.
"""
