"""What the documentation says can be done: configurations load, commands have work to do, the site has no warning."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest
import yaml
from configurations import labelled

from gyriflow.config import load

CHECKOUT = Path(__file__).parents[2]
PAGES = [CHECKOUT / "README.md", CHECKOUT / "docs" / "tutorial.md", *sorted(CHECKOUT.glob("docs/how-to/*.md"))]
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
BRAINS = labelled(21, 24)
FILE = re.compile(r"[\w./-]+\.(?:nii\.gz|gii|tsv|mgz|pial|white)\b")


def blocks(page, kind):
    return [match[3] for match in BLOCK.finditer(page.read_text()) if match[2] == kind]


def completed(block):
    """Returns the configuration of a block that shows part of one."""
    given = yaml.safe_load(block)
    if {"brains", "atlas", "participants"} & set(given):
        rest = {"start": given["brains"][0]["id"]} if isinstance(given.get("brains"), list) else {"start": "all"}
    else:
        rest = {"brains": BRAINS, "start": "a"}
    return rest | given | {"folding": {"end_week": 32} | given.get("folding", {})}


def study_of(page):
    """Returns a study of synthetic brains with the settings that a page shows."""
    study = {"brains": BRAINS, "start": "a", "folding": {"end_week": 24}}
    for block in blocks(page, "yaml"):
        shown = yaml.safe_load(block)
        study |= {name: shown[name] for name in ("runs", "studies", "calibrate") if name in shown}
    return study


CONFIGURATIONS = [
    pytest.param(block, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, block in enumerate(blocks(page, "yaml"), start=1)
]


@pytest.mark.parametrize("block", CONFIGURATIONS)
def test_a_configuration_that_is_shown_is_one(block, tmp_path):
    for name in FILE.findall(block):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "participants.tsv").write_text("participant_id\tage\tfiles\ns1\t24.1\tlabels.nii.gz\n")
    (tmp_path / "labels.nii.gz").touch()
    assert load(completed(block), tmp_path).runs


def test_functions_that_the_api_lists_exist():
    named = re.findall(r"^::: ([\w.]+)\.(\w+)$", (CHECKOUT / "docs" / "api.md").read_text(), flags=re.MULTILINE)
    sources = {module: CHECKOUT / "src" / f"{module.replace('.', '/')}.py" for module, _ in named}
    missing = [
        f"{module}.{name}"
        for module, name in named
        if not sources[module].exists()
        or not re.search(rf"^(def|class) {name}\b", sources[module].read_text(), flags=re.MULTILINE)
    ]
    assert len(named) > 5
    assert missing == []


def options_of(line):
    """Returns what a command that runs the workflow gives to Snakemake."""
    command, *words = shlex.split(line, comments=True)[1:]
    if command == "snakemake":
        return " ".join(words)
    _, configuration, *further = words
    given = [] if configuration == "config/config.yaml" else ["--configfile", configuration]
    return " ".join([*given, *("--directory" if word == "-d" else word for word in further if word != "--stage")])


# a command that several pages show is tried once, one with a page's own study on each page; those for clusters are not
COMMANDS = {
    (page if "my.yaml" in line else None, options_of(line)): page
    for page in PAGES
    for block in blocks(page, "")
    for line in block.splitlines()
    if line.strip().startswith(("./run snakemake", "./run gyriflow run"))
    if not re.search(r"\{|BRAIN|--profile|retrieve", line)
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "options"),
    [pytest.param(page, options, id=f"{page.stem}: {options[:60]}") for (_, options), page in COMMANDS.items()],
)
def test_a_command_that_is_shown_has_work_to_do(page, options, workflow):
    if "my.yaml" in options:
        (workflow.directory / "my.yaml").write_text(yaml.safe_dump(study_of(page)))
    assert workflow.jobs(*options.split())


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path):
    command = ["mkdocs", "build", "--strict", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "site" / "how-to" / "extend.html").exists()
