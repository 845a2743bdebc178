"""Small motions about a position of equilibrium: mass, damping and stiffness in independent coordinates, frequencies and modes."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.closure.solver import EngineName
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, MechgraphWarning, counted, listed
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import door, unit_of
from mechgraph.response.motion_equations import MASSLESS, in_unit_inertias
from mechgraph.response.place import STEP, Place
from mechgraph.result.solution import Solution
from mechgraph.result.values import bracket, number

UNBALANCED = 1e-6
"""Generalized force, against the largest that a load exerts, above which a position is said to be none of equilibrium."""
MODES_SHOWN, AMPLITUDES_SHOWN = 8, 4
"""Most motions, and of each the most amplitudes, that are shown."""
SAME_MOTION = 1e-9
"""Difference of the rates of two freedoms up to which they move alike, as two hinges on one line do."""
STANDING = 1e-12
"""Rate of a motion, of the fastest, that is none."""
UNRESISTED = 10.0
"""Stiffness, against its rounding, up to which there is none."""


@dataclass(frozen=True, repr=False)
class Linearized(Shown):
    """Small motions about a position of equilibrium.

    ``freedoms``: names of the independent ones ``(n,)``; ``M, C, K (n, n)`` in the user's units (coordinates of these freedoms);
    ``force (n,)`` what is left of the balance, zero in an equilibrium; ``motions (F, n)`` rates of all freedoms for unit rates of the
    independent ones, user's units; ``unresisted (n, k)`` the motions against which there is no stiffness (K takes nothing of them);
    ``solution`` everything at rest there.
    """

    mechanism: Mechanism
    freedoms: tuple[str, ...]
    M: Array
    C: Array
    K: Array
    force: Array
    motions: Array
    unresisted: Array
    solution: Solution

    def document(self) -> Document:
        """Frequencies, damping and shapes of the motions."""
        time = self.mechanism.units.get("time", "")
        per = unit_of(self.mechanism.units, (0, 0, -1))
        rows = []
        for w, ratio, shape in zip(
            self.frequencies[:MODES_SHOWN], self.damping[:MODES_SHOWN], self.modes[:MODES_SHOWN], strict=False
        ):
            swings = (number(w), number(w / (2 * np.pi))) if np.isfinite(w) else ("none", "")
            told = (number(ratio),) if w != 0.0 else ("free",)
            rows.append((*swings, *told, " ".join(f"{name} {abs(shape[name]):.3g}" for name in self._told(shape))))
        head = (
            f"frequency{bracket(per)}",
            f"cycles{bracket(f'1/{time}' if time else '')}",
            "damping",
            "greatest amplitudes",
        )
        count = f"{counted(len(self.freedoms), 'independent freedom')}: {listed(self.freedoms)}"
        return Document(f"Small motions of {self.mechanism.name}", (Paragraph(f"{count}."), Table(head, rows, "rrrl")))

    def _told(self, shape: Mapping[str, complex]) -> list[str]:
        """The freedoms that tell a mode: those of which the declaration says something, then the largest; no two that move alike."""
        m, names = self.mechanism, self.mechanism.freedom_names()
        said = {*m.start, *(d.freedom for d in m.drives), *(one.in_freedom for one in m.loads if one.in_freedom)}
        said |= m.response.freedoms if m.response else set()
        said = {m.full_name(name) for name in said}
        largest = max(map(abs, shape.values()))
        moving = [name for name in names if abs(shape[name]) > 1e-3 * largest]
        told: list[int] = []
        for name in sorted(moving, key=lambda name: (name not in said, -abs(shape[name]))):
            i = names.index(name)
            rows = [self.motions[i] - sign * self.motions[j] for j in told for sign in (1.0, -1.0)]
            if not any(np.abs(row).max() <= SAME_MOTION * np.abs(self.motions[i]).max() for row in rows):
                told.append(i)
        return [names[i] for i in told[:AMPLITUDES_SHOWN]]

    @cached_property
    def A(self) -> Array:
        """State matrix ``(2 n, 2 n)``: ``d(u, u')/dt = A (u, u')``."""
        n = len(self.M)
        lower = -np.linalg.solve(self.M, np.concatenate([self.K, self.C], axis=1))
        return np.concatenate([np.concatenate([np.zeros((n, n)), np.eye(n)], axis=1), lower])

    @cached_property
    def _modes(self) -> tuple[Array, Array]:
        n, k = self.unresisted.shape
        if not self.C.any() and np.abs(self.K - self.K.T).max(initial=0.0) <= 1e-9 * np.abs(self.K).max(initial=0.0):
            w, U = scipy.linalg.eigh(0.5 * (self.K + self.K.T), self.M)
            w[np.argsort(np.abs(w))[:k]] = 0.0
            order = np.argsort(np.abs(w), kind="stable")
            return np.emath.sqrt(-w[order].astype(complex)), U[:, order].astype(complex)
        # along what is unresisted the place tells nothing: only the rates count, so that its zero is simple and exact
        R = scipy.linalg.null_space(self.unresisted.T) if k else np.eye(n)
        lower = -np.linalg.solve(self.M, np.concatenate([self.K @ R, self.C], axis=1))
        w, V = np.linalg.eig(np.concatenate([np.concatenate([np.zeros((n - k, n - k)), R.T], axis=1), lower]))
        still = np.abs(w) <= STANDING * np.abs(w).max(initial=0.0)
        w, V = w[~still], V[n - k :, ~still]
        kept = np.flatnonzero(w.imag > 0) if 2 * (w.imag > 0).sum() == len(w) else np.flatnonzero(w.imag >= 0)
        kept = kept[np.argsort(np.abs(w[kept]), kind="stable")]
        return np.append(np.zeros(k), w[kept]), np.concatenate([self.unresisted, V[:, kept]], axis=1)

    @property
    def eigenvalues(self) -> Array:
        """Exponents ``s`` of the motions ``exp(s t)``, one of every conjugate pair, slowest first."""
        return self._modes[0]

    @property
    def frequencies(self) -> Array:
        """Undamped natural frequencies ``|s|`` in rad a unit of time; 0 of a motion that nothing resists, NaN of one that grows or creeps
        without swinging.
        """
        s = self.eigenvalues
        return np.where((np.abs(s.imag) > 0) | (s == 0), np.abs(s), np.nan)

    @property
    def damping(self) -> Array:
        """Damping ratios ``-Re s / |s|``."""
        s = self.eigenvalues
        return np.asarray(-s.real / np.where(np.abs(s) > 0, np.abs(s), 1.0))

    @property
    def modes(self) -> tuple[dict[str, complex], ...]:
        """Mode shapes: amplitudes of all freedoms by name, the largest one 1."""
        shapes = (self.motions @ self._modes[1]).T
        names = self.mechanism.freedom_names()
        return tuple(
            dict(zip(names, (shape / shape[np.argmax(np.abs(shape))]).tolist(), strict=True)) for shape in shapes
        )


@door
def linearize(m: Mechanism, at: Mapping[str, float] | None = None, *, engine: EngineName = "auto") -> Linearized:
    """Small motions about the declared ``start`` or the coordinates ``at``, the drives at rest; meant for an equilibrium.

    Raises
    ------
    DeclarationError, AssemblyError
    """
    place = Place(m, "linearize", at, engine)
    d = place.derivatives()
    if np.linalg.eigvalsh(in_unit_inertias(d.M)).min() <= MASSLESS:
        raise DeclarationError(
            f"linearize {m.name!r}", ["has a motion without inertia; give mass or inertia to what moves so"]
        )
    largest = max(place.largest(), float(np.abs(d.K).max()) * STEP)
    s, free, names = place.task.system, place.chart.free, m.freedom_names()
    said = []
    if np.abs(d.Q).max() > UNBALANCED * largest:
        said.append(
            f"is not in equilibrium there (generalized forces of {np.abs(d.Q).max() / largest:.2g} of the largest that a load exerts); "
            "mg.equilibrium(m) finds a position that is"
        )
    for what, which, hint in (
        ("stiffness", d.bent, "a force has a corner or a jump there, as a one-sided spring at its contact"),
        ("damping", d.dry, "a force jumps with the sign of a rate, as dry friction does"),
    ):
        if which:
            where = listed(names[free[i]] for i in which)
            said.append(
                f"has no {what} in {where}: slopes at several lengths differ ({hint}); what is given is doubtful"
            )
    for one in said:
        warnings.warn(f"mechanism {m.name!r}: {one}", MechgraphWarning, stacklevel=3)
    zero = _unresisted(d.K, d.noise)
    K = d.K - d.K @ zero @ zero.T
    L = s.par.L
    unit = np.where(s.is_length, L, 1.0)
    u = unit[free]
    work = L**2 / np.outer(u, u)
    motions: Any = unit[:, None] * place.motions / u
    parts = (work * d.M, work * d.C, work * K, L**2 / u * d.Q, motions, scipy.linalg.orth(u[:, None] * zero))
    return Linearized(m, tuple(names[i] for i in free), *parts, place.solution())


def _unresisted(K: Array, noise: Array) -> Array:
    """Orthonormal motions ``(n, k)`` of which the stiffness is rounding."""
    _, sizes, V = np.linalg.svd(K)
    return np.asarray(V[sizes <= UNRESISTED * np.linalg.norm(noise)].T)
