"""The one compiled file; all else about the package stands in pyproject.toml."""

from Cython.Build import cythonize
from setuptools import Extension, setup

# Operations are neither fused nor reordered, so that a decision does not depend on the processor.
KERNELS = Extension(
    "companion.compiled.kernels",
    ["companion/compiled/kernels.pyx"],
    extra_compile_args=["-O3", "-ffp-contract=off", "-fno-math-errno"],
)

setup(ext_modules=cythonize([KERNELS], build_dir="build", show_all_warnings=True))
