"""Make the README's picture from real demo output: ``tpjb demo --out OUT; python docs/make_picture.py OUT``.

Three of the report's figures side by side, as they are.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from tpjb_ident.report.figure import prefixed_ids

PANELS = {
    "kyy-over-load": "Stiffness: predicted and measured",
    "pivot-stiffness": "Pivots: dry test and printed formula",
    "locus-and-clearance": "Shaft centre locus and clearance",
}
HEIGHT = 300.0
TITLE = 26.0
GAP = 12.0


def main(demo_out: Path) -> None:
    """Write docs/demo.svg."""
    pieces, x = [], 0.0
    for name, title in PANELS.items():
        svg = (demo_out / "figures" / f"{name}.svg").read_text(encoding="utf-8")
        body = prefixed_ids(svg[svg.index("<svg") :], name)
        body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.S)
        _, _, width, height = (float(v) for v in re.search(r'viewBox="([^"]+)"', body)[1].split())
        shown = width * HEIGHT / height
        pieces.append(f'<text x="{x + 8:.1f}" y="18" font-family="sans-serif" font-size="15">{title}</text>')
        box = f'viewBox="0 0 {width} {height}"'
        head = f'<svg x="{x:.1f}" y="{TITLE:.1f}" width="{shown:.1f}" height="{HEIGHT:.1f}" {box}>'
        pieces.append(head + body[body.index(">") + 1 :])
        x += shown + GAP
    width = x - GAP
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'viewBox="0 0 {width:.1f} {HEIGHT + TITLE:.1f}" width="{width:.1f}" height="{HEIGHT + TITLE:.1f}">'
        f'<rect width="100%" height="100%" fill="white"/>{"".join(pieces)}</svg>\n'
    )
    path = Path(__file__).resolve().parent / "demo.svg"
    path.write_text(text, encoding="utf-8")
    print(f"{path}: {len(text) / 1024:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
