"""Rotations, poses and moved wrenches, for tests that move a mechanism."""

import numpy as np
from scipy.linalg import expm
from scipy.spatial.transform import Rotation


def rotation_exp(turns: np.ndarray) -> np.ndarray:
    """Rotation matrices ``(3, 3, ...)`` of rotation vectors ``(3, ...)``."""
    vectors = np.moveaxis(np.asarray(turns, float), 0, -1)
    return np.moveaxis(
        Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*vectors.shape, 3), (-2, -1), (0, 1)
    )


def pose_exp(twist: np.ndarray) -> np.ndarray:
    """Pose ``(3, 4)`` of a finite twist: the exponential of its matrix."""
    (x, y, z), v = twist[:3], twist[3:]
    return expm(np.array([[0, -z, y, v[0]], [z, 0, -x, v[1]], [-y, x, 0, v[2]], [0, 0, 0, 0]]))[:3]


def moved_wrench(pose: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Wrenches ``(..., 6)``, moment first, given in the frame of a pose, in the outer frame: ``(R M + p x R F, R F)``."""
    R, p = pose[:3, :3], pose[:3, 3]
    force = wrench[..., 3:] @ R.T
    return np.concatenate([wrench[..., :3] @ R.T + np.cross(p, force), force], axis=-1)
