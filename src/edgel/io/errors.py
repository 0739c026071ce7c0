"""The one error of files that are not what they claim to be."""


class FormatError(ValueError):
    """A file that cannot be read, or a cloud that a format cannot hold.

    The message names the file, what was found in it, and what to do.

    Examples
    --------
    >>> from edgel.io import FormatError
    >>> issubclass(FormatError, ValueError)
    True
    """
