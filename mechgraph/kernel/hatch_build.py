"""Build hook: the kernel compiled at ``pip install`` of a clone, where a C compiler is found; without one, or where it fails, the package
is installed without it.

``MECHGRAPH_TARGET`` and ``MECHGRAPH_PLATFORM`` (a target of zig and the platform tag of its wheel) build for another machine: see
``.ci/wheels``.
"""

from __future__ import annotations

import os
import runpy
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import sys_tags

FOLDER = "mechgraph/kernel"


class KernelBuildHook(BuildHookInterface[Any]):
    """Adds the library of the kernel to a wheel, or puts it beside the source of an editable installation."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build before the files of the wheel are collected."""
        compiler = runpy.run_path(os.path.join(self.root, FOLDER, "compiler.py"))
        target = os.environ.get("MECHGRAPH_TARGET", "")
        self.folder = tempfile.TemporaryDirectory()
        place = Path(self.root, FOLDER) if version == "editable" else Path(self.folder.name)
        platform = os.environ.get("MECHGRAPH_PLATFORM") or _platform()
        for command in compiler["compilers"]():
            try:
                library = place / f"kernel-{compiler['key']()}{compiler['suffix'](target)}"
                # it may lie beside the source from another environment; its name holds the key of all that made it
                if not library.is_file():
                    compiler["compile_library"](command, library, target)
            except (OSError, subprocess.SubprocessError) as error:
                self.app.display_warning(f"the kernel is not compiled: {compiler['refusal'](command, error)}")
                continue
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{platform}"
            if version != "editable":
                build_data["force_include"][os.fspath(library)] = f"{FOLDER}/{library.name}"
            return
        if target:
            raise RuntimeError(f"no kernel for {target}")
        self.app.display_info("without a compiled kernel: no C compiler builds it here")

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Nothing is left behind."""
        self.folder.cleanup()


def _platform() -> str:
    tags = (tag.platform for tag in sys_tags())
    return next(tag for tag in tags if not tag.startswith(("manylinux", "musllinux")))
