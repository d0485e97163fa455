"""One target of `rolling-panda bench mutation`, in a process of its own, since mutmut keeps its settings for life.

Run in the target's folder with SAMPLE, SEED and WORKERS; `results.json` is what came of it. WORKERS 0 tries none.

mutmut makes the mutants and finds out which tests run a function. The trials are made here: pytest collects the tests
once, and each mutant gets a fork of that process, so that a trial costs its tests and not their imports.
"""

import functools
import hashlib
import json
import math
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from mutmut import __main__ as mutmut
from mutmut.configuration import config
from mutmut.mutation.data import SourceFileMutationData
from mutmut.mutation.diff_apply import get_diff_for_mutant
from mutmut.mutation.trampoline import get_mutant_under_test, set_mutant_under_test
from mutmut.runners.harness import PytestRunner
from mutmut.state import state
from mutmut.stats import load_stats, status_by_exit_code
from mutmut.utils.file_utils import change_cwd
from mutmut.utils.format_utils import mangled_name_from_mutant_name

_AGAIN = (None, "survived", "no tests")
_PASSED, _KILLED, _UNTESTED, _TIMEOUT = 0, 1, 33, 36
#: The tests could not be run, or were not, which says nothing.
_NOTHING = (None, 2, 4, 255)
#: A trial's limits, in CPU seconds and in seconds: so many, and so many times what its tests take.
_CPU_S, _WALL_S, _TIMES = 20, 60, 10.0
#: Tries mutants and tells each one's exit code; returns its process's.
Attempt = Callable[[list[str], Callable[[str, int], None]], int]
#: mutmut's statistics: which tests run a function.
_STATISTICS = Path("mutants/mutmut-stats.json").absolute()
#: Functions that run when tests are imported, a file beside mutmut's statistics.
_IMPORTED = Path("mutants/imported.json").absolute()


class _Imports:
    """Finds the functions that run while tests are imported."""

    def pytest_collection_finish(self) -> None:
        """All modules are imported."""
        if get_mutant_under_test() == "stats":
            before = json.loads(_IMPORTED.read_text()) if _IMPORTED.exists() else []
            _IMPORTED.write_text(json.dumps(sorted({*before, *state()._stats})))
            state()._stats.clear()


def statistics(names: list[str]) -> None:
    """Run the tests without a mutant, in a fork, and keep which functions each runs.

    mutmut runs only tests that are new. All are run where none is known for the function of a mutant of `names`.

    Raises:
        SystemExit: A test fails.
    """
    if load_stats() and not all(map(tests_of, names)):
        _STATISTICS.unlink()
    execute = PytestRunner.execute_pytest

    def executed(runner: PytestRunner, words: list[str], **others: Any) -> int:
        return int(execute(runner, words, **{**others, "plugins": [*others.get("plugins", ()), _Imports()]}))

    def collect() -> int:
        PytestRunner.execute_pytest = executed
        mutmut.collect_or_load_stats(mutmut.get_mutant_runner(1))
        return 0

    if code := wait(fork(collect)):
        sys.exit(f"the tests without a mutant ended with {code}")
    load_stats()


def fork(work: Callable[[], int], cpu_s: int | None = None) -> int:
    """Start a process that ends with the code that `work` returns.

    Args:
        work: What it does.
        cpu_s: Limit of its processor time (s); with one it leads a process group of its own.
    """
    sys.stdout.flush()
    process = os.fork()
    if process:
        return process
    code = 3
    try:
        if cpu_s is not None:
            os.setpgid(0, 0)
            resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))
        code = work()
    except SystemExit as end:
        print(end.code, flush=True)
    finally:
        sys.stdout.flush()
        os._exit(code)


