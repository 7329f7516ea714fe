"""The report, one HTML page that needs nothing else; beside it the methods as text, the configuration, and versions."""

from gyriflow.cli.provenance import software
from gyriflow.io.downloads import sha256_of
from gyriflow.io.figures import picture_addresses, read_body
from gyriflow.io.files import read_json, read_table, read_text, write_json, write_text
from gyriflow.io.yaml_files import read_yaml, write_yaml, yaml_text
from gyriflow.report.page import hide_paths, methods_text, page_content, report_page, shown_figures
from gyriflow.step import step

PICTURE_BYTES = 9_000_000
PARTS = ("style", "three", "notice", "controls", "viewer")
files, params, output = snakemake.input, snakemake.params, snakemake.output
with step(snakemake.log[0]):
    hashed = [{"brain": brain, "what": what, "sha256": sha256_of(path)} for brain, what, path in params.files]
    provenance = software() | {"files": hashed}
    runs = [
        {"run": run, "start": brain, "parameters": read_yaml(settings), "summary": read_json(summary)}
        for (run, brain), settings, summary in zip(params.folded, files.run_params, files.summaries, strict=True)
    ]
    methods = methods_text(read_text(files.template), runs=runs, software=provenance, **params.method)
    words = read_yaml(files.words)
    figures = [figure for figure in params.figures if figure[0] in words]
    pictures = [path for _, path, _ in figures if path.endswith(".png")]
    contents = dict(zip(pictures, picture_addresses(pictures, PICTURE_BYTES), strict=True))
    contents |= {path: read_body(path) for _, path, _ in figures if path not in contents}
    content = page_content(
        brains=params.brains,
        provenance=provenance,
        methods=methods,
        configuration=yaml_text(hide_paths(params.config)),
        shown=shown_figures(words, figures, contents),
        validation=read_table(files.validation) if files.validation else None,
        **{name: read_table(files[name]) for name in ("quality", "runs", "warnings")},
    )
    parts = {name: read_text(path) for name, path in files.items() if name in PARTS}
    write_text(output.page, report_page(read_text(files.page), parts, read_json(files.view), **content))
    write_text(output.methods, methods)
    write_json(output.provenance, provenance)
    write_yaml(output.config, params.config)
