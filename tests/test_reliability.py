"""Each fault and each promise of `faults.yaml` has a test that says so."""

import ast
from pathlib import Path

import pytest
from reliability import listed

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
