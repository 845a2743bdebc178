"""Tolerances of Lee's RCSR mechanism: which dimension decides the input torque.

Problem: the lengths of the mechanism of ``03_lee_rcsr.py`` are made to 0.002 in, its twists to 0.05 degrees (one standard deviation).
How far does the input torque scatter over the swing, and what would have to be made better?

Checked two ways: the scatter of 2,000 random mechanisms, each closed and solved, against the sum of squares of first-order
sensitivities by central differences; and one of these mechanisms solved alone.
"""

import sys

import numpy as np
import scipy.stats

import mechgraph as mg

LENGTH, ANGLE = 0.002, np.deg2rad(0.05)


def tolerance_study(count: int) -> mg.Study:
    ways = {f"length[{k}]": scipy.stats.norm(a, LENGTH) for k, a in enumerate((0.5, 0.8, 0.4, 0.5))}
    ways |= {"twist[0]": scipy.stats.norm(np.deg2rad(12), ANGLE), "twist[3]": scipy.stats.norm(np.deg2rad(15), ANGLE)}
    theta = np.deg2rad(np.arange(150.0, 196.0))
    return mg.study(
        mg.load("rcsr"),
        ways,
        {"torque": "O1.effort"},
        n=count,
        seed=1977,
        sampling="latin",
        motions={"O1": mg.Motion(theta, 0.1, 0.2)},
    )


def draw(study: mg.Study, path: str) -> None:
    import matplotlib.pyplot as plt

    theta = np.arange(150, 196)
    low, middle, high = study.quantiles("torque")
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
    left.fill_between(theta, low, high, color="#0b6fa4", alpha=0.25, lw=0, label="99.7 % of the mechanisms")
    left.plot(theta, middle, color="#0b6fa4", label="median")
    left.set(xlabel="theta1 [deg]", ylabel="input torque [lb in2/s2]")
    for name, slope in study.sensitivities("torque").items():
        sigma = LENGTH if name.startswith("length") else ANGLE
        right.plot(theta, np.abs(slope) * sigma, label=name)
    right.set(xlabel="theta1 [deg]", ylabel="part of the scatter [lb in2/s2]")
    for ax in (left, right):
        ax.legend(frameon=False)
        ax.grid(alpha=0.3)
        ax.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=120)


def main() -> None:
    study = tolerance_study(2000)
    assert not study.failed.any()
    scatter, linear = study.std("torque"), study.linear_std("torque")
    i = int(np.argmax(scatter))
    print(f"torque at {150 + i} deg: {study.nominal['torque'][i]:.2f} with a scatter of {scatter[i]:.3f} lb in2/s2")
    for name, slope in study.sensitivities("torque").items():
        sigma = LENGTH if name.startswith("length") else ANGLE
        print(f"  {name:10s} {abs(slope[i]) * sigma:.4f}")
    print(f"sum of squares of these: {linear[i]:.3f}")
    assert np.allclose(scatter, linear, rtol=0.06)
    alone = mg.solve(study.variant(17), study.motions)["O1"].effort[0, :, 0]
    assert np.allclose(alone, study.outputs["torque"][17], rtol=1e-9)
    if len(sys.argv) > 1:
        draw(study, sys.argv[1])


if __name__ == "__main__":
    main()
