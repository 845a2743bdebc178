"""The job of ``peer_pinocchio`` written in C++ (``peer_pinocchio.cpp``), compiled here against the headers that come with the wheels.

Pinocchio's headers and Boost's are in its wheels, Eigen's in ``cmeel-eigen``. An ImportError says what is missing. One call a job, its
numbers handed over as arrays; the time to compile is not counted.
"""

import ctypes
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pinocchio as pin
from peer_cases import Case

VERSION = pin.__version__
FORCE = slice(0, 3)
SOURCE = Path(__file__).with_suffix("").with_name("peer_pinocchio.cpp")


def compiled() -> ctypes.CDLL:
    """The compiled program."""
    compiler = shutil.which(os.environ.get("CXX", "c++"))
    if compiler is None:
        raise ImportError("no C++ compiler")
    here = next((p for p in Path(pin.__file__).parents if (p / "include" / "pinocchio").is_dir()), None)
    if here is None:
        raise ImportError("no headers of Pinocchio")
    if not (here / "include" / "eigen3").is_dir():
        raise ImportError("no headers of Eigen (cmeel-eigen)")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "peer_pinocchio.so"
        includes = [f"-I{here / 'include'}", f"-I{here / 'include' / 'eigen3'}"]
        command = [compiler, "-std=c++17", "-O3", "-DNDEBUG", "-w", "-shared", "-fPIC", *includes]
        linked = [f"-L{here / 'lib'}", f"-Wl,-rpath,{here / 'lib'}", "-lpinocchio_default", "-lboost_serialization"]
        done = subprocess.run(
            [*command, str(SOURCE), *linked, "-o", str(target)], capture_output=True, text=True, check=False
        )
        if done.returncode:
            fault = next((line for line in done.stderr.splitlines() if "error" in line), "unknown fault")
            raise ImportError(f"does not compile: {fault}")
        return ctypes.CDLL(str(target))


PROGRAM = compiled()


def solve(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Torque of the driver ``(T,)`` and wrench of every joint ``(joints, T, 6)``, force first, in the frame of its link b."""
    bodies = {body.name: body for body in case.bodies}
    carried = [bodies.get(joint.b) for joint in case.joints]
    zero = np.zeros(3)
    numbers = [
        np.array([joint.point for joint in case.joints]),
        np.array([joint.axes for joint in case.joints]),
        np.array([0.0 if body is None else body.mass for body in carried]),
        np.array([zero if body is None else body.center for body in carried]),
        np.array([np.zeros((3, 3)) if body is None else body.inertia for body in carried]),
        np.array(case.gravity),
    ]
    turned, rate, change = (np.ascontiguousarray(x, dtype=float) for x in case.turned())
    torque, wrenches = np.empty(len(case.t)), np.empty((len(case.joints), len(case.t), 6))
    kinds = "".join(joint.kind for joint in case.joints).encode()
    failed = PROGRAM.solve(
        len(case.joints), kinds, *map(pointer, numbers), len(case.t), *map(pointer, (turned, rate, change)),
        ctypes.c_double(case.step), pointer(torque), pointer(wrenches),
    )  # fmt: skip
    if failed:
        raise RuntimeError("the loop does not close")
    return torque, wrenches


def pointer(values: np.ndarray) -> ctypes.c_void_p:
    """Where the numbers of an array begin; they lie one behind the other."""
    return values.ctypes.data_as(ctypes.c_void_p)


def verdict(case: Case) -> str:
    """The program has no count of redundant constraints."""
    return ""
