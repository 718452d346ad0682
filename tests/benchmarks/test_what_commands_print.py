"""What the commands say where there is little to say."""

from io import StringIO

from rich.console import Console

from benchmarks.mistakes.judge import summary_table


def test_no_share_is_given_of_no_mistakes() -> None:
    console = Console(file=StringIO(), width=100)
    console.print(summary_table([]))
    assert "%" not in console.file.getvalue()  # type: ignore[attr-defined]
    assert "-" in console.file.getvalue()  # type: ignore[attr-defined]
