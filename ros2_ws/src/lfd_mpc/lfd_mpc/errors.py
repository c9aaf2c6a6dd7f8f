"""The one exception that a user's mistake raises, and how it is told."""


class UserError(Exception):
    """A mistake of the user's: one line that names what was wrong and what is acceptable."""

    def __str__(self) -> str:
        """One line, whatever the text quotes: line breaks become spaces, control codes `?`."""
        line = " ".join(super().__str__().splitlines())
        return "".join(c if c.isprintable() else "?" for c in line)
