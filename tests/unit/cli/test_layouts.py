"""Scans, ages and files of folders as public data sets and pipelines have them, and
files that cannot be used."""

import pytest
from configurations import from_yaml
from facts import Facts
from scan_trees import make_tree
from shapes import cerebrum_surface, phantom

from gyriflow.cli.recognition import recognise
from gyriflow.errors import InputError
from gyriflow.io.surfaces import write_surface


def both(pattern):
    """Return the paths of both sides, such as {lh,rh}.pial, or a path as it is."""
    before, is_pair, rest = pattern.partition("{")
    sides, _, after = rest.partition("}")
    return [before + side + after for side in sides.split(",")] if is_pair else [before]


def brains(folder, **options):
    """Return week, files, white ones last, and causes of each scan by id."""
    found = {}
    for brain in recognise(folder, **options).brains:
        files = brain.files.split(", ") + brain.entry.get("white", [])
        week, causes = brain.entry["week"], " ".join(brain.causes)
        found[brain.entry["id"]] = week, files, causes
    return found


DATA_SETS = from_yaml(
    """
FeTA:
  files: [sub-026/anat/sub-026_rec-mial_dseg.nii.gz]
  tables: {participants.tsv: participant_id Gestational-age | sub-026 23.3}
  found: {sub-026: 23.3 sub-026/anat/sub-026_rec-mial_dseg.nii.gz}
# several kinds of one scan are asked for, with ages at the scan of sessions
dHCP:
  files:
  - derivatives/dhcp/sub-C6/ses-30/anat/sub-C6_ses-30_desc-drawem9_dseg.nii.gz
  - derivatives/dhcp/sub-C6/ses-30/anat/sub-C6_ses-30_hemi-{L,R}_pial.surf.gii
  tables:
    participants.tsv: participant_id sex birth_age | C6 F 39.1
    sub-C6/sub-C6_sessions.tsv: session_id scan_age | 30 29.71
  found:
    sub-C6_ses-30:
      29.71 derivatives/dhcp/sub-C6/ses-30/anat/sub-C6_ses-30_hemi-{L,R}_pial.surf.gii
    sub-C6_ses-30-2:
      29.71 derivatives/dhcp/sub-C6/ses-30/anat/sub-C6_ses-30_desc-drawem9_dseg.nii.gz
  note: keep one
fetpype:
  files: [derivatives/nesvor_bounti/sub-01/ses-01/anat/sub-01_ses-01_dseg.nii.gz]
  tables: {participants.tsv: participant_id session_id ga | sub-01 ses-01 24+3}
  found:
    sub-01_ses-01:
      24.43 derivatives/nesvor_bounti/sub-01/ses-01/anat/sub-01_ses-01_dseg.nii.gz
# a template's space and meshes beside the subject's own
NiBabies:
  files:
  - sub-01/anat/sub-01_space-MNIInfant_cohort-1_dseg.nii.gz
  - sub-01/anat/sub-01_hemi-{L,R}_pial.surf.gii
  - sub-01/anat/sub-01_hemi-{L,R}_white.surf.gii
  - sub-01/anat/sub-01_hemi-{L,R}_space-fsLR_den-32k_pial.surf.gii
  - sub-01/anat/sub-01_label-GM_probseg.nii.gz
  tables: {participants.tsv: participant_id pma | sub-01 41.2}
  found:
    sub-01:
      41.2 sub-01/anat/sub-01_hemi-{L,R}_pial.surf.gii
      sub-01/anat/sub-01_hemi-{L,R}_white.surf.gii
# with its template
FreeSurfer:
  files:
  - subjects/sub-01/surf/{lh,rh}.pial
  - subjects/sub-01/surf/{lh,rh}.pial.T1
  - subjects/sub-01/surf/{lh,rh}.white
  - subjects/sub-01/surf/{lh,rh}.sphere
  - subjects/sub-02/surf/{lh,rh}.pial.T1
  - subjects/fsaverage/surf/{lh,rh}.pial
  - subjects/sub-01/mri/aseg.mgz
  - subjects/sub-01/mri/aparc+aseg.mgz
  tables: {subjects/participants.tsv: participant_id week | sub-01 36 | sub-02 37}
  found:
    sub-01: 36 subjects/sub-01/surf/{lh,rh}.pial subjects/sub-01/surf/{lh,rh}.white
    sub-02: 37 subjects/sub-02/surf/{lh,rh}.pial.T1
# without sub-
Infant FreeSurfer:
  files: ["case7/surf/{lh,rh}.pial", "case8/surf/{lh,rh}.pial", case7/mri/aseg.mgz]
  tables: {participants.tsv: participant_id week | case7 36 | case8 37}
  found: {case7: "36 case7/surf/{lh,rh}.pial", case8: "37 case8/surf/{lh,rh}.pial"}
HCP:
  files:
  - 1003/T1w/Native/1003.{L,R}.pial.native.surf.gii
  - 1003/T1w/Native/1003.{L,R}.white.native.surf.gii
  - 1003/T1w/fsaverage_LR32k/1003.{L,R}.pial.32k_fs_LR.surf.gii
  - 1003/MNINonLinear/Native/1003.{L,R}.pial.native.surf.gii
  tables: {participants.tsv: participant_id week | 1003 36}
  found:
    "1003":
      36 1003/T1w/Native/1003.{L,R}.pial.native.surf.gii
      1003/T1w/Native/1003.{L,R}.white.native.surf.gii
dHCP's atlas:
  files:
  - week22.{left,right}.pial.surf.gii
  - week22.{left,right}.wm.surf.gii
  - week22.{left,right}.sphere.surf.gii
  found:
    week22: 22 week22.{left,right}.pial.surf.gii week22.{left,right}.wm.surf.gii
"""
)


