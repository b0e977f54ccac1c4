"""The version, in a module of its own: whoever records it depends on nothing else."""

__version__ = "0.2.0"
