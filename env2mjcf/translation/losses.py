"""What a dialect cannot express, and how that is said."""

from __future__ import annotations

from typing import NoReturn

from ..diagnostics import DiagnosticLog
from ..errors import Span
from ..model.dialects import RULES, DialectRules
from ..model.environment import Dialect


class Losses:
    """Collects what is lost on the way into a dialect; in strict mode the first loss is an error.

    Args:
        dialect: The dialect that is written.
        log: Where findings go.
    """

    def __init__(self, dialect: Dialect, log: DiagnosticLog) -> None:
        self.dialect = dialect
        self.log = log

    @property
    def rules(self) -> DialectRules:
        """How the dialect reads, and what it can express."""
        return RULES[self.dialect]

    def lost(self, code: str, subject: str, message: str, hint: str = "", span: Span | None = None) -> None:
        """Report what is left out or changed, while poses of links stay as they are."""
        self.log.warn(code, subject, message, hint=hint, span=span)

    def refuse(self, code: str, subject: str, message: str, hint: str = "", span: Span | None = None) -> NoReturn:
        """Refuse what would move links if it were left out.

        Raises:
            ConversionError: Always.
        """
        self.log.fail(code, subject, message, hint=hint, span=span)
