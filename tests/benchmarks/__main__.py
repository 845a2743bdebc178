"""All benchmarks, one after the other: ``python tests/benchmarks``. What each measures is in the README beside it."""

import os
import subprocess
import sys
from pathlib import Path


def main() -> None:
    here = Path(__file__).resolve().parent
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(here.parents[1])}
    failed = []
    for script in sorted(here.glob("bench_*.py")):
        print(f"\n== {script.stem}", flush=True)
        if subprocess.run([sys.executable, str(script)], env=env, check=False).returncode:
            failed.append(script.stem)
    if failed:
        raise SystemExit(f"failed: {', '.join(failed)}")


if __name__ == "__main__":
    main()
