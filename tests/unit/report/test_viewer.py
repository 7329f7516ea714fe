"""The report's 3D view uses no name that it does not declare: a browser would stop
there without a word on the page."""

import re
from pathlib import Path

VIEWER = Path(__file__).parents[3] / "workflow" / "report" / "page" / "viewer.js"
DECLARED = (
    r"\b(?:const|let)\s+([^;]*?)(?=;|\n)",
    r"\b(?:class|function)\s+(\w+)",
    r"\(([^()]*)\)\s*(?:=>|\{)",
    r"(\w+)\s*=>",
)
NAME = r"[A-Za-z_$][\w$]*"
KNOWN = """
class function constructor for in if try catch return continue true false window
Float32Array Set setInterval brain paint run triangles
"""
"""Words of the language, of browsers, and methods of the view."""


def undeclared(script: str) -> set[str]:
    code = re.sub(r"//[^\n]*|\"[^\"\n]*\"|'[^'\n]*'", " ", script)
    # of templates only what is put into them
    code = re.sub(r"`[^`]*`", lambda text: " ".join(inserted(text[0])), code)
    declared = set()
    for pattern in DECLARED:
        for names in re.findall(pattern, code):
            declared |= set(re.findall(NAME, names))
    used = re.findall(rf"(?<![.\w$])({NAME})(?!\s*:)(?![\w$])", code)
    return set(used) - declared - set(KNOWN.split())


def inserted(template: str) -> list[str]:
    return re.findall(r"\$\{([^}]*)\}", template)


def test_the_view_uses_only_names_that_there_are():
    script = VIEWER.read_text()
    assert undeclared(script) == set()
    other = script.replace("brain(observed, week, map)", "brain(real, week, map)")
    assert undeclared(other) == {"real"}
