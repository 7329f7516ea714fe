"""The report: one HTML page that needs nothing else."""

from gyriflow.io.figures import picture_addresses, read_body
from gyriflow.io.files import read_json, read_table, read_text, write_text
from gyriflow.io.yaml_files import yaml_text
from gyriflow.report.page import Results, Shown, assemble, hide_paths, picture, report_page
from gyriflow.step import step

PARTS = ("style", "three", "notice", "controls", "viewer")
files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    pictures = [entry["file"] for entry in params.entries if entry["file"].endswith(".png")]
    addresses = dict(zip(pictures, picture_addresses(pictures, params.picture_bytes), strict=True))
    shown = [
        Shown(
            entry["section"],
            entry["title"],
            picture(*addresses[path], entry["title"]) if path in addresses else read_body(path),
            entry["caption"],
            first=path == params.first,
            technical=entry["technical"],
        )
        for path, entry in ((entry["file"], entry) for entry in params.entries)
    ]
    results = Results(
        brains=params.brains,
        surfaces={brain: read_json(path) for brain, path in zip(params.surfaced, files.surfaces, strict=True)},
        runs=read_table(files.runs),
        provenance=read_json(files.provenance),
        methods=read_text(files.methods),
        configuration=yaml_text(hide_paths(params.config)),
        **{name: read_table(files[name]) for name in ("validation", "quality", "warnings") if files.get(name)},
    )
    view = read_json(files.view)
    parts = {name: read_text(path) for name, path in files.items() if name in PARTS}
    write_text(snakemake.output[0], report_page(read_text(files.page), parts, view, **assemble(results, shown, view)))
