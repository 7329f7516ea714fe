"""Measure a brain of the shipped atlas with the installed gyriflow, in a temporary
folder; used by the public CI."""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from gyriflow.shipped import ATLASES, INSTALLED

STUDY = """
brains:
  - {{id: a, week: 21, labels: {labels}, scheme: spina-bifida-atlas}}
surface: {{edge_length_mm: 3.0}}
metrics: {{curvature_radius_mm: 7.0, spangy_modes: 60}}
"""


def main() -> None:
    assert INSTALLED.is_dir(), (
        f"this is a checkout, not an installed package: {INSTALLED}"
    )
    labels = (
        ATLASES
        / "spina-bifida"
        / "fetal_SB_atlas_GA21_notoperated"
        / "parcellation.nii.gz"
    )
    with TemporaryDirectory() as folder:
        config = Path(folder, "a.yaml")
        config.write_text(STUDY.format(labels=labels.as_posix()))
        command = [sys.executable, "-P", "-m", "gyriflow.cli"]
        subprocess.run(
            [*command, "measure", config, "-d", folder, "--cores", "1"],
            cwd=folder,
            check=True,
        )
        found = subprocess.run(
            [*command, "view", "--print", folder],
            check=True,
            capture_output=True,
            text=True,
        )
        report = Path(found.stdout.strip())
        assert "<html" in report.read_text(encoding="utf-8")[:1000]
        table = Path(
            folder, "results", "brains", "a", "metrics", "metrics.csv"
        ).read_text(encoding="utf-8")
        assert "gyrification_index" in table
    print("measured")


if __name__ == "__main__":
    main()
