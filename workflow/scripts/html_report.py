"""The report of a study or of one brain, an HTML page that needs nothing else."""

from gyriflow.io.figures import picture_addresses, read_body
from gyriflow.io.files import read_json, read_table, read_text, write_text
from gyriflow.io.yaml_files import read_yaml, yaml_text
from gyriflow.report.page import hide_paths, page_content, report_page, shown_figures
from gyriflow.step import step

PICTURE_BYTES = 9_000_000
PARTS = ("style", "three", "notice", "controls", "viewer")
files, params = snakemake.input, snakemake.params
with step(snakemake.log[0]):
    paths = [figure["path"] for figure in params.figures]
    pictures = [path for path in paths if path.endswith(".png")]
    contents = dict(zip(pictures, picture_addresses(pictures, PICTURE_BYTES), strict=True))
    contents |= {path: read_body(path) for path in paths if path not in contents}
    small = None if params.pictured is None else picture_addresses(files.small, PICTURE_BYTES)
    prediction = params.get("prediction")
    prediction = prediction and prediction | {"worth": read_yaml(files.worth)}
    content = page_content(
        prediction=prediction,
        brains=params.brains,
        pictures=None if small is None else dict(zip(params.pictured, small, strict=True)),
        norm=params.norm,
        provenance=read_json(files.provenance),
        methods=read_text(files.methods),
        configuration=yaml_text(hide_paths(params.config)),
        shown=shown_figures(params.figures, contents),
        **{name: read_table(files[name]) for name in ("quality", "warnings", "metrics", "centiles")},
        **{name: read_table(path) if (path := files.get(name)) else None for name in ("runs", "validation")},
    )
    parts = {name: read_text(path) for name, path in files.items() if name in PARTS}
    view = read_json(path) if (path := files.get("view")) else {"groups": []}
    write_text(snakemake.output[0], report_page(read_text(files.page), parts, view, **content))
