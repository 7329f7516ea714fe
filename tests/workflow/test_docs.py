"""What the documentation says can be done: configurations load, commands name what
there is, the site is whole."""

import importlib.util
import json
import re
import sys
from pathlib import Path

import pytest
import yaml
from configurations import labelled, touched
from facts import Facts
from processes import ran

from gyriflow.study.loading import load

CHECKOUT = Path(__file__).parents[2]
PAGES = [
    CHECKOUT / "README.md",
    *sorted(CHECKOUT.glob("docs/tutorial*.md")),
    *sorted(CHECKOUT.glob("docs/how-to/*.md")),
]
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"[\w./-]+\.(?:nii\.gz|gii|tsv|mgz|pial|white)\b")


def blocks(page, kind):
    return [match[3] for match in BLOCK.finditer(page.read_text()) if match[2] == kind]


def completed(block):
    """Return the configuration of a block that shows part of one."""
    given = yaml.safe_load(block)
    rest = {"start": "all"}
    if isinstance(given.get("brains"), list):
        rest = {"start": given["brains"][0]["id"]}
    elif not {"brains", "atlas", "participants"} & set(given):
        rest = {"brains": labelled(21, 24), "start": "a"}
    return rest | given | {"folding": {"end_week": 32} | given.get("folding", {})}


CONFIGURATIONS = [
    pytest.param(block, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, block in enumerate(blocks(page, "yaml"), start=1)
]


@pytest.mark.parametrize("block", CONFIGURATIONS)
def test_a_configuration_that_is_shown_is_one(block, tmp_path):
    touched(tmp_path, *FILE.findall(block), "labels.nii.gz")
    (tmp_path / "participants.tsv").write_text(
        "participant_id\tgestational_age\tfiles\ns1\t24.1\tlabels.nii.gz\n"
    )
    assert load(completed(block), tmp_path).runs


def test_targets_and_files_of_commands_that_are_shown_exist():
    rules = [CHECKOUT / "Snakefile", *CHECKOUT.glob("workflow/rules/*.smk")]
    texts = "".join(path.read_text() for path in rules)
    targets = set(re.findall(r"^rule (\w+):", texts, re.MULTILINE))
    shown = "\n".join(block for page in PAGES for block in blocks(page, ""))
    commands = re.findall(r"^ *\./run gyriflow run [^#\n]*", shown, re.MULTILINE)
    assert len(commands) > 5
    for command in commands:
        assert set(re.findall(r"--stage ([a-z_]+)", command)) <= targets, command
        for file in re.findall(r"\bconfig/\S+", command):
            assert (CHECKOUT / file).exists(), command


@pytest.mark.parametrize("name", ["keys.md", "api.md"])
def test_pages_that_are_made_from_the_code_are_those_of_this_code(name):
    program = CHECKOUT / "docs" / "reference.py"
    spec = importlib.util.spec_from_file_location("reference", program)
    reference = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reference)
    # ./run python docs/reference.py
    assert (CHECKOUT / "docs" / name).read_text() == reference.PAGES[name]()


def test_the_examples_in_python_run(tmp_path, monkeypatch, capsys):
    (tmp_path / "atlases").symlink_to(CHECKOUT / "atlases")
    monkeypatch.chdir(tmp_path)
    page = CHECKOUT / "docs" / "how-to" / "python.md"
    names = {}
    for block in blocks(page, "python"):
        exec(block, names)
    assert capsys.readouterr().out == Facts("mm²", "gyrification_index")
    assert (tmp_path / "depth.png").stat().st_size > 10_000


GALLERY = CHECKOUT / "docs" / "how-to" / "bad-inputs.md"
MAX_GALLERY_MB = 1.5
MOST_WORDS = 30_000
"""In docs/, without the pages that are made from the code."""


def test_pictures_are_all_shown_and_those_of_the_gallery_small():
    pages = [CHECKOUT / "README.md", *CHECKOUT.glob("docs/**/*.md")]
    shown = {
        (page.parent / link).resolve()
        for page in pages
        for link in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text())
    }
    assert shown == set(CHECKOUT.glob("docs/images/**/*.png"))
    pictures = list(CHECKOUT.glob("docs/images/gallery/*.png"))
    assert len(pictures) >= 10
    size = sum(picture.stat().st_size for picture in pictures)
    assert size < MAX_GALLERY_MB * 1e6


def test_the_pages_have_no_more_words_than_somebody_reads():
    made = ("keys.md", "api.md")
    pages = [page for page in CHECKOUT.glob("docs/**/*.md") if page.name not in made]
    words = [word for page in pages for word in page.read_text().split()]
    assert sum(bool(re.search(r"\w", word)) for word in words) <= MOST_WORDS


@pytest.mark.slow
@pytest.mark.extended
def test_the_gallery_has_the_words_of_each_case(tmp_path):
    program = CHECKOUT / "benchmarks" / "gallery.py"
    done = ran(sys.executable, str(program), str(tmp_path), timeout_s=3600)
    assert done.returncode == 0, done.stderr
    page = " ".join(GALLERY.read_text().split())
    cases = json.loads(done.stdout.splitlines()[-1])
    missing = [
        f"{name}: {text}"
        for name, case in cases.items()
        for text in [case["verdict"], *case["messages"]]
        if text not in page
    ]
    assert missing == []
    assert len(cases) >= 10


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path):
    site = tmp_path / "site"
    done = ran("mkdocs", "build", "--strict", "--site-dir", str(site), cwd=CHECKOUT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (site / "how-to" / "extend.html").exists()
