"""Whether a report works in a browser: opened without a network, its 3D view turned and moved through the weeks.

    ./run python benchmarks/report_view.py results/report/report.html --pictures FOLDER

needs Playwright and a Chromium, which are not part of the environment (`pip install playwright`, and Debian's
`chromium`). The last line is JSON: size of the file, messages on the console, requests to elsewhere, whether the view
turned, and whether the slider moved the surface.
"""

import argparse
import json
import shutil
from pathlib import Path

from playwright.sync_api import sync_playwright

SOFTWARE_GL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
MOVED = (
    "value => { const s = document.getElementById('view-week'); s.value = value; s.dispatchEvent(new Event('input')) }"
)


def tried(report: Path, pictures: Path | None) -> dict[str, object]:
    """Returns what happened when the report was opened, turned and moved."""
    said: list[str] = []
    elsewhere: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", *SOFTWARE_GL]
        )
        page = browser.new_context(viewport={"width": 1500, "height": 1000}, offline=True).new_page()
        page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: said.append(f"error: {error}"))
        page.on(
            "request",
            lambda request: elsewhere.append(request.url) if request.url.startswith(("http:", "https:")) else None,
        )
        page.goto(report.resolve().as_uri())
        page.wait_for_timeout(2000)

        def picture(name: str) -> bytes:
            return page.screenshot(path=pictures / f"{name}.png" if pictures else None)

        picture("first-page")
        page.evaluate("document.getElementById('surfaces-in-3d').scrollIntoView()")
        box = page.locator("#view3d canvas").bounding_box()
        before, seen = page.evaluate("view3d.camera.position.toArray()"), picture("view")
        page.mouse.move(box["x"] + 300, box["y"] + 200)
        page.mouse.down()
        page.mouse.move(box["x"] + 420, box["y"] + 140, steps=8)
        page.mouse.up()
        turned = page.evaluate("view3d.camera.position.toArray()") != before
        after_turn = picture("turned")
        title = page.inner_text("#view-title-0")
        page.evaluate(MOVED, page.evaluate("Number(document.getElementById('view-week').min)"))
        after_move = picture("first-week")
        page.select_option("#view-map", index=1)
        picture("map")
        moved = page.inner_text("#view-title-0") != title and after_move != after_turn
        browser.close()
    return {
        "bytes": report.stat().st_size,
        "console": said,
        "requests_elsewhere": elsewhere,
        "turned": turned and after_turn != seen,
        "slider_moves": moved,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", type=Path)
    parser.add_argument("--pictures", type=Path, help="folder for screenshots")
    arguments = parser.parse_args()
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
    print(json.dumps(tried(arguments.report, arguments.pictures)))
