"""The printed equations hold: text and LaTeX are read back and evaluated with numbers that owe nothing to the formulation.

Directions and points come from the poses of the links and the markers, inertia from the accelerations of the mass centers, loads
from their declaration, unknowns from the reactions of a solution, taken apart by Lee's definitions; rates of pairs and links from
the same solution. Closure of position, velocity and acceleration, motion, inertia, forces, couplings, and the response.
"""

import re
from dataclasses import dataclass

import numpy as np
import pytest
import scipy

import mechgraph as mg

pytestmark = pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
"""Random loads move passive freedoms; ``test_passive_loads`` looks at what is said of it."""

MOVING = tuple(
    name
    for name in mg.library()
    if mg.load(name).expected.get("mobility", 0) > 0 and not any(pair.curve for pair in mg.load(name).pairs)
)
"""Without those on curves: the evaluation of printed texts below knows constant screws alone."""
BOOKKEEPINGS = ("lee", "minimal")
LETTERS = dict(zip("XYA", np.eye(3), strict=True))
PART = r"[A-Za-z]\w*?'*0?_[\w,]+?(?:\([^()]*\))?"
SPOKEN = {
    r"\dot{\bar{v}}": "dv", r"\bar{\omega}": "w", r"\bar{\alpha}": "dw", r"\dot{V}": "dV", r"\dot{S}": "dS", r"\ddot{S}": "ddS",
    **{rf"\bar{{{letter}}}": letter for letter in "vackzy"}, r"\theta": "theta", r"\omega": "omega", r"\alpha": "alpha", r"\rho": "rho",
}  # fmt: skip
"""What letters of LaTeX are in text."""
SYMBOL = re.compile(rf"(?P<name>{PART})(?P<axis>[xyz]?)")
TOKEN = re.compile(rf"{PART}[xyz]?(?![\w(]|,\d)|[exXYA](?!\w)|\d+(?:\.\d+)?|[-+().=]")
TEX = re.compile(
    r"(?:\\hat\{(?P<hat>\w|\\text\{\w+\})\}|(?P<plain>\\text\{\w+\}|[A-Zm]))(?P<primes>'*)"
    r"(?:\^\{(?P<above>[^{}]*)\})?_\{(?P<below>(?:[^{}]|\{[^{}]*\})*)\}"
)


def untexed(latex: str) -> str:
    """The LaTeX of an equation as the text of the same equation."""

    def symbol(m: re.Match[str]) -> str:
        letter = (m["hat"] or m["plain"]).removeprefix("\\")
        return re.sub(r"\\?text\{([^{}]*)\}", r"\1", f"{letter}{m['primes']}{m['above'] or ''}_{m['below']}")

    for tex, text in SPOKEN.items():
        latex = latex.replace(tex, rf"\text{{{text}}}")
    words = re.sub(r"\\hat\{([XYA])\}", r"\1", TEX.sub(symbol, latex))
    for tex, text in {r"\epsilon": "e", r"\cdot": ".", r"\times": "x", r"\exp": "exp"}.items():
        words = words.replace(tex, text)
    assert "\\" not in words.replace(r"\_", "_"), latex
    return words.replace(r"\_", "_")


@dataclass(frozen=True)
class Dual:
    """``real + e dual``: scalars or vectors, with e e = 0."""

    real: np.ndarray
    dual: np.ndarray

    @staticmethod
    def of(real: object, dual: object = 0.0) -> "Dual":
        return Dual(np.asarray(real, dtype=float), np.asarray(dual, dtype=float))

    @property
    def size(self) -> float:
        return float(max(np.abs(self.real).max(), np.abs(self.dual).max()))

    def __add__(self, other: "Dual") -> "Dual":
        return Dual(self.real + other.real, self.dual + other.dual)

    def __neg__(self) -> "Dual":
        return Dual(-self.real, -self.dual)

    def __mul__(self, other: "Dual") -> "Dual":
        return Dual(self.real * other.real, self.real * other.dual + self.dual * other.real)

    def cross(self, other: "Dual") -> "Dual":
        real = np.cross(self.real, other.real)
        return Dual(real, np.cross(self.real, full_vector(other.dual)) + np.cross(full_vector(self.dual), other.real))

    def dot(self, other: "Dual") -> "Dual":
        return Dual(np.asarray(self.real @ other.real), self.real @ other.dual + self.dual @ other.real)


