"""`python -m rolling_panda.generate --check | --write`: files generated from messages, topics, reasons and modes."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from rolling_panda.errors import RollingPandaError
from rolling_panda.generate import guides, languages, safety
from rolling_panda.generate.javascript import messages_module, messages_types, reasons_catalogue
from rolling_panda.generate.markdown import fill, guide_table, reasons_table
from rolling_panda.transport.access import access_control

ROOT = Path(__file__).resolve().parents[2]
_ROUTER_HEADER = """\
// Configuration of a Zenoh router (zenohd 1.x) for the robot's wire: mutual TLS, and everything refused that the table
// of topics does not let a sender say. `rolling-panda router --certificates DIR` does the same without this file.
// Made by `python -m rolling_panda.generate --write`; put the certificates where the paths say, or change the paths.
"""


def generated(root: Path = ROOT) -> dict[Path, str]:
    """The text of each generated file of a checkout."""
    wire, safety_page = root / "docs" / "wire.md", root / "docs" / "safety.md"
    reasons_page, guide = root / "docs" / "reasons.md", root / "docs" / "operator-guide.md"
    reasons_blocks = {"reasons": reasons_table}
    return {
        root / "web" / "js" / "link" / "messages.js": messages_module(),
        root / "web" / "js" / "link" / "messages.d.ts": messages_types(),
        root / "web" / "js" / "state" / "languages.js": languages.languages_module(root / "web" / "text"),
        root / "web" / "text" / "reasons.en.json": reasons_catalogue(),
        root / "assets" / "config" / "router.json5": router_config(),
        wire: fill(wire.read_text(encoding="utf-8")),
        reasons_page: fill(reasons_page.read_text(encoding="utf-8"), reasons_blocks, "docs/reasons.md"),
        guide: fill(guide.read_text(encoding="utf-8"), {"commands": guide_table}, "docs/operator-guide.md"),
        safety_page: fill(safety_page.read_text(encoding="utf-8"), safety.BLOCKS, "docs/safety.md"),
    } | guides.guides(root)


def router_config() -> str:
    """Text of `assets/config/router.json5`: mutual TLS, and access control from the topic table."""
    folder = "/etc/rolling-panda/certificates"
    tls = {
        "root_ca_certificate": f"{folder}/ca.pem",
        "listen_certificate": f"{folder}/router.pem",
        "listen_private_key": f"{folder}/router.key",
        "enable_mtls": True,
    }
    content = {
        "mode": "router",
        "listen": {"endpoints": ["tls/0.0.0.0:7447"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"link": {"tls": tls}},
        "access_control": access_control(),
    }
    return f"{_ROUTER_HEADER}{json.dumps(content, indent=2)}\n"


def stale(root: Path = ROOT) -> list[Path]:
    """Generated files that are out of date or missing."""
    return [
        path for path, text in generated(root).items() if not path.exists() or path.read_text(encoding="utf-8") != text
    ]


def main(argv: Sequence[str] | None = None) -> int:
    """Write the files, or report those that are out of date and what languages differ in; returns the exit code."""
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
                path.parent.mkdir(exist_ok=True)
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
    texts_folder = ROOT / "web" / "text"
    wrong = [f"web/text/{problem}" for problem in languages.problems(texts_folder)]
    wrong += guides.problems(ROOT, languages.languages(texts_folder))
    for problem in wrong:
        print(problem, file=sys.stderr)
    return 1 if old or wrong else 0


if __name__ == "__main__":
    sys.exit(main())