def wait(process: int, wall_s: float = math.inf) -> int:
    """The exit code of a process, minus the signal that ended it; none lives longer than `wall_s`."""
    end, found, code = time.monotonic() + wall_s, 0, 0
    try:
        while not found and time.monotonic() < end:
            found, code = os.waitpid(process, 0 if wall_s == math.inf else os.WNOHANG)
            if not found:
                time.sleep(0.005)
    finally:
        if wall_s < math.inf:
            # What a test has started ends with it.
            with suppress(ProcessLookupError):
                os.killpg(process, signal.SIGKILL)
        if not found:
            os.waitpid(process, 0)
    return os.waitstatus_to_exitcode(code) if found else _TIMEOUT


def try_one(name: str, tests: list[str], run: Callable[[list[str]], bool]) -> int:
    """The exit code of a mutant's tests, which `run` runs in a fork; it tells whether all passed."""
    folder = tempfile.mkdtemp(prefix="mutant-")

    def quietly() -> int:
        set_mutant_under_test(name)
        os.environ["PYTEST_DEBUG_TEMPROOT"] = os.environ["TMPDIR"] = tempfile.tempdir = folder
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        return _PASSED if run(tests) else _KILLED

    taken = sum(state().duration_by_test.get(test, 0.0) for test in tests)
    try:
        return wait(fork(quietly, int(_CPU_S + _TIMES * taken)), _WALL_S + _TIMES * taken)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


class Trials:
    """A pytest plugin: in place of running the tests once, it runs each mutant's tests in a fork."""

    def __init__(self, names: list[str], register: Callable[[str, int], None]) -> None:
        """Try the mutants `names`; `register` is told each one's exit code."""
        self._names, self._register = names, register

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Try them."""
        items = {item.nodeid: item for item in session.items}

        def run(tests: list[str]) -> bool:
            chosen = [items[test] for test in tests]
            for test, following in zip(chosen, [*chosen[1:], None], strict=True):
                test.config.hook.pytest_runtest_protocol(item=test, nextitem=following)
                if session.testsfailed:
                    return False
            return True

        if try_one("fail", list(items), run) == _PASSED:
            sys.exit("no test fails where every function that is mutated raises: trials would tell nothing")
        for name in self._names:
            tests = in_order(test for test in tests_of(name) if test in items)
            self._register(name, try_one(name, tests, run) if tests else _UNTESTED)
        return True


def tests_of(name: str) -> set[str]:
    """The tests that run a mutant's function."""
    return set(state().tests_by_mangled_function_name.get(mangled_name_from_mutant_name(name), ()))


def try_forked(names: list[str], tell: Callable[[str, int], None]) -> int:
    """Try mutants one after the other, in forks of a process that has imported the tests without a mutant."""
    set_mutant_under_test("")
    with change_cwd("mutants"):
        words = ["-q", *config().pytest_add_cli_args_test_selection]
        return int(PytestRunner().execute_pytest(words, plugins=[Trials(names, tell)]))


def try_anew(names: list[str], tell: Callable[[str, int], None]) -> int:
    """Try mutants one after the other, with the imports of the tests each time."""
    runner = PytestRunner()
    for name in names:
        tell(name, try_one(name, [], lambda tests: runner.run_tests(mutant_name=None, tests=tests) == _PASSED))
    return 0


def results(names: list[str], workers: int, attempt: Attempt) -> Iterator[tuple[str, int]]:
    """Try mutants with `attempt` in `workers` processes; yields each with its exit code.

    Raises:
        SystemExit: Not all could be tried.
    """
    source, sink = os.pipe()

    def tell(name: str, code: int) -> None:
        os.write(sink, f"{name} {code}\n".encode())

    shares = (names[i::workers] for i in range(workers))
    processes = [fork(functools.partial(attempt, share, tell)) for share in shares if share]
    os.close(sink)
    with os.fdopen(source) as told:
        for line in told:
            name, code = line.split()
            yield name, int(code)
    if any([wait(process) for process in processes]):
        sys.exit("not all were tried")


