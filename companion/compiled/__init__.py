"""What is compiled: the inner loops of the avoidance, in Cython (`kernels.pyx`).

A decision flies hundreds of ways ahead past every track; on arrays as small as one aircraft's traffic numpy's
price per call is most of that. After a change `make setup` builds it anew.
"""
