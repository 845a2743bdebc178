"""Hypothesis profiles: ``dev`` at the desk, ``ci`` (always the same examples) where CI is set. Golden files."""

import functools
import importlib
import itertools
import os
import subprocess
import zlib
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from hypothesis import settings

import mechgraph as mg
from mechgraph import outcome
from mechgraph.kernel import build, compiler

settings.register_profile("dev", max_examples=10, deadline=None)
settings.register_profile("ci", max_examples=10, deadline=None, derandomize=True, database=None)
CI = os.environ.get("CI", "").lower() not in {"", "0", "false"}
settings.load_profile("ci" if CI else "dev")

GOLDEN = Path(__file__).parent / "golden"
FURTHER = 10_000
"""First seed of ``--attack``."""
DAILY = 2
"""Seeds of a test that are run every day; its others are slow."""
TURNS = 3
HEAVY = frozenset(Path(__file__).with_name("turns.txt").read_text(encoding="utf-8").split())
"""Tests of more than .4 s of processor a case. Their cases take turns: a third of them with each commit, the others are slow."""


def turn_of_commit() -> int:
    """The same commit runs the same tests, wherever and whenever; where nothing is committed, the first third."""
    try:
        asked = subprocess.run(["git", "rev-parse", "HEAD"], cwd=GOLDEN, capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return 0
    return int(asked.stdout, 16) % TURNS


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--update-golden`` writes the golden files anew; look at the difference before you keep it."""
    parser.addoption("--update-golden", action="store_true", help="write the files of tests/golden anew")
    parser.addoption(
        "--kernel", action="store_true", help="all tests on the compiled kernel, where it was installed or built"
    )
    parser.addoption(
        "--attack", type=int, default=0, metavar="N", help="so many seeds more for every test of random mechanisms"
    )
    parser.addoption(
        "--turn",
        type=int,
        default=turn_of_commit(),
        help=f"which of {TURNS} parts of the heavy tests is run, by default as the commit says; -1 for all",
    )


def pytest_report_header(config: pytest.Config) -> str:
    """Which part of the heavy tests is run."""
    return f"heavy tests: --turn {config.getoption('--turn')} of {TURNS}"


def pytest_configure(config: pytest.Config) -> None:
    """Markers of these tests."""
    config.addinivalue_line(
        "markers",
        "seeds(n, without=(), daily=...): a test for each of n seeds, the first but those named, and for as many more as "
        "--attack says; only these further ones may be skipped; every day the first, or those named as quick",
    )
    config.addinivalue_line(
        "markers", "daily(n): n of the cases of this test, evenly spread, are run every day; the others are slow"
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Seeds of tests that are marked so: always the same ones, most of them slow, then the further ones of ``--attack``."""
    marker = metafunc.definition.get_closest_marker("seeds")
    if marker is not None:
        without = marker.kwargs.get("without", ())
        always = list(itertools.islice((seed for seed in itertools.count() if seed not in without), marker.args[0]))
        more = metafunc.config.getoption("--attack")
        daily = marker.kwargs.get("daily", always[:DAILY])
        late = (pytest.param(seed, marks=pytest.mark.slow) for seed in always if seed not in daily)
        metafunc.parametrize("seed", [*daily, *late, *range(FURTHER, FURTHER + more)])


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What tests are given as cases: every mechanism of the library is read once."""
    load, mg.load = mg.load, functools.cache(mg.load)
    try:
        return (yield)
    finally:
        mg.load = load


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """Tests of one file run in one worker, so that what they share is made once."""
    return importlib.import_module("xdist.scheduler").LoadFileScheduling(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Cases that stand for many others: of a test marked ``daily(n)`` all but n are slow; before they are chosen by markers.

    So are heavy tests whose turn it is not.
    """
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("daily") and not item.get_closest_marker("slow"):
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for found in cases.values():
        n = min(found[0].get_closest_marker("daily").args[0], len(found))
        kept = {i * len(found) // n for i in range(n)}
        for i in set(range(len(found))) - kept:
            found[i].add_marker(pytest.mark.slow)
    for item in items:
        turn, heavy = item.config.getoption("--turn"), item.nodeid.partition("[")[0] in HEAVY
        if heavy and turn >= 0 and zlib.crc32(item.nodeid.encode()) % TURNS != turn:
            item.add_marker(pytest.mark.slow)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A seed that is always drawn and then skipped checks nothing: it is a failure, and belongs among those left out."""
    report = yield
    if (
        report.when == "call"
        and report.skipped
        and item.get_closest_marker("seeds")
        and item.callspec.params["seed"] < FURTHER
    ):
        report.outcome, report.longrepr = "failed", f"{report.longrepr[2]}: name the seed in without="
    return report


@pytest.fixture(scope="session", autouse=True)
def start_sets(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Start sets of assemblies, and a kernel that is built, are kept for these tests alone, not in the folder of the user."""
    os.environ["MECHGRAPH_CACHE"] = str(tmp_path_factory.mktemp("start_sets"))


@pytest.fixture(scope="session", autouse=True)
def spoken_warnings() -> None:
    """What numpy says of values that are none, users never see; here it is a warning, and so an error."""
    importlib.import_module("mechgraph.quantities").FLOATING |= {"all": "warn", "under": "ignore"}


@pytest.fixture(scope="session", autouse=True)
def quick_compiler() -> None:
    """Where no kernel was installed, tests build it with fewer optimizations: the same numbers in a fourth of the compiler's time."""
    if not (build.PACKAGED / f"kernel-{compiler.key()}{compiler.suffix()}").is_file():
        compiler.FLAGS = ("-O1", *compiler.FLAGS[1:])


@pytest.fixture(scope="session")
def kernel_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where tests of the kernel build it, once for all workers: not where programs that other tests start would find it."""
    folder = tmp_path_factory.getbasetemp()
    folder = (folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder) / "kernel"
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


@pytest.fixture(autouse=True)
def engine_of_auto(request: pytest.FixtureRequest, kernel_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """``auto`` takes numpy, whatever was built before, unless a test asks for the kernel, or ``--kernel`` for all of them."""
    if "compiled" in request.fixturenames:
        monkeypatch.setenv("MECHGRAPH_CACHE", str(kernel_cache))
    elif not request.config.getoption("--kernel"):
        monkeypatch.setattr(outcome, "at_hand", lambda: None)


@pytest.fixture
def compiled() -> None:
    """What a test of the compiled kernel asks for: where no C compiler is, it is skipped, and where CI is set it fails."""
    try:
        mg.compile(mg.load("four-bar"))
    except mg.MissingExtraError as error:
        (pytest.fail if CI else pytest.skip)(str(error))


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Callable[[str, str], None]:
    """Compare a text with ``tests/golden/<name>``, or write it where ``--update-golden`` asks."""

    def compare(name: str, text: str) -> None:
        file = GOLDEN / name
        if request.config.getoption("--update-golden"):
            file.write_text(text, encoding="utf-8")
        assert file.read_text(encoding="utf-8") == text

    return compare
