"""Start-up as a user meets it, in whole processes: ``python tests/benchmarks/bench_startup.py [rounds]``.

Every round runs every command once, one after the other, so that a busy machine slows them alike; the first round, which writes
the bytecode into a folder of its own, does not count. Printed, never asserted: the shortest and the median wall time, the
shortest CPU time, and the ratios of the shortest to those of the packages that mechgraph builds on.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parents[2]
ROUNDS = 15
COMMANDS = {
    "import numpy, networkx, scipy": ["-c", "import numpy, networkx, scipy"],
    "import numpy, scipy": ["-c", "import numpy, scipy"],
    "import mechgraph": ["-c", "import mechgraph"],
    "mechgraph check 7r": ["-m", "mechgraph", "check", "7r"],
    "mechgraph solve 7r": ["-m", "mechgraph", "solve", "7r"],
}
BASE = "import numpy, networkx, scipy"
BARS = {"import mechgraph": "bar: ratio 1.2", "mechgraph check 7r": "bar: 0.8 s"}


def environment(folder: str) -> dict[str, str]:
    """One BLAS thread, this tree, and bytecode that is kept from one run to the next."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return kept | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), "PYTHONPYCACHEPREFIX": folder}


def timed(arguments: list[str], env: dict[str, str], folder: str) -> tuple[float, float]:
    """Wall and CPU seconds of one process."""
    before, begin = os.times(), time.perf_counter()
    subprocess.run([sys.executable, *arguments], cwd=folder, env=env, stdout=subprocess.DEVNULL, check=True)
    wall, after = time.perf_counter() - begin, os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return wall, cpu


def measure(rounds: int) -> dict[str, list[tuple[float, float]]]:
    """Wall and CPU seconds of every command in every round."""
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in COMMANDS}
    with tempfile.TemporaryDirectory() as folder:
        env = environment(folder)
        for turn in range(rounds + 1):
            for name, arguments in COMMANDS.items():
                found = timed(arguments, env, folder)
                if turn:
                    times[name].append(found)
    return times


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else ROUNDS
    times = measure(rounds)
    least = {name: (min(w for w, _ in found), min(c for _, c in found)) for name, found in times.items()}
    print(f"{'':32} {'wall s':>8} {'median':>8} {'CPU s':>8} {'ratio':>8} {'of CPU':>8}")
    for name, (wall, cpu) in least.items():
        middle = median(w for w, _ in times[name])
        ratio, of_cpu = wall / least[BASE][0], cpu / least[BASE][1]
        print(f"{name:32} {wall:8.3f} {middle:8.3f} {cpu:8.3f} {ratio:8.2f} {of_cpu:8.2f}  {BARS.get(name, '')}")


if __name__ == "__main__":
    main()
