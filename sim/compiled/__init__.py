"""The simulated aircraft's steps: `airframe_step.py`, compiled by Cython where there is a C compiler.

An encounter of a campaign takes more than a thousand steps of a tenth of a second.
"""
