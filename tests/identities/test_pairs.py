"""Identities of the pair table, for every row of it and for rows of a user. Frames are A (marker on a) and B (marker on b)."""

from copy import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from test_surfaces import INSIDE, SAMPLE

import mechgraph as mg
from mechgraph.maths import se3
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.contact_types import OnSurface

PITCH = 0.37
USER_ROWS = {
    "oblique slide": mg.PairType("Tob", freedoms=[mg.Freedom("T45", (0, 0, 0, 0.6, 0.0, 0.8))], reactions=None),
    "offset hinge": mg.PairType(
        "Roff",
        freedoms=[mg.Freedom("Rz", (0, 0, 1, 0.0, -0.7, 0.0))],
        reactions=None,
        efforts=[mg.Component("Mz", (0, 0, 1, 0, 0, 0))],
    ),
    "turn of screw and slide": mg.PairType("HT", freedoms=["Rz + pitch Tz", "Tx"], reactions=None),
    "rotation before slide": mg.PairType("ST", freedoms=["rotation", "Tz"], reactions=None),
    "universal without components": mg.PairType("U2", freedoms=["Rz", "Rx"], reactions=None),
    "free body": mg.PairType("Free", freedoms=["Tx", "Ty", "Tz", "rotation"], reactions=[]),
    "named frame": mg.PairType("Ub", freedoms=["Rz", "Rx"], reactions=["Fx@2", "Fy@2", "Fz@2", "My@1"]),
}
ROWS = {**mg.pair_types(), **USER_ROWS}
each_row = pytest.mark.parametrize("row", ROWS.values(), ids=list(ROWS))


def states(row, n=3, T=5, seed=0):
    rng = np.random.default_rng(seed)
    return evaluation.random_coordinates(row, rng, n, T)


def evaluated(row, x):
    """Frames, twists, efforts, reactions at states (nx, n, T)."""
    pitch = np.full((x.shape[1], 1), PITCH)
    frames = evaluation.frames_of(row, pitch, x)
    parts = evaluation.twists_of, evaluation.efforts_of, evaluation.reactions_of
    return frames, *(part(row, pitch, frames) for part in parts)


def test_the_table_has_the_rows_of_the_design():
    freedoms = {
        "R": 1,
        "P": 1,
        "H": 1,
        "C": 2,
        "U": 2,
        "S": 3,
        "E": 3,
        "Sc": 3,
        "Sg": 4,
        "Cp": 4,
        "Sp": 5,
        "Tc": 5,
        "Fr": 6,
        "W": 0,
    }
    assert {symbol: row.f for symbol, row in mg.pair_types().items()} == freedoms


@pytest.mark.parametrize(
    ("symbol", "freedoms", "components"),
    [
        ("R", "Rz", "Fx Fy Fz Mx My"),
        ("P", "Tz", "Fx Fy Mx My Mz"),
        ("C", "Rz Tz", "Fx Fy Mx My"),
        ("U", "Rz Rx", "Fx Fy Fz My"),
        ("S", "Rx Ry Rz", "Fx Fy Fz"),
        ("E", "Tx Ty Rz", "Fz Mx My"),
        ("Sc", "Tz Ry Rx", "Fx Fy Mz"),
        ("Sg", "Tz Rx Ry Rz", "Fx Fy"),
        ("Cp", "Tx Ty Rz Rx", "Fz My"),
        ("Sp", "Tx Ty Rx Ry Rz", "Fz"),
        ("W", "", "Fx Fy Fz Mx My Mz"),
    ],
)
def test_freedoms_and_components_are_named_as_in_the_design(symbol, freedoms, components):
    row = mg.pair_types()[symbol]
    assert [f.name for f in row.freedoms] == freedoms.split()
    assert list(row.component_names) == components.split()


@pytest.mark.parametrize("row", mg.pair_types().values(), ids=list(mg.pair_types()))
def test_rows_of_the_table_pass_the_checks_of_a_user_row(row):
    """The table is built without the trials at random positions; made by the constructor, each row is the same."""
    freedoms = ["rotation" if len(group) == 3 else row.freedoms[group[0]] for group in row.factors]
    tried = mg.PairType(
        row.symbol,
        row.name,
        freedoms=freedoms,
        reactions=row.reactions,
        bookkeeping=row.bookkeeping,
        directed=row.directed,
        square_second=row.square_second,
    )
    told = copy(row)
    object.__setattr__(told, "touching", None)  # contacts are told by the table alone
    assert tried == told