class Numbers(dict[str, Dual]):
    """Values of the symbols at one position of a solution."""

    def __init__(self, m: mg.Mechanism, s: mg.Solution, i: int) -> None:
        super().__init__(e=Dual.of(0.0, 1.0))
        self.m, self.s, self.i = m, s, i
        self.held = max((float(np.abs(effort[i])) for effort in s.passive_effort.values()), default=0.0)
        moving = [link.name for link in m.links if link.name != m.frame]
        self.number = {name: str(n) for n, name in enumerate([*moving, m.frame], 1)}
        for k, pair in enumerate(m.pairs):
            self.put_pair(str(k + 1), pair)
        for link in m.links:
            if link.name != m.frame:
                self.put_link(link)
                self.put_motion(link)
        self.update({letter: Dual.of(unit) for letter, unit in LETTERS.items()})
        for coupling in m.couplings:
            places = [m.freedom(name) for name in coupling.freedoms]
            values = [s[m.pairs[k].name].position[i, j] for k, j in places]
            self[f"K_C({coupling.name})"] = Dual.of(np.dot(coupling.coefficients, values))

    def put_motion(self, link: mg.Link) -> None:
        """Twist and its rate, acceleration of the mass center, inertia in global directions."""
        here, n = self.s.link(link.name), self.number[link.name]
        for mark, both in (("", here.twist[self.i]), ("d", here.acceleration[self.i])):
            turning, moving = both[:3], both[3:]
            self[f"{mark}V_{n}"] = Dual.of(turning, moving)
            self[f"{mark}w_{n}"], self[f"{mark}v_{n}"] = Dual.of(turning), Dual.of(moving)
        R = self.pose(link.name)[:3, :3]
        self[f"m_{n}"] = Dual.of(link.mass)
        if link.mass:
            self[f"c_{n}"], self[f"a_{n}"] = Dual.of(here.center[self.i]), Dual.of(here.center_acceleration[self.i])
        if link.inertia is not None:
            self[f"I_{n}"] = Dual.of(R @ link.inertia @ R.T)

    def put_freedoms(self, k: str, pair: mg.Pair) -> None:
        """Position, rate and acceleration of every freedom, with a direction where the pair has several of its sort."""
        joint, turns = self.s[pair.name], [f.turns for f in pair.type.freedoms]
        for j, freedom in enumerate(pair.type.freedoms):
            direction = "XYA"["xyz".index(freedom.name[1])] + pair.type.frame_before[j] * "'"
            where = f"{direction if turns.count(turns[j]) > 1 else ''}_{k}"
            for letter, values in zip(
                ("theta", "omega", "alpha") if turns[j] else ("S", "dS", "ddS"),
                (joint.position, joint.velocity, joint.acceleration),
                strict=True,
            ):
                self[letter + where] = Dual.of(values[self.i, j])

    def shape(self, link: str, k: int, n: int) -> np.ndarray:
        """Pose of the marker of pair ``n`` (numbered from 1) on a link, seen from that of pair ``k``."""
        first, second = (full(self.m.pairs[i - 1].markers[self.m.pairs[i - 1].a != link].pose()) for i in (k, n))
        return np.linalg.inv(first) @ second

    def pose(self, link: str) -> np.ndarray:
        return self.s.link(link).pose[self.i]

    def frames(self, pair: mg.Pair) -> list[np.ndarray]:
        """Poses of the frames of a pair, one more after every single freedom."""
        out = [self.pose(pair.a) @ full(pair.markers[0].pose())]
        for label, q in zip((f.name for f in pair.type.freedoms), self.s[pair.name].position[self.i], strict=True):
            step = np.eye(4)
            axis = "xyz".index(label[1])
            if label[0] == "T":
                step[axis, 3] = q
            else:
                j, k = (axis + 1) % 3, (axis + 2) % 3
                step[[j, k], [j, k]], step[j, k], step[k, j] = np.cos(q), -np.sin(q), np.sin(q)
            out.append(out[-1] @ step)
        return out

    def put_pair(self, k: str, pair: mg.Pair) -> None:
        at_b = (self.pose(pair.b) @ full(pair.markers[1].pose()))[:3, 3]
        frames = self.frames(pair)
        slides = {
            f"{'XYA'['xyz'.index(f.name[1])]}{p * chr(39)}"
            for p, f in enumerate(pair.type.freedoms)
            if f.name[0] == "T"
        }
        for p, frame in enumerate(frames):
            for letter, unit in LETTERS.items():
                name, point = letter + p * "'", frame[:3, 3]
                line, moment = frame[:3, :3] @ unit, np.cross(at_b if name in slides else point, frame[:3, :3] @ unit)
                self[f"{name}_{k}"], self[f"{name}0_{k}"] = Dual.of(line, moment), Dual.of(moment)
        if pair.pitch is not None:
            self[f"rho_{k}"] = Dual.of(pair.pitch)
        self.put_freedoms(k, pair)
        joint = self.s[pair.name]
        moment, force = joint.reaction[self.i, :3], joint.reaction[self.i, 3:]
        a, b = self.number[pair.a], self.number[pair.b]
        alone = sum({p.a, p.b} == {pair.a, pair.b} for p in self.m.pairs) == 1
        name = "" if alone else f"({pair.name})"
        self[f"R_{a}{b}{name}"], self[f"R_{b}{a}{name}"] = Dual.of(force, moment), -Dual.of(force, moment)
        for part, value in joint.components.items():
            for p in range(4):
                self[f"{part[0]}{'XYA'['xyz'.index(part[1])]}{p * chr(39)}_{k}"] = Dual.of(value[self.i])
        axis, origin = frames[0][:3, 2], frames[0][:3, 3]
        if pair.type.symbol in ("R", "H"):  # Lee: what remains has no force along the axis, and no moment about it
            along = float(axis @ force)
            rho = pair.pitch or 0.0
            moment = moment - along * (np.cross(origin, axis) - rho * axis)
            force = force - along * axis
            self[f"FA_{k}"] = Dual.of(along)
        elif pair.type.symbol == "P":
            along = float(axis @ (moment - np.cross(origin, force)))
            moment = moment - along * axis
            self[f"MA_{k}"] = Dual.of(along)
        self[f"F_{a}{b}{name}"], self[f"M_{a}{b}{name}"] = Dual.of(force, moment), Dual.of(moment)

    def put_link(self, link: mg.Link) -> None:
        here, n = self.s.link(link.name), self.number[link.name]
        pose, w, alpha = here.pose[self.i], here.angular_velocity[self.i], here.angular_acceleration[self.i]
        turned = np.zeros((3, 3)) if link.inertia is None else pose[:3, :3] @ link.inertia @ pose[:3, :3].T
        place = here.center[self.i] if link.mass else np.zeros(3)
        force = -link.mass * (here.center_acceleration[self.i] if link.mass else np.zeros(3))
        moment = np.cross(place, force) - turned @ alpha - np.cross(w, turned @ w)
        self.put_load(f"I{n}", force, moment)
        force, moment = np.zeros(3), np.zeros(3)
        for load in self.m.loads:
            if isinstance(load, mg.Gravity):
                weight = link.mass * np.asarray(load.acceleration)
                force, moment = force + weight, moment + np.cross(place, weight)
            else:
                assert isinstance(load, mg.Effort)
                k, j = self.m.freedom(load.freedom)
                pair = self.m.pairs[k]
                sign = (pair.b == link.name) - (pair.a == link.name)
                letter = "XYA"["xyz".index(pair.type.freedoms[j].name[1])] + j * "'"
                line = self[f"{letter}_{k + 1}"]
                turns = pair.type.freedoms[j].turns
                moment = moment + sign * load.value * (line.real if turns else line.dual)
                force = force + sign * load.value * line.real * (not turns)
        self.put_load(f"L{n}", force, moment)

    def put_load(self, place: str, force: np.ndarray, moment: np.ndarray) -> None:
        self[f"F_{place}"], self[f"M_{place}"] = Dual.of(force, moment), Dual.of(moment)

    def value(self, word: str) -> Dual:
        if word in self:
            return self[word]
        if word[0].isdigit():
            return Dual.of(float(word))
        name, axis = SYMBOL.fullmatch(word).group("name", "axis")
        return Dual.of(self[name].real["xyz".index(axis)])


