"""Which tests try which fault or promise of `faults.yaml`, and the page of their outcomes."""

from collections import defaultdict
from datetime import UTC, datetime
from pathlib import Path

import pytest
import yaml

FAULTS_FILE = Path(__file__).with_name("faults.yaml")
CHECKOUT = FAULTS_FILE.parents[1]
MARKS = {"fault": "faults", "promise": "promises"}
WORST_FIRST = ("failed", "not run", "passed")


def listed():
    """Return the faults and the promises by number: (section, fault, what the user gets), (text,)."""
    content = yaml.safe_load(FAULTS_FILE.read_text(encoding="utf-8"))
    faults = {
        number: (section, row["fault"], row["user gets"])
        for section, rows in content["faults"].items()
        for number, row in rows.items()
    }
    return {"fault": faults, "promise": {number: (text,) for number, text in content["promises"].items()}}


def trying(numbers):
    """Return cases for `parametrize`, each marked with the faults that it tries: {case: number or numbers}."""
    return [
        pytest.param(name, marks=pytest.mark.fault(*(tried if isinstance(tried, tuple) else (tried,))), id=name)
        for name, tried in numbers.items()
    ]


class Collector:
    """Gathers the outcome of each marked test of a run.

    Attributes
    ----------
    tests : {(kind, number): {test: outcome}}
        `kind` is "fault" or "promise", a test the file and the name of its function.
    """

    def __init__(self, page: Path | None):
        self.page = page
        self.tests = defaultdict(dict)
        self.of_node = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items):
        """Run before tests are deselected, so that these are known as not run."""
        for item in items:
            path = item.path.relative_to(CHECKOUT).as_posix()
            name = f"{path}::{getattr(item, 'originalname', None) or item.name}"
            for kind in MARKS:
                for mark in item.iter_markers(kind):
                    for number in mark.args:
                        self.tests[kind, number].setdefault(name, "not run")
                        self.of_node.setdefault(item.nodeid, set()).add((kind, number, name))

    def pytest_runtest_logreport(self, report):
        if report.when != "call" and not report.failed:
            return
        outcome = "not run" if report.skipped else report.outcome
        for kind, number, name in self.of_node.get(report.nodeid, ()):
            # of a test's cases the one that failed counts
            if self.tests[kind, number][name] != "failed":
                self.tests[kind, number][name] = outcome

    def pytest_sessionfinish(self, session):
        if hasattr(session.config, "workeroutput"):
            session.config.workeroutput["tried"] = dict(self.tests)
        elif self.page is not None:
            self.page.write_text(page_of(self.tests), encoding="utf-8")

    def pytest_testnodedown(self, node):
        """Add what a worker has tried; each has collected all tests."""
        for tried, outcomes in getattr(node, "workeroutput", {}).get("tried", {}).items():
            for name, outcome in outcomes.items():
                if outcome != "not run" and self.tests[tried].get(name) != "failed":
                    self.tests[tried][name] = outcome
                self.tests[tried].setdefault(name, outcome)


def page_of(tests=None):
    """Return the page of all faults and promises; with `tests`, also the worst outcome of the tests of each."""
    known = listed()
    lines = [
        "# Reliability",
        "",
        "What can go wrong, and the result for the user ([exit codes](questions.md)). Each row is tested.",
    ]
    if tests is None:
        tests = {(kind, number): {"": "passed"} for kind, rows in known.items() for number in rows}
    else:
        outcomes = [outcome for found in tests.values() for outcome in found.values()]
        counts = ", ".join(f"{outcomes.count(outcome)} {outcome}" for outcome in WORST_FIRST[::-1])
        lines += [
            "An outcome is given if not all tests passed.",
            "",
            f"Run of {datetime.now(UTC):%Y-%m-%d}; tests by fault and promise: {counts}.",
        ]
    section = None
    for number, (of, fault, gets) in known["fault"].items():
        if of != section:
            lines += ["", f"## {of}", "", "| | fault | result |", "| --- | --- | --- |"]
            section = of
        lines.append(_row(number, (fault, gets), tests.get(("fault", number), {})))
    lines += ["", "## Promises", "", "| | promise |", "| --- | --- |"]
    lines += [_row(number, texts, tests.get(("promise", number), {})) for number, texts in known["promise"].items()]
    return "\n".join(lines) + "\n"


def _row(number, texts, found):
    outcome = next((word for word in WORST_FIRST if word in found.values()), "not run")
    cells = [str(number), *(_plain(text) for text in texts)]
    return f"| {' | '.join(cells)}{'' if outcome == 'passed' else f' (**{outcome}**)'} |"


def _plain(text):
    return text.replace("|", "\\|").replace("<", "&lt;")
