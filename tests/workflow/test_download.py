"""`snakemake download` with the real command, against a server on this machine."""

import socket

import pytest
from local_server import Server, gifti, packed, serving

ROOT = "kcl_cdb/{}/raw/master/{}"
SURFACES = "dhcp_fetal_brain_surface_atlas"
VOLUMES = "fetal_brain_mri_atlas"
WEEKS = (21, 22)
FILES = {
    f"{SURFACES}/atlas/fetal.week{week}.{side}.pial.surf.gii": gifti(f"{week} {side}")
    for week in WEEKS
    for side in ("left", "right")
} | {
    f"{VOLUMES}/{name}": packed(200_000, seed)
    for week in WEEKS
    for seed, name in enumerate(
        (f"parcellations/tissue-t{week}.00_dhcp-19.nii.gz", f"structural/t2-t{week}.00.nii.gz"), week
    )
}
"""The files by their paths in the atlas folder."""
LONG = f"{VOLUMES}/parcellations/tissue-t21.00_dhcp-19.nii.gz"


def address(name: str) -> str:
    """Returns the path at the server of a file of the atlas folder."""
    repository, _, path = name.partition("/")
    return ROOT.format(repository, path)


@pytest.fixture(autouse=True)
def no_proxy(monkeypatch):
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")


@pytest.fixture
def server():
    with serving(Server({address(name): content for name, content in FILES.items()})) as running:
        yield running


def study(url):
    return {
        "atlas": {"folder": "atlas", "weeks": list(WEEKS), "url": url},
        "start": "surface-week21",
        "folding": {"end_week": 22},
    }


def files_in(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_the_atlas_is_fetched_once_and_then_planned(workflow, server):
    name = workflow.write("study.yaml", study(server.url))
    before = workflow.run("-n", "growth", "--configfile", name)
    assert before.returncode == 2
    assert "lacks the surface files of weeks 21, 22" in before.stderr
    assert "lacks the volume files of weeks 21, 22" in before.stderr
    assert "`./run snakemake --cores 1 download`" in before.stderr

    server.broken_after[address(LONG)] = [120_000]
    first = workflow.run("download", "--cores", "1", "--configfile", name)
    assert first.returncode == 0, first.stderr
    folder = workflow.directory / "atlas"
    assert files_in(folder) == {*FILES, "checksums.txt"}
    assert all((folder / file).read_bytes() == content for file, content in FILES.items())
    assert [asked for path, asked in server.asked if path == address(LONG)] == [None, "bytes=120000-"]
    assert f"gyriflow: 8 of 8: {VOLUMES}/structural/t2-t22.00.nii.gz" in first.stderr

    # a file that is damaged later is named, and no other is fetched again
    server.asked.clear()
    (folder / LONG).write_bytes(FILES[LONG][:-1])
    second = workflow.run("download", "--cores", "1", "--configfile", name)
    assert second.returncode == 5
    assert f"not as recorded on first use: {LONG}" in second.stderr
    (folder / LONG).unlink()
    third = workflow.run("download", "--cores", "1", "--configfile", name)
    assert third.returncode == 0, third.stderr
    assert server.asked == [(address(LONG), None)]

    further = study(server.url)
    further["atlas"]["weeks"] = [21, 21.5, 23]
    lacking = workflow.run("-n", "growth", "--configfile", workflow.write("further.yaml", further))
    assert lacking.returncode == 2
    for source in ("surface", "volume"):
        assert f"has no {source} files of week 21.5; present: 21, 22." in lacking.stderr
        assert f"lacks the {source} files of week 23, such as " in lacking.stderr

    jobs = workflow.jobs("growth", "--configfile", name)
    assert (jobs["poses"], jobs["pial_from_labels"], jobs["pial_from_hemispheres"], jobs["growth_rates"]) == (
        1,
        2,
        2,
        1,
    )


def test_no_network_ends_in_5_with_one_message_and_nothing_torn(workflow):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        name = workflow.write("study.yaml", study(f"http://127.0.0.1:{free.getsockname()[1]}"))
        outcome = workflow.run("download", "--cores", "1", "--configfile", name)
    assert outcome.returncode == 5
    assert "Traceback" not in outcome.stderr
    assert outcome.stderr.count("gyriflow: http://") == 1
    assert "cannot be fetched; found" in outcome.stderr
    assert "Connection refused" in outcome.stderr
    assert files_in(workflow.directory / "atlas") == set()


def test_without_an_atlas_there_is_nothing_to_download(workflow):
    name = workflow.write(
        "study.yaml", {"brains": [{"id": "a", "week": 21, "phantom": {}}], "start": "a"} | {"folding": {"end_week": 22}}
    )
    outcome = workflow.run("download", "--cores", "1", "--configfile", name)
    assert outcome.returncode == 2
    assert "nothing to download; expected a section `atlas` in the configuration" in outcome.stderr