@each_row
def test_reactions_do_no_work(row):
    """S^T W = 0."""
    _, S, _, W = evaluated(row, states(row))
    np.testing.assert_allclose(np.einsum("ifnt,icnt->fcnt", S, W), 0, atol=1e-13)


@each_row
def test_efforts_are_dual_to_freedoms(row):
    """S^T E = 1."""
    _, S, E, _ = evaluated(row, states(row))
    unit = np.einsum("ifnt,ignt->fgnt", S, E)
    np.testing.assert_allclose(unit, np.broadcast_to(np.eye(row.f)[:, :, None, None], unit.shape), atol=1e-13)


def rank(A):
    """Singular values above 1e-9; none of an empty matrix."""
    return int((np.linalg.svd(A, compute_uv=False) > 1e-9).sum())


@each_row
def test_freedoms_and_reactions_together_span_everything(row):
    """rank S = f, rank W = 6 - f, and [W, E] is a basis of the wrenches."""
    _, S, E, W = evaluated(row, states(row))
    assert S.shape[1] == row.f
    assert W.shape[1] == 6 - row.f == len(row.component_names)
    for i in range(S.shape[2]):
        for t in range(S.shape[3]):
            assert rank(S[:, :, i, t]) == row.f
            assert rank(W[:, :, i, t]) == 6 - row.f
            assert np.linalg.cond(np.concatenate([W, E], axis=1)[:, :, i, t]) < 1e4


@each_row
def test_twists_are_the_rate_of_the_displacement(row):
    """(dD/dt D^-1)^v = S q', by a fourth-order difference along advance."""
    rng = np.random.default_rng(4)
    x = states(row)
    _, S, _, _ = evaluated(row, x)
    dq = rng.normal(size=(row.f, *x.shape[1:]))
    h = 2e-3
    poses = [evaluated(row, evaluation.advance(row, x, k * h * dq))[0][-1] for k in (-2, -1, 0, 1, 2)]
    steps = [se3.pose_log(se3.compose(X, se3.inverse(poses[2]))) for X in poses]
    rate = (steps[0] - 8 * steps[1] + 8 * steps[3] - steps[4]) / (12 * h)
    expected = np.einsum("ifnt,fnt->int", S, dq) if row.f else np.zeros_like(rate)
    np.testing.assert_allclose(rate, expected, atol=1e-8)


@each_row
def test_displacement_is_the_product_of_exponentials(row):
    """D = prod exp(q_k s_k), rotations by exp of the rotation vector."""
    rng = np.random.default_rng(8)
    q = rng.uniform(-1, 1, (row.f, 1, 1))
    x = evaluation.coordinates_to_state(row, q)
    D = evaluated(row, x)[0][-1][..., 0, 0]
    expected = se3.identity()
    for group in row.factors:
        s = sum(
            q[j, 0, 0] * (np.array(row.freedoms[j].twist) + PITCH * np.array(row.freedoms[j].per_pitch)) for j in group
        )
        expected = se3.compose(expected, se3.pose_exp(s))
    np.testing.assert_allclose(D, expected, atol=1e-13)


@each_row
def test_at_zero_the_markers_coincide(row):
    x = evaluation.coordinates_to_state(row, np.zeros((row.f, 1, 1)))
    np.testing.assert_allclose(evaluated(row, x)[0][-1][..., 0, 0], se3.identity(), atol=1e-15)


@each_row
def test_a_batch_is_the_evaluation_of_each(row):
    x = states(row, 2, 3, seed=5)
    whole = evaluated(row, x)
    for i in range(2):
        for t in range(3):
            one = evaluated(row, x[:, i : i + 1, t : t + 1])
            np.testing.assert_allclose(whole[0][-1][..., i, t], one[0][-1][..., 0, 0], atol=1e-14)
            for a, b in zip(whole[1:3], one[1:3], strict=True):
                np.testing.assert_allclose(a[..., i, t], b[..., 0, 0], atol=1e-14)
            if row.reactions is not None:
                np.testing.assert_allclose(whole[3][..., i, t], one[3][..., 0, 0], atol=1e-14)


@each_row
@given(st.integers(0, 2**31))
def test_difference_inverts_advance(row, seed):
    rng = np.random.default_rng(seed)
    x = states(row, seed=seed)
    dq = rng.uniform(-1.5, 1.5, (row.f, *x.shape[1:]))
    ahead = evaluation.advance(row, x, dq)
    np.testing.assert_allclose(evaluation.advance(row, ahead, -dq), x, atol=1e-12)


