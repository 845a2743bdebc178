"""Where the mechanisms of the library are: inside an installed package, beside the package in a repository."""

from pathlib import Path

from mechgraph.errors import FileError

__all__ = ["library_names", "library_path"]

_PACKAGE = Path(__file__).resolve().parents[1]
_PLACES = (_PACKAGE / "library", _PACKAGE.parent / "library")


def library_path(name: str | None = None) -> Path:
    """Path of the library folder, or of the file of the mechanism `name` in it.

    A wheel holds the library as ``mechgraph/library``, an editable install as ``library`` beside
    ``mechgraph``; the first that exists is taken.

    Parameters
    ----------
    name
        Name as in `library_names`, without ``.toml``.

    Raises
    ------
    FileError
        No library folder in either place, or no mechanism of that name; the message lists those there are.
    """
    folder = next((place for place in _PLACES if place.is_dir()), None)
    if folder is None:
        raise FileError(_PLACES[0], f"no mechanism library there, nor in {_PLACES[1]}; install mechgraph again")
    if name is None:
        return folder
    names = _stems(folder)
    if name not in names:
        raise FileError(folder, f"no mechanism {name!r} in the library; there are: {', '.join(names)}")
    return folder / f"{name}.toml"


def library_names() -> tuple[str, ...]:
    """Names of the mechanisms in the library, sorted: the stems of its TOML files.

    Raises
    ------
    FileError
        No library folder, see `library_path`.
    """
    return _stems(library_path())


def _stems(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in folder.glob("*.toml")))
