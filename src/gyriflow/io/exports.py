"""Surfaces, maps and tables of a study as BIDS derivatives."""

import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..geometry.triangles import Floats, transformed
from ..names import bids_label, bids_subject, folder_name, require_bids_names
from ..quantities import VERTEX_MAPS
from ..settings.terms import OBSERVED, STRUCTURES, Side
from .files import AnyPath, atomic_write, files_below, read_json, write_json, write_text
from .made_files import making_files, require_own_data_set
from .surfaces import (
    Layer,
    read_pose,
    read_surface,
    read_vertex_maps,
    write_surface,
    write_vertex_maps,
)
from .volumes import LabelVolume, write_label_volume

if TYPE_CHECKING:
    import pandas as pd

BIDS_VERSION = "1.10.0"
STUDY_TABLES = ("participants", "metrics_wide", "metrics_long")
"""Tables of all subjects."""
IGNORED = """\
# BIDS has no names for surfaces and the maps on them yet: these are those that its
# proposal BEP011 has for them
*.surf.gii
*.shape.gii
{kinds}
# tables of the whole study, its report, and files to keep
/metrics_*
/report.html
/brains
/methods.rst
figures
/work
"""
README = """\
# gyriflow derivatives

Pial surfaces of fetal brains, maps of folding on them, and simulated brains of later
weeks, made by gyriflow {version}.

- `*_pial.surf.gii`: surfaces, in the world coordinates (RAS+ mm) of the input's
  volumes; `*_curv.shape.gii` and others: a map with a value at each of their vertices,
  described with its unit in the file `.json` of its name. Those of a `space-` are at
  the vertices of the pial surfaces of that subject and session.
- `desc-…`: simulated brains of a run at a week; `descriptions.tsv` has a row for each.
  `*_dseg.nii.gz` are their labels in the grid of the start's: `dseg.tsv`.
- `participants.tsv` and `sessions.tsv`: gestational ages in weeks. `metrics_wide.tsv`
  has a row for each brain, `metrics_long.tsv` one for each number; `metrics_wide.json`
  has units.
"""
PEOPLE = {
    "gestational_age": {"Description": "Gestational age at the scan", "Units": "weeks"},
    "brain": {"Description": "Name of the brain in gyriflow's own results"},
}
OWN_COLUMNS = ("participant_id", "session_id", "gestational_age", "brain")
"""The columns of the tables of people that are not covariates."""
COLUMNS = {
    "brain": PEOPLE["brain"],
    "run": {"Description": f"Run of the simulation; {OBSERVED}: the observed brain"},
    "week": {"Description": "Gestational age", "Units": "weeks"},
}
COLUMNS_OF_NUMBERS = {
    "hemisphere": {"Description": "left, right, or whole: both together"},
    "region": {"Description": "Region of the cortex; n/a: all of it"},
    "metric": {"Description": "Name of the metric"},
    "value": {"Description": "Value of the metric, in the unit of its row"},
    "unit": {"Description": "Unit of the value; 1: none"},
}
LABELS_FILE = "{}{}_dseg.nii.gz"
EXPORTED_TISSUES = ((1, "cerebrum within the cortex"), (2, "cortex"))
OF_INPUT = {"Description": "As in the tables of the input"}
SESSION = re.compile(r"_ses-([A-Za-z0-9]+)")
Place = tuple[Path, str]
"""What the paths of a brain's files begin with, and the entity `desc-` of simulated
brains."""
BidsNames = Mapping[str, tuple[str, str | None]]
"""Subject and session of each measured brain, None where the study needs no
sessions."""


class ExportedBrain(NamedTuple):
    """A brain at a week and its files by side; regions may be empty.

    The run is "observed" for observed brains; simulated ones have brain, subject and
    covariates of their start. `template_maps` are at another brain's vertices.
    Simulated brains of labels have a `volume`: the start's `labels`, whose grid is
    used, and `surface` and `thickness` of the whole brain.
    """

    brain: str
    run: str
    week: float
    subject: str
    surfaces: Mapping[Side, str]
    maps: Mapping[Side, str]
    regions: Mapping[Side, str]
    report: str
    covariates: Mapping[str, str]
    white: Mapping[Side, str] = {}
    white_maps: Mapping[Side, str] = {}
    template: str | None = None
    template_maps: Mapping[Side, str] = {}
    volume: Mapping[str, Any] = {}


