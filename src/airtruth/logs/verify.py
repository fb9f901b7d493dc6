"""Compare the files of a folder with the digests that manifests and ledgers in it hold, at any depth."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Final

from airtruth.errors import StoreError
from airtruth.logs import ledger, manifest
from airtruth.logs.digest import sha256_of_each
from airtruth.logs.lease import LEASES
from airtruth.logs.ledger import LEDGER
from airtruth.logs.manifest import MANIFEST, MANIFEST_PARTS
from airtruth.logs.names import chunk_file
from airtruth.logs.remote import files_below, location

if TYPE_CHECKING:
    import pandas as pd

LOCK: Final = ".lock"
"""File whose lock a flying process holds; it has no content."""
_SETTINGS: Final = "campaign.json"
"""File of a campaign that shows that its manifest is missing."""
_CAMPAIGN_FILE: Final = re.compile(
    r"(?:logs|truth-parts)/[a-z]?\d{5,}\.parquet|plan\.parquet|truth\.parquet|campaign\.json"
)
"""Files of a campaign, relative to its folder."""
DAMAGED: Final = "damaged"
"""State of a file whose content is not the recorded one."""
MISSING: Final = "missing"
"""State of a recorded file that does not exist."""
EXTRA: Final = "extra"
"""State of a file that no manifest or ledger lists."""


@dataclass(frozen=True)
class FileFinding:
    """A file that is not as recorded.

    Attributes
    ----------
    file : its path, relative to the folder.
    state : `DAMAGED`, `MISSING` or `EXTRA`.
    reason : why.
    """

    file: str
    state: str
    reason: str


@dataclass(frozen=True)
class Verification:
    """The files of a folder compared with their digests.

    Attributes
    ----------
    folder : the folder.
    checked : number of files that a manifest or ledger lists.
    findings : files that are not as recorded, by name.
    """

    folder: Path
    checked: int
    findings: tuple[FileFinding, ...]

    @property
    def intact(self) -> bool:
        """Whether every file is as recorded."""
        return not self.findings

    def summary(self) -> str:
        """Numbers of files, and one line for each that is not as recorded."""
        counts = (f"{sum(f.state == s for f in self.findings)} {s}" for s in (DAMAGED, MISSING, EXTRA))
        lines = (f"{f.state:8s} {f.file}: {f.reason}" for f in self.findings)
        return "\n".join([f"{self.folder}: {self.checked} files checked, {', '.join(counts)}", *lines])

    def to_frame(self) -> pd.DataFrame:
        """One row per finding: file, state, reason."""
        import pandas as pd

        return pd.DataFrame([asdict(f) for f in self.findings], columns=["file", "state", "reason"])

    def to_dict(self) -> dict[str, Any]:
        """The folder, the number of files and the findings, in types that JSON has."""
        findings = [asdict(f) for f in self.findings]
        return {"folder": str(self.folder), "checked": self.checked, "findings": findings}


def verify(folder: Path | str) -> Verification:
    """Compare every file of a folder with the digests in the manifests and ledgers at any depth.

    Parameters
    ----------
    folder : folder of a campaign, any folder into which a command wrote, or a parent of such folders.

    Raises
    ------
    StoreError
        If it is no folder, holds neither manifest nor ledger, or a file cannot be read.
    """
    folder = location(folder)
    if not folder.is_dir():
        raise StoreError(f"{folder}: is not a folder; give a folder into which a command wrote")
    files = {p.relative_to(folder).as_posix(): p for p in files_below(folder)}
    ledgers = {name for name in files if PurePosixPath(name).name == LEDGER}
    campaigns = _campaigns(files.keys())
    if not ledgers and not campaigns:
        raise StoreError(
            f"{folder}: holds neither {MANIFEST} nor {LEDGER}, with which its files could be compared; "
            "give a folder into which a command wrote"
        )
    findings: list[FileFinding] = []
    recorded: dict[str, str] = {}
    known = {*ledgers, LOCK}
    for at in campaigns:
        digests, faults = _of_manifest(folder / at)
        recorded |= {(at / name).as_posix(): digest for name, digest in digests.items()}
        findings += [replace(fault, file=(at / fault.file).as_posix()) for fault in faults]
        known |= _own_files(files.keys(), at, complete=not faults)
    for name in sorted(ledgers):
        try:
            entries = ledger.read(files[name].parent)
        except StoreError as error:
            findings.append(FileFinding(name, DAMAGED, str(error).partition(": ")[2]))
            continue
        parent = PurePosixPath(name).parent
        recorded |= {(parent / file).as_posix(): entry.sha256 for file, entry in entries.items()}
    findings += _compared(folder, recorded)
    known |= recorded.keys()
    findings += [
        FileFinding(name, EXTRA, "no manifest or ledger lists it") for name in sorted(files.keys() - known)
    ]
    return Verification(folder, len(recorded), tuple(sorted(findings, key=lambda f: f.file)))


def _campaigns(names: Iterable[str]) -> list[PurePosixPath]:
    """Folders of the campaigns, relative to the folder; a campaign without a manifest still has its settings."""
    paths = map(PurePosixPath, names)
    return sorted({path.parent for path in paths if path.name in (MANIFEST, _SETTINGS)})


def _own_files(names: Iterable[str], at: PurePosixPath, *, complete: bool) -> set[str]:
    """Files of a campaign that its manifest does not list; with an incomplete manifest, every file that it writes."""
    prefix = "" if at == PurePosixPath() else f"{at}/"
    inside = (name.removeprefix(prefix) for name in names if name.startswith(prefix))
    return {
        prefix + name
        for name in inside
        if name in (MANIFEST, LOCK)
        or name.startswith((f"{LEASES}/", f"{MANIFEST_PARTS}/"))
        or (not complete and _CAMPAIGN_FILE.fullmatch(name))
    }


def _of_manifest(folder: Path) -> tuple[dict[str, str], list[FileFinding]]:
    """Digests by file name, and what is wrong with the manifest itself."""
    if not (folder / MANIFEST).exists():
        return {}, [FileFinding(MANIFEST, MISSING, "the same fly command writes it again")]
    scan = manifest.scan(folder / MANIFEST)
    faults = [FileFinding(MANIFEST, DAMAGED, f"line {number}") for number in scan.damaged]
    digests: dict[str, str] = {}
    for record in scan.records:
        files: Any = record.get("files", {})
        digests |= files
        if "truth" in record and (folder / "truth-parts").exists():
            number: Any = record["chunk"]
            digests[f"truth-parts/{chunk_file(number)}"] = str(record["truth"])
    if not scan.closed and not faults:
        faults = [
            FileFinding(
                MANIFEST, DAMAGED, "is not that of a complete campaign; the same fly command continues"
            )
        ]
    return digests, faults


def _compared(folder: Path, recorded: dict[str, str]) -> Iterator[FileFinding]:
    present = sha256_of_each([folder / name for name in recorded])
    for (name, digest), here in zip(recorded.items(), present, strict=True):
        if here is None:
            yield FileFinding(name, MISSING, "is listed and does not exist")
        elif here != digest:
            yield FileFinding(name, DAMAGED, "its SHA-256 is not the recorded one")


__all__ = ["DAMAGED", "EXTRA", "MISSING", "FileFinding", "Verification", "verify"]
