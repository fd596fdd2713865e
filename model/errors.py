"""The error every front door turns into one clear line."""


class InputError(ValueError):
    """What the user gave cannot be used.

    The message is one line for the reader: what was wrong, in which input, what to do.
    The command line prints it and exits with 2; the service answers with a problem+json.
    """


class MissingDependencyError(InputError):
    """An optional package or a weights file that the chosen method needs is absent."""
