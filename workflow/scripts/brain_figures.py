"""Draw a measured brain: page and table row of quality control, maps and small
pictures."""

from gyriflow.anatomy.plausible import (
    expected_volume_ml,
    hides_area,
    is_inaccurate,
)
from gyriflow.geometry.poses import posed_whites
from gyriflow.geometry.triangles import merged
from gyriflow.io.figures import write_figure
from gyriflow.io.files import read_json, write_json
from gyriflow.io.surfaces import read_pose, read_surface, read_vertex_maps
from gyriflow.io.volumes import read_volume_map
from gyriflow.messages import read_messages
from gyriflow.report.pictures import brain_depth, brain_maps, small_pictures
from gyriflow.report.quality import (
    QualityBrain,
    quality_page,
    quality_row,
    tissue_groups,
)
from gyriflow.step import step

files, output, params = snakemake.input, snakemake.output, snakemake.params
with step(snakemake.log[0]):
    surface, report = read_surface(files.surface), read_json(files.report)
    pose, image, tissues, thickness = read_pose(files.report), None, None, None
    if files.image:
        values, affine = read_volume_map(files.image, params.labels.affine_from)
        image = values, pose.world @ affine
    if params.labels:
        labels = params.labels.read()
        tissues = (
            tissue_groups(labels.labels, params.labels.scheme),
            pose.world @ labels.affine,
        )
    if files.thickness:
        (thickness,) = read_vertex_maps(files.thickness).values()
    whites = posed_whites(
        pose, {side: read_surface(path) for side, path in params.white_files.items()}
    )
    white = merged(*whites.values()) if whites else None
    warnings = list(
        dict.fromkeys(
            message.first_line
            for message in read_messages(params.log)
            if message.level == "warning"
        )
    )
    expected = expected_volume_ml(report["week"])
    measured = read_json(files.measured) if files.measured else {}
    row = quality_row(
        params.columns,
        report,
        measured,
        warnings,
        expected,
        thickness_is_inaccurate=is_inaccurate(measured),
        area_is_lower_bound=hides_area(measured),
    )
    brain = QualityBrain(
        surface, report["fissure_x_mm"], thickness, white, image, tissues
    )
    halves = [
        (read_surface(hemisphere), read_vertex_maps(maps))
        for hemisphere, maps in zip(
            files.hemispheres,
            files.maps,
            strict=True,
        )
    ]
    depth = brain_depth(halves, sides=params.sides)
    maps = brain_maps(halves, sides=params.sides)
    notes = [report["hindbrain"]] if "hindbrain" in report else []
    page = quality_page(brain, row, warnings, notes)
    write_figure(output.quality, output.quality_pdf, page)
    write_figure(output.depth, output.depth_pdf, depth)
    write_figure(output.maps, output.maps_pdf, maps)
    write_figure(
        output.small,
        output.small_pdf,
        small_pictures(
            halves,
            side=params.sides[0],
        ),
    )
    write_json(output.row, row)
