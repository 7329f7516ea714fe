"""The rules of the workflow, checked on their text: which files they name, and which are there."""

import ast
import importlib.util
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCRIPTS = sorted((ROOT / "workflow" / "scripts").glob("*.py"))
PROGRAMS = [*SCRIPTS, *(ROOT / "benchmarks").rglob("*.py"), *(ROOT / "atlases").rglob("*.py")]
RULE_FILES = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk"))]


def test_every_script_is_used_and_there():
    text = "\n".join(path.read_text() for path in RULE_FILES)
    assert set(re.findall(r"\.\./scripts/(\w+\.py)", text)) == {path.name for path in SCRIPTS}


def test_what_scripts_and_benchmarks_import_is_there():
    # imports within functions too, which only a job would otherwise try
    imported = [
        (path.name, node.module, alias.name)
        for path in PROGRAMS
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gyriflow")
        for alias in node.names
    ]
    gone = [row for row in imported if not hasattr(importlib.import_module(row[1]), row[2]) and not is_module(*row[1:])]
    assert gone == []


def is_module(package: str, name: str) -> bool:
    return importlib.util.find_spec(f"{package}.{name}") is not None
