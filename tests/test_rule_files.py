"""The rules of the workflow, checked on their text: what each has to name, and what has to be there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCRIPTS = sorted((ROOT / "workflow" / "scripts").glob("*.py"))
RULE_FILES = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk"))]


def rules() -> dict[str, str]:
    """Returns the text of every rule by name."""
    text = "\n".join(path.read_text() for path in RULE_FILES)
    return dict(re.findall(r"^rule (\w+):\n((?:(?:[ \t].*)?\n)*)", text + "\n", flags=re.MULTILINE))


def test_every_rule_has_a_log_a_benchmark_and_an_environment():
    working = {name: body for name, body in rules().items() if re.search(r"^    output:", body, flags=re.MULTILINE)}
    assert len(working) > 5
    missing = [
        f"{name}: {keyword}"
        for name, body in working.items()
        for keyword in ("log", "benchmark", "conda")
        # a download's time is the network's; with a benchmark, the table of resources would depend on what is missing
        if (name, keyword) != ("atlas_file", "benchmark")
        and not re.search(rf"^    {keyword}:", body, flags=re.MULTILINE)
    ]
    assert missing == []


def test_every_script_is_used_and_there():
    named = {name for body in rules().values() for name in re.findall(r"\.\./scripts/(\w+\.py)", body)}
    assert named == {path.name for path in SCRIPTS}


def test_every_caption_is_used_and_there():
    named = {name for body in rules().values() for name in re.findall(r"\b(\w+\.rst)\b", body)}
    assert named | {"workflow.rst"} == {path.name for path in (ROOT / "workflow" / "report").glob("*.rst")}
