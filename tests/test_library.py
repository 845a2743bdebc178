"""The library is found in a wheel (inside the package) and in an editable install (beside it)."""

import importlib.util
import shutil
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

import mechgraph as mg

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "mechgraph" / "model" / "toml.py"


def module_installed_in(folder: Path, *libraries: str) -> ModuleType:
    """The library module as it works when its package lies in `folder`, with `libraries` relative to that."""
    copy = folder / "mechgraph" / "model" / "toml.py"
    copy.parent.mkdir(parents=True)
    shutil.copy(SOURCE, copy)
    for library in libraries:
        (folder / library).mkdir(parents=True)
        for name in ("rcsr", "7r", "bennett"):
            (folder / library / f"{name}.toml").touch()
        (folder / library / "schema.json").touch()
    spec = importlib.util.spec_from_file_location("library_elsewhere", copy)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("place", ["mechgraph/library", "library"])
def test_library_is_found_in_the_package_and_beside_it(tmp_path: Path, place: str) -> None:
    module = module_installed_in(tmp_path, place)
    assert module.library_path() == (tmp_path / place).resolve()
    assert module.library_path("rcsr") == (tmp_path / place / "rcsr.toml").resolve()
    assert module.library_names() == ("7r", "bennett", "rcsr")


def test_the_package_comes_first(tmp_path: Path) -> None:
    module = module_installed_in(tmp_path, "library", "mechgraph/library")
    assert module.library_path() == (tmp_path / "mechgraph" / "library").resolve()


def test_a_missing_library_names_both_places(tmp_path: Path) -> None:
    module = module_installed_in(tmp_path)
    with pytest.raises(mg.FileError, match=r"mechgraph.library: no .* nor in .*library; install"):
        module.library_names()


@pytest.mark.parametrize("name", ["rscr", "../library/rcsr", "schema", "rcsr.toml", ""])
def test_an_unknown_name_lists_the_known(tmp_path: Path, name: str) -> None:
    module = module_installed_in(tmp_path, "library")
    with pytest.raises(mg.FileError, match="available: 7r, bennett, rcsr"):
        module.library_path(name)


def test_every_file_of_the_repository_library_is_toml() -> None:
    files = sorted((ROOT / "library").glob("*.toml"))
    assert files, "library/ holds no mechanism"
    for file in files:
        assert tomllib.loads(file.read_text(encoding="utf-8")), file.name