def full(pose: np.ndarray) -> np.ndarray:
    return np.vstack([pose, [0, 0, 0, 1]])


def full_vector(value: np.ndarray) -> np.ndarray:
    return np.broadcast_to(value, (3,))


def evaluated(text: str, numbers: Numbers) -> Dual:
    """A sum of products; ``.`` and ``x`` of dual vectors bind less than a product with a number, a tensor acts on a vector."""
    words = TOKEN.findall(text)
    assert "".join(words) == text.replace(" ", ""), text

    def product() -> Dual:
        parts = []
        while words and words[0] not in ("+", "-", ")", ".", "x"):
            word = words.pop(0)
            parts.append(summed() if word == "(" else numbers.value(word))
        total = parts.pop()
        for part in reversed(parts):
            total = Dual.of(part.real @ total.real) if part.real.ndim == 2 else part * total
        return total

    def summed() -> Dual:
        total = Dual.of(0.0)
        while words and words[0] != ")":
            sign = words.pop(0) if words[0] in "+-" else "+"
            term = product()
            while words and words[0] in (".", "x"):
                term = (term.dot if words.pop(0) == "." else term.cross)(product())
            total = total + (term if sign == "+" else -term)
        if words:
            words.pop(0)
        return total

    return summed()


def displaced(text: str, numbers: Numbers) -> np.ndarray:
    """A product of displacements ``exp(screw)`` and shapes of links ``L_2(1,2)``."""
    pose, named = np.eye(4), {n: name for name, n in numbers.number.items()}
    while text:
        shape = re.match(r"L_(\d+)\((\d+),(\d+)\) ?", text)
        if shape:
            link, k, n = shape.groups()
            pose, text = pose @ numbers.shape(named[link], int(k), int(n)), text[shape.end() :]
            continue
        assert text.startswith("exp("), text
        depth = np.cumsum([(c == "(") - (c == ")") for c in text[3:]])
        end = 3 + int(np.argmin(depth != 0))
        twist = evaluated(text[4:end], numbers)
        w = np.cross(full_vector(twist.real), -np.eye(3))
        screw = np.vstack([np.column_stack([w, full_vector(twist.dual)]), np.zeros(4)])
        pose, text = pose @ scipy.linalg.expm(screw), text[end + 1 :].lstrip()
    return pose


