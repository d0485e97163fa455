"""How benchmarks write what they found: JSON that people can read and compare line by line."""

import argparse
import json
import os
import platform
from pathlib import Path
from typing import Any


def bench_parser(name: str, about: str | None) -> argparse.ArgumentParser:
    """The arguments of `rolling-panda bench NAME`: --json so far, for `write`."""
    parser = argparse.ArgumentParser(prog=f"rolling-panda bench {name}", description=about)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures here")
    return parser


def write(path: Path | None, document: dict[str, Any]) -> None:
    """Write a document with the machine that its figures are from; without a path, write nothing."""
    if path is not None:
        path.write_text(one_row_a_line({"machine": machine(), **document}), encoding="utf-8")


def machine() -> str:
    """Where figures come from: the system, how many cores it has, and how many programs wanted them in this minute."""
    return f"{platform.platform()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"


def one_row_a_line(document: dict[str, Any]) -> str:
    """JSON text with each key, and each row of a list, on one line; numbers to six digits."""
    parts = []
    for key, value in document.items():
        if isinstance(value, list):
            rows = ",\n".join(f"  {_line(row)}" for row in value)
            parts.append(f" {json.dumps(key)}: [\n{rows}\n ]")
        elif isinstance(value, dict):
            rows = ",\n".join(f"  {json.dumps(name)}: {_line(entry)}" for name, entry in value.items())
            parts.append(f" {json.dumps(key)}: {{\n{rows}\n }}")
        else:
            parts.append(f" {json.dumps(key)}: {_line(value)}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def _line(value: Any) -> str:
    return json.dumps(_rounded(value), ensure_ascii=False)


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {name: _rounded(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(entry) for entry in value]
    return value
