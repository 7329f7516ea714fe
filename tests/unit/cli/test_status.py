"""How far a study is, from what lies in its folder."""

import pytest

from gyriflow.cli.launch import hold_lock
from gyriflow.cli.status import STATE, status
from gyriflow.errors import InputError
from gyriflow.io.files import write_json

RUNNING = {
    "began": "2026-01-01 10:00:00",
    "ended": None,
    "done": 3,
    "total": 10,
    "left_s": 240.0,
    "running": ["folding, run r, brain a: GW 21.50 of 23"],
    "failed": [],
    "details": "run.log",
    "interrupted": False,
}


@pytest.fixture
def study(tmp_path):
    for name in ("brains/a/surface/pial.surf.gii", "brains/b/logs/x", "runs/r/a/logs/simulate.log"):
        (tmp_path / "results" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "results" / name).touch()
    write_json(tmp_path / STATE, RUNNING)
    return tmp_path


def text(folder):
    return "\n".join(status(folder))


def test_a_live_run_tells_what_it_is_at_and_the_time_left(study):
    with hold_lock(study):
        said = text(study)
    assert "running since 2026-01-01 10:00:00: 3 of 10 steps done, about 4 min left" in said
    assert "now: folding, run r, brain a: GW 21.50 of 23" in said


def test_a_run_that_was_killed_is_called_interrupted(study):
    assert "interrupted: the run of 2026-01-01 10:00:00 ended without notice, 3 of 10 steps done" in text(study)
    assert "now:" not in text(study)
    write_json(study / STATE, RUNNING | {"ended": "2026-01-01 10:05:00", "interrupted": True})
    assert "interrupted at 2026-01-01 10:05:00, 3 of 10 steps done" in text(study)


def test_stages_of_brains_and_runs_are_told_from_their_files(study):
    rows = [line.split() for line in text(study).splitlines()]
    assert ["a", "done", "-", "-"] in rows
    assert ["b", "-", "-", "-"] in rows
    assert ["r", "a", "-", "-", "-", "-"] in rows
    progress = study / "results/runs/r/a/logs/simulate.jsonl"
    progress.write_text('{"event": "size"}\n{"event": "step", "week": 21.5, "end_week": 23.0, "left_s": 142.0}\n')
    assert "GW 21.50 of 23 " in text(study)
    write_json(study / "results/runs/r/a/folding/summary.json", {"weeks": [21.0, 22.0, 23.0]})
    assert "done, GW 23.00 " in text(study)
    assert "report:" not in text(study)


def test_a_folder_without_a_study_is_named(tmp_path):
    with pytest.raises(InputError, match=f"{tmp_path}: holds no study"):
        text(tmp_path)
