"""The file of certificates: committed data, and the references of the library."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from ocp import DamagedFile
from ocp.internal import with_checksum, without_checksum, write_file

# Of the file; 1 had one set of versions for all entries.
FORMAT = 2
COMMITTED = Path(__file__).parents[2] / "data" / "certificates.json"


@dataclass(frozen=True)
class Certificates:
    """What is on file.

    Attributes:
        entries: by name of the case, as ``Certificate.as_dict`` has them, and under ``versions``
            of what computed each.
    """

    entries: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path) -> "Certificates":
        """Read a file; nothing where there is none.

        Raises:
            DamagedFile: if it is no file of certificates, of another format, or not as it was
                written; entries of earlier versions have no checksum.
        """
        if not file.exists():
            return cls()
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            written, cases = content["format"], content["cases"]
            if written != FORMAT:
                raise DamagedFile(f"{file} has format {written}; this version reads {FORMAT}")
            return cls({name: _entry(name, entry) for name, entry in cases.items()})
        except DamagedFile:
            raise
        except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as no:
            raise DamagedFile(f"{file} is no file of certificates: {no!r}") from no

    def with_(
        self, case: str, entry: Mapping[str, Any], versions: Mapping[str, str]
    ) -> "Certificates":
        """Return them with one more, or one anew, and with what computed it.

        A certificate that holds is not given up for one that does not.
        """
        if self.entries.get(case, {}).get("holds") and not entry["holds"]:
            return self
        made = {**entry, "versions": dict(versions)}
        return Certificates(dict(sorted({**self.entries, case: made}.items())))

    def write(self, file: Path) -> None:
        """Write them in one piece, so that a killed run leaves the old file or the new one."""
        # Each by itself, with its name: two people may add one each.
        cases = {
            name: with_checksum({**entry, "case": name}) for name, entry in self.entries.items()
        }
        content = {"format": FORMAT, "cases": cases}
        file.parent.mkdir(parents=True, exist_ok=True)
        write_file(file, (json.dumps(content, indent=1) + "\n").encode())


def _entry(name: str, entry: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return an entry as it was given."""
    if "versions" not in entry:
        raise ValueError(f"'{name}' has no versions")
    try:
        known = without_checksum(entry)
    except ValueError as reason:
        raise ValueError(f"the entry of '{name}': {reason}") from reason
    if (own := known.pop("case", name)) != name:
        raise ValueError(f"the entry of '{own}' is under the name '{name}'")
    return known


@cache
def committed() -> Certificates:
    """Return the certificates that the library stands on."""
    return Certificates.read(COMMITTED)
