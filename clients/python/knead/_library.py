"""Load libknead and libknead-scene, and give their functions the types that the headers declare."""
import ctypes
import os

from knead import _api

_SONAME = '.so.1'


def _load(name):
    """Load a library from this package's folder (a wheel), else the one that is installed."""
    beside = os.path.join(os.path.dirname(__file__), name)
    return ctypes.CDLL(beside if os.path.exists(beside) else name, mode=ctypes.RTLD_GLOBAL)


def _typed(library):
    for name, (result, arguments) in _api.FUNCTIONS.items():
        function = getattr(library, name, None)
        if function is not None:
            function.restype, function.argtypes = result, arguments
    return library


core = _typed(_load('libknead' + _SONAME))
if core.kn_version().decode() != _api.KN_VERSION:
    raise ImportError(f'libknead is of version {core.kn_version().decode()}, expected {_api.KN_VERSION}')


def scene():
    """Return libknead-scene, which needs libyaml."""
    global _scene
    if _scene is None:
        if os.path.exists(os.path.join(os.path.dirname(__file__), 'libyaml-0.so.2')):
            _load('libyaml-0.so.2')
        _scene = _typed(_load('libknead-scene' + _SONAME))
    return _scene


_scene = None
