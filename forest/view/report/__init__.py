"""A run as one page that opens in any browser, from disk, with nothing beside it."""

from forest.view.report.page import write_report

__all__ = ["write_report"]
