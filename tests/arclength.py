"""A second opinion on positions out of reach: pseudo-arclength continuation, in which the path parameter may turn back."""

import numpy as np

from mechgraph.kinematics.assembly import assembled, named_columns
from mechgraph.kinematics.state import Configuration


class _Path:
    """The straight path through the driver values, by its length; the last direction goes on beyond the end."""

    def __init__(self, points):
        length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=1), axis=0))])
        keep = np.concatenate([[True], np.diff(length) > 0])
        self.points, self.length = points[:, keep], length[keep]
        self.end = self.length[-1]

    def slope(self, s):
        i = min(max(int(np.searchsorted(self.length, s, side="right")) - 1, 0), len(self.length) - 2)
        return (self.points[:, i + 1] - self.points[:, i]) / (self.length[i + 1] - self.length[i])

    def at(self, s):
        inside = np.array([np.interp(s, self.length, row) for row in self.points])
        return inside + max(0.0, s - self.end) * self.slope(self.end)


def fold_before_the_end(m, given, step=1e-2, steps=1000):
    """Whether the curve of closed positions over the driver path turns back (or runs off) before the path ends."""
    system, x = assembled(m, {k: float(np.ravel(v.position)[0]) for k, v in given.items()})
    columns, _ = named_columns(m, system, dict.fromkeys(given, 0.0))
    rows = system.single_rows[columns]
    unit = np.where(system.is_length[columns], system.par.L, 1.0)
    values = np.array([np.ravel(v.position) for v in given.values()]) / unit[:, None]
    path = _Path(np.concatenate([x[rows][:, None], values], axis=1))
    F = system.n_freedoms

    def matrix(J, s):
        A = np.zeros((J.shape[0] + len(columns), F + 1))
        A[: J.shape[0], :F] = J
        A[J.shape[0] + np.arange(len(columns)), columns] = 1.0
        A[J.shape[0] :, F] = -path.slope(s) * path.end
        return A

    s, tangent = 0.0, np.eye(F + 1)[F]
    for _ in range(steps):
        A = matrix(Configuration(system, x[:, None]).J[:, :, 0], s)
        _, sigma, Vt = np.linalg.svd(A)
        null = Vt[(sigma > 1e-9 * sigma[0]).sum() :]
        tangent = null.T @ (null @ tangent)
        tangent /= np.linalg.norm(tangent)
        if tangent[F] <= 0:
            return True
        x = system.advance(x[:, None], (step * tangent[:F])[:, None])[:, 0]
        s += step * tangent[F] * path.end
        for _ in range(12):
            here = Configuration(system, x[:, None])
            r = np.concatenate([here.residual[:, 0], x[rows] - path.at(s)])
            if np.abs(r).max() < 1e-11:
                break
            A = np.vstack([matrix(here.J[:, :, 0], s), tangent])
            d = np.linalg.lstsq(A, np.concatenate([-r, [0.0]]), rcond=1e-9)[0]
            x = system.advance(x[:, None], d[:F, None])[:, 0]
            s += d[F] * path.end
        if s >= path.end:
            return False
    return True
