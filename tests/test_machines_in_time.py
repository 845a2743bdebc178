"""The acceptance of friction and impact in time: ``python tests/test_machines_in_time.py`` prints every number.

Cases 18 to 23 of machines as built, each with its closed form, and declared otherwise: links of pairs swapped, moved and turned, in
millimeters and tonnes, in the plane or in space, with every engine; with next to no friction the motion without. Sources: K. Magnus and
K. Popp, Schwingungen, 1997 (dry slide, journal, belt); F. Genot and B. Brogliato, European Journal of Mechanics A 18, 1999 (sliding rod);
J. E. Shigley and C. R. Mischke, Mechanical Engineering Design, 1989, chapter 8 (screw); F. Pfeiffer and Ch. Glocker, Multibody Dynamics
with Unilateral Contacts, 1996, chapter 8 (impacts).
"""

import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve
from test_friction_in_time import PITCH, RADIUS, G, belt, screw, slide
from test_impact import four_bar, law, rod, shaken

import mechgraph as mg

X, Y, Z = np.eye(3)
FINE = {"rtol": 1e-10, "atol": 1e-12}
SI = {"length": "m", "mass": "kg", "time": "s"}


class Number(NamedTuple):
    """What it is, by the closed form, as read from a response; the power of a millimeter in its unit."""

    what: str
    expected: float
    read: Callable[[mg.Response], Any]
    unit: int = 0


class Motion(NamedTuple):
    """A machine that moves: how it is responded, and the numbers that are known of it."""

    machine: mg.Mechanism
    times: Any
    how: dict[str, Any]
    numbers: list[Number]


CASES: dict[int, tuple[str, Callable[[], Iterator[Motion]]]] = {}


def case(n: int, title: str) -> Callable[[Callable[[], Iterator[Motion]]], Callable[[], Iterator[Motion]]]:
    """A case of the acceptance."""

    def keep(motions: Callable[[], Iterator[Motion]]) -> Callable[[], Iterator[Motion]]:
        CASES[n] = title, motions
        return motions

    return keep


def happened(words: str, i: int) -> Callable[[mg.Response], float]:
    """The time of an event of these words, by its number among them."""
    return lambda r: [one.t for one in r.events if str(one).split(" at ")[0] in words.split(", ")][i]


def position(pair: str, t: float) -> Callable[[mg.Response], float]:
    """A coordinate at a time."""
    return lambda r: r.at(t)[pair].position[0]


@case(18, "mass, spring, dry slide; slope")
def _dry_slide() -> Iterator[Motion]:
    d, half, w = 0.1 * 2.0 * G / 40.0, np.pi / np.sqrt(20.0), np.sqrt(20.0)
    turns = [Number(f"turn {i + 1}", half * (i + 1), happened("A reverses, A sticks", i)) for i in range(3)]
    yield Motion(slide(), [0.0, 2.6], {"start": {"A": 0.3}}, [
        *turns,
        Number("rests", -(0.3 - 6 * d), position("A", 2.6), 1),
        Number("first swing", d + (0.3 - d) * np.cos(w * 0.4), position("A", 0.4), 1),
        Number("second turn", 0.3 - 4 * d, position("A", 2 * half), 1),
        Number("lost", 20.0 * (0.3**2 - (0.3 - 6 * d) ** 2), lambda r: r.energy.friction[-1], 1),
    ])  # fmt: skip
    mu, v = 0.3, 2.0
    for angle in (0.25, 0.35):
        along = (np.cos(angle), np.sin(angle), 0)
        links = [mg.Link("frame"), mg.Link("block", mass=2.0, center=(0, 0, 0), inertia=0.01 * np.eye(3))]
        loads = [mg.Gravity((0, -G, 0)), mg.Friction("A", mu=mu)]
        m = mg.Mechanism(
            "slope", links, [mg.Pair("A", "P", "frame", "block", point=(0, 0, 0), axis=along)], loads=loads
        )
        up, down = (G * (np.sin(angle) + s * mu * np.cos(angle)) for s in (1, -1))
        stays = np.tan(angle) < mu
        top = v * v / up / 2
        yield Motion(m, [0.0, 1.5], {"rates": {"A": v}}, [
            Number("stops", v / up, happened("A sticks" if stays else "A reverses", 0)),
            Number("stays" if stays else "returns", top - (not stays) * 0.5 * down * (1.5 - v / up) ** 2, position("A", 1.5), 1),
        ])  # fmt: skip


