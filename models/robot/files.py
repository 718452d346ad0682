"""Where the file of a mesh is, that a description names by its package."""

from collections.abc import Mapping
from pathlib import Path

from ocp import ProblemError
from ocp.internal import check_instance

_SCHEME = "package://"


def resolve_file(
    file: str, packages: Mapping[str, Path | str], *, base: Path | str | None = None
) -> Path:
    """Return the path of a file that a description names.

    Args:
        file: ``package://name/rest``, ``file:///path``, or a path.
        packages: the folder of each package, by name.
        base: folder of the description, from which a path that is not absolute counts.

    Raises:
        ProblemError: naming the package that is not among ``packages``.
    """
    check_instance(file, str, "resolve_file: file")
    check_instance(packages, Mapping, "resolve_file: packages")
    if file.startswith(_SCHEME):
        package, _, rest = file.removeprefix(_SCHEME).partition("/")
        if package not in packages:
            known = ", ".join(packages) or "none"
            raise ProblemError(
                f"{file}: where is the package '{package}'? Known are: {known}; "
                f"give packages={{'{package}': folder}}"
            )
        return Path(packages[package]) / rest
    path = Path(file.removeprefix("file://"))
    return path if base is None else Path(base) / path
