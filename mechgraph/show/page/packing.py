"""Numbers for a script, and JSON that may stand in a page."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array


def packed(values: Any) -> dict[str, Any]:
    """An array as 32-bit numbers, little-endian, in base64; NaN stays NaN."""
    array = np.ascontiguousarray(values, dtype="<f4")
    return {"shape": list(array.shape), "f32": base64.b64encode(array.tobytes()).decode()}


def rounded(values: Array) -> list[float]:
    """A few numbers, to seven digits."""
    return [float(f"{value:.7g}") for value in np.asarray(values, dtype=float).ravel()]


def json_for_script(data: Any) -> str:
    """JSON that ends no script element and no line of one, whatever its texts hold.

    ValueError where a number is not finite: what is not known is packed, or is no number.
    """
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
