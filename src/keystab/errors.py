"""The one exception that a user of keystab is meant to read."""


class InputError(ValueError):
    """Input that keystab cannot work with.

    The message is one line: what was given, what is allowed, and what to do. Commands print it
    without a traceback and exit with status 2.
    """
