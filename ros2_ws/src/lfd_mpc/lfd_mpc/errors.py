"""The one exception that a user's mistake raises."""


class UserError(Exception):
    """Its text is the one line that the user sees; the exit status is 2."""
