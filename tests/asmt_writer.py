"""FreeCAD assemblies written by a script: any mechanism whose pairs FreeCAD has, its parts in frames of their own."""

import numpy as np

import mechgraph as mg

KINDS = {
    "R": ["RevoluteJoint"],
    "P": ["TranslationalJoint"],
    "C": ["CylindricalJoint"],
    "S": ["SphericalJoint"],
    "U": ["UniversalJoint"],
    "E": ["PlanarJoint"],
    "W": ["FixedJoint"],
    "Sg": ["PointInLineJoint"],
    "Sp": ["PointInPlaneJoint"],
    "Cp": ["LineInPlaneJoint"],
    "H": ["CylindricalJoint", "ScrewJoint"],
}
Z_FROM_X = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]).T
"""Turns a marker so that its z lies where its x was."""
SECOND_IS_Z = ("U", "Cp")
"""Pairs whose second axis is z of marker J in FreeCAD."""


def lines_of(depth, *entries):
    """Indented lines; a list is a level deeper than the line before it, an array a row of numbers or several."""
    out = []
    for entry in entries:
        if isinstance(entry, list):
            out += lines_of(depth + 1, *entry)
        elif isinstance(entry, np.ndarray):
            out += ["\t" * (depth + 1) + "\t".join(f"{v:.17g}" for v in row) + "\t" for row in np.atleast_2d(entry)]
        else:
            out.append("\t" * depth + str(entry))
    return out


def placed(X):
    return ["Position3D", X[:3, 3], "RotationMatrix", X[:3, :3]]


def marker(name, X):
    """A marker in a RefPoint that stands anywhere in its part."""
    point = random_pose(np.random.default_rng(len(name)))
    return ["RefPoint", [*placed(point), "Markers", ["Marker", ["Name", [name], *placed(np.linalg.inv(point) @ X)]]]]


def random_pose(rng, size=1.0):
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = q * np.sign(np.linalg.det(q)), size * rng.normal(size=3)
    return X


def marker_pose(marker):
    X = np.eye(4)
    X[:3] = marker.pose()
    return X


class Writer:
    """Collects the sections of a file; poses are given in the assembly."""

    def __init__(self, name="Assembly1", at=None):
        self.name, self.at = name, np.eye(4) if at is None else at
        self.parts, self.markers, self.poses = {}, {name: []}, {name: self.at}
        self.joints, self.motions, self.limits, self.forces = [], [], [], []
        self.variables, self.assemblies, self.general = [], [], []
        self.gravity, self.simulation, self.results = np.zeros(3), (0.0, 1.0, 0.1), []

    def part(self, name, X, mass=0.0, center=(0, 0, 0), axes=None, moments=(0, 0, 0)):
        """A part at X; center and principal axes in its own frame."""
        M = np.eye(4)
        M[:3, :3], M[:3, 3] = np.eye(3) if axes is None else axes, center
        self.parts[name] = ["PrincipalMassMarker", ["Name", ["MassMarker"], *placed(M), "Mass", np.array([mass]),
                            "MomentOfInertias", np.array(moments, float), "Density", ["10"]]]  # fmt: skip
        self.poses[name], self.markers[name] = X, []

    def marker(self, part, name, X):
        self.markers[part].append(marker(name, np.linalg.inv(self.poses[part]) @ X))
        return f"/{self.name}/{part}/{name}" if part != self.name else f"/{self.name}/{name}"

    def joint(self, kind, name, a, A, b, B, *numbers):
        """A joint between marker A on part a and marker B on part b; numbers as label, value."""
        i, j = self.marker(a, f"{name} I on {a} {kind}", A), self.marker(b, f"{name} J on {b} {kind}", B)
        head = ["Name", [name]] if name is not None else ["Name", [""]]
        more = [[str(n)] if isinstance(n, int | float) else n for n in numbers]
        self.joints += [kind, [*head, "MarkerI", [i], "MarkerJ", [j], *more]]
        return i, j

    def motion(self, kind, name, joint, *formulas):
        pairs = [[text] if k % 2 else text for k, text in enumerate(formulas)]
        self.motions += [kind, ["Name", [name], "MotionJoint", [f"/{self.name}/{joint}"], *pairs]]

    def body(self, name, X):
        """The lines of the assembly of that name, standing at X."""
        parts = []
        for part, mass in self.parts.items():
            refs = [line for m in self.markers[part] for line in m]
            parts += ["Part", ["Name", [part], *placed(self.poses[part]), "Velocity3D", np.zeros(3), "FeatureOrder",
                      *mass, "RefPoints", refs, "RefCurves", "RefSurfaces"]]  # fmt: skip
        return ["Notes", ["(Text string: '')"], "Name", [name], *placed(X), "RefPoints",
            [line for m in self.markers[self.name] for line in m], "RefCurves", "RefSurfaces", "Parts", [*parts, *self.assemblies],
            "Variables", self.variables, "KinematicIJs",
            "ConstraintSets", ["Joints", self.joints, "Motions", self.motions, "Limits", self.limits,
             "GeneralConstraintSets", self.general],
            "ForceTorques", self.forces]  # fmt: skip

    def text(self):
        start, end, step = self.simulation
        body = lines_of(1, *self.body(self.name, self.at), "ConstantGravity", self.gravity, "SimulationParameters",
            ["tstart", np.array([start]), "tend", np.array([end]), "hout", np.array([step])])  # fmt: skip
        return "\n".join(["OndselSolver", "Assembly", *body, *self.results]) + "\n"


def written(m, at, rng=None, turned=()):
    """A Writer of a mechanism at a position of its drivers, its parts standing in frames of their own.

    ``turned``: names of pairs whose marker J is turned half round.
    """
    s = mg.kinematics(m, at)
    w = Writer(m.frame)
    for link in m.links:
        if link.name == m.frame:
            continue
        X = s.link(link.name).pose
        own = np.eye(4) if rng is None else random_pose(rng, 0.3)  # the part's frame in that of the link
        back = np.linalg.inv(own)
        center, moments, axes = np.zeros(3), np.zeros(3), np.eye(3)
        if link.center is not None:
            center = (back @ [*link.center, 1.0])[:3]
        if link.inertia is not None:
            moments, axes = np.linalg.eigh(np.array(link.inertia))
            axes[:, 0] *= np.sign(np.linalg.det(axes))
            axes, moments = back[:3, :3] @ axes, np.maximum(moments, 0)
        w.part(link.name, X @ own, link.mass, center, axes, moments)
    for p in m.pairs:
        A = s.link(p.a).pose @ marker_pose(p.markers[0])
        B = s.link(p.b).pose @ marker_pose(p.markers[1])
        if p.type.symbol in SECOND_IS_Z:
            B = B @ np.block([[Z_FROM_X, np.zeros((3, 1))], [np.zeros(3), 1.0]])
        if p.name in turned:
            B = B @ np.diag([1.0, -1, -1, 1])
        for kind in KINDS[p.type.symbol]:
            lead = ("pitch", 2 * np.pi * p.pitch_per_radian) if kind == "ScrewJoint" else ()
            w.joint(kind, p.name if kind != "ScrewJoint" else f"{p.name} lead", p.a, A, p.b, B, *lead)
    for load in m.loads:
        if isinstance(load, mg.Gravity):
            w.gravity = np.array(load.acceleration, float)
    return w
