"""Tables of a Solution: DataFrame and Dataset over the batch axes."""

from __future__ import annotations

import numpy as np
import pytest

import mechgraph as mg


def crank(shape: tuple[int, ...]) -> mg.Solution:
    """A crank with a weight at positions of a given shape."""
    links = [mg.Link("frame"), mg.Link("crank", 2.0, (0.5, 0, 0))]
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1))]
    m = mg.Mechanism("crank", links, pairs, ["A"], [mg.Gravity((0, -10.0, 0))])
    angles = np.linspace(0.1, 0.9, int(np.prod(shape, dtype=int))).reshape(shape)
    return mg.solve(m, {"A": angles})


BATCHES = [
    ((), ()),
    ((3,), ("position",)),
    ((2, 3), ("case", "position")),
    ((2, 1, 3), ("case0", "case1", "position")),
]


@pytest.mark.parametrize(("shape", "dims"), BATCHES)
def test_dataset(shape: tuple[int, ...], dims: tuple[str, ...]) -> None:
    pytest.importorskip("xarray")
    s = crank(shape)
    data = s.to_xarray()
    assert data.attrs["mechanism"] == "crank"
    assert tuple(data["closure"].dims) == dims
    for name in data:
        assert data[name].dims == dims
    assert any(np.array_equal(data[name], s["A"].effort[..., 0]) for name in data)


@pytest.mark.parametrize(("shape", "dims"), BATCHES[1:])
def test_frame(shape: tuple[int, ...], dims: tuple[str, ...]) -> None:
    pytest.importorskip("pandas")
    s = crank(shape)
    frame = s.to_pandas()
    assert len(frame) == np.prod(shape)
    if len(shape) > 1:
        assert list(frame.index.names) == list(dims)
        assert frame.index[-1] == tuple(n - 1 for n in shape)
    assert any(np.array_equal(frame[name], s["A"].effort.ravel()) for name in frame)
