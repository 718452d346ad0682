"""The file of certificates: committed data, and the references of the library."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

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
            ValueError: if it is no file of certificates, or of another format.
        """
        if not file.exists():
            return cls()
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            written, cases = content["format"], content["cases"]
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as reason:
            raise ValueError(f"{file} is no file of certificates: {reason!r}") from None
        if written != FORMAT:
            raise ValueError(f"{file} has format {written}; this version reads {FORMAT}")
        lacking = [name for name, entry in cases.items() if "versions" not in entry]
        if lacking:
            raise ValueError(f"{file} is no file of certificates: '{lacking[0]}' has no versions")
        return cls(cases)

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
        content = {"format": FORMAT, "cases": dict(self.entries)}
        file.parent.mkdir(parents=True, exist_ok=True)
        draft = file.with_suffix(".new")
        draft.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        draft.replace(file)


@cache
def committed() -> Certificates:
    """Return the certificates that the library stands on."""
    return Certificates.read(COMMITTED)