def assert_closed(block: mg.equations.terms.Block, numbers: Numbers) -> None:
    """A displacement closure holds: its product is the identity, lengths against the largest of all."""
    product, _, right = block.text.rpartition(" = ")
    if right != "1":
        assert_holds(block.text, numbers)
        return
    scale = max(number.size for number in numbers.values())
    assert np.abs(displaced(product, numbers) - np.eye(4)).max() <= 1e-11 * scale, block.text


def assert_holds(text: str, numbers: Numbers) -> None:
    """To rounding, and to the effort that holds a passive freedom, which is no unknown of the printed equations."""
    left, right = (evaluated(side, numbers) for side in text.split(" = "))
    gap, scale = left + -right, max(number.size for number in numbers.values())
    assert max(np.abs(gap.real).max(), np.abs(gap.dual).max()) <= 1e-11 * scale + numbers.held, text


def numbered(text: str, latex: str) -> dict[str, tuple[str, str]]:
    """Text and LaTeX of the component equations by number: V1 ... and A1 ... of the closure, 1 ... of the forces."""
    flat = " ".join(text[text.index("\nComponents") :].split())
    pieces = re.split(r"(?:^| )\(([VA]?\d+)\) ", re.sub(r" Components( of the \w+ closure)? [-~]+", "", flat))[1:]
    tagged = {n: line for line, n in re.findall(r"^(.*) \\tag\{([VA]?\d+)\}$", latex, re.MULTILINE)}
    assert list(tagged) == pieces[::2]
    return {n: (words, tagged[n]) for n, words in zip(pieces[::2], pieces[1::2], strict=True)}


