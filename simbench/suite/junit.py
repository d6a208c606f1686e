"""A suite's run as JUnit XML: every run and every gate is a test case.

A run that ended badly is an `error`, a gate that is missed a `failure`, one that cannot be decided `skipped`
(never passed). Properties of a run: its seed, the hash of what happened, the line that makes it again.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from xml.etree import ElementTree

from simbench.suite.gate import Answer, Gate, interval, number
from simbench.suite.side import Side

MOST_TEXT = 4000
REFUSED = re.compile("[^\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit(answer: Answer, side: Side, seconds: Mapping[str, float]) -> str:
    """The document. seconds: of work, by case (group/seed)."""
    suites, asked = [], dict[str, list[Gate]]()
    for gate in answer.gates:
        asked.setdefault(gate.group, []).append(gate)
    for group, of in side.groups.items():
        cases = []
        for seed, run in of.runs.items():
            case = _element("testcase", classname=group, name=f"seed {seed}",
                            time=f"{seconds.get(f'{group}/{seed}', 0.0):.3f}")  # fmt: skip
            properties = ElementTree.SubElement(case, "properties")
            for name, value in (("seed", seed), ("hash", run.scenario), ("command", run.command)):
                properties.append(_element("property", name=name, value=value))
            if run.status != "ok":
                _told(case, "error", run.status, run.why or run.status)
            cases.append(case)
        gates = [gate for gate in asked.get(group, ()) if gate.kind != "runs"]
        suites.append(_suite(group, [*cases, *(_gate(gate) for gate in gates)]))
    known = set(side.groups)
    others = [gate for gate in answer.gates if gate.group not in known]
    if others or answer.problems:
        cases = [_gate(gate) for gate in others]
        for problem in answer.problems:
            cases.append(_element("testcase", classname=side.suite, name="the run as a whole", time="0"))
            _told(cases[-1], "error", "bench_error", problem)
        suites.append(_suite(side.suite, cases))
    root = _element("testsuites", name=side.suite, **_counts([case for suite in suites for case in suite]))
    root.extend(suites)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _suite(name: str, cases: Sequence[ElementTree.Element]) -> ElementTree.Element:
    suite = _element("testsuite", name=name, **_counts(cases))
    suite.extend(cases)
    return suite


def _counts(cases: Sequence[ElementTree.Element]) -> dict[str, str]:
    def having(tag: str) -> int:
        return sum(case.find(tag) is not None for case in cases)

    return {
        "tests": str(len(cases)), "failures": str(having("failure")), "errors": str(having("error")),
        "skipped": str(having("skipped")),
        "time": f"{sum(float(case.get('time', '0')) for case in cases):.3f}",
    }  # fmt: skip


def _gate(gate: Gate) -> ElementTree.Element:
    case = _element("testcase", classname=gate.group, name=gate.name, time="0")
    words = (
        f"new {number(gate.new)}, old {number(gate.old)}, threshold {gate.threshold}, {interval(gate)}, "
        f"n = {gate.n}"
    )
    text = f"{gate.note}; {words}" if gate.note else words
    kind = {"PASS": None, "INCONCLUSIVE": "skipped", "ERROR": "error"}.get(gate.outcome, "failure")
    if kind is not None:
        _told(case, kind, gate.outcome, text)
    else:
        ElementTree.SubElement(case, "system-out").text = _clean(text)
    return case


def _told(case: ElementTree.Element, tag: str, kind: str, text: str) -> None:
    what = ElementTree.SubElement(case, tag, message=_clean(text)[:300])
    if tag != "skipped":
        what.set("type", kind)
    what.text = _clean(text)


def _element(tag: str, **attributes: str) -> ElementTree.Element:
    return ElementTree.Element(tag, {name: _clean(value) for name, value in attributes.items()})


def _clean(text: str) -> str:
    """Without what XML 1.0 cannot hold: a pipeline may have raised anything."""
    kept = (
        c if c in "\t\n" or " " <= c <= "\ud7ff" or "\ue000" <= c <= "\ufffd" or c > "\uffff" else "?"
        for c in text
    )
    return "".join(kept)[:MOST_TEXT]
