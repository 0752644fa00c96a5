"""When radiation damage to CCDs has spoiled the shapes of galaxies, and which effect a model of it lacks."""

from ctiplan._ctiplan import __version__, set_threads, threads
from ctiplan._errors import InputError, InternalError

__all__ = ["InputError", "InternalError", "__version__", "set_threads", "threads"]
