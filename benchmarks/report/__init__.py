"""One self-contained page about a results folder."""

from benchmarks.report.page import report_page

__all__ = ["report_page"]