def export_bids(
    folder: AnyPath,
    brains: Sequence[ExportedBrain],
    tables: Mapping[str, "pd.DataFrame"],
    version: str,
    columns: Mapping[str, tuple[str, str]],
) -> None:
    """Write a BIDS derivative: a file for each map, simulated brains under
    `desc-RUNgwWEEK`, tables as TSV.

    Brains of no named session have their week's, where a subject has several. Surfaces
    lie in the world of the brain's volumes, unless its sides were posed separately.
    `tables` have the columns subject, run and week; `columns` has description and unit
    of each in `metrics_wide`. InputError where two subjects, runs or brains would have
    one name.
    """
    # takes a third of a second, which a dry run need not wait for
    import pandas as pd

    folder = Path(folder)
    observed = [brain for brain in brains if brain.run == OBSERVED]
    require_bids_names(
        [brain.subject for brain in observed], [brain.run for brain in brains]
    )
    names = _subjects_and_sessions(observed)
    space, reference = _template(observed, names)
    places = _places(folder, brains, names)
    sidecars: dict[str, dict[str, Any]] = {}
    for brain, place in zip(brains, places, strict=True):
        pose = read_pose(brain.report)
        sidecars |= _write_surfaces(
            place, brain, pose.inverse if pose.together else np.eye(4)
        )
        sidecars |= _write_maps(place, brain, space, reference)
        if brain.volume and pose.together:
            write_label_volume(
                LABELS_FILE.format(*place),
                _labels(brain, pose.inverse),
            )
            _write_tsv(
                folder / "dseg.tsv",
                pd.DataFrame(EXPORTED_TISSUES, columns=["index", "name"]),
            )
    for suffix, sidecar in sidecars.items():
        write_json(folder / f"{suffix}.json", sidecar)
    kinds = "\n".join(f"/{suffix}.json" for suffix in sorted(sidecars))
    write_text(folder / ".bidsignore", IGNORED.format(kinds=kinds))
    write_text(folder / "README.md", README.format(version=version))
    if descriptions := _descriptions(brains, places):
        _write_tsv(
            folder / "descriptions.tsv",
            pd.DataFrame(
                descriptions.items(),
                columns=["desc_id", "description"],
            ),
        )
    _write_people(folder, observed, names)
    for name, table in tables.items():
        ids = [names[brain] for brain in table["subject"]]
        table = table.rename(columns=_column_of_input).rename(
            columns={"subject": "brain"}
        )
        table.insert(0, "participant_id", [subject for subject, _ in ids])
        table.insert(1, "session_id", [session for _, session in ids])
        _write_tsv(folder / f"{name}.tsv", table)
    wide = COLUMNS.copy()
    for name in map(str, tables.get("metrics_wide", ())):
        wide.setdefault(_column_of_input(name), OF_INPUT)
    wide |= {
        name: {"Description": text, "Units": _bids_unit(unit)}
        for name, (text, unit) in columns.items()
    }
    wide.pop("subject", None)
    write_json(folder / "metrics_wide.json", wide)
    write_json(folder / "metrics_long.json", COLUMNS | COLUMNS_OF_NUMBERS)
    made_by = {
        "Name": "gyriflow",
        "Version": version,
        "Description": "Pial surfaces, maps and simulations of folding",
    }
    dataset = {
        "Name": "gyriflow",
        "BIDSVersion": BIDS_VERSION,
        "DatasetType": "derivative",
        "GeneratedBy": [made_by],
    }
    # the last file: where it is there, all is
    write_json(folder / "dataset_description.json", dataset)


def labels_file(
    folder: AnyPath,
    brain: ExportedBrain,
    brains: Sequence[ExportedBrain],
) -> str:
    """Return the file to which `export_bids` writes the labels of a simulated brain,
    given all brains."""
    names = _subjects_and_sessions(
        [observed for observed in brains if observed.run == OBSERVED]
    )
    return LABELS_FILE.format(*_places(Path(folder), [brain], names)[0])


def _places(
    folder: Path,
    brains: Sequence[ExportedBrain],
    names: BidsNames,
) -> list[Place]:
    taken: dict[tuple[str, str], ExportedBrain] = {}
    places = []
    for brain in brains:
        subject, session = names[brain.brain]
        stem = "_".join(filter(None, (subject, session)))
        simulated = f"_desc-{bids_label(brain.run)}gw{brain.week:.2f}".replace(".", "")
        place = (
            folder / subject / (session or "") / "anat" / stem,
            "" if brain.run == OBSERVED else simulated,
        )
        places.append(place)
        on_disk = folder_name(stem), folder_name(place[1])
        if (first := taken.setdefault(on_disk, brain)) is not brain:
            brains_and_runs = (
                f"{first.brain} ({first.run}) and {brain.brain} ({brain.run})"
            )
            raise InputError(
                f"two brains have the same BIDS name {stem}",
                found=brains_and_runs,
                expected="ids and runs that differ in their letters and digits",
            )
    return places


