"""Make the start sets of synthesis that come with the package: those of the ladder of tasks.

    PYTHONPATH=tests python tests/benchmarks/make_task_starts.py [words ...]

With words it adds the rungs whose names have one of them, large ones too.

Sets that the package or the user's folder has are taken over. Only sets of which a trace test says that they are all are taken in.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np
from ladder import LADDER, LARGE, PUBLISHED

from mechgraph.modes.homotopy import polished
from mechgraph.synthesis.classes import TaskClass
from mechgraph.synthesis.labelling import TaskLabelling
from mechgraph.synthesis.solve import PACKED, TaskStart, arrays, kept, start_set
from mechgraph.synthesis.system import RowProblem


def main(words: list[str]) -> None:
    """Work them out and write them."""
    found: dict[str, Any] = dict(np.load(PACKED)) if PACKED.exists() else {}
    for name, rung in (LADDER | (LARGE if words else {})).items():
        if words and not any(word in name for word in words):
            continue
        m, task, unknown, total = rung()
        rng, begin = np.random.default_rng(0), time.process_time()
        of = TaskClass(RowProblem(m, task, unknown), rng)
        published = (total, PUBLISHED[name]) if name in PUBLISHED else None
        start = kept(of) or start_set(of, rng, None, published)
        N = start.x.shape[1]
        if published and published[0] == N:
            start = replace(start, source=PUBLISHED[name])
        print(f"{name}: {N} of {total}, {start.word}, {time.process_time() - begin:.1f} s", flush=True)
        if start.word in ("tested", "proved"):
            labelling = TaskLabelling(of)
            found |= {f"{labelling.key}/{part}": value for part, value in shortened(of, start).items()}
            # the key begins with the version of the files
            found = {one: value for one, value in found.items() if one[:2] == labelling.key[:2]}
            np.savez_compressed(PACKED, **found)


def shortened(of: TaskClass, start: TaskStart) -> dict[str, Any]:
    """A start set as arrays; of a large one of few digits, where Newton's method brings back the others."""
    told = arrays(TaskLabelling(of), start)
    if told["x"].size < 10_000:
        return told
    x = start.alike.reshape(len(start.x), -1).copy()
    for i, given in enumerate(of.given):
        # what is asked stands with the task
        x[of.head + i * of.nx + of.asked_rows[given]] = 0.0
    short = np.stack([x.real, x.imag], axis=-1).astype(np.float16).astype(float) @ [1.0, 1.0j]
    back, closed = polished(of.leg(start.member, start.member), short, 1.0, np.zeros(x.shape[1], dtype=np.intp))
    lost = np.flatnonzero(~closed | (np.abs(back - x)[: of.u].max(axis=0) > 1e-6 * np.abs(x[: of.u]).max(axis=0)))
    ordered = TaskLabelling(of).ordered(start.member, x)["x"]
    short = np.stack([ordered.real, ordered.imag], axis=-1).astype(np.float16)
    return told | {"x": short, "exactly": lost, "exact": ordered[:, lost]}


if __name__ == "__main__":
    main(sys.argv[1:])
