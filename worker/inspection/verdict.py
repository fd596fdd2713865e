"""What an inspection finds wrong."""


class UnknownFormatError(ValueError):
    """The file is not of a format that is read here; one line says which are."""


class BrokenFileError(ValueError):
    """The file is of such a format, but broken, too large or without what it must hold; one line says how."""