def put_unknowns(f: mg.Formulation, s: mg.Solution, i: int, numbers: Numbers) -> None:
    """Efforts and multipliers of a solution, and what the driver prescribes."""
    for u in f.unknowns:
        if u.group == "driver":
            k, j = f.mechanism.freedom(u.freedom)
            joint = s[f.mechanism.pairs[k].name]
            numbers[u.name] = Dual.of(joint.effort[i, j])
            for given in [a for a in f.unknowns if a.group == "acceleration" and a.freedom == u.freedom]:
                numbers[f"{given.name}(IN)"] = Dual.of(joint.acceleration[i, j])
        elif u.group == "coupling":
            numbers[u.name] = Dual.of(s.coupling(u.owner).effort[i])


def put_definition(block: mg.equations.terms.Block, numbers: Numbers) -> None:
    """A symbol gets the value of its definition: one dual vector, or two vectors, ``z_1 + e y_1 = ...``."""
    left, _, right = block.text.partition(" = ")
    value = evaluated(right, numbers)
    real, plus, dual = left.partition(" + e ")
    if not plus:
        numbers[left] = value
    else:
        numbers[real], numbers[dual] = Dual.of(full_vector(value.real)), Dual.of(full_vector(value.dual))
    name = re.fullmatch(r"([NF])(_\w+)", left)
    if name:  # its dual part among the components
        dual_name = {"N": "N0", "F": "M"}[name[1]] + name[2]
        numbers[dual_name] = Dual.of(full_vector(value.dual))
        numbers[left] = Dual(full_vector(value.real), full_vector(value.dual))


def check_all(m: mg.Mechanism, s: mg.Solution, bookkeeping: str, positions: tuple[int, ...]) -> None:
    """Every printed equation, block by block and component by component, as text and as LaTeX."""
    drives = [d.freedom for d in m.drives]
    for sought, efforts in (("kinetostatics", None), ("response", drives)):
        f = mg.formulate(m, bookkeeping, efforts, unknowns=sought)
        names = [u.name for u in f.unknowns]
        assert len(set(names)) == len(names)
        whole = f.text()
        components = numbered(whole, f.latex())
        systems = (f.closure.velocity, f.closure.acceleration, f)
        assert len(components) == sum(len(system.equations) for system in systems)
        closure = f.closure
        closed = (*closure.velocity.blocks, *closure.acceleration.blocks)
        every = (*closure.position, *closed, *closure.motion, *closure.inertia, *f.blocks)
        for text, latex in [*components.values(), *((b.text, b.latex) for b in every)]:
            assert untexed(latex) == text
        flat = " ".join(whole.split())
        assert all(block.text in flat for block in every)
        for i in positions:
            numbers = Numbers(m, s, i)
            put_unknowns(f, s, i, numbers)
            for block in (*closure.motion, *closure.inertia, *f.blocks):
                if block.kind in ("bias", "effort", "coupling", "influence"):
                    put_definition(block, numbers)
                else:
                    assert_holds(block.text, numbers)
            for block in closure.position:
                assert_closed(block, numbers)
            for text in [*(b.text for b in closed), *(text for text, _ in components.values())]:
                assert_holds(text, numbers)