@each_row
def test_coordinates_and_states_are_inverse(row):
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (row.f, 4))
    x = evaluation.coordinates_to_state(row, q)
    back = np.stack([evaluation.state_to_coordinates(row, x[:, t : t + 1])[:, 0] for t in range(4)], axis=1)
    np.testing.assert_allclose(back, q, atol=1e-13)


def test_a_helical_pair_without_pitch_is_a_revolute():
    rows = mg.pair_types()
    x = states(rows["R"])
    for kind in (evaluation.twists_of, evaluation.efforts_of):
        zero = np.zeros((x.shape[1], 1))
        values = [kind(rows[s], zero, evaluation.frames_of(rows[s], zero, x)) for s in "RH"]
        np.testing.assert_allclose(*values, atol=1e-15)


@given(st.floats(-3, 3), st.floats(-2, 2))
def test_a_helical_pair_turns_and_advances(q, pitch):
    row = mg.pair_types()["H"]
    D = evaluation.frames_of(row, np.array([[pitch]]), np.array([[[q]]]))[-1][..., 0, 0]
    np.testing.assert_allclose(D[:, :3], se3.rotation_exp(np.array([0, 0, q])), atol=1e-14)
    np.testing.assert_allclose(D[:, 3], [0, 0, pitch * q], atol=1e-14)


def test_a_cylindrical_pair_is_a_revolute_then_a_prismatic():
    rows = mg.pair_types()
    none = np.zeros((1, 1))
    x = np.array([[[0.7]], [[-1.3]]])
    D = evaluation.frames_of(rows["C"], none, x)[-1]
    turned = evaluation.frames_of(rows["R"], none, x[:1])[-1]
    both = evaluation.frames_of(rows["P"], none, x[1:], base=turned)[-1]
    np.testing.assert_allclose(D, both, atol=1e-15)


def test_the_pin_of_a_slotted_sphere_stays_in_the_plane_of_groove_and_slot():
    """Sc: b* . (c x b) = 0 with c the groove (z), b the pin at the reference (x), b* the pin now."""
    row = mg.pair_types()["Sc"]
    D = evaluated(row, states(row, 4, 6))[0][-1]
    np.testing.assert_allclose(D[1, 0], 0, atol=1e-14)
    np.testing.assert_allclose(D[:2, 3], 0, atol=1e-14)


def test_the_touching_line_of_a_cylinder_stays_in_its_plane():
    """Cp: the axis of the cylinder (x of B) stays parallel to the plane and at its height."""
    row = mg.pair_types()["Cp"]
    D = evaluated(row, states(row, 4, 6))[0][-1]
    np.testing.assert_allclose(D[2, 0], 0, atol=1e-14)
    np.testing.assert_allclose(D[2, 3], 0, atol=1e-14)


@pytest.mark.parametrize(
    ("symbol", "lies"), [("Sg", (0, 1)), ("Sp", (2,)), ("S", (0, 1, 2)), ("E", (2,)), ("R", (0, 1, 2))]
)
def test_the_origin_of_marker_b_stays_on_point_line_or_plane_of_a(symbol, lies):
    row = mg.pair_types()[symbol]
    D = evaluated(row, states(row, 4, 6))[0][-1]
    for i in lies:
        np.testing.assert_allclose(D[i, 3], 0, atol=1e-14)


@each_row
def test_screws_move_with_the_marker(row):
    """In another base frame every screw is the moved screw."""
    rng = np.random.default_rng(6)
    x = states(row, 2, 3)
    pitch = np.full((2, 1), PITCH)
    base = se3.pose_exp(rng.normal(size=(6, 2, 3)))
    here, there = (evaluation.frames_of(row, pitch, x, base=b) for b in (None, base))
    for j in range(row.f):
        for kind, move in ((evaluation.twists_of, se3.move_twist), (evaluation.efforts_of, se3.move_wrench)):
            moved = move(base, kind(row, pitch, here)[:, j])
            np.testing.assert_allclose(kind(row, pitch, there)[:, j], moved, atol=1e-13)


def test_rotation_vectors_are_continuous_through_full_turns():
    row = mg.pair_types()["S"]
    axis = np.array([0.6, 0.0, 0.8])
    angle = np.linspace(0.0, 25.0, 400)
    x = evaluation.coordinates_to_state(row, axis[:, None] * angle)
    np.testing.assert_allclose(evaluation.state_to_coordinates(row, x), axis[:, None] * angle, atol=1e-9)
    q = evaluation.state_to_coordinates(row, x[:, ::-1], start=axis * 25.0)
    np.testing.assert_allclose(q, axis[:, None] * angle[::-1], atol=1e-9)