@case(19, "pendulum on a journal")
def _journal() -> Iterator[Motion]:
    L, mu, radius = 0.5, 0.3, 0.06
    rho = radius * np.sin(np.arctan(mu))
    bob = mg.Link("bob", mass=3.0, center=(0, -L, 0))
    loads = [mg.Gravity((0, -G, 0)), mg.Friction("A", mu=mu, radius=radius)]
    m = mg.Mechanism(
        "pendulum", [mg.Link("frame"), bob], [mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=Z)], loads=loads
    )
    t, q, sense, turns = 0.0, 0.25, -1.0, []
    while abs(q) > np.arcsin(rho / L):

        def rates(_: float, y: Any, sense: float = sense) -> list[float]:
            couple = rho * abs(G * np.cos(y[0]) + L * y[1] ** 2) / np.sqrt(L * L - rho * rho)
            return [y[1], -(G * np.sin(y[0]) + sense * couple) / L]

        def turn(at: float, y: Any, sense: float = sense) -> float:
            return float(y[1]) if at > 0.1 else sense

        turn.terminal = True  # type: ignore[attr-defined]
        found = solve_ivp(rates, (0, 3), [q, 0.0], method="DOP853", rtol=1e-12, atol=1e-13, events=turn)
        t, q, sense = t + found.t_events[0][0], found.y_events[0][0][0], -sense
        turns.append(Number(f"turn {len(turns) + 1}", t, happened("A reverses, A sticks", len(turns))))
    rests = [
        Number("rests", q, position("A", 4.0)),
        Number("below", 1.0, lambda r: float(abs(r["A"].position[-1, 0]) < np.arcsin(rho / L))),
    ]
    yield Motion(m, [0.0, 4.0], {"start": {"A": 0.25}}, [*turns, *rests])


@case(20, "mass on a belt, static above mu")
def _belt() -> Iterator[Motion]:
    mu, static, v, w = 0.1, 0.3, 0.25, 5.0
    m, motions = belt(mu, static, v)
    d = (static - mu) * G / 25.0
    slips, sticks = happened("A slips", 0), happened("A sticks", 0)
    yield Motion(m, [0.0, 2.0], {"motions": motions}, [
        Number("sticks at first", static * G / 25.0 / v, slips),
        Number("slips", 2 * (np.pi - np.arctan(d * w / v)) / w, lambda r: sticks(r) - slips(r)),
        Number("sticks", 2 * d / v, lambda r: happened("A slips", 1)(r) - sticks(r)),
    ])  # fmt: skip


@case(21, "sliding rod: one normal force, none, two")
def _painleve() -> Iterator[Motion]:
    for angle, mu, w in ((0.6, 0.3, 0.0), (1.0, 1.2, 1.5), (1.4, 1.3, -2.0)):
        for sense in (1.0, -1.0):
            b, p = law(angle, mu, sense, w)
            yield Motion(rod(angle, mu), [0.0, 0.001], {"rates": {"K.Ts": sense, "K.Rz": w}}, [
                Number(f"N at {angle:g}", -2.0 * b / p, lambda r: np.linalg.norm(r["K"].force[0])),
                Number(f"friction at {angle:g}", sense * mu * 2.0 * b / p, lambda r: r["K"].friction[0, 0]),
            ])  # fmt: skip
    # where p is least dp/dt = 0, tan(2 t) = -mu: it is zero there for the least coefficient
    for mu, w, words in ((4 / 3 - 1e-5, 0.0, "one"), (4 / 3 + 1e-7, 0.0, "none"), (4 / 3 + 1e-7, 8.0, "two")):
        m, how = rod(0.5 * (np.pi - np.arctan(mu)), mu), {"rates": {"K.Ts": -1.0, "K.Rz": w}}
        yield Motion(m, [0.0, 1e-9], how, [Number(f"{words} at mu = 4/3", ("one", "none", "two").index(words), _kind)])


