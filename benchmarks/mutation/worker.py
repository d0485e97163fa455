"""One target of `rolling-panda bench mutation`, in a process of its own, since mutmut keeps its settings for life.

Run in the target's folder with SAMPLE, SEED and WORKERS; `results.json` is what came of it. WORKERS 0 tries none.
"""

import hashlib
import json
import os
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mutmut import __main__ as mutmut
from mutmut.mutation.diff_apply import get_diff_for_mutant
from mutmut.mutation.trampoline import get_mutant_under_test
from mutmut.runners.harness import BadTestExecutionCommandsException, PytestRunner
from mutmut.state import state
from mutmut.stats import status_by_exit_code

_AGAIN = (None, "survived", "no tests")
_KILLED = 1
#: The tests could not be run, or were not, which says nothing.
_NOTHING = (None, 2, 4, 255)
_execute, _arguments = PytestRunner.execute_pytest, PytestRunner._pytest_args_regular_run


class _Imports:
    """What runs when tests are imported is every test's, where mutmut would say the first one's."""

    def __init__(self) -> None:
        """Nothing has failed."""
        self.failed = False

    def pytest_collectreport(self, report: Any) -> None:
        """A module was imported, or could not be: by the mutant's doing where that stands in the traceback."""
        self.failed = self.failed or (report.failed and re.search(r"__mutmut_\d", str(report.longrepr)) is not None)

    def pytest_collection_finish(self, session: Any) -> None:
        """All modules are imported."""
        if get_mutant_under_test() == "stats":
            for function in state()._stats:
                state().tests_by_mangled_function_name[function].update(item.nodeid for item in session.items)
            state()._stats.clear()


def execute(runner: PytestRunner, words: list[str], **others: Any) -> int:
    """Run pytest; a mutant that keeps tests from being imported is killed."""
    imports = _Imports()
    try:
        code = int(_execute(runner, words, **{**others, "plugins": [*others.get("plugins", ()), imports]}))
    except BadTestExecutionCommandsException:
        if not imports.failed:
            raise
    return _KILLED if imports.failed else code


def tests_in_order(runner: PytestRunner, tests: Iterable[str]) -> list[str]:
    """Arguments of a run: quick files first, since the first test that fails ends it, and file by file for fixtures."""
    spent: dict[str, float] = defaultdict(float)
    for test in tests:
        spent[test.partition("::")[0]] += state().duration_by_test.get(test, 0.0)
    return list(_arguments(runner, sorted(tests, key=lambda test: (spent[test.partition("::")[0]], test))))


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
    mutmut.set_mutant_under_test("mutant_generation")
    with mutmut.CatchOutput():
        mutmut.copy_src_dir()
        mutmut.copy_also_copy_files()
        mutmut.create_mutants(2)
    rows, _ = mutmut.collect_source_file_mutation_data(mutant_names=())
    chosen = sorted((name for _, name, _ in rows), key=lambda name: order(seed, name))[: sample or None]
    known = {name: status(code) for _, name, code in rows}
    left = [name for name in chosen if known[name] in _AGAIN]
    print(f"{len(known)} mutants, {len(chosen)} chosen, {len(left)} to be tried", flush=True)
    if left and workers:
        mutmut._run(tuple(left), workers)
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
    PytestRunner.execute_pytest = execute
    PytestRunner._pytest_args_regular_run = tests_in_order
    sys.path[:] = [path for path in sys.path if path not in (root, str(Path(__file__).parent))]
    main()
