"""What is compiled where there is a C compiler; pyproject.toml has everything else about the package."""

from Cython.Build import cythonize
from setuptools import Extension, setup

# Operations are neither fused nor reordered, so that a decision does not depend on the processor.
SOURCES = [
    Extension(
        name,
        [name.replace(".", "/") + ".py"],
        extra_compile_args=["-O3", "-g0", "-ffp-contract=off", "-fno-math-errno"],
    )
    for name in ("companion.compiled.kernels", "companion.compiled.pairs", "sim.compiled.airframe_step")
]
DIRECTIVES = {
    "language_level": 3,
    "infer_types": True,
    "cdivision": True,
    "boundscheck": False,
    "wraparound": False,
    "initializedcheck": False,
}

extensions = cythonize(SOURCES, build_dir="build", compiler_directives=DIRECTIVES)
for extension in extensions:
    extension.optional = True  # without a compiler the same files run as plain Python
setup(ext_modules=extensions)
