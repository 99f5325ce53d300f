"""With kernels as plain Python properties are tried on fewer examples; `make test` has the rest."""

from hypothesis import settings

from dap3d_core.kernels.runtime.cache import jit_is_on

if not jit_is_on():
    settings.register_profile("plain Python", max_examples=20)
    settings.load_profile("plain Python")
