"""Build a release twice and say what it is made of (needs `build`, `hatchling`; no network).

    python .ci/release.py FOLDER

Writes the wheel and `sbom.cdx.json` (CycloneDX 1.5: this package and the ones it needs, with version and licence as
installed here) into FOLDER. SOURCE_DATE_EPOCH is the time of the last commit; ends with exit code 1 where two builds of
the same source are not the same bytes.
"""

import hashlib
import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OURS = "tpjb-ident"


def source_date() -> str:
    """Time of the last commit [s since 1970]; that of the changelog outside a checkout."""
    command = ["git", "log", "-1", "--format=%ct"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or str(int((ROOT / "CHANGELOG.md").stat().st_mtime))


def build(folder: Path, epoch: str) -> Path:
    """A wheel of the checkout."""
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env={**os.environ, "SOURCE_DATE_EPOCH": epoch})
    (wheel,) = folder.glob("*.whl")
    return wheel


def needed(name: str, found: dict[str, importlib.metadata.Distribution]) -> None:
    """Gather a distribution and all that it needs without extras."""
    key = re.sub(r"[-_.]+", "-", name).lower()
    if key in found:
        return
    try:
        found[key] = importlib.metadata.distribution(name)
    except importlib.metadata.PackageNotFoundError:  # for another platform or Python
        return
    for requirement in found[key].requires or ():
        if "extra ==" not in requirement:
            needed(re.split(r"[\s<>=!~;(\[]", requirement, maxsplit=1)[0], found)


def licence(metadata: importlib.metadata.PackageMetadata) -> str:
    """Licence as its metadata state it, in one line."""
    classified = [line.rpartition(" :: ")[2] for line in metadata.get_all("Classifier") or () if "License ::" in line]
    stated = metadata.get("License-Expression") or "; ".join(classified) or metadata.get("License") or "not stated"
    return stated.splitlines()[0][:100]


def component(key: str, distribution: importlib.metadata.Distribution) -> dict[str, object]:
    """One entry of the bill."""
    return {
        "type": "library",
        "name": distribution.metadata["Name"],
        "version": distribution.version,
        "purl": f"pkg:pypi/{key}@{distribution.version}",
        "licenses": [{"license": {"name": licence(distribution.metadata)}}],
    }


def bill(wheel: Path) -> dict[str, object]:
    """Software bill of materials of a wheel."""
    found: dict[str, importlib.metadata.Distribution] = {}
    needed(OURS, found)
    ours = component(OURS, found.pop(OURS))
    ours["hashes"] = [{"alg": "SHA-256", "content": hashlib.sha256(wheel.read_bytes()).hexdigest()}]
    parts = [component(key, found[key]) for key in sorted(found)]
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {"component": ours},
        "components": parts,
    }


def main(folder: Path) -> None:
    """Build, compare, write."""
    folder.mkdir(parents=True, exist_ok=True)
    epoch = source_date()
    with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
        one, other = build(Path(first), epoch), build(Path(second), epoch)
        if one.read_bytes() != other.read_bytes():
            raise SystemExit("two builds of the same source are not the same bytes")
        wheel = folder / one.name
        wheel.write_bytes(one.read_bytes())
    text = json.dumps(bill(wheel), indent=1) + "\n"
    (folder / "sbom.cdx.json").write_text(text, encoding="utf-8")
    print(
        f"{wheel}\nSHA-256 {hashlib.sha256(wheel.read_bytes()).hexdigest()}, the same twice\n{folder / 'sbom.cdx.json'}"
    )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "dist"))
