"""What is compiled where there is a C compiler; pyproject.toml has everything else about the package."""

from Cython.Build import cythonize
from setuptools import Extension, setup

# Operations are neither fused nor reordered, so that a decision does not depend on the processor.
# Optional: without a compiler the same files run as plain Python.
COMPILED = [
    Extension(
        name,
        [name.replace(".", "/") + ".py"],
        extra_compile_args=["-O3", "-g0", "-ffp-contract=off", "-fno-math-errno"],
        optional=True,
    )
    for name in ("companion.compiled.kernels", "sim.compiled.airframe_step")
]
DIRECTIVES = {
    "language_level": 3,
    "infer_types": True,
    "cdivision": True,
    "boundscheck": False,
    "wraparound": False,
    "initializedcheck": False,
}

setup(ext_modules=cythonize(COMPILED, build_dir="build", compiler_directives=DIRECTIVES))
