"""Results as HTML for a notebook: a heading, facts, and text as it stands; everything escaped."""

from collections.abc import Iterable
from html import escape

_TEXT = "white-space: pre-wrap; line-height: 1.35; margin: 0.3em 0;"


def html_of(title: str, text: str = "", facts: Iterable[tuple[str, object]] = ()) -> str:
    """Return a heading, a table of facts, and a text in lines.

    Nothing in it is taken for a mark: names may hold ``<`` and ``&``.
    """
    rows = "".join(
        f"<tr><th style='text-align: left'>{escape(str(name))}</th>"
        f"<td style='text-align: left'>{escape(str(value))}</td></tr>"
        for name, value in facts
    )
    table = f"<table>{rows}</table>" if rows else ""
    body = f"<pre style='{_TEXT}'>{escape(text)}</pre>" if text else ""
    return f"<div><b>{escape(title)}</b>{table}{body}</div>"


def counted(number: int, what: str) -> str:
    """Return a number with its word, in the plural where it is not one."""
    return f"{number} {what}{'s' * (number != 1)}"