def _kind(r: mg.Response | mg.FrictionError) -> int:
    """How many normal forces there are: one, none or two."""
    if not isinstance(r, mg.FrictionError):
        return 0
    return ["", "no finite force", "friction not determined"].index(r.kind)


@case(22, "screw with its motor cut off")
def _screw() -> Iterator[Motion]:
    cut, mass, inertia = 0.2, 40.0, 0.002
    for mu in (0.15, 0.4):
        lead, phi = np.arctan(PITCH / RADIUS), np.arctan(mu)

        def acceleration(couple: float, way: int, lead: float = lead, phi: float = phi) -> float:
            arm = RADIUS * np.tan(lead + way * phi)
            return (couple - arm * mass * G) / (inertia + arm * mass * PITCH)

        speed = acceleration(5.0, 1) * cut
        stop, stays = cut - speed / acceleration(0.0, 1), lead < phi
        top = 0.5 * speed * stop
        end = top + (0.0 if stays else 0.5 * acceleration(0.0, -1) * (0.5 - stop) ** 2)
        word, then = "A sticks" if stays else "A reverses", "stays" if stays else "runs back"
        yield Motion(screw(mu, cut), [0.0, cut, 0.5], {}, [
            Number("stops", stop, happened(word, 0)),
            Number(then, PITCH * end, position("D", 0.5), 1),
            Number("top", PITCH * top, position("D", stop), 1),
        ])  # fmt: skip
        # from there on, without the motor: a function of time is neither compiled nor in other units
        off, begun = screw(mu, cut), 0.5 * speed * cut
        off = off.replace(loads=[load for load in off.loads if not isinstance(load, mg.Effort)])
        yield Motion(off, [0.0, 0.5 - cut], {"rates": {"M": -speed}}, [
            Number(f"cut off, {word[2:]}", stop - cut, happened(word, 0)),
            Number(f"cut off, {then}", PITCH * (end - begun), position("D", 0.5 - cut), 1),
        ])  # fmt: skip


def _four_bar_at(x: Any) -> tuple[Any, Any, Any]:
    """Crank, coupler, rocker turned by ``x``: closure, the tip, and the rates per unit rate of the crank with those of the tip."""
    turns = [np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in x]
    crank, coupler, rocker, tip = (
        R @ v for R, v in zip((*turns, turns[1]), np.array([(0, 1), (2, 0.5), (0, 1.5), (1, 1)]), strict=True)
    )
    across = [np.array([-v[1], v[0]]) for v in (crank, coupler, rocker, tip)]
    w = np.linalg.solve(np.stack([across[1], -across[2]], axis=1), -across[0])
    return crank + coupler - np.array([2, 0]) - rocker, crank + tip, (w, across[0] + w[0] * across[3], turns)


def _kinetic(x: Any) -> tuple[float, Any]:
    """Kinetic energy for a unit rate of the crank, and the momentum of the crank."""
    w, _, turns = _four_bar_at(x)[2]
    centers = np.array([(0, 0.5), (1, 0.3), (0, 0.7)])
    r = [R @ c for R, c in zip(turns, centers, strict=True)]
    spin = (1.0, *w)
    v = [spin[i] * np.array([-r[i][1], r[i][0]]) for i in range(3)]
    v[1] = v[1] + np.array([-(turns[0] @ (0, 1))[1], (turns[0] @ (0, 1))[0]])
    masses = (1.0, 2.0, 1.5)
    return 0.5 * sum(m * (u @ u) + 0.01 * s * s for m, u, s in zip(masses, v, spin, strict=True)), v[0]


