"""The kernel as a library: found, built on request into a folder that is the user's alone, installed with the package."""

import os
import stat
from pathlib import Path
from types import SimpleNamespace

import pytest

import mechgraph as mg
from mechgraph.kernel import build, compiler

pytestmark = pytest.mark.skipif(os.name == "nt", reason="rights of POSIX")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A kernel of two lines, not installed, and an empty cache."""
    source, header = tmp_path / "k.c", tmp_path / "k.h"
    source.write_text("int answer(void) { return 42; }\n")
    header.write_text("int answer(void);\n")
    monkeypatch.setattr(compiler, "SOURCES", (source,))
    monkeypatch.setattr(compiler, "INCLUDED", (header,))
    monkeypatch.setenv("MECHGRAPH_CACHE", str(tmp_path / "cache"))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(build, "installed", INSTALLED)
    build.installed.cache_clear()
    yield tmp_path / "cache" / "kernel"
    INSTALLED.cache_clear()


INSTALLED = build.installed
"""As it is, whatever other tests put in its place."""
REAL = {"SOURCES": compiler.SOURCES, "INCLUDED": compiler.INCLUDED}
FLAGS = compiler.FLAGS
"""Of an installation, whatever tests build with."""


def scripted(folder: Path, name: str, text: str) -> Path:
    folder.mkdir(exist_ok=True)
    program = folder / name
    program.write_text(f"#!/bin/sh\n{text}\n")
    program.chmod(0o755)
    return folder


def without_compilers(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: None)


def test_built_on_request_and_found_afterwards(compiled, cache, monkeypatch, tmp_path):
    assert build.installed() is None
    assert not cache.exists()
    assert build.built().answer() == 42
    (file,) = cache.iterdir()
    assert not file.stat().st_mode & 0o022
    assert not cache.stat().st_mode & 0o077
    without_compilers(monkeypatch, tmp_path / "none")
    assert build.installed().answer() == 42
    assert build.built().answer() == 42


def test_what_was_made_of_another_text_is_not_taken(compiled, cache, tmp_path):
    build.built()
    build.installed.cache_clear()
    compiler.INCLUDED[0].write_text("int answer(void); /* newer */\n")
    assert build.installed() is None
    assert build.built().answer() == 42
    assert len(list(cache.iterdir())) == 2


def test_without_a_compiler_the_extra_is_named(cache, monkeypatch, tmp_path):
    without_compilers(monkeypatch, tmp_path / "none")
    assert build.installed() is None
    with pytest.raises(
        mg.MissingExtraError, match=r"^a C compiler is not installed\. Run: pip install 'mechgraph\[fast\]'$"
    ):
        build.built()


def test_a_compiler_that_fails_leaves_nothing_and_the_next_one_is_tried(compiled, cache, monkeypatch, tmp_path):
    broken = scripted(tmp_path / "broken", "cc", "echo 'k.c:1: error: no such header' >&2; exit 1")
    with monkeypatch.context() as alone:
        alone.setenv("PATH", str(broken))
        alone.setattr(compiler.importlib.util, "find_spec", lambda name: None)
        with pytest.raises(mg.MissingExtraError, match=r"cc: k\.c:1: error: no such header"):
            build.built()
    assert list(cache.iterdir()) == []
    monkeypatch.setenv("CC", str(broken / "cc"))
    assert build.built().answer() == 42


@pytest.mark.parametrize("right", [stat.S_IWGRP, stat.S_IWOTH])
def test_a_folder_that_others_may_write_is_refused(compiled, cache, right):
    build.built()
    build.installed.cache_clear()
    cache.chmod(0o700 | right)
    assert build.installed() is None
    with pytest.raises(mg.FileError, match=r"others may write to .*MECHGRAPH_CACHE"):
        build.built()


def test_a_file_that_others_may_write_is_not_loaded_but_built_anew(compiled, cache):
    build.built()
    (file,) = cache.iterdir()
    file.chmod(0o722)
    build.installed.cache_clear()
    assert build.installed() is None
    build.built()
    assert not build.doubt(file)


def test_a_folder_that_others_may_exchange_is_refused(compiled, cache):
    build.built()
    build.installed.cache_clear()
    cache.parent.chmod(0o777)
    assert build.installed() is None
    assert "another folder in the place" in build.doubt(cache)
    cache.parent.chmod(0o1777)
    assert not build.doubt(cache)


def test_what_belongs_to_another_user_is_refused(compiled, cache, monkeypatch):
    build.built()
    build.installed.cache_clear()
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    assert "belongs to another user" in build.doubt(cache)
    assert build.installed() is None


@pytest.mark.parametrize(("version", "found"), [("standard", True), ("editable", True), ("standard", False)])
def test_pip_installs_with_a_compiler_and_without_one(version, found, compiled, cache, monkeypatch, tmp_path):
    """The build hook: a library and a platform's wheel, or the plain wheel; never a failure."""
    pytest.importorskip("hatchling")
    from mechgraph.kernel.hatch_build import FOLDER, KernelBuildHook

    root = tmp_path / "clone"
    (root / FOLDER).mkdir(parents=True)
    made = {"calls.c": compiler.SOURCES[0], "compiler.py": Path(compiler.__file__)}
    for name in ("calls.c", "derivative.c", "kernel.c", "kernel.h", "motion.c", "tracks.c", "compiler.py"):
        (root / FOLDER / name).write_text(
            made[name].read_text(encoding="utf-8") if name in made else "typedef int none;\n"
        )
    said = []
    app = SimpleNamespace(display_warning=said.append, display_info=said.append)
    if not found:
        without_compilers(monkeypatch, tmp_path / "none")
        monkeypatch.setenv("CC", str(scripted(tmp_path / "broken", "cc", "exit 1") / "cc"))
    data = {"pure_python": True, "force_include": {}}
    hook = KernelBuildHook(str(root), {}, None, None, str(tmp_path), "wheel", app)
    hook.initialize(version, data)
    libraries = [Path(file) for file in data["force_include"]] + list(
        (root / FOLDER).glob(f"kernel-*{compiler.suffix()}")
    )
    assert len(libraries) == found
    assert data["pure_python"] is not found
    if found:
        assert data["tag"].startswith("py3-none-")
        assert "manylinux" not in data["tag"]
        monkeypatch.setattr(build, "PACKAGED", libraries[0].parent)
        monkeypatch.setattr(compiler, "FLAGS", FLAGS)
        for what in ("SOURCES", "INCLUDED"):
            files = [root / FOLDER / file.name for file in REAL[what]]
            monkeypatch.setattr(compiler, what, files)
        monkeypatch.setattr(compiler, "TRACKS", root / FOLDER / "tracks.c")
        build.installed.cache_clear()
        assert build.installed().answer() == 42
    else:
        assert "without a compiled kernel" in said[-1]
    hook.finalize(version, data, "")
    assert [file.exists() for file in libraries] == [version == "editable"] * found
