"""What makes the memory of temporary arrays cheap."""

from __future__ import annotations

from functools import cache

import numpy as np

LARGEST = 31 << 20
"""Bytes of the block that is asked for: the largest from which glibc learns is 32 MB."""


@cache
def keep_freed_memory() -> None:
    """Let the allocator keep what is freed instead of handing it back to the system; once a process, nothing is written.

    glibc maps blocks above a threshold anew every time, page by page, and gives free memory above twice the threshold back; the
    threshold grows with the largest block freed so far (mallopt(3), M_MMAP_THRESHOLD). One block that is asked for and freed untouched
    spares all later arrays these page faults: a tenth of the time of a cycle (``tests/benchmarks/bench_cycle.py``).
    """
    np.empty(LARGEST, dtype=np.uint8)
