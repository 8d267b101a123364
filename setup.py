"""What is compiled; all else about the package stands in pyproject.toml."""

from Cython.Build import cythonize
from setuptools import Extension, setup

# Operations are neither fused nor reordered, so that a decision does not depend on the processor.
COMPILED = [
    Extension(
        name,
        [name.replace(".", "/") + ".pyx"],
        extra_compile_args=["-O3", "-ffp-contract=off", "-fno-math-errno"],
    )
    for name in ("companion.compiled.kernels", "sim.compiled.wing")
]

setup(ext_modules=cythonize(COMPILED, build_dir="build", show_all_warnings=True))
