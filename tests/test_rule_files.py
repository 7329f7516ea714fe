"""The rules of the workflow, checked on their text: what each has to name, and what has to be there."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCRIPTS = sorted((ROOT / "workflow" / "scripts").glob("*.py"))
RULE_FILES = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk"))]
PLAIN = {"config", "errors", "geometry", "io", "step", "units"}
"""What no rule names: `code` has geometry and io in it, the configuration's values are parameters themselves."""


def rules() -> dict[str, str]:
    """Returns the text of every rule by name."""
    text = "\n".join(path.read_text() for path in RULE_FILES)
    return dict(re.findall(r"^rule (\w+):\n((?:(?:[ \t].*)?\n)*)", text + "\n", flags=re.MULTILINE))


def test_every_rule_has_a_log_a_benchmark_an_environment_and_resources():
    working = {name: body for name, body in rules().items() if re.search(r"^    output:", body, flags=re.MULTILINE)}
    assert len(working) > 5
    missing = [
        f"{name}: {keyword}"
        for name, body in working.items()
        for keyword in ("log", "benchmark", "conda", "resources")
        # a download's time is the network's; with a benchmark, the table of resources would depend on what is missing
        if (name, keyword) != ("atlas_file", "benchmark")
        and not re.search(rf"^    {keyword}:", body, flags=re.MULTILINE)
    ]
    assert missing == []


def test_every_script_is_used_and_there():
    named = {name for body in rules().values() for name in re.findall(r"\.\./scripts/(\w+\.py)", body)}
    assert named == {path.name for path in SCRIPTS}


def test_every_caption_is_used_and_there():
    named = {name for body in rules().values() for name in re.findall(r"\.\./report/(\w+\.rst)", body)}
    assert named | {"workflow.rst"} == {path.name for path in (ROOT / "workflow" / "report").glob("*.rst")}


SCRIPTED = {name: body for name, body in rules().items() if "../scripts/" in body and "output:" in body}


@pytest.mark.parametrize("name", [name for name, body in SCRIPTED.items() if "code=" in body])
def test_a_change_of_the_code_that_a_script_calls_runs_its_rule_again(name):
    (script,) = re.findall(r"\.\./scripts/(\w+\.py)", SCRIPTED[name])
    (arguments,) = re.findall(r"\bcode\(([^)]*)\)", SCRIPTED[name])
    tree = ast.parse((ROOT / "workflow" / "scripts" / script).read_text())
    modules = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module]
    rooms = {module.split(".")[1] for module in modules if module.startswith("gyriflow.")}
    assert rooms - PLAIN <= set(re.findall(r'"(\w+)"', arguments))


def test_only_the_report_and_downloads_have_no_hash_of_their_code():
    # a file that is there is not fetched again
    assert {name for name, body in SCRIPTED.items() if "code=" not in body} == {"html_report", "atlas_file"}
