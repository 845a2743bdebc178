"""Lee's RCSR mechanism: kinematics against his Table III, and his equations.

Problem: I.-P. J. Lee, thesis, Oklahoma State University 1977, section 2.6: a spatial four-link mechanism with revolute, cylindric,
spherical and revolute pair; find angles, rates and accelerations of the pairs for a driven first pair.

Checked against two printed rows of Table III, to 0.7 of the last printed digit (angles: and 1e-5 relative, the table was made
with a truncated degree). The unknowns and equations of his section 3.4 are 24 each.
"""

import numpy as np

import mechgraph as mg

# theta1; theta2 [deg], S2 [in], theta4 [deg]; their rates [rad/s, in/s, rad/s]; their accelerations [rad/s2, in/s2, rad/s2]
TABLE_III = {
    150: (-103.882, -8.961, 37.232, 0.143, 0.006, -0.007, 0.282, 0.015, -0.083),
    188: (-55.591, -8.845, -46.226, 0.044, 0.022, -0.362, 0.040, 0.040, -0.742),
}


def main() -> None:
    m = mg.load("rcsr")
    theta1 = np.deg2rad([float(angle) for angle in TABLE_III])
    s = mg.kinematics(m, {"O1": mg.Motion(theta1, velocity=0.1, acceleration=0.2)})

    def row(kind: str, degrees: bool = False) -> np.ndarray:
        second, fourth = getattr(s["O2"], kind), getattr(s["O4"], kind)
        turn = np.rad2deg(1.0) if degrees else 1.0
        return np.stack([turn * second[:, 0], second[:, 1], turn * fourth[:, 0]], axis=1)

    found = np.concatenate([row("position", degrees=True), row("velocity"), row("acceleration")], axis=1)
    printed = np.array(list(TABLE_III.values()))
    allowed = 0.7e-3 + 1e-5 * np.abs(printed) * np.isin(np.arange(9), (0, 2))
    assert (np.abs(found - printed) <= allowed).all()

    f = mg.formulate(m, bookkeeping="lee")
    assert (len(f.unknowns), len(f.equations)) == (24, 24)
    print(f.text(components=False))
    print(f"largest difference from Table III: {np.abs(found - printed).max():.4f} (printed to 0.001)")


if __name__ == "__main__":
    main()