@pytest.mark.parametrize("case", DATA_SETS.values(), ids=DATA_SETS)
def test_a_data_set_is_read_as_it_is(tmp_path, case):
    contents = {"labels": [], "surfaces": [], "tables": {}}
    for pattern in case["files"]:
        is_volume = pattern.endswith((".nii.gz", ".mgz"))
        contents["labels" if is_volume else "surfaces"] += both(pattern)
    for path, rows in case.get("tables", {}).items():
        contents["tables"][path] = rows.split(" | ")
    expected = {}
    for name, text in case["found"].items():
        week, *patterns = text.split()
        files = [file for pattern in patterns for file in both(pattern)]
        note = Facts(case["note"]) if "note" in case else ""
        expected[name] = float(week), files, note
    assert brains(make_tree(tmp_path, **contents)) == expected


def test_a_clone_of_git_annex_has_scans_with_and_without_contents(tmp_path):
    lost = ["sub-01_week24_dseg.nii.gz", *both("sub-02_week25/surf/{lh,rh}.pial")]
    make_tree(tmp_path, lost=lost, labels=["sub-03_week26_dseg.nii.gz"])
    assert brains(tmp_path) == {
        "sub-01": (24.0, lost[:1], Facts(lost[0])),
        "sub-02": (25.0, lost[1:], Facts("lh.pial")),
        "sub-03": (26.0, ["sub-03_week26_dseg.nii.gz"], ""),
    }


KEEP_ONE = Facts("2 files", "keep one")
WEEK = "sub-01_week24"


@pytest.mark.parametrize(
    ("kind", "files", "facts"),
    [
        ("labels", [f"{WEEK}_space-MNI152NLin6Asym_dseg.nii.gz"], ["MNI152NLin6Asym"]),
        ("labels", [f"{WEEK}_space-dhcpSym_dseg.nii.gz"], ["dhcpSym"]),
        ("labels", [f"{WEEK}_space-T2w_dseg.nii.gz"], []),
        ("labels", [f"tpl-x/{WEEK}_dseg.nii.gz"], ["tpl-x"]),
        ("labels", [f"sub-02/{WEEK}_dseg.nii.gz"], ["sub-01", "sub-02"]),
        ("labels", ["week24/sub-mü_dseg.nii.gz"], ["sub-mü"]),
        ("torn", [f"{WEEK}_dseg.nii.gz"], [f"{WEEK}_dseg.nii.gz"]),
        ("surfaces", both(f"{WEEK}/{{lh,rh}}.white"), ["white", "pial"]),
        ("surfaces", [f"{WEEK}/lh.pial"], []),
        ("surfaces", [f"{WEEK}/lh.pial", f"{WEEK}/rh.sphere"], ["right", "rh.sphere"]),
        ("surfaces", [f"{WEEK}/lh.pial", f"{WEEK}/label/rh.a.annot"], ["rh.a.annot"]),
        (
            "surfaces",
            [*both(f"{WEEK}/{{lh,rh}}.pial"), f"{WEEK}/lh.white"],
            ["lh.white"],
        ),
        (
            "surfaces",
            [f"{WEEK}/left/lh.pial", f"{WEEK}/right/lh.pial"],
            ["left/lh.pial", "right/lh.pial"],
        ),
        ("surfaces", both(f"{WEEK}_hemi-{{L,R}}_space-fsLR_den-32k_pial.surf.gii"), []),
        # the second is a link to nowhere
        ("lost", [f"{WEEK}/lh.pial", f"{WEEK}/rh.pial"], ["rh.pial"]),
        (
            "lost",
            [*both(f"{WEEK}/{{lh,rh}}.pial"), f"{WEEK}/lh.white", f"{WEEK}/rh.white"],
            ["rh.white"],
        ),
    ],
)
def test_files_that_cannot_be_used_are_named(tmp_path, kind, files, facts):
    contents = {kind: files}
    if kind == "torn":
        contents = {"text": {files[0]: "no labels"}}
    elif kind == "lost":
        contents = {"surfaces": files[:-1], "lost": files[-1:]}
    ((_, _, cause),) = brains(make_tree(tmp_path, **contents)).values()
    assert cause == (Facts(*facts) if facts else "")


