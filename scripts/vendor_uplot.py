"""Copy uPlot from the npm registry into the package, checked by its digest: python -m scripts.vendor_uplot."""

from __future__ import annotations

import base64
import hashlib
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from airtruth.reporting.pages.assets import DIGESTS, INTEGRITY, UPLOT

FOLDER = Path(__file__).resolve().parents[1] / "src/airtruth/reporting/pages/assets/uplot"


def unpacked(archive: bytes) -> dict[str, bytes]:
    """Return the files of the package that the pages need.

    Raises
    ------
    SystemExit
        If a digest is not the pinned one.
    """
    digest = "sha512-" + base64.b64encode(hashlib.sha512(archive).digest()).decode()
    if digest != INTEGRITY:
        sys.exit(f"uplot-{UPLOT}.tgz has the digest {digest}, expected {INTEGRITY}")
    found = {}
    with tempfile.TemporaryFile() as file:
        file.write(archive)
        file.seek(0)
        with tarfile.open(fileobj=file) as package:
            for name, expected in DIGESTS.items():
                member = package.extractfile(
                    f"package/{name}" if name == "LICENSE" else f"package/dist/{name}"
                )
                content = b"" if member is None else member.read()
                if hashlib.sha256(content).hexdigest() != expected:
                    sys.exit(f"{name} of uPlot {UPLOT} has another digest than expected")
                found[name] = content
    return found


def main() -> None:
    """Fetch the package with npm, check it and write its files."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["npm", "pack", f"uplot@{UPLOT}", "--silent"], cwd=folder, check=True)
        files = unpacked((Path(folder) / f"uplot-{UPLOT}.tgz").read_bytes())
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (FOLDER / name).write_bytes(content)
        print(FOLDER / name)


if __name__ == "__main__":
    main()
