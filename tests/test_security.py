"""User files are untrusted: no shell takes them apart, and none makes objects of any
class. Ruff finds other calls that make code of data (`S` in pyproject.toml)."""

import re
from pathlib import Path

CHECKOUT = Path(__file__).parents[1]
SOURCES = [*(CHECKOUT / "src").rglob("*.py"), *(CHECKOUT / "workflow").rglob("*.py")]
RULES = [*(CHECKOUT / "workflow" / "rules").glob("*.smk"), CHECKOUT / "Snakefile"]


def test_no_source_unpickles():
    unpickles = re.compile(
        r"allow_pickle=(?!False)|import \w*pickle|import (dill|shelve)"
    )
    assert len(SOURCES) > 150
    assert [path for path in SOURCES if unpickles.search(path.read_text())] == []


def test_shell_commands_of_rules_quote_what_they_are_given():
    """Values in the text of a shell command are quoted (`:q`), but for numbers and the
    MPI launcher of a profile."""
    places = []
    for path in RULES:
        text = path.read_text()
        for block in re.findall(
            r"^SOLVE = \((.*?)^\)|^    shell:\n((?:        [^\n]*\n)*)",
            text,
            re.DOTALL | re.MULTILINE,
        ):
            texts = re.findall(r'"(.*)"', "".join(block))
            places += [
                place
                for text in texts
                for place in re.findall(r"(?<!\{)\{(?!\{)([^{}]+)\}", text)
            ]
    assert len(places) > 5
    assert {place for place in places if not place.endswith(":q")} == {
        "resources.mpi",
        "resources.tasks",
    }
