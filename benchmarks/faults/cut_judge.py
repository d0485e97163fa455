"""What the records of one start say: the blades' own against the ledger, the wire, and what people were told."""

from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from benchmarks.faults.cut_rig import CutRig, Told
from controller.ledger.check import verify

#: States in which a point may be cut again, or is said to stand.
_STANDS = ("ACCEPTED", "PROPOSED", "REJECTED", "FAILED_NOT_CUT")


@dataclass(frozen=True)
class Finding:
    """Something that must not be: its kind, and which."""

    kind: str
    text: str


@dataclass(frozen=True)
class Records:
    """What one start has left behind.

    Attributes:
        blades: What they did, in order: `event`, `cut_id`, `point_id`.
        tickets: Rows about points: number, point, body.
        requests: Rows about what was asked.
        told: What was said on the wire.
        problem: Why the ledger is not whole; empty when it is.
        rows: How many rows it has.
    """

    blades: list[dict[str, Any]]
    tickets: list[tuple[int, str, dict[str, Any]]]
    requests: list[tuple[int, str, dict[str, Any]]]
    told: Told
    problem: str
    rows: int

    @property
    def bitten(self) -> set[str]:
        """Points that are really cut off."""
        return {event["point_id"] for event in self.blades if event["event"] == "bite"}


def records(rig: CutRig) -> Records:
    """Everything that a start has left behind."""
    verdict = verify(rig.state_folder)
    return Records(rig.blades(), rig.rows("ticket"), rig.rows("request"), rig.told, verdict.problem, verdict.rows)


def judge_cuts(left: Records) -> tuple[Finding, ...]:
    """What must not be; none when all is well."""
    found = [*_double(left), *_lost(left), *_untrue(left), *_certain(left)]
    found += [Finding("forgotten stop", text) for text in left.told.forgotten]
    if left.problem:
        found.append(Finding("damaged ledger", left.problem))
    return tuple(found)


def _double(left: Records) -> Iterator[Finding]:
    """A cut id closes the blades once, and a point is bitten once: nobody accepts one again that is off."""
    for what, key in (("closing", "cut_id"), ("bite", "point_id")):
        for name, count in Counter(event[key] for event in left.blades if event["event"] == what).items():
            if count > 1:
                yield Finding("double cut", f"{key} {name}: {count} times {what}")


def _lost(left: Records) -> Iterator[Finding]:
    """What anybody was told, and what was done, is a row."""
    written = {(name, body["state"]) for _, name, body in left.tickets}
    for point, state in sorted(left.told.states - written):
        yield Finding("lost row", f"{point} was told to be {state}, which is in no row")
    intents = {(body["cut_id"], body["state"]) for _, _, body in left.tickets}
    for cut_id in sorted({event["cut_id"] for event in left.blades}):
        if (cut_id, "CUTTING") not in intents:
            yield Finding("lost row", f"cut {cut_id} has no intent")
    granted = Counter(left.told.granted)
    recorded = Counter(
        (body["asked"]["type"], body["asked"].get("point_id", ""))
        for _, _, body in left.requests
        if body["reason"] is None
    )
    for (kind, point), count in sorted(granted.items()):
        if recorded[kind, point] < count:
            yield Finding("lost row", f"{kind} {point} was granted {count} times, {recorded[kind, point]} are rows")


def _untrue(left: Records) -> Iterator[Finding]:
    """Of each point the newest word is true, or UNKNOWN."""
    bitten, newest = left.bitten, {name: body["state"] for _, name, body in left.tickets}
    for point, state in sorted(newest.items()):
        if state == "DONE" and point not in bitten:
            yield Finding("untrue state", f"{point} is DONE and stands")
        if state in _STANDS and point in bitten:
            yield Finding("untrue state", f"{point} is {state} and is off")
    for point in sorted(bitten - newest.keys()):
        yield Finding("untrue state", f"{point} is off and has no row")


def _certain(left: Records) -> Iterator[Finding]:
    """After an intent nobody knows more than the bridge has said, unless no order was ever given."""
    rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for _, name, body in left.tickets:
        rows[name].append(body)
    for point, those in sorted(rows.items()):
        for before, after in zip(those, those[1:], strict=False):
            if before["state"] != "CUTTING" or after["state"] not in ("DONE", "FAILED_NOT_CUT", "ACCEPTED"):
                continue
            cut_id = before["cut_id"]
            if cut_id not in left.told.outcomes and cut_id in left.told.ordered:
                yield Finding("certain of the unknown", f"{point} is {after['state']}, and nobody has said so")