def keep(results: Iterable[tuple[str, int]], files: dict[str, SourceFileMutationData]) -> None:
    """Write each result to the file of its mutants, and tell it."""
    for number, (name, code) in enumerate(results, 1):
        files[name].exit_code_by_key[name] = code
        files[name].save()
        print(f"{number} {name}: {status_by_exit_code[code]}", flush=True)


def in_order(tests: Iterable[str]) -> list[str]:
    """Tests, quick files first, since the first test that fails ends a trial, and file by file for fixtures."""
    spent: dict[str, float] = defaultdict(float)
    known = list(tests)
    for test in known:
        spent[test.partition("::")[0]] += state().duration_by_test.get(test, 0.0)
    return sorted(known, key=lambda test: (spent[test.partition("::")[0]], test))


def order(seed: int, name: str) -> str:
    """Sorts mutants at random, each by itself: a larger sample holds a smaller one, and other mutants move none."""
    return hashlib.sha256(f"{seed} {name}".encode()).hexdigest()


def status(exit_code: int | None) -> str | None:
    """What an exit code of a mutant's tests says; None where it was not tried."""
    return None if exit_code in _NOTHING else str(status_by_exit_code[exit_code])


def change(name: str, path: Path) -> dict[str, str]:
    """What a mutant changed."""
    lines = get_diff_for_mutant(name, path=path).splitlines()[2:]
    was, becomes = (" ".join(line[1:].strip() for line in lines if line[0] == sign) for sign in "-+")
    return {"file": str(path), "was": was, "becomes": becomes}


def main() -> None:
    """Make the mutants, choose, try those of them that no test is known to kill, and tell."""
    sample, seed, workers = (int(word) for word in sys.argv[1:4])
    Path("mutants").mkdir(exist_ok=True)
    # mutmut leaves a copy as it is, though the file has changed since, unless it mutates the file.
    for copy in Path("mutants").rglob("*.py"):
        if not copy.with_name(f"{copy.name}.meta").exists():
            copy.unlink()
    set_mutant_under_test("mutant_generation")
    with mutmut.CatchOutput():
        mutmut.copy_src_dir()
        mutmut.copy_also_copy_files()
        mutmut.create_mutants(2)
    mutmut.setup_source_paths()
    rows, _ = mutmut.collect_source_file_mutation_data(mutant_names=())
    chosen = sorted((name for _, name, _ in rows), key=lambda name: order(seed, name))[: sample or None]
    known, files = {name: status(code) for _, name, code in rows}, {name: data for data, name, _ in rows}
    left = [name for name in chosen if known[name] in _AGAIN]
    print(f"{len(known)} mutants, {len(chosen)} chosen, {len(left)} to be tried", flush=True)
    if left and workers:
        statistics(left)
        keep(results(left, workers, try_forked), files)
        # What runs while the tests are imported was made without the mutant so far.
        imported = set(json.loads(_IMPORTED.read_text()))
        alive = [name for name in left if status(files[name].exit_code_by_key[name]) in _AGAIN]
        early = [name for name in alive if mangled_name_from_mutant_name(name) in imported]
        keep(results(early, workers, try_anew), files)
    rows, _ = mutmut.collect_source_file_mutation_data(mutant_names=tuple(chosen))
    found = {name: (data.path, status(code)) for data, name, code in rows}
    alive = [change(name, path) for name, (path, said) in found.items() if said in ("survived", "no tests")]
    counts = Counter(said for _, said in found.values() if said is not None)
    document = {"mutants": len(known), "chosen": len(chosen), "counts": counts, "alive": alive}
    Path("results.json").write_text(json.dumps(document), encoding="utf-8")


if __name__ == "__main__":
    # The tests and the processes that they start import the mutants, not this checkout.
    root = os.environ.pop("PYTHONPATH")
    from benchmarks.mutation.operators import extend

    extend()
    sys.path[:] = [path for path in sys.path if path not in (root, str(Path(__file__).parent))]
    main()
