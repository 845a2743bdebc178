"""Hypothesis profiles: ``dev`` at the desk, ``ci`` (more examples, always the same ones) where CI is set."""

import os

from hypothesis import settings

settings.register_profile("dev", max_examples=25, deadline=None)
settings.register_profile("ci", max_examples=60, deadline=None, derandomize=True, database=None)
settings.load_profile("ci" if os.environ.get("CI", "").lower() not in {"", "0", "false"} else "dev")
