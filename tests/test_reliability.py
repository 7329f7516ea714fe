"""Each fault and each promise of `faults.yaml` has a test that says so."""

import ast
import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from reliability import Collector, listed, page_of

TESTS = Path(__file__).parent


def marked():
    """Return the numbers that tests name by kind, read from their sources: marks and tables of cases."""
    found = {"fault": set(), "promise": set()}
    for path in TESTS.rglob("test_*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in found:
                found[name] |= {number.value for number in node.args if isinstance(number, ast.Constant)}
            elif name == "trying":
                numbers = [n.value for n in ast.walk(node) if isinstance(n, ast.Constant)]
                found["fault"] |= {number for number in numbers if isinstance(number, int)}
    return found


@pytest.mark.parametrize("kind", ["fault", "promise"])
def test_every_number_has_a_test_and_every_test_a_number_that_is_listed(kind):
    numbers = set(listed()[kind])
    assert marked()[kind] == numbers
    assert numbers == set(range(1, len(numbers) + 1))


def item(name, *numbers):
    marks = [SimpleNamespace(args=numbers)]
    return SimpleNamespace(
        path=TESTS / "test_x.py",
        originalname=name,
        name=f"{name}[case]",
        nodeid=f"{name}[{numbers}]",
        iter_markers=lambda kind: marks if kind == "fault" else [],
    )


def report(node, outcome, when="call"):
    return SimpleNamespace(
        nodeid=node.nodeid, when=when, outcome=outcome, failed=outcome == "failed", skipped=outcome == "skipped"
    )


def test_the_page_tells_the_worst_outcome_of_each_fault(tmp_path):
    nodes = item("test_good", 1), item("test_bad", 2), item("test_bad", 2, 3), item("test_asleep", 4)
    collector = Collector(tmp_path / "page.md")
    collector.pytest_collection_modifyitems(nodes)
    for node, outcome in zip(nodes, ["passed", "failed", "passed"], strict=False):
        collector.pytest_runtest_logreport(report(node, "passed", "setup"))
        collector.pytest_runtest_logreport(report(node, outcome))
    collector.pytest_runtest_logreport(report(nodes[3], "skipped"))
    # what another worker has tried
    elsewhere = {("fault", 3): {"tests/test_x.py::test_bad": "not run"}, ("fault", 5): {"test_far": "passed"}}
    collector.pytest_testnodedown(SimpleNamespace(workeroutput={"tried": elsewhere}))
    collector.pytest_sessionfinish(SimpleNamespace(config=SimpleNamespace()))
    page = (tmp_path / "page.md").read_text()
    rows = page.partition("## Promises")[0].splitlines()
    told = {number: row for row in rows if row.startswith("| ") for number in row.split()[1:2]}
    marks = {number: re.findall(r"\(\*\*(.*)\*\*\) \|$", told[number]) for number in "12345"}
    assert marks == {"1": [], "2": ["failed"], "3": [], "4": ["not run"], "5": []}


def test_the_page_shows_text_as_text():
    assert "&lt;script>" in page_of({})
