"""The ladder of synthesis, row by row: ``python tests/benchmarks/bench_synthesis.py [--seeds N] [words ...]``.

How many solutions over C and real ones, how sure it is that these are all, seconds of processor time with the start set that came with the
package, and of the first task of its kind, whose set is made: from one seed, or N of them, all of which have to find as many. With words
the rows whose names have one of them, also the rungs of minutes.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from ladder import LADDER, LARGE

import mechgraph as mg


def timed(rung: Any, **options: Any) -> tuple[mg.Syntheses, float]:
    """The answer to a rung, fitness of every mechanism too, and seconds of processor time."""
    m, task, unknown, _ = rung()
    begin = time.process_time()
    s = mg.synthesize(m, task, unknown, **options)
    return s, time.process_time() - begin


def main() -> None:
    """Print the table; a count that is not the known one stands in it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("words", nargs="*")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MECHGRAPH_CACHE"] = folder
        print(
            f"{'task':52} {'over C':>10} {'real':>5} {'kept s':>7}  {'word':8} {'first s':>8}  {'counts of first':16} word"
        )
        for name, rung in (LADDER | (LARGE if asked.words else {})).items():
            if asked.words and not any(word in name for word in asked.words):
                continue
            s, kept = timed(rung)
            print(
                f"{name:52} {s.total:4} of {rung()[3]:<4}{len(s):5} {kept:8.2f}  {s.completeness:8}", end="", flush=True
            )
            first = [timed(rung, seed=seed, cache=False) for seed in range(asked.seeds)]
            counts, words = ({getattr(one, what) for one, _ in first} for what in ("total", "completeness"))
            seconds = median(taken for _, taken in first)
            print(f"{seconds:9.2f}  {', '.join(map(str, sorted(counts))):16} {', '.join(sorted(words))}", flush=True)


if __name__ == "__main__":
    main()
