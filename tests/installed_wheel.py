"""The wheel as a user has it: built, installed outside the checkout, its demo run there; once in a run of the tests."""

import json
import os
import shutil
import site
import subprocess
import sys
import sysconfig
import zipfile
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.good_campaigns import once

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Shipped:
    """Folder of a release and what was printed of it; folder of the demo's results and what that printed."""

    release: str
    built: str
    out: str
    printed: str

    @property
    def wheel(self) -> Path:
        """The only one of the release."""
        (path,) = Path(self.release).glob("*.whl")
        return path

    @property
    def report(self) -> Path:
        """The demo's page."""
        return Path(self.out) / "report.html"


def shipped(folder: Path) -> Shipped:
    """What the first who asks made below `folder`, whichever worker it is on."""

    def write(path: Path) -> None:
        path.write_text(json.dumps(asdict(_made(folder / f"wheel-{os.getpid()}"))), encoding="utf-8")

    return Shipped(**json.loads(once(folder / "wheel.json", write, patience=600.0).read_text(encoding="utf-8")))


def _made(folder: Path) -> Shipped:
    release, out = folder / "release", folder / "elsewhere" / "out"
    out.parent.mkdir(parents=True)
    built = call(sys.executable, ROOT / ".ci" / "release.py", release)
    (wheel,) = release.glob("*.whl")
    python = _installed(wheel, folder / "venv")
    elsewhere = {"cwd": out.parent, "env": {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}}
    place = call(python, "-c", "import tpjb_ident; print(tpjb_ident.__file__)", **elsewhere)
    assert str(ROOT) not in place
    printed = call(python, "-m", "tpjb_ident", "demo", "--out", out, **elsewhere)
    return Shipped(str(release), built, str(out), printed)


def call(*command, **options) -> str:
    """Run a program that has to succeed; what it printed."""
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def _installed(wheel: Path, folder: Path) -> Path:
    """Python of a fresh environment with the wheel in it, the dependencies lent by this one."""
    call(sys.executable, "-m", "venv", "--without-pip", folder)
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    home = call(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    # .pth lines add these folders, but not the .pth files in them: the editable checkout stays out
    lent = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib"), *site.getsitepackages()}
    Path(home, "lent.pth").write_text("\n".join(sorted(lent)) + "\n")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(home)
    # what was compiled of the same sources: half a minute to compile again; its stamp is of their text, not their place
    for code in [*ROOT.glob("model/**/*.nbi"), *ROOT.glob("model/**/*.nbc")]:
        kept = Path(home, code.relative_to(ROOT))
        kept.parent.mkdir(exist_ok=True)
        shutil.copy(code, kept)
    return python
