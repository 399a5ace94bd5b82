"""Errors of the reports."""

from __future__ import annotations


class ReportError(RuntimeError):
    """The report cannot be built; the message names the offending path or value and the way out."""
