"""`python -m rolling_panda.generate --check | --write`: keep what is made from messages and modes current."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rolling_panda.errors import RollingPandaError
from rolling_panda.generate import bounds, modes
from rolling_panda.generate.javascript import messages_module, messages_types
from rolling_panda.generate.markdown import fill
from rolling_panda.generate.router import router_config

ROOT = Path(__file__).resolve().parents[2]


def generated(root: Path = ROOT) -> dict[Path, str]:
    """What each generated file of a checkout should contain."""
    wire, safety = root / "docs" / "wire.md", root / "docs" / "safety.md"
    return {
        root / "web" / "js" / "link" / "messages.js": messages_module(),
        root / "web" / "js" / "link" / "messages.d.ts": messages_types(),
        root / "assets" / "config" / "router.json5": router_config(),
        wire: fill(wire.read_text(encoding="utf-8")),
        safety: fill(safety.read_text(encoding="utf-8"), modes.BLOCKS | bounds.BLOCKS, "docs/safety.md"),
    }


def stale(root: Path = ROOT) -> list[Path]:
    """Generated files that differ from what they should contain, or are missing."""
    return [
        path for path, text in generated(root).items() if not path.exists() or path.read_text(encoding="utf-8") != text
    ]


def main(argv: Sequence[str] | None = None) -> int:
    """Write the files, or say which are out of date. Returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m rolling_panda.generate", description=__doc__)
    choice = parser.add_mutually_exclusive_group(required=True)
    choice.add_argument("--check", action="store_true", help="exit with 1 when a file is out of date")
    choice.add_argument("--write", action="store_true", help="write what is out of date")
    arguments = parser.parse_args(argv)
    try:
        old = stale()
        if arguments.write:
            texts = generated()
            for path in old:
                path.write_text(texts[path], encoding="utf-8")
                print(f"wrote {path.relative_to(ROOT)}")
            return 0
    except (RollingPandaError, OSError) as error:
        print(f"generate: {error}", file=sys.stderr)
        return 1
    for path in old:
        print(
            f"{path.relative_to(ROOT)} is out of date; run: python -m rolling_panda.generate --write", file=sys.stderr
        )
    return 1 if old else 0


if __name__ == "__main__":
    sys.exit(main())
