"""Planar mechanisms built of dyads by name: any geometry closes as declared."""

import re

import numpy as np

import mechgraph as mg

TYPES = {"1": "RRR", "2": "RRT", "3": "RTR", "4": "TRT", "5": "RTT"}


class Builder:
    """Links 0, 1, ... (0 the frame) and pairs at random places of the plane."""

    def __init__(self, seed: int = 1) -> None:
        self.rng = np.random.default_rng(seed)
        self.count, self.pairs = 1, []

    def link(self) -> str:
        self.count += 1
        return str(self.count - 1)

    def pair(self, letter: str, one: str, other: str) -> str:
        """A turn, or a slide whose guide is on ``one``."""
        point = (*self.rng.uniform(-1, 1, 2), 0.0)
        angle = self.rng.uniform(0, 2 * np.pi)
        axis = (np.cos(angle), np.sin(angle), 0) if letter == "T" else (0, 0, 1)
        name = f"P{len(self.pairs)}"
        self.pairs.append(mg.Pair(name, "P" if letter == "T" else "R", one, other, point=point, axis=axis))
        return name

    def driver(self, letter: str) -> str:
        return self.pair(letter, "0", self.link())

    def dyad(self, version: str, on: tuple[str, str]) -> None:
        """A dyad such as D42 with its first link on ``on[0]``."""
        kind, number = version[1], int(version[2])
        letters, first, second = TYPES[kind], self.link(), self.link()
        if letters != letters[::-1]:
            reverse, number = number & 1, number >> 1
        else:
            reverse = 0
        ends = [first, second] if not reverse else [second, first]
        outer = on if not reverse else on[::-1]
        # (where the guide is by default, where it is with its bit set)
        places = [(outer[0], ends[0]), (ends[0], ends[1]), (outer[1], ends[1])]
        for letter, place in zip(letters, places, strict=True):
            if letter == "T":
                place = place if not number & 1 else place[::-1]
                number >>= 1
            self.pair(letter, *place)

    def mechanism(self, name: str, drives: tuple[str, ...] = ("P0",)) -> mg.Mechanism:
        return mg.Mechanism(name, links=[mg.Link(str(i)) for i in range(self.count)], pairs=self.pairs, drives=drives)


def named(symbol: str, seed: int = 1) -> mg.Mechanism:
    """A mechanism of its symbol, e.g. ``R - D42 - D30 - 1 + 2``."""
    b = Builder(seed)
    letter = symbol[0]
    dyads = re.findall(r"D\d\d", symbol)
    at = re.findall(r"(\d+) \+ (\d+)", symbol)
    b.driver(letter)
    for version, on in zip(dyads, [("1", "0"), *at], strict=True):
        b.dyad(version, on)
    return b.mechanism(symbol)


def of_chain(chain: mg.Chain, frame: int, seed: int = 1) -> mg.Mechanism:
    """A chain of turning joints at random places; a joint of k links as k - 1 pairs in one place."""
    rng = np.random.default_rng(seed)
    topology = chain.mechanism(frame)
    places: dict[str, tuple[float, ...]] = {}
    pairs = []
    for p in topology.pairs:
        point = places.setdefault(p.name.rstrip("abcdef"), (*rng.uniform(-1, 1, 2), 0.0))
        pairs.append(mg.Pair(p.name, "R", p.a, p.b, point=point, axis=(0, 0, 1)))
    return mg.Mechanism(topology.name, links=list(topology.links), pairs=pairs, frame=topology.frame)
