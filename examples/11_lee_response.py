"""Lee's second problem: RCSR under a given input torque, from rest; the motion that follows, beside his Table XIX.

Problem: I.-P. J. Lee, thesis, Oklahoma State University 1977, section 3.5: the acceleration of the input is an unknown beside the
reactions. A torque of 10 in lb acts on the input from 20 degrees on. Point masses (2, 5, 5) as his force rows have them; his tensors are
left out, as no position makes them inertias of a body.

His table cannot be right: at rest the point masses alone allow 10 / 365 = .0274 rad/s2, printed is .175, so that his mechanism runs
away from the true one. Checked here: the acceleration at rest by statics, kinetic energy against the work of the torque, and that the
same motion, prescribed, needs exactly that torque. With a path, a picture of both motions:

    python examples/11_lee_response.py picture.png
"""

import sys
from pathlib import Path

import numpy as np
from lee_1977 import response
from lee_1977.tables import table

import mechgraph as mg


def followed() -> mg.Response:
    """Two seconds from rest."""
    m = response.mechanism().replace(loads=[mg.Effort("O1", response.TORQUE)], drives=[])
    t = np.linspace(0.0, 2.0, 21)
    return mg.respond(m, t, start={"O1": np.deg2rad(20.0)}, rtol=1e-11, atol=1e-13)


def check(r: mg.Response) -> None:
    """The checks of the head of this file."""
    turn = r["O1"].position[:, 0] - r["O1"].position[0, 0]
    alpha = r["O1"].acceleration[0, 0]
    assert abs(alpha - response.acceleration_at_rest()) < 1e-9
    work = response.TORQUE * turn
    assert np.abs(r.energy.kinetic - work).max() < 1e-9 * work.max()
    motion = mg.Motion(r["O1"].position[:, 0], r["O1"].velocity[:, 0], r["O1"].acceleration[:, 0])
    driven = mg.solve(r.mechanism.replace(loads=[]), {"O1": motion})
    assert np.abs(driven["O1"].effort - response.TORQUE).max() < 1e-7
    printed = table("XIX")
    print("t [s]   theta1 [deg]  printed   w1 [rad/s]  printed   alpha1 [rad/s2]  printed")
    for i in (0, 5, 10, 15, 20):
        row = (np.rad2deg(r["O1"].position[i, 0]), r["O1"].velocity[i, 0], r["O1"].acceleration[i, 0])
        theirs = (printed["theta1"][i], printed["w1"][i], printed["alpha1"][i])
        cells = "".join(f"{own:12.4f} {other:10.3f}" for own, other in zip(row, theirs, strict=True))
        print(f"{r.t[i]:4.1f} {cells}")
    print(f"kinetic energy {r.energy.kinetic[-1]:.6f}, work of the torque {work[-1]:.6f} in lb")


def draw(r: mg.Response, target: Path) -> None:
    """Speed of the input, ours and printed."""
    import matplotlib.pyplot as plt

    figure, ax = plt.subplots(figsize=(6, 3.5), layout="constrained")
    ax.plot(r.t, r["O1"].velocity[:, 0], label="motion under the torque")
    ax.plot(table("XIX")["t"], table("XIX")["w1"], "o", mfc="w", label="Table XIX")
    ax.set(xlabel="t [s]", ylabel="w1 [rad/s]")
    ax.legend()
    figure.savefig(target, metadata={"Software": None})
    plt.close(figure)


if __name__ == "__main__":
    motion = followed()
    check(motion)
    if len(sys.argv) > 1:
        draw(motion, Path(sys.argv[1]))
