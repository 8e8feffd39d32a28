"""Judging a run of an FMU by criteria: docs/acceptance.md."""
