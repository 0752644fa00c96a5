"""Exceptions. Every other failure is Python's own."""

from __future__ import annotations


class InputError(ValueError):
    """Something that was given cannot be used.

    Attributes
    ----------
    refused : str
        What could not be done, such as ``cannot use mission `a.toml` ``.
    place : str or None
        Where, such as ``line 17: detector.temperature_k = -120.0``.
    problem : str
        What is wrong there and what is allowed, with units.
    help : str or None
        What to try.
    """

    def __init__(self, refused: str, place: str | None, problem: str, help: str | None = None) -> None:
        super().__init__(refused, place, problem, help)
        self.refused = refused
        self.place = place
        self.problem = problem
        self.help = help

    def __str__(self) -> str:
        lines = [self.refused, self.place, self.problem, self.help and f"help: {self.help}"]
        return "\n  ".join(line for line in lines if line)


class InternalError(RuntimeError):
    """A fault of ctiplan itself. Please report it with what led to it."""
