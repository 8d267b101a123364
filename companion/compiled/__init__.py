"""The inner loops of the avoidance: `kernels.py`, compiled by Cython where there is a C compiler.

A decision flies hundreds of paths ahead past every track. With arrays as small as one aircraft's traffic
numpy spends most of that time on the overhead of its calls.
"""


def slow_notice() -> str | None:
    """A line for the user when the loops run as plain Python; `None` when they are compiled."""
    from companion.compiled import kernels

    if kernels.COMPILED:
        return None
    return (
        "Companion runs without its compiled part, as no C compiler was found at installation: "
        "the same decisions, but each takes 20 to 100 times as long"
    )