def test_rotation_vectors_are_continuous_where_the_axis_wanders_near_a_half_turn():
    row = mg.pair_types()["S"]
    t = np.linspace(0, 6, 800)
    v = (np.pi + 0.3 * np.sin(t)) * np.stack([np.cos(0.2 * t), np.sin(0.2 * t), 0 * t])
    q = evaluation.state_to_coordinates(row, evaluation.coordinates_to_state(row, v), start=v[:, 0])
    np.testing.assert_allclose(q, v, atol=1e-9)


@pytest.mark.parametrize(
    ("more", "word"),
    [
        ({"freedoms": ["Rz"], "reactions": ["Fx", "Fy", "Fz", "Mx", "Mz"]}, "reciprocal"),
        ({"freedoms": ["Rz", "Rx"], "reactions": ["Fx", "Fy", "Fz", "My"]}, "reciprocal"),
        ({"freedoms": ["Rz"], "reactions": ["Fx", "Fy", "Fz", "Mx"]}, "expected 6 - f = 5"),
        ({"freedoms": ["Rz"], "reactions": ["Fx", "Fy", "Fz", "Mx", "Fx"]}, "repeat"),
        ({"freedoms": ["Rz"], "reactions": ["Fx", "Fy", "Fz", "Mx", "Qy"]}, "Qy"),
        (
            {"freedoms": ["Rz"], "reactions": ["Fx", "Fy", "Mx", "My", mg.Component("N", (0, 0, 0, 1, 0, 0))]},
            "reactions .*: not independent",
        ),
        (
            {"freedoms": ["Rz"], "reactions": ["Fx", "Fy", "Mx", "My", mg.Component("N", (0, 0, 1))]},
            "six finite numbers",
        ),
        ({"freedoms": ["Rw"]}, "Rw"),
        ({"freedoms": ["Rz", "Rz"]}, "repeat"),
        ({"freedoms": ["Rz + pitch Ry2"]}, "unknown"),
        ({"freedoms": [42]}, "42"),
        ({"freedoms": [mg.Freedom("R", (0, 0, 2, 0, 0, 0))]}, "unit"),
        ({"freedoms": [mg.Freedom("a", (0, 0, 1, 0, 0, 0)), mg.Freedom("b", (0, 0, -1, 0, 0, 0))]}, "independent"),
        ({"freedoms": ["Rz"], "efforts": ["Mz", "Fx"]}, "efforts: 2"),
        ({"freedoms": ["Rz"], "efforts": ["Mx"]}, "dual"),
        ({"freedoms": ["Tz"], "reactions": ["Fx@3", "Fy", "Mx", "My", "Mz"]}, "no frame 3"),
        ({"freedoms": ["rotation"], "reactions": ["Fx@1", "Fy", "Fz"]}, "no frame 1"),
        ({"freedoms": ["Tx", "Ty", "Tz", "rotation", mg.Freedom("Q", (0, 0, 1, 0, 0, 0))]}, "pair type"),
        ({"freedoms": [mg.Freedom("R", (0, 0, np.nan, 0, 0, 0))]}, "pair type"),
        ({"freedoms": [mg.Freedom("R", (0, 0, 1))]}, "pair type"),
        (
            {"freedoms": ["Rz"], "bookkeeping": mg.Bookkeeping((), (mg.Component("Fz", (0, 0, 1)),))},
            "bookkeeping: along 'Fz': wrench = .*six finite numbers, moment part first",
        ),
        (
            {"freedoms": ["Rz"], "bookkeeping": mg.Bookkeeping((mg.Freedom("Rz", (0, 0, 1)),), ())},
            "freedom 'Rz': twist = .*six finite numbers, angular part first",
        ),
        (
            {"freedoms": ["Rz"], "bookkeeping": mg.Bookkeeping(("Rz",), ())},
            "bookkeeping: conditions = 'Rz': expected a Freedom",
        ),
        (
            {"freedoms": ["Rz"], "bookkeeping": mg.Bookkeeping((), ("Fz",))},
            "bookkeeping: along = 'Fz': expected a Component",
        ),
    ],
)
def test_a_bad_row_is_refused(more, word):
    with pytest.raises(mg.DeclarationError, match=word):
        mg.PairType("X", **more)


