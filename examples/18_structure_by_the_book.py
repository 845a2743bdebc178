"""Problem 2.7 of Marghitu's chapter, as the book does it: contours, connectivity table, structural diagram, family, groups and name.

"Find the family, the number of degrees of freedom, represent the structural diagram, and find the dyads": the figure is not in the text,
so the mechanism of the library is a crank and rocker that drives a slide. By hand: five moving links, six turning pairs and one slide of
class 5 in the plane, M = 3 * 5 - 2 * 7 = 1; without the driver two dyads are left, RRR and RRT.

``python examples/18_structure_by_the_book.py [PICTURE]`` also draws the structural diagram.
"""

import sys

import mechgraph as mg
from mechgraph import show


def by_the_book(m: mg.Mechanism) -> mg.Decomposition:
    report = mg.check(m)
    families = report.families
    assert families is not None
    n, c5 = families.links, families.classes[4]
    contours = " and ".join("-".join(loop.pairs) for loop in families.loops)
    print(f"{n} moving links, {c5} pairs of class 5: N = c - n = {c5 - n} independent contours, {contours}")
    print("\nMobility table: no link has " + ", ".join(missing(families)))
    print(
        f"Family f = {families.family}: M = {6 - families.family} * {n} - {5 - families.family} * {c5} = {families.dobrovolski}"
    )
    assert (families.family, families.dobrovolski, report.finite_mobility) == (3, 1, 1)
    groups = mg.groups(m)
    print("\nConnectivity table")
    for number, name, others in groups.connectivity:
        print(f"  {number} {name:8} {', '.join(others)}")
    print("\nDriver link and dyads, in the order in which they are solved")
    for group in groups.groups:
        print(f"  {group.name:4} {group.letters:4} links {', '.join(group.links)} on {', '.join(group.on)}")
    print(f"\nName: {groups.symbol} ({groups.words}), {mg.identify(m).name}")
    assert groups.symbol == "R - D10 - D20 - 3 + 0"
    return groups


def missing(families: mg.Families) -> list[str]:
    """The columns of the mobility table with no yes in them."""
    names = ("Tx", "Ty", "Tz", "Rx", "Ry", "Rz")
    return [name for i, name in enumerate(names) if not any(row.columns[i] for row in families.table)]


if __name__ == "__main__":
    mechanism = mg.load("marghitu-2-7")
    found = by_the_book(mechanism)
    others = mg.check(mechanism).groups_by_driver
    assert others["D.Rz"] == "R - D10 - D20 - 1 + 0"  # driven by its rocker, the slide's dyad hangs on the driver
    print("With other drivers: " + "; ".join(f"{name}: {symbol}" for name, symbol in others.items()))
    if len(sys.argv) > 1:
        show.save_picture(show.draw_structure(mechanism, groups=found), sys.argv[1])