@pytest.mark.parametrize(
    ("files", "surfaces", "cause"),
    [
        # of one data set
        (["anat/sub-01_dseg.nii.gz"], "surf/sub-01_hemi-{L,R}_pial.surf.gii", KEEP_ONE),
        (["a/sub-01_dseg.nii.gz"], "b/sub-01_hemi-{L,R}_pial.surf.gii", KEEP_ONE),
        (["anat/sub-01_dseg.nii.gz", "seg/sub-01_desc-x_dseg.nii.gz"], "", KEEP_ONE),
        # of two
        (
            ["siteA/anat/sub-01_dseg.nii.gz", "siteB/anat/sub-01_dseg.nii.gz"],
            "",
            Facts("siteA", "siteB"),
        ),
    ],
)
def test_folders_of_kinds_of_data_are_not_data_sets(tmp_path, files, surfaces, cause):
    make_tree(tmp_path, labels=files, surfaces=both(surfaces) if surfaces else [])
    assert [found for _, _, found in brains(tmp_path).values()] == [cause] * 2


def test_closed_surfaces_of_whole_brains_are_recognised(tmp_path):
    brain = cerebrum_surface(*phantom(24.0, 2.0))
    for name in ("24.stl", "week25.ply", "skull.stl"):
        write_surface(tmp_path / name, brain)
    write_surface(tmp_path / "nut.stl", type(brain)(0.1 * brain.vertices, brain.faces))
    assert brains(tmp_path) == {
        "week25": (25.0, ["week25.ply"], ""),
        "24": ("CHOOSE", ["24.stl"], Facts("week")),
    }
    assert recognise(tmp_path).unused == {"nut.stl": Facts("mL", 15, 700)}


@pytest.mark.parametrize(
    "files",
    [
        # sides in other folders, in another order of parts, as single letters
        ["sub-01/lh/lh.pial", "sub-01/rh/rh.pial"],
        ["sub-01_run-1_hemi-L_pial.surf.gii", "sub-01_hemi-R_run-1_pial.surf.gii"],
        ["sub-01_L.stl", "sub-01_R.stl"],
    ],
)
def test_both_sides_of_a_scan_are_found_wherever_they_are(tmp_path, files):
    (brain,) = recognise(make_tree(tmp_path, surfaces=files)).brains
    assert (brain.entry["id"], brain.problem) == ("sub-01", "")
    assert brain.entry["hemispheres"] == dict(
        zip(("left", "right"), files, strict=True)
    )


def test_a_torn_file_beside_a_good_one_and_other_meshes_are_not_chosen_between(
    tmp_path,
):
    torn = {"sub-01_desc-x_dseg.nii.gz": "torn", "sub-01_placenta.stl": "x"}
    make_tree(tmp_path, labels=["sub-01_dseg.nii.gz"], text=torn)
    first, _ = recognise(tmp_path).brains
    assert (first.entry["id"], first.problem) == ("sub-01", "")
    assert not [note for note in first.notes if "keep one" in note]


def test_links_to_folders_that_are_not_there_are_scans_that_cannot_be_read(tmp_path):
    make_tree(tmp_path, labels=["sub-01_week24_dseg.nii.gz"])
    (tmp_path / "sub-02").symlink_to("nowhere")
    assert brains(tmp_path)["sub-02"] == ("CHOOSE", ["sub-02"], Facts("link"))


def test_only_results_of_gyriflow_are_passed_over(tmp_path):
    own = "own/results/brains/a/week25_dseg.nii.gz"
    make_tree(
        tmp_path,
        labels=["results/week24_dseg.nii.gz", own],
        text={"own/results/study/study.json": "{}"},
    )
    assert list(brains(tmp_path)) == ["week24"]
    with pytest.raises(InputError, check=Facts(tmp_path / "own")):
        recognise(tmp_path / "own")


def test_scans_and_tables_in_formats_that_are_not_read_are_named(tmp_path):
    foreign = {
        "case3_week26.seg.nrrd": "NRRD0005",
        "case4_week27_label.mha": "NDims = 3",
        # exported, too
        "case1_week24_seg.seg.nrrd": "NRRD0005",
        "image.nrrd": "NRRD0005",
        "participants.xlsx": "PK",
    }
    labels = ["case1_week24_seg.nii.gz", "case2_week25_seg.nii.gz"]
    found = recognise(make_tree(tmp_path, labels=labels, text=foreign))
    assert [brain.entry["week"] for brain in found.brains] == [24, 25]
    assert found.unused == {
        "case3_week26.seg.nrrd": Facts("NIfTI"),
        "case4_week27_label.mha": Facts("NIfTI"),
        "participants.xlsx": Facts(".tsv"),
    }
    for path in tmp_path.glob("*.nii.gz"):
        path.unlink()
    with pytest.raises(InputError, check=Facts("case3_week26.seg.nrrd", "NIfTI")):
        recognise(tmp_path)