def _descriptions(
    brains: Sequence[ExportedBrain], places: Sequence[Place]
) -> dict[str, str]:
    descriptions = {}
    for brain, (_, desc) in zip(brains, places, strict=True):
        if desc:
            descriptions[desc[1:]] = (
                f"Run {brain.run} of the simulation, at {brain.week:.2f} weeks of"
                " gestation"
            )
    if any(brain.white for brain in brains):
        descriptions["desc-white"] = (
            "Map on the white surface; those without it are on the pial one"
        )
    return descriptions


def _write_surfaces(
    place: Place,
    brain: ExportedBrain,
    back: Floats,
) -> dict[str, dict[str, Any]]:
    prefix, simulated = place
    kinds: dict[str, tuple[Mapping[Side, str], str, Layer]] = {
        "pial": (brain.surfaces, simulated, "Pial")
    }
    kinds |= {"white": (brain.white, "", "GrayWhite")} if brain.white else {}
    for kind, (files, desc, layer) in kinds.items():
        for side, path in files.items():
            named = f"{prefix}_hemi-{side[0].upper()}{desc}_{kind}.surf.gii"
            write_surface(
                named, transformed(read_surface(path), back), STRUCTURES[side], layer
            )
    for side, path in brain.regions.items():
        desc = simulated or "_desc-regions"
        named = f"{prefix}_hemi-{side[0].upper()}{desc}_dseg.label.gii"
        _copy(path, named)
    return {
        kind: {
            "Description": f"{kind.capitalize()} surface, RAS+ mm",
            "Units": "mm",
        }
        for kind in kinds
    }


def _write_maps(
    place: Place,
    brain: ExportedBrain,
    space: str,
    reference: Mapping[str, Any],
) -> dict[str, dict[str, Any]]:
    sidecars: dict[str, dict[str, Any]] = {}
    prefix, simulated = place
    # files by side, the entities `space-` and `desc-`, and the space in sidecars
    kinds: tuple[tuple[Any, str, str, Mapping[str, Any]], ...] = (
        (brain.maps, "", simulated, {}),
        (brain.template_maps, space, simulated, reference),
        (brain.white_maps, "", "_desc-white", {}),
    )
    for files, entity, desc, more in kinds:
        for side, path in files.items():
            for name, values in read_vertex_maps(path).items():
                quantity = VERTEX_MAPS[name]
                suffix, sign = quantity.bids_suffix, quantity.export_sign
                described = {
                    "Description": quantity.description,
                    "Units": _bids_unit(quantity.unit),
                }
                sidecars["_".join(filter(None, (entity, suffix)))] = {
                    **described,
                    **more,
                }
                density = f"_{entity}_den-{len(values)}" if entity else ""
                named = (
                    f"{prefix}_hemi-{side[0].upper()}{density}{desc}_{suffix}.shape.gii"
                )
                write_vertex_maps(
                    named,
                    {suffix if sign < 0 else name: sign * values},
                    STRUCTURES[side],
                )
    return sidecars


def _template(
    observed: Sequence[ExportedBrain], names: BidsNames
) -> tuple[str, dict[str, Any]]:
    template = next(
        (brain for brain in observed if brain.brain == brain.template), None
    )
    if template is None:
        return "", {}
    stem = "_".join(filter(None, names[template.brain]))
    place = "/".join(
        filter(
            None,
            (*names[template.brain], "anat", stem),
        )
    )
    surfaces = {
        side[0].upper(): f"bids::{place}_hemi-{side[0].upper()}_pial.surf.gii"
        for side in template.surfaces
    }
    return f"space-{bids_label(stem)}", {"SpatialReference": surfaces}


def _labels(brain: ExportedBrain, back: Floats) -> LabelVolume:
    from ..geometry.matching import layer_labels

    start = brain.volume["labels"].read()
    mesh = transformed(read_surface(brain.volume["surface"]), back)
    (thickness,) = read_vertex_maps(brain.volume["thickness"]).values()
    return LabelVolume(
        layer_labels(
            mesh,
            thickness,
            start.labels.shape,
            start.affine,
        ),
        start.affine,
    )