@pytest.mark.parametrize("symbol", ["", "2R", "a b", "R-R", None])
def test_a_bad_symbol_is_refused(symbol):
    with pytest.raises(mg.DeclarationError, match="symbol"):
        mg.PairType(symbol, freedoms=["Rz"])


def test_all_faults_of_a_row_come_at_once():
    with pytest.raises(mg.DeclarationError) as caught:
        mg.PairType("9", freedoms=["Rw"], reactions=["Qx"])
    assert len(caught.value.faults) == 3


def test_reactions_none_names_components_n1_n2():
    assert USER_ROWS["offset hinge"].component_names == ("n1", "n2", "n3", "n4", "n5")


def test_the_table_prints_every_row():
    text = str(mg.pair_types())
    for row in mg.pair_types().values():
        assert row.name.split()[0] in text


def test_efforts_are_named_after_the_axes_of_their_freedoms():
    """A couple for a turn, a force for a slide, about and along the same axis."""
    named = {symbol: [e.name for e in row.efforts] for symbol, row in mg.pair_types().items()}
    assert named["C"] == ["Mz", "Fz"]
    assert named["Sc"] == ["Fz", "My", "Mx"]
    assert named["Sp"] == ["Fx", "Fy", "Mx", "My", "Mz"]
    for row in mg.pair_types().values():
        assert [e.name for e in row.efforts] == [("M" if f.turns else "F") + f.name[1] for f in row.freedoms]


@pytest.mark.parametrize("size", [1e-3, 0.05, 0.5, 2.0, 3.1])
def test_rates_of_rotation_vectors_are_their_derivatives(size):
    """d/dt log(exp(t w) exp(v)) at t = 0, by central differences; small and large turns."""
    rng, h = np.random.default_rng(5), 1e-5
    v = rng.normal(size=(3, 4))
    v *= size / np.linalg.norm(v, axis=0)
    w = rng.normal(size=(3, 4))
    turned = [se3.turn_between(se3.turned(se3.quaternion_exp(v), s * h * w), np.eye(4, 1)) for s in (1, -1)]
    np.testing.assert_allclose(se3.turn_tangent(v, w), (turned[0] - turned[1]) / (2 * h), rtol=0, atol=2e-8)


@pytest.mark.parametrize("row", [row for row in ROWS.values() if row.reactions is None], ids=lambda row: row.symbol)
def test_reactions_without_components_are_a_basis_about_marker_b(row):
    """Orthonormal in the directions of marker B, moments about its origin; reciprocal at complex states too, without a conjugate."""
    x = states(row)
    frames, S, _, W = evaluated(row, x)
    B = frames[-1]
    moment = W[:3] - np.cross(np.broadcast_to(B[:, None, 3], W[3:].shape), W[3:], axis=0)
    N = np.concatenate([np.einsum("jint,jcnt->icnt", B[:, :3], part) for part in (moment, W[3:])])
    unit = np.einsum("icnt,idnt->cdnt", N, N)
    np.testing.assert_allclose(unit, np.broadcast_to(np.eye(6 - row.f)[:, :, None, None], unit.shape), atol=1e-13)
    x = x + 1e-2j * np.random.default_rng(3).normal(size=x.shape)
    _, S, _, W = evaluated(row, x)
    assert np.abs(W.imag).max() > 1e-4
    np.testing.assert_allclose(np.einsum("ifnt,icnt->fcnt", S, W), 0, atol=1e-13)


def test_a_place_for_a_surface_counts_as_a_row():
    assert len(OnSurface().freedoms) == 2


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", list(SAMPLE))
def test_the_frame_on_a_surface_turns_by_its_twists(name, turned):
    """``R' = w x R`` and ``x' = v`` along both coordinates, against differences of the frame."""
    place = OnSurface(SAMPLE[name], INSIDE.get(name, (0.7, 0.4)), turned=turned)
    x, h = np.array([[0.05, -0.1], [0.08, 0.03]]), 1e-5
    _, _, twists = place.here(x)
    for j in range(2):
        step = h * np.eye(2)[j][:, None]
        (p0, R0, _), (_, R, _), (p1, R1, _) = (place.here(x + k * step) for k in (-1, 0, 1))
        w = 0.5 * np.cross(R, (R1 - R0) / (2 * h), axis=0).sum(axis=1)
        assert_allclose(twists[:3, j], w, atol=1e-8)
        assert_allclose(twists[3:, j], (p1 - p0) / (2 * h), atol=1e-8)
