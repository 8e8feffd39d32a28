"""Every error that tiefmu raises on purpose. Messages are one line that names file, table or option, and id."""

from ._core import Diverged, SceneError, StepTooLong

__all__ = ["Diverged", "RunError", "RunStopped", "SceneError", "StepTooLong", "UsageError", "one_line"]


class UsageError(ValueError):
    """What was asked for cannot be done: an option out of range, a missing folder, a file of another kind."""


class RunError(Exception):
    """A co-simulation that cannot start or did not finish."""


class RunStopped(RunError):
    """The FMU refused to go on, or gave no numbers."""


def one_line(error: object) -> str:
    """What it says, its lines and tabs joined by blanks: for text of other packages within a message of ours."""
    return " ".join(str(error).split())