def publish_derivatives(
    exported: AnyPath,
    folder: AnyPath,
    source: AnyPath,
    brains: Sequence[str],
    whole: bool,
) -> None:
    """Bring the BIDS derivative of a study to another folder; files there that gyriflow
    has not made stay.

    Beside each subject's files come the quality pages of its `brains`, with the `whole`
    study its tables, report and methods. `source` is the data set that it was made of,
    which `SourceDatasets` then names by its DOI or its folder.
    """
    exported, folder, source = Path(exported), Path(folder), Path(source)
    require_own_data_set(folder)
    files = {}
    subjects = set()
    for path in files_below(exported):
        name = str(path.relative_to(exported))
        subject, is_of_subject, _ = name.partition("/")
        if is_of_subject:
            subjects.add(subject)
        elif path.stem in STUDY_TABLES and not whole:
            continue
        files[name] = path
    results = exported.parent
    pages = {}
    for brain in brains:
        name = f"{brain.split('_')[0]}/figures/{brain}_quality.png"
        pages[name] = results / "brains" / brain / "figures" / "quality.png"
    if whole:
        report = results / "report"
        # brains of an atlas have pages, too, to which the report leads
        for page in (*report.glob("**/*.html"), report / "methods.rst"):
            pages[str(page.relative_to(report))] = page
    for name, page in pages.items():
        if page.is_file():
            files[name] = page
    with making_files(folder, exported.with_name(".published-files.json"), *subjects):
        for name, path in files.items():
            _copy(path, folder / name)
    description = source / "dataset_description.json"
    source_description = read_json(description) if description.is_file() else {}
    doi = str(source_description.get("DatasetDOI", ""))
    if not doi:
        url = source.resolve().as_uri()
    elif doi.startswith(("doi:", "http")):
        url = doi
    else:
        url = f"doi:{doi}"
    described = read_json(exported / "dataset_description.json")
    described["SourceDatasets"] = [{"URL": url}]
    write_json(folder / "dataset_description.json", described)


def _subjects_and_sessions(brains: Sequence[ExportedBrain]) -> BidsNames:
    sessions = {}
    for brain in brains:
        named = SESSION.search(brain.brain)
        if named:
            sessions[brain.brain] = f"ses-{named[1]}"
    n_subjects = len({brain.subject for brain in brains})
    has_sessions = bool(sessions) or n_subjects < len(brains)
    names: dict[str, tuple[str, str | None]] = {}
    for brain in brains:
        session = sessions.get(brain.brain)
        if session is None and has_sessions:
            session = f"ses-{brain.week:.2f}w".replace(".", "")
        names[brain.brain] = (bids_subject(brain.subject), session)
    return names


def _write_people(
    folder: Path,
    brains: Sequence[ExportedBrain],
    names: BidsNames,
) -> None:
    # covariates that differ between a subject's brains are those of sessions
    first = list(OWN_COLUMNS)
    rows = []
    for brain in brains:
        own = (
            *names[brain.brain],
            brain.week,
            brain.brain,
        )
        row: dict[str, Any] = dict(zip(first, own, strict=True))
        for name, text in brain.covariates.items():
            row[_column_of_input(name)] = text
        rows.append(row)
    import pandas as pd

    people = pd.DataFrame(rows).sort_values(first[:2])
    most = people.groupby("participant_id").nunique(dropna=False).max()
    tables = {"participants": people.drop(columns="session_id")}
    if people["session_id"].notna().any():
        varying = [
            name for name in people if name in first[1:] or most.get(name, 0) > 1
        ]
        tables = {
            "participants": people.drop(columns=varying).drop_duplicates(),
            "sessions": people[varying],
        }
        for subject, part in people.groupby("participant_id"):
            _write_tsv(
                folder / str(subject) / f"{subject}_sessions.tsv",
                part[varying],
            )
    _write_tsv(folder / "participants.tsv", tables["participants"])
    for name, table in tables.items():
        columns = {}
        for key in map(str, table):
            if key not in first[:2]:
                columns[key] = PEOPLE.get(key, OF_INPUT)
        write_json(folder / f"{name}.json", columns)


def _column_of_input(name: str) -> str:
    """Return the column of a covariate, which may be named like a column of the export
    itself."""
    return f"{name}_of_input" if name in OWN_COLUMNS else name


def _bids_unit(unit: str) -> str:
    """Return a unit as BIDS writes it: powers with ^, and "arbitrary" for none."""
    return "arbitrary" if unit == "1" else re.sub(r"([cm]m)(\d)", r"\1^\2", unit)


def _write_tsv(path: Path, table: "pd.DataFrame") -> None:
    with atomic_write(path) as temporary:
        table.to_csv(
            temporary,
            sep="\t",
            index=False,
            float_format="%.10g",
            na_rep="n/a",
        )


def _copy(source: AnyPath, target: AnyPath) -> None:
    with atomic_write(target) as temporary:
        shutil.copyfile(source, temporary)
