"""The version of the distribution, written into every manifest."""

__version__ = "0.1.0"