@case(23, "linkage against a wall; block on a shaken table")
def _impacts() -> Iterator[Motion]:
    def at_wall(x: Any) -> Any:
        closure, tip, _ = _four_bar_at(x)
        return [*closure, tip[0] - 1.1]

    x = fsolve(at_wall, [-0.1, 0.0, -0.1], xtol=1e-14)
    per, momentum = _kinetic(x)
    energy = _kinetic(np.zeros(3))[0]
    rate, closing = np.sqrt(energy / per), _four_bar_at(x)[2][1][0]
    for e in (0.0, 0.5, 1.0):
        stop = {"stops": ("coupler.tip.Tx", 1.1, e)}
        yield Motion(four_bar(False), [0.0, 0.3], {"rates": {"A": -1.0}, **stop}, [
            Number(f"lost, e = {e:g}", (1 - e * e) * energy, lambda r: r.events[0].energy_lost, 1),
            Number(f"impulse, e = {e:g}", (1 + e) * 2 * energy / (rate * abs(closing)), lambda r: r.events[0].impulse),
            Number(f"pins of the crank, e = {e:g}", (1 + e) * rate * np.linalg.norm(momentum), _pins),
        ])  # fmt: skip
    a, w = 0.02, 30.0
    opens = np.arcsin(G / (a * w * w)) / w

    def gap(t: float) -> float:
        s = t - opens
        return float(a * np.sin(w * opens) + a * w * np.cos(w * opens) * s - G * s * s / 2 - a * np.sin(w * t))

    lands = brentq(gap, opens + 0.02, 0.2, xtol=1e-15)
    for flat in (False, True):
        m, motions = shaken(a, w, flat)
        yield Motion(m, [0.0, 0.01, 0.2], {"motions": motions}, [
            Number("opens", opens, happened("K opens", 0)),
            Number("lands", lands, happened("K lands", 1)),
            Number("presses", 2.0 * (G - a * w * w * np.sin(0.3)), lambda r: np.sqrt(np.nansum(r["K"].force[1] ** 2))),
        ])  # fmt: skip  # across the plane in which it moves the force is not unique where it is declared in space
    m, motions = shaken(0.01, 30.0)
    yield Motion(
        m, [0.0, 0.1], {"motions": motions}, [Number("stays below A w^2 = g", 0.0, lambda r: r["K"].gap.max(), 1)]
    )


def _pins(r: mg.Response) -> float:
    """Size of what both pins of the crank give it in its plane."""
    strike, ends = r.events[0].impulses, {pair.name: pair.b for pair in r._course.mechanism.pairs}
    given = (strike[name][3:5] * (1 if ends[name] == "crank" else -1) for name in "AB")
    return float(np.linalg.norm(sum(given)))


# --- declared otherwise -----------------------------------------------------------------------------------------------------


def _as_it_is(m: mg.Mechanism) -> mg.Mechanism:
    return m


def _swapped(m: mg.Mechanism) -> mg.Mechanism:
    """Links a and b of pairs exchanged, their axes turned round: coordinates are what they were."""
    other = {"a": "b", "b": "a"}
    pairs = [p if p.type.touching else p.replace(a=p.b, b=p.a, axis=tuple(-np.array(p.axis))) for p in m.pairs]
    loads = [load.replace(on=other[load.on]) if isinstance(load, mg.Friction) else load for load in m.loads]
    return m.replace(pairs=pairs, loads=loads)


