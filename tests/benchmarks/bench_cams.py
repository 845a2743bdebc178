"""Cams beside linkages of the same size and motion: ``python tests/benchmarks/bench_cams.py``.

An eccentric with a roller moves as a slider-crank does (``test_followers``), so both do the same work but for the curve; a cam of a
law, whose jerk jumps, takes more steps, and so does a roller on a profile through points, whose center goes beside the spline. Timed in
turn in one run: ``mg.solve`` with rates, reactions and checks.
"""

import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from test_followers import CENTER, CIRCLE, ROLLER, Z, driven_cam, law

import mechgraph as mg

ROUNDS = 7


def machines() -> dict[str, mg.Mechanism]:
    at = np.array([0.1, np.sqrt((1 + ROLLER) ** 2 - 0.2**2), 0])
    slide = mg.Pair("F", "P", "frame", "follower", point=at, axis=(0, 1, 0))
    rod = [
        mg.Pair("D", "R", "cam", "rod", point=CENTER, axis=Z),
        mg.Pair("E", "R", "rod", "follower", point=at, axis=Z),
    ]
    t = 2 * np.pi * np.arange(24) / 24
    points = np.stack([0.3 + np.cos(t), 0.9 * np.sin(t) + 0.05 * np.cos(2 * t), 0 * t], axis=1)
    profile, beside = mg.Curve.through(points=points, closed=True), points[6] + [0, 0.2, 0]
    lobe = mg.Curve.cam.of(law(), 0.9, second=(0, 1, 0), roller_radius=0.2, offset=0.15)
    top = lobe.at(np.array(0.0))[0]
    return {
        "slider-crank": driven_cam(slide, *rod, point=at, more=["rod"]),
        "eccentric, roller": driven_cam(
            slide, mg.Pair("K", "Ps", "cam", "follower", curve=CIRCLE, roller=ROLLER, point=at), point=at
        ),
        "roller on points": mg.assemble(
            driven_cam(
                mg.Pair(
                    "F", "P", "frame", "follower", on_a=mg.Marker(beside, (0, 1, 0)), on_b=mg.Marker(beside, (0, 1, 0))
                ),
                mg.Pair("K", "Ps", "cam", "follower", curve=profile, roller=0.2, on_b=mg.Marker(beside, Z)),
                point=beside,
            )
        ),
        "cam of a law": driven_cam(
            mg.Pair("F", "P", "frame", "follower", point=top, axis=(0, 1, 0)),
            mg.Pair("K", "Ps", "cam", "follower", curve=lobe, point=top),
            point=top,
        ),
    }


def main() -> None:
    kinds = machines()
    for count in (36, 360, 3600):
        given = {"A": mg.Motion(np.linspace(0, 2 * np.pi, count, endpoint=False), 3.0, 0.0)}
        took: dict[str, list[float]] = {name: [] for name in kinds}
        for _ in range(ROUNDS):
            for name, m in kinds.items():
                begin = time.perf_counter()
                mg.solve(m, given)
                took[name].append(time.perf_counter() - begin)
        linkage = min(took["slider-crank"])
        told = (f"{name} {1e3 * min(times):.1f} ms ({min(times) / linkage:.2f})" for name, times in took.items())
        print(f"{count} positions: {', '.join(told)}")


if __name__ == "__main__":
    main()