@pytest.mark.daily(1)
@pytest.mark.parametrize("bookkeeping", BOOKKEEPINGS)
@pytest.mark.parametrize("name", MOVING)
def test_printed_equations_of_the_library_hold(name: str, bookkeeping: str) -> None:
    # springs pull on links: their wrenches stand in the printed loads, which this test takes from given efforts and gravity alone
    m = mg.load(name).replace(loads=[load for load in mg.load(name).loads if not load.between_links])
    (drive,) = m.drives
    if drive.motion is None:
        s = mg.solve(m, {drive.freedom: mg.Motion([0.0, 0.1], 2.0, 3.0)}, redundant="minimum_norm")
        check_all(m, s, bookkeeping, (0, 1))
        return
    s = mg.solve(m, redundant="minimum_norm")
    check_all(m, s, bookkeeping, (0, len(s.status) // 3))


Z = (0.0, 0.0, 1.0)


def planar() -> mg.Mechanism:
    """Two drivers on one link of a planar pair whose frames turn: efforts along slides that act at the marker of link b."""
    links = [mg.Link("frame"), mg.Link("plate", 2.0, (0.3, 0.2, 0.1), np.diag([0.1, 0.2, 0.3]))]
    pair = mg.Pair("E", "E", "frame", "plate", point=(0.1, -0.2, 0.4), axis=(0.2, 0.3, 1.0))
    return mg.Mechanism("plate", links, [pair], drives=["E.Tx", "E.Ty", "E.Rz"], loads=[mg.Gravity((1.0, 2.0, -9.81))])


def seen_from_the_other_link() -> mg.Mechanism:
    """A slider-crank whose pairs name the moving link, or the later one, first: minus in front, and a driver that acts on link a."""
    links = [
        mg.Link("frame"), mg.Link("crank", 1.0, (0.0, 0.05, 0.01), np.eye(3) * 0.01),
        mg.Link("rod", 2.0, (0.2, 0.05, 0.0), np.eye(3) * 0.02), mg.Link("slider", 3.0, (0.4, 0.01, 0.0)),
    ]  # fmt: skip
    pairs = [
        mg.Pair("A", "R", "crank", "frame", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "rod", "crank", point=(0, 0.1, 0), axis=Z),
        mg.Pair("C", "R", "slider", "rod", point=(0.4, 0, 0), axis=Z),
        mg.Pair("D", "P", "slider", "frame", point=(0.4, 0, 0), axis=(1, 0, 0)),
    ]
    return mg.Mechanism(
        "turned", links, pairs, drives=["A"], loads=[mg.Gravity((0.3, -9.81, 0.2)), mg.Effort("D", 4.0)]
    )


def door() -> mg.Mechanism:
    """Two hinges between the same links, with names that mean something in LaTeX, and a wheel geared to them."""
    links = [mg.Link("frame"), mg.Link("door", 20.0, (0.4, 0, 0.9)), mg.Link("wheel", 1.0, (1.1, 0, 0), np.eye(3))]
    pairs = [
        mg.Pair("hinge_low", "R", "frame", "door", point=(0, 0, 0), axis=Z),
        mg.Pair("hinge_high", "R", "door", "frame", point=(0, 0, 2), axis=Z),
        mg.Pair("axle", "R", "frame", "wheel", point=(1, 0, 0), axis=Z),
    ]
    gears = mg.Coupling({"hinge_low": 1.0, "axle": -2.5}, name="belt")
    return mg.Mechanism(
        "door", links, pairs, couplings=[gears], drives=["hinge_low"], loads=[mg.Gravity((0, 1, -9.81))]
    )


@pytest.mark.daily(3)
@pytest.mark.parametrize("bookkeeping", BOOKKEEPINGS)
@pytest.mark.parametrize(
    ("m", "motion"),
    [
        (planar(), {"E.Tx": [0.1, 0.2], "E.Ty": [0.3, 0.4], "E.Rz": mg.Motion([0.7, 0.9], 2.0, 3.0)}),
        (seen_from_the_other_link(), {"A": mg.Motion([0.7, 0.9], 2.0, 3.0)}),
        (door(), {"hinge_low": mg.Motion([0.7, 0.9], 2.0, 3.0)}),
    ],
    ids=["several drivers", "first link moves", "two pairs between two links, coupling"],
)
def test_printed_equations_hold_beyond_the_library(m: mg.Mechanism, motion: dict, bookkeeping: str) -> None:
    check_all(m, mg.solve(m, motion, redundant="minimum_norm"), bookkeeping, (0, 1))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bookkeeping", "sought"),
    [
        ("minimal", "kinetostatics"),
        ("minimal", "response"),
        ("lee", "kinetostatics"),
        ("lee", "response"),
    ],
)
def test_a_wrong_sign_would_be_seen(bookkeeping: str, sought: str) -> None:
    """Every term counts: with its sign turned about, no equation holds (axes in general directions), but where the term is zero.

    Of the terms of forces none is; some of the motion are, as the links of this mechanism that only slide do not turn.
    """
    pose = np.eye(4)
    pose[:3, :3] = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    pose[:3, :3] *= np.linalg.det(pose[:3, :3])
    pose[:3, 3] = 0.3, -0.2, 0.4
    m = mg.load("rprrhc").moved(pose)
    (drive,) = m.drives
    assert drive.motion is not None
    s = mg.solve(m, {drive.freedom: mg.Motion(drive.motion.position[3:4], 2.0, 3.0)})
    seen, unseen = 0, []
    f = mg.formulate(m, bookkeeping, [drive.freedom], unknowns=sought)
    numbers = Numbers(m, s, 0)
    put_unknowns(f, s, 0, numbers)
    for block in (*f.closure.motion, *f.blocks):
        if block.kind in ("bias", "effort", "influence"):
            put_definition(block, numbers)
    texts = [text for text, _ in numbered(f.text(), f.latex()).values()]
    texts += [b.text for b in (*f.blocks, *f.closure.motion) if b.kind in ("link", "twist", "velocity", "acceleration")]
    for text in texts:
        assert_holds(text, numbers)
        for sign in re.finditer(r"(?:^-| [-+] )(?=[A-Za-z(])", text):
            turned = text[: sign.start()] + (" - " if "+" in sign[0] else " + ") + text[sign.end() :]
            try:
                assert_holds(turned, numbers)
                unseen.append(turned)
            except AssertionError:
                seen += 1
    for block in f.closure.position:
        for sign in re.finditer(r"exp\(-?", block.text):
            turned = block.text[: sign.start()] + ("exp(-" if sign[0] == "exp(" else "exp(") + block.text[sign.end() :]
            with pytest.raises(AssertionError):
                assert_closed(mg.equations.terms.Block((turned,), block.kind, block.owner), numbers)
            seen += 1
    assert seen > 100
    assert len(unseen) < seen / 8
    assert not [
        text for text in unseen if re.search(r"\b[FM][A-Z]?'*_\d", text) and "alpha" not in text and "dd" not in text
    ]


def test_a_motion_in_time_obeys_what_is_printed_for_it() -> None:
    """Closure, motion, inertia and forces of an integrated response, read back at three of its outputs."""
    m = mg.load("rcsr").replace(drives=[])
    r = mg.respond(m, np.linspace(0.0, 0.2, 3), rates={"O1": 1.0})
    for bookkeeping in BOOKKEEPINGS:
        check_all(m, r, bookkeeping, (0, 1, 2))


def test_names_are_escaped_in_latex() -> None:
    r"""A pair called ``\input{x}`` is text, not a command; a pair type's own component likewise."""
    slot = mg.PairType("Q", "crossed slots", freedoms=["Tx", "Ty"], reactions=None)
    pairs = [
        mg.Pair(r"\input{x}", "R", "frame", "a"),
        mg.Pair("B_1%", "R", "frame", "a"),
        mg.Pair("C", slot, "frame", "a"),
    ]
    for bookkeeping in BOOKKEEPINGS:
        latex = mg.formulate(mg.Mechanism("names", pairs=pairs), bookkeeping, efforts=["B_1%", "C.Tx"]).latex()
        assert r"\input" not in latex
        assert r"\text{\textbackslash{}input\{x\}}" in latex
        assert r"M^{A}_{IN(\text{B\_1\%})}" in latex
        assert r"\hat{\text{n1}}_{3}" in latex


def test_symbols_are_explained_in_mathematics() -> None:
    latex = mg.formulate(mg.load("rchch")).latex()
    assert r"\item $\hat{R}_{ab} = F + \epsilon M$: force" in latex
    assert r"\item $\hat{A}_{k} = A_{k} + \epsilon A^{0}_{k}$: " in latex
    assert r"\item $\rho_{k}$: pitch" in latex
    assert r"\hat{R}_{23} = \hat{F}_{23} + (1 - \epsilon \rho_{3}) F^{A}_{3} \hat{A}_{3}" in latex
    assert r"\rho" not in mg.formulate(mg.load("7r")).latex()
    text = mg.formulate(mg.load("rchch")).text()
    assert "- rho_k: pitch of pair k, advance per radian" in text
    assert "F_Lb: loads applied to link b" in text
    assert "F_Lb" not in mg.formulate(mg.load("rchch").replace(loads=[])).text()