def _moved(m: mg.Mechanism) -> mg.Mechanism:
    pose = np.eye(4)
    c, s = np.cos(0.7), np.sin(0.7)
    pose[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    pose[:3, 3] = 0.3, -0.2, 0.5
    return m.replace(planar=False).moved(pose)


def _in_millimeters(m: mg.Mechanism) -> mg.Mechanism:
    return m.replace(units=SI).to_units(length="mm", mass="t", time="s")


def _planar(m: mg.Mechanism) -> mg.Mechanism:
    return m.replace(planar=True)


FORMS: dict[str, Callable[[mg.Mechanism], mg.Mechanism]] = {
    "as it is": _as_it_is,
    "swapped": _swapped,
    "moved": _moved,
    "mm, t": _in_millimeters,
    "planar": _planar,
    "numpy": _as_it_is,
    "compiled": _as_it_is,
}
ENGINES = {"numpy": "dense", "compiled": "compiled"}
"""What of a form is not its mechanism."""


def responded(motion: Motion, form: str) -> mg.Response | mg.FrictionError:
    """The response of a form of a machine."""
    m, how = FORMS[form](motion.machine), dict(motion.how)
    size = 1e3 if form == "mm, t" else 1.0
    for name in ("start", "rates"):
        how[name] = {of: value * (1.0 if m.turns(of) else size) for of, value in how.get(name, {}).items()}
    laws = how.pop("motions", {})
    how["motions"] = {of: (lambda t, law=law: tuple(size * v for v in law(t))) for of, law in laws.items()}
    if "stops" in how:
        name, limit, e = how["stops"]
        how["stops"] = mg.Stop(name, upper=limit * size, restitution=e)
    try:
        return mg.respond(m, motion.times, engine=ENGINES.get(form, "auto"), **how, **FINE)
    except mg.FrictionError as error:
        return error


def numbers(n: int, form: str) -> Iterator[tuple[str, float, float]]:
    """What, the number expected, the number found, of a case in a form."""
    for motion in CASES[n][1]():
        if not fits(motion, form):
            continue
        r, unit = responded(motion, form), 1e3 if form == "mm, t" else 1.0
        yield from ((one.what, one.expected * unit**one.unit, float(one.read(r))) for one in motion.numbers)


def fits(motion: Motion, form: str) -> bool:
    """Whether a form says this machine: stops of points are along the axes of the frame; screws are spatial, what opens is not compiled."""
    opens, flat = (
        any(p.type.touching for p in motion.machine.pairs),
        all(p.type.symbol in "RP" for p in motion.machine.pairs),
    )
    named, timed = "stops" in motion.how, any(isinstance(load, mg.Effort) for load in motion.machine.loads)
    if timed and form in ("mm, t", "compiled"):
        return False
    return not (
        (form == "moved" and named)
        or (form == "planar" and not (flat or motion.machine.planar))
        or (form == "compiled" and opens)
    )


def off(expected: float, found: float) -> float:
    """The error of a number, over its size."""
    return float(np.nan_to_num(abs(found - expected) / (abs(expected) or 1.0), nan=np.inf))


DAILY = [(18, "as it is"), (20, "mm, t"), (21, "moved"), (22, "swapped"), (23, "numpy")]


@pytest.mark.parametrize(
    ("n", "form"),
    [pytest.param(n, form, marks=() if (n, form) in DAILY else pytest.mark.slow) for n in CASES for form in FORMS],
)
def test_every_number_of_every_form(n: int, form: str) -> None:
    for what, expected, found in numbers(n, form):
        assert off(expected, found) < 1e-7, (what, expected, found)


@pytest.mark.slow
@pytest.mark.parametrize("n", [18, 19, 22])
def test_with_next_to_no_friction_it_is_the_motion_without(n: int) -> None:
    assert without(n) < 1e-7


def without(n: int) -> float:
    """By how much places of links differ, where friction is next to nothing, from those without."""
    worst = 0.0
    for motion in CASES[n][1]():
        loads = motion.machine.loads
        some = [load.replace(mu=1e-12) if isinstance(load, mg.Friction) else load for load in loads]
        none = [load for load in loads if not isinstance(load, mg.Friction)]
        ends = [
            responded(motion._replace(machine=motion.machine.replace(loads=own), times=[0.0, 0.3]), "as it is")
            for own in (some, none)
        ]
        for link in motion.machine.links:
            worst = max(worst, float(np.abs(np.subtract(*(r.link(link.name).pose[-1] for r in ends))).max()))
    return worst


def table() -> Iterator[str]:
    """All numbers as they are, the worst of their errors in each form, and without friction."""
    yield f"{'':48} {'expected':>14} {'found':>14} {'error':>8}"
    for n, (title, _) in CASES.items():
        yield f"{n} {title}"
        for what, expected, found in numbers(n, "as it is"):
            yield f"   {what:45} {expected:14.9g} {found:14.9g} {off(expected, found):8.1e}"
        for form in list(FORMS)[1:]:
            worst = [off(expected, found) for _, expected, found in numbers(n, form)]
            if worst:
                yield f"   {form:45} {'':29} {max(worst):8.1e}"
        if n in (18, 19, 22):
            yield f"   {'mu = 1e-12 against no friction':45} {'':29} {without(n):8.1e}"


if __name__ == "__main__":
    for line in table():
        sys.stdout.write(line + "\n")
        sys.stdout.flush()
